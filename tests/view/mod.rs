//! The window as a user sees it: the real program on a virtual display, driven by keys and pointer, checked by its
//! pixels.

// Shared with the tests of the protocol, which use all of it.
mod authors;
mod beside;
mod colour;
#[allow(dead_code)]
mod contact;
mod desk;
mod dicom;
mod exam;
mod framing;
mod lesson;
mod live;
mod mmode;
mod panels;
mod planes;
mod robust;
mod soak;
mod spectrum;
mod tools;
mod tracker;
mod trajectory;
mod unsaved;
mod view3d;

use std::time::Duration;

use desk::{Desk, Key};

use crate::common::skip;

/// A cyst and wires in liver; small, so that a frame takes a software driver some milliseconds.
const SCENE: &str = r#"
name = "Cyst and wires"
background = "liver"

[probe]
preset = "linear"
scanlines = 64
elevation_layers = 1
samples = 512

[imaging]
image_height = 400

[[mesh]]
name = "cyst"
shape = { sphere = { radius = "5 mm" } }
tissue = "cyst_fluid"
translate = [-8, 0, "2 cm"]

[[wire]]
from = [8, -2, 15]
to = [8, 2, 15]
"#;

/// Parts of the default window, pixels: the console is on the right.
const CONSOLE: [u16; 4] = [1280 - 336, 0, 336, 720];
/// The part with the image; the 3D view is between it and the console.
const IMAGE: [u16; 4] = [60, 100, 400, 500];

#[test]
fn a_window_opens_follows_the_keys_and_closes() {
    let Some(mut desk) = Desk::open(SCENE, &["--validate"]) else {
        return;
    };
    desk.wait_for("an image", |d| brightness(&d.grab(IMAGE)) > 10.0);
    let still = desk.settle(IMAGE);

    // The probe slides off the cyst: another image; home again: the same one except for the noise.
    for _ in 0..6 {
        desk.press(Key::Right);
    }
    desk.wait_for("the image to move", |d| difference(&d.grab(IMAGE), &still) > 4.0);
    desk.settle(IMAGE);
    desk.press(Key::Home);
    desk.wait_for("the image to come back", |d| difference(&d.grab(IMAGE), &still) < 1.5);

    // Panels.
    let open = desk.settle(CONSOLE);
    desk.press(Key::Letter('c'));
    desk.wait_for("the console to close", |d| difference(&d.grab(CONSOLE), &open) > 5.0);
    desk.press(Key::Letter('c'));
    desk.wait_for("the console to open", |d| difference(&d.grab(CONSOLE), &open) < 1.0);
    let lower = [0, 540, 900, 160];
    let before = desk.settle(lower);
    desk.press(Key::Letter('t'));
    desk.wait_for("the timings", |d| difference(&d.grab(lower), &before) > 5.0);
    desk.press(Key::Letter('t'));
    desk.wait_for("the timings to go", |d| difference(&d.grab(lower), &before) < 1.5);
    let before = desk.settle(IMAGE);
    desk.press(Key::Help);
    desk.wait_for("the list of keys", |d| difference(&d.grab(IMAGE), &before) > 5.0);
    desk.press(Key::Escape);
    desk.wait_for("the list to go", |d| difference(&d.grab(IMAGE), &before) < 1.5);

    // Frozen, nothing follows the probe; live, it is at its new place.
    let before = desk.settle(IMAGE);
    desk.press(Key::Space);
    for _ in 0..6 {
        desk.press(Key::Right);
    }
    std::thread::sleep(Duration::from_millis(700));
    assert!(difference(&desk.grab(IMAGE), &before) < 0.5, "frozen");
    desk.press(Key::Space);
    desk.wait_for("the image to follow", |d| difference(&d.grab(IMAGE), &before) > 4.0);

    desk.quit();
}

