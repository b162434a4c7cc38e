//! Colour Doppler in the window: colours over what flows, their box, and why there may be none.

use serde_json::Value;

use super::desk::{Desk, Display, Key};
use super::tools::sidecar;
use super::{brightness, difference};
use crate::common::vessel::VESSEL;

/// A small image, before the vessel.
const PROBE: &str = r#"name = "Vessel"
background = "muscle"

[probe]
preset = "linear"
depth = "40 mm"
scanlines = 64
samples = 768
elevation_layers = 1

[imaging]
image_height = 400
"#;

/// The part with the image, without the 3D view; its middle.
const IMAGE: [u16; 4] = [200, 100, 560, 540];
const MIDDLE: (u16, u16) = (482, 360);

/// The key of the colours: F5.
const COLOURS: Key = Key::Symbol(0xffc2);

/// Colours of the box's corners, without the pointer over it and with it; colour of warnings.
const CORNERS: [[u8; 3]; 2] = [[92, 176, 196], [208, 212, 216]];
const WARN: [u8; 3] = [232, 170, 84];

fn open(arguments: &[&str]) -> Option<Desk> {
    let mut desk = Desk::open(&format!("{PROBE}{VESSEL}"), arguments)?;
    desk.wait_for("an image", |d| brightness(&d.grab([200, 100, 300, 400])) > 5.0);
    // The 3D view has tests of its own.
    desk.press(Key::Letter('v'));
    desk.wait_for("the image alone", |d| brightness(&d.grab([600, 300, 100, 100])) > 5.0);
    Some(desk)
}

/// Pixels of the colours of flow, red and blue: no green, or as much as lightens them.
fn colours(pixels: &[u8]) -> [usize; 2] {
    let mut counts = [0; 2];
    for pixel in pixels.chunks_exact(3) {
        let [r, g, b] = [pixel[0], pixel[1], pixel[2]].map(i32::from);
        counts[0] += usize::from(r > b + 50 && g < r && b < 30);
        counts[1] += usize::from(b > r + 50 && g < b && r < 30);
    }
    counts
}

/// Pixels that have exactly this colour.
fn exactly(pixels: &[u8], colour: [u8; 3]) -> usize {
    pixels.chunks_exact(3).filter(|pixel| *pixel == colour).count()
}

/// Place of the box's right edge in a part of the display with the image: the middle of its last corners.
fn right_edge(pixels: &[u8]) -> Option<u16> {
    let is_corner = |pixel: &[u8]| CORNERS.iter().any(|colour| pixel == colour);
    let columns = pixels.chunks_exact(3).zip(0u32..).filter(|(pixel, _)| is_corner(pixel));
    let last = columns.map(|(_, at)| at % u32::from(IMAGE[2])).max()?;
    Some(IMAGE[0] + last as u16 - 3)
}

/// The value of a key in the scene file.
fn value(desk: &Desk, key: &str) -> Option<f64> {
    let text = desk.scene();
    let line = text.lines().find(|line| line.starts_with(&format!("{key} = ")))?;
    line.split(" = ").nth(1)?.trim().parse().ok()
}

