//! Freeze, loop, calipers, texts, stills and clips.

use std::path::{Path, PathBuf};
use std::time::Duration;

use image::AnimationDecoder;
use image::codecs::gif::GifDecoder;
use insonify::gpu::list_devices;
use serde_json::Value;

use super::desk::{Desk, Key};
use super::{IMAGE, SCENE, brightness, difference};

/// The part of the default window with the picture and its surroundings.
const CENTRE: [u16; 4] = [0, 0, 1280 - 336, 680];

/// A folder for captures.
fn folder() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    let captures = folder.path().join("captures");
    (folder, captures)
}

/// Waits for a sidecar, which is written last, and reads it.
pub fn sidecar(desk: &mut Desk, folder: &Path, name: &str) -> Value {
    let file = folder.join(name);
    let mut found = None;
    desk.wait_for(name, |_| {
        let text = std::fs::read_to_string(&file).unwrap_or_default();
        found = serde_json::from_str(&text).ok();
        found.is_some()
    });
    found.expect("waited for")
}

/// The picture of the scene that `insonify render` makes in a folder, with the device and the tracer of a still's
/// sidecar: the window's device is one that can show pictures, `render` alone would take the best.
pub fn rendered(folder: &Path, still: &Value) -> image::DynamicImage {
    rendered_of(SCENE, folder, still)
}

/// The same of another scene, at the still's time.
pub fn rendered_of(text: &str, folder: &Path, still: &Value) -> image::DynamicImage {
    let (scene, picture) = (folder.join("scene.toml"), folder.join("rendered.png"));
    std::fs::write(&scene, text).expect("written");
    let devices = list_devices().expect("devices").devices;
    let shown = devices.iter().find(|d| still["device"] == format!("{} ({})", d.name, d.driver));
    let device = shown.expect("the window's device").index.to_string();
    let tracer = still["tracer"].as_str().expect("a tracer");
    let status = std::process::Command::new(env!("CARGO_BIN_EXE_insonify"))
        .args(["render", "--time", &still["time_s"].to_string()])
        .args(["--device", &device, "--tracer", tracer, "-o"])
        .args([&picture, &scene])
        .stdout(std::process::Stdio::null())
        .status()
        .expect("started");
    assert!(status.success());
    image::open(picture).expect("a picture")
}

#[test]
fn a_frozen_loop_shows_and_saves_what_was_imaged_before() {
    let (_folder, captures) = folder();
    let arguments = ["--validate", "--captures", captures.to_str().expect("UTF-8")];
    let Some(mut desk) = Desk::open(SCENE, &arguments) else {
        return;
    };
    desk.wait_for("an image", |d| brightness(&d.grab(IMAGE)) > 10.0);
    let mut shown = vec![desk.settle(IMAGE)];
    for _ in 0..3 {
        desk.press(Key::Right);
        desk.press(Key::Right);
        let before = shown[shown.len() - 1].clone();
        desk.wait_for("another image", |d| difference(&d.grab(IMAGE), &before) > 2.0);
        shown.push(desk.settle(IMAGE));
    }
    desk.press(Key::Space);
    assert_eq!(difference(&desk.settle(IMAGE), &shown[3]), 0.0, "the newest");

    // Back through the loop: the first image is there to the last bit, and so are all between.
    let mut back = vec![desk.grab(IMAGE)];
    while back[back.len() - 1] != shown[0] {
        assert!(back.len() < 20, "the first image does not come back");
        desk.press(Key::Letter(','));
        back.push(desk.settle(IMAGE));
    }
    for earlier in &shown {
        assert!(back.contains(earlier));
    }
    desk.press(Key::Letter('.'));
    desk.wait_for("the next one", |d| difference(&d.grab(IMAGE), &shown[0]) > 0.5);

    // The track of the bar: beyond its left end is the first image again.
    desk.drag((560, 702), (300, 702));
    desk.wait_for("the first by the pointer", |d| d.grab(IMAGE) == shown[0]);

    // The saved image is the shown one: the first picture, which `render` makes as well.
    desk.press(Key::F2);
    let still = sidecar(&mut desk, &captures, "cyst-and-wires-0001.json");
    let saved = image::open(captures.join("cyst-and-wires-0001.png")).expect("a picture");
    assert!(saved == rendered(&captures, &still), "the pixels differ");
    assert_eq!(still["file"], "cyst-and-wires-0001.png");
    assert_eq!(still["quality"]["level"], 0, "at rest it is the scene's own");
    assert_eq!(still["image"]["height"], 400);
    // 400 pixels of so many mm are the depth of the probe, give or take the last.
    let pitch = still["image"]["pixel_pitch_mm"].as_f64().expect("a number");
    let text = std::fs::read(captures.join("cyst-and-wires-0001.png")).expect("there");
    let said = format!("\"pixel_pitch_mm\":{pitch}");
    let is_inside = text.windows(said.len()).any(|w| w == said.as_bytes());
    assert!(is_inside, "the settings are in the picture, too");

    // The loop: as many frames as there are, in one file, and a number of its own.
    desk.press(Key::F3);
    let clip = sidecar(&mut desk, &captures, "cyst-and-wires-0002.json");
    let frames = gif(&captures.join("cyst-and-wires-0002.gif"));
    assert_eq!(frames.len(), back.len());
    assert_eq!(clip["frames"].as_array().map(Vec::len), Some(back.len()));
    assert!(frames[0].as_raw() == saved.to_rgba8().as_raw(), "it begins with the first");
    // The loop as single pictures, which the list at the bar's right end offers.
    desk.click((907, 702));
    desk.click((900, 658));
    desk.press(Key::F3);
    sidecar(&mut desk, &captures, "cyst-and-wires-0003.json");
    for (index, frame) in frames.iter().enumerate() {
        let file = captures.join(format!("cyst-and-wires-0003/{index:04}.png"));
        let picture = image::open(file).expect("a picture").to_rgba8();
        assert!(picture == *frame, "picture {index}");
    }

    desk.press(Key::Enter);
    desk.wait_for("the loop to play", |d| difference(&d.grab(IMAGE), &shown[0]) > 2.0);
    desk.press(Key::Enter);
    desk.settle(IMAGE);

    // Live, the image is the newest except for its noise.
    desk.press(Key::Space);
    desk.wait_for("the newest", |d| difference(&d.grab(IMAGE), &shown[3]) < 1.5);
    desk.quit();
}