#[test]
fn a_window_of_another_size_is_filled() {
    let Some(mut desk) = Desk::open(SCENE, &["--validate"]) else {
        return;
    };
    desk.wait_for("an image", |d| brightness(&d.grab(IMAGE)) > 10.0);
    for (width, height) in [(900, 600), (700, 420), (1300, 740)] {
        desk.resize(width, height);
        // The console lies at the right edge from top to bottom.
        let corner = [width - 20, height - 40, 16, 30];
        desk.wait_for("the console at the edge", |d| brightness(&d.grab(corner)) > 15.0);
    }
    desk.hide();
    std::thread::sleep(Duration::from_millis(300));
    desk.press(Key::Right);
    desk.show();
    desk.wait_for("the window again", |d| brightness(&d.grab(IMAGE)) > 10.0);
    desk.quit();
}

#[test]
fn a_window_in_which_nothing_happens_costs_nothing() {
    let Some(mut desk) = Desk::open(SCENE, &[]) else {
        return;
    };
    desk.wait_for("an image", |d| brightness(&d.grab(IMAGE)) > 10.0);
    desk.settle([0, 0, 1280, 720]);
    // One frame of the interface alone takes ten milliseconds and more; a clock tick is ten.
    desk.idles(Duration::from_millis(20));
    desk.quit();
}

#[test]
fn the_pointer_sets_what_the_console_shows() {
    let Some(mut desk) = Desk::open(SCENE, &["--validate"]) else {
        return;
    };
    desk.wait_for("an image", |d| brightness(&d.grab(IMAGE)) > 10.0);
    let before = desk.settle(IMAGE);
    // "Freeze" is the first button of the console; a second press goes live again.
    let button = (CONSOLE[0] + 30, 18);
    desk.click(button);
    desk.press(Key::Right);
    desk.press(Key::Right);
    std::thread::sleep(Duration::from_millis(500));
    assert!(difference(&desk.grab(IMAGE), &before) < 0.5, "frozen");
    desk.click(button);
    desk.wait_for("the image to follow", |d| difference(&d.grab(IMAGE), &before) > 2.0);
    desk.quit();
}

#[test]
fn a_screenshot_is_the_window() {
    let Some(desk) = desk::Display::open() else {
        return;
    };
    let folder = tempfile::tempdir().expect("a folder");
    let scene = folder.path().join("scene.toml");
    std::fs::write(&scene, SCENE).expect("written");
    let file = folder.path().join("window.png");
    let status =
        desk.program(&scene, &["--validate", "--screenshot"]).arg(&file).status().expect("started");
    assert!(status.success());
    let picture = image::open(&file).expect("a picture").to_rgb8();
    assert_eq!(picture.dimensions(), (1280, 720));
    let console = picture.get_pixel(1275, 700);
    assert!(console.0.iter().all(|&c| c > 15), "{console:?}");
    let mean = |x: std::ops::Range<u32>, y: std::ops::Range<u32>| {
        let (mut sum, mut count) = (0_u64, 0);
        for (px, py) in x.flat_map(|x| y.clone().map(move |y| (x, y))) {
            sum += u64::from(picture.get_pixel(px, py).0[1]);
            count += 1;
        }
        sum as f64 / f64::from(count)
    };
    assert!(mean(300..600, 150..600) > 10.0, "the image is in it");
}

#[test]
fn without_a_display_the_remedy_is_said() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = folder.path().join("scene.toml");
    std::fs::write(&scene, SCENE).expect("written");
    let output = desk::program(&scene, &[]).env_remove("DISPLAY").output().expect("started");
    assert_eq!(output.status.code(), Some(1));
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(text.contains("insonify render"), "{text}");
}

/// Mean of all colours.
fn brightness(pixels: &[u8]) -> f64 {
    pixels.iter().map(|&p| f64::from(p)).sum::<f64>() / pixels.len() as f64
}

/// Mean absolute difference of all colours.
fn difference(a: &[u8], b: &[u8]) -> f64 {
    assert_eq!(a.len(), b.len());
    let apart = a.iter().zip(b).map(|(a, b)| f64::from(a.abs_diff(*b)));
    apart.sum::<f64>() / a.len() as f64
}

#[test]
fn the_comparison_of_pictures_notices_a_change() {
    assert_eq!(brightness(&[0, 10, 20]), 10.0);
    assert_eq!(difference(&[0, 10, 20], &[3, 10, 17]), 2.0);
}