#[test]
fn what_flows_is_coloured_by_a_key_saved_so_and_costs_nothing_when_off() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).to_str().expect("UTF-8").to_owned();
    let captures = path("captures");
    for on in [false, true] {
        let json = path("times.json");
        let arguments = ["--validate", "--json", &json, "--captures", &captures];
        let Some(mut desk) = open(&arguments) else {
            return;
        };
        if on {
            desk.press(COLOURS);
            let away = |d: &mut Desk| {
                let [red, blue] = colours(&d.grab(IMAGE));
                blue > 3000 && blue > 4 * red
            };
            desk.wait_for("blood that flows away, blue", away);
            // The bar beside the image has both directions, below the greys.
            let [red, blue] = colours(&desk.grab([14, 100, 12, 300]));
            assert!(red > 100 && blue > 100, "{red} {blue}");
            desk.press(Key::F2);
            let still = sidecar(&mut desk, captures.as_ref(), "vessel-0001.json");
            assert_eq!(still["doppler"]["shows"], "velocity", "{still}");
            let saved = image::open(folder.path().join("captures/vessel-0001.png"));
            let [red, blue] = colours(&saved.expect("a picture").to_rgb8());
            assert!(blue > 1000 && blue > 4 * red, "{red} {blue}");
            desk.press(COLOURS);
            let loud = |d: &mut Desk| {
                let [red, blue] = colours(&d.grab(IMAGE));
                red > 3000 && blue < red / 50
            };
            desk.wait_for("power, red", loud);
            desk.press(COLOURS);
            // Tissue that stands still is dark, in one colour or the other, wherever the image is not black.
            let tissue = |d: &mut Desk| colours(&d.grab(IMAGE)).iter().sum::<usize>() > 15_000;
            desk.wait_for("tissue", tissue);
            desk.press(COLOURS);
            desk.wait_for("no colours", |d| colours(&d.grab(IMAGE)) == [0, 0]);
            desk.press(COLOURS);
            desk.wait_for("colours again", away);
        }
        desk.quit();
        let text = std::fs::read_to_string(&json).expect("written");
        let said: Value = serde_json::from_str(&text).expect("JSON");
        for stage in ["packet", "autocorrelation", "colour"] {
            let told = said["stages_ms"].get(stage).is_some();
            // A driver without timestamps tells no stage at all.
            let timed = said["stages_ms"].get("beam").is_some();
            assert_eq!(told, on && timed, "{stage}: {text}");
        }
    }
}

#[test]
fn the_box_is_moved_and_resized_by_the_pointer_and_undone() {
    let Some(mut desk) = open(&["--validate"]) else {
        return;
    };
    // Blood stands still for it.
    desk.press(Key::Letter('p'));
    desk.press(COLOURS);
    desk.wait_for("the box", |d| right_edge(&d.grab(IMAGE)).is_some());
    let (x, y) = MIDDLE;
    desk.drag(MIDDLE, (x + 60, y + 30));
    desk.hold_control(Key::Letter('s'));
    desk.wait_for("a box elsewhere", |d| value(d, "left").is_some_and(|left| left > 0.25));
    let [left, right, top, bottom] =
        ["left", "right", "top", "bottom"].map(|key| value(&desk, key).expect(key));
    assert!((right - left - 0.6).abs() < 2e-3 && (bottom - top - 0.6).abs() < 2e-3);
    assert!(top > 0.22 && top < 0.3, "{top}");
    let edge = right_edge(&desk.settle(IMAGE)).expect("corners");
    desk.drag((edge, y), (edge - 80, y));
    desk.hold_control(Key::Letter('s'));
    desk.wait_for("a narrower box", |d| value(d, "right").is_some_and(|now| now < right - 0.05));
    assert_eq!(value(&desk, "left"), Some(left));
    desk.hold_control(Key::Letter('z'));
    desk.hold_control(Key::Letter('s'));
    desk.wait_for("the wider box", |d| value(d, "right") == Some(right));
    desk.quit();
}

#[test]
fn settings_that_cannot_be_coloured_say_why_and_the_image_goes_on() {
    // Deeper than the pulses of the box have time for.
    let deep = format!("{PROBE}{VESSEL}").replace("40 mm", "290 mm");
    let Some(mut desk) = Desk::open_on(
        match Display::open() {
            Some(display) => display,
            None => return,
        },
        &deep,
        &["--validate"],
        |_, _| {},
    ) else {
        return;
    };
    let lower = [300, 500, 600, 180];
    desk.wait_for("an image", |d| brightness(&d.grab([60, 100, 400, 400])) > 1.0);
    assert_eq!(exactly(&desk.grab(lower), WARN), 0);
    desk.press(COLOURS);
    desk.wait_for("the reason", |d| exactly(&d.grab(lower), WARN) > 30);
    let before = desk.grab([60, 100, 400, 300]);
    desk.press(Key::Letter('-'));
    desk.press(Key::Letter('-'));
    desk.wait_for("the image to go on", |d| {
        difference(&d.grab([60, 100, 400, 300]), &before) > 0.1
    });
    assert_eq!(colours(&desk.grab([60, 100, 400, 300])), [0, 0]);
    desk.quit();
}