/// Pictures of an animation.
fn gif(path: &Path) -> Vec<image::RgbaImage> {
    let file = std::io::BufReader::new(std::fs::File::open(path).expect("there"));
    let frames = GifDecoder::new(file).expect("a GIF").into_frames();
    let frames = frames.collect_frames().expect("whole");
    frames.into_iter().map(|frame| frame.into_buffer()).collect()
}

#[test]
fn a_folder_that_cannot_be_written_to_is_said_and_another_one_taken() {
    let (_folder, captures) = folder();
    // A folder inside a file: not even a superuser can make it.
    std::fs::write(&captures, "").expect("written");
    let inside = captures.join("in");
    let arguments = ["--captures", inside.to_str().expect("UTF-8")];
    let Some(mut desk) = Desk::open(SCENE, &arguments) else {
        return;
    };
    desk.wait_for("an image", |d| brightness(&d.grab(IMAGE)) > 10.0);
    let before = desk.settle(CENTRE);
    desk.press(Key::F2);
    desk.wait_for("the reason", |d| difference(&d.grab(CENTRE), &before) > 0.5);
    let said = desk.settle(CENTRE);
    // Once it can be written to, the same again.
    std::fs::remove_file(&captures).expect("removed");
    desk.press(Key::F2);
    sidecar(&mut desk, &inside, "cyst-and-wires-0001.json");
    desk.wait_for("success", |d| difference(&d.grab(CENTRE), &said) > 0.3);
    desk.quit();
}

/// A bright spot: the centre of connected pixels brighter than [`WHITE`], pixels.
type Spot = [f64; 2];
/// Grey level that wires reach and speckle does not.
const WHITE: u8 = 170;

/// Bright spots of a picture of the display, by connected pixels.
fn spots(pixels: &[u8], width: usize) -> Vec<Spot> {
    let grey: Vec<u8> = (pixels.chunks_exact(3))
        // Drawings over the image have a colour; wires have none.
        .map(|p| if p.iter().all(|&c| c == p[0]) { p[0] } else { 0 })
        .collect();
    let mut seen = vec![false; grey.len()];
    let mut out = Vec::new();
    for start in 0..grey.len() {
        if seen[start] || grey[start] < WHITE {
            continue;
        }
        let (mut todo, mut sums, mut count) = (vec![start], [0.0; 3], 0);
        seen[start] = true;
        while let Some(at) = todo.pop() {
            let (x, y, weight) = (at % width, at / width, f64::from(grey[at]));
            sums[0] += weight * x as f64;
            sums[1] += weight * y as f64;
            sums[2] += weight;
            count += 1;
            for (dx, dy) in [(-1, 0), (1, 0), (0, -1), (0, 1)] {
                let (nx, ny) = (x as i64 + dx, y as i64 + dy);
                let next = (ny * width as i64 + nx) as usize;
                let inside = (0..width as i64).contains(&nx) && next < grey.len() && ny >= 0;
                if inside && !seen[next] && grey[next] >= WHITE {
                    seen[next] = true;
                    todo.push(next);
                }
            }
        }
        if count >= 6 {
            out.push([sums[0] / sums[2], sums[1] / sums[2]]);
        }
    }
    out
}

/// The phantom's wires as found in the picture.
struct Wires {
    /// On the axis, at 10, 20, ... mm.
    column: Vec<Spot>,
    /// At 40 mm of depth, 10 mm apart; the middle one is the column's.
    near: Vec<Spot>,
    /// At 90 mm of depth, 20 mm apart.
    far: Vec<Spot>,
}

/// Finds them by their arrangement alone: a column in the middle of the image, and rows that cross it.
fn wires(pixels: &[u8], width: usize, middle: f64) -> Result<Wires, String> {
    let all = spots(pixels, width);
    let mut column: Vec<Spot> =
        all.iter().copied().filter(|s| (s[0] - middle).abs() < 4.0).collect();
    column.sort_by(|a, b| a[1].total_cmp(&b[1]));
    if column.len() != 15 {
        return Err(format!("{} wires on the axis", column.len()));
    }
    let pitch = (column[14][1] - column[0][1]) / 14.0;
    let row = |centre: Spot, step: f64, each: i32| {
        let expected = (-each..=each).map(|i| centre[0] + f64::from(i) * step * pitch);
        let found = expected.map(|x| {
            let near = |s: &&Spot| {
                (s[0] - x).abs() < 0.25 * pitch && (s[1] - centre[1]).abs() < 0.25 * pitch
            };
            all.iter().find(near).copied()
        });
        found
            .collect::<Option<Vec<Spot>>>()
            .ok_or_else(|| format!("a gap in the row at {centre:?}"))
    };
    Ok(Wires { near: row(column[3], 1.0, 3)?, far: row(column[8], 2.0, 2)?, column })
}

/// Accuracy of a distance between two wires, as required of a scanner's calipers.
const ACCURACY: f64 = 0.01;

fn is_accurate(measured: f64, expected: f64) -> bool {
    (measured / expected - 1.0).abs() <= ACCURACY
}

fn measures_the_phantom(scale: f64) {
    let (_folder, captures) = folder();
    let arguments = ["--captures", captures.to_str().expect("UTF-8")];
    let scene = include_str!("../../scenes/phantom.toml");
    let Some(mut desk) = Desk::open_scaled(scene, &arguments, scale) else {
        return;
    };
    // Console and 3D view would leave little room beside them at a larger scale.
    desk.resize(1280, 720);
    desk.press(Key::Letter('c'));
    desk.press(Key::Letter('v'));
    let picture = [0, 0, 1280, (720.0 - 40.0 * scale) as u16];
    let width = usize::from(picture[2]);
    // Grey bar and time gain take 84 points beside the image, the ruler 64.
    let middle = 640.0 + 10.0 * scale;
    let mut found = Err(String::new());
    desk.wait_for("the wires", |d| {
        found = wires(&d.grab(picture), width, middle);
        found.is_ok()
    });
    desk.press(Key::Space);
    desk.settle(picture);
    let wires = match wires(&desk.grab(picture), width, middle) {
        Ok(wires) => wires,
        Err(problem) => panic!("{problem}"),
    };
    let pixel = |spot: Spot| spot.map(|x| x.round() as u16).into();

    // Distances: lateral, axial, oblique; two clicks or a drag.
    desk.press(Key::Letter('l'));
    desk.click(pixel(wires.near[0]));
    desk.click(pixel(wires.near[6]));
    desk.drag(pixel(wires.column[1]), pixel(wires.column[12]));
    desk.drag(pixel(wires.far[0]), pixel(wires.near[5]));
    // An angle between the axis and the row at 90 mm.
    desk.press(Key::Letter('k'));
    for wire in [wires.column[6], wires.column[8], wires.far[3]] {
        desk.click(pixel(wire));
    }
    // The anechoic cylinder of 10 mm at (-60, 78), placed by the wires of the picture.
    let mm = (wires.column[14][1] - wires.column[0][1]) / 140.0;
    let at = |x: f64, z: f64| {
        let [x0, z0] = wires.column[7];
        pixel([x0 + x * mm, z0 + (z - 80.0) * mm])
    };
    desk.press(Key::Letter('o'));
    desk.drag(at(-65.0, 78.0), at(-55.0, 78.0));
    desk.click(at(-60.0, 83.0));
    // A text; its letters are keys of the console and others, which have no effect meanwhile.
    desk.press(Key::Letter('n'));
    desk.drag(at(-60.0, 78.0), at(-45.0, 110.0));
    desk.still(picture);
    for letter in "cyst".chars() {
        desk.press(Key::Letter(letter));
    }
    desk.press(Key::Enter);
    desk.settle(picture);
    desk.press(Key::F2);
    let said = sidecar(&mut desk, &captures, "general-purpose-phantom-0001.json");
    let measured = said["measurements"].as_array().expect("a list");
    assert_eq!(measured.len(), 5, "{measured:#?}");

    let distances = [("lateral", 60.0), ("axial", 110.0), ("oblique", 60.0_f64.hypot(50.0))];
    for ((name, expected), entry) in distances.into_iter().zip(measured) {
        let length = entry["length_mm"].as_f64().expect("a number");
        let off = 100.0 * (length / expected - 1.0);
        println!("scale {scale}, {name}: {length:.2} mm, {off:+.2} %");
        assert!(is_accurate(length, expected), "{name}: {length} {expected}");
        // A pixel pitch off by two hundredths would be noticed.
        assert!(!is_accurate(length * 1.02, expected), "{name}: {length}");
        assert!(!is_accurate(length / 1.02, expected), "{name}: {length}");
    }
    // Each end is hit to half a pixel across each arm, which is 20 and 40 mm long.
    let angle = measured[3]["angle_deg"].as_f64().expect("a number");
    let slack = (0.71 / (20.0 * mm)).atan() + (0.71 / (40.0 * mm)).atan();
    assert!((angle - 90.0).abs() < slack.to_degrees(), "{angle}");
    // The same holds for the ends of both axes, of 10 mm.
    let area = measured[4]["area_mm2"].as_f64().expect("a number");
    let circle = std::f64::consts::PI * 25.0;
    let slack = 4.0 * 0.71 / (10.0 * mm);
    println!("scale {scale}, angle {angle:.2}, area {area:.2} of {circle:.2} mm2");
    assert!((area / circle - 1.0).abs() < slack, "{area} {circle}");
    assert_eq!(said["texts"][0]["text"], "cyst");
    let tip = &said["texts"][0]["arrow_mm"];
    let [x, z] = [0, 1].map(|axis| tip[axis].as_f64().expect("a number"));
    assert!((x + 60.0).hypot(z - 78.0) < 1.0, "{tip}");
    let marked = image::open(captures.join("general-purpose-phantom-0001-marked.png"));
    assert!(marked.expect("with its marks").width() > 600);
    assert_eq!(said["set"]["probe.pose.position"], "[0, 0, 0]");
    desk.quit();
}

#[test]
fn calipers_measure_the_wires_of_the_phantom() {
    measures_the_phantom(1.0);
}

#[test]
fn calipers_measure_where_points_are_not_pixels() {
    measures_the_phantom(1.25);
}

#[test]
fn spots_are_found_where_they_are() {
    let (width, height) = (40, 30);
    let mut pixels = vec![20_u8; 3 * width * height];
    let mut set = |x: usize, y: usize, colour: [u8; 3]| {
        pixels[3 * (y * width + x)..][..3].copy_from_slice(&colour);
    };
    for (x, y) in [(10, 5), (11, 5), (12, 5), (10, 6), (11, 6), (12, 6)] {
        set(x, y, [250; 3]);
    }
    // A mark has a colour, and noise is small.
    for x in 20..30 {
        set(x, 20, [255, 214, 84]);
    }
    set(35, 25, [255; 3]);
    assert_eq!(spots(&pixels, width), [[11.0, 5.5]]);
}

#[test]
fn nothing_is_recorded_while_nothing_changes() {
    let Some(mut desk) = Desk::open(SCENE, &[]) else {
        return;
    };
    desk.wait_for("an image", |d| brightness(&d.grab(IMAGE)) > 10.0);
    let still = desk.settle(IMAGE);
    std::thread::sleep(Duration::from_millis(500));
    desk.press(Key::Space);
    desk.press(Key::Letter(','));
    assert_eq!(desk.settle(IMAGE), still, "the loop has one image");
    desk.quit();
}
