//! The examination: saved pictures without what is pressed, worksheet and report.

use super::desk::{Desk, Display, Key};
use super::tools::sidecar;
use super::{SCENE, brightness, difference};

/// The tools at the lower left, where the image is not while it has the window for itself.
const TOOLS: [u16; 4] = [8, 560, 30, 70];
const ALL: [u16; 4] = [0, 0, 1280, 670];

#[test]
fn a_measured_still_has_no_buttons_and_stands_in_the_report() {
    let folder = tempfile::tempdir().expect("a folder");
    let captures = folder.path().join("captures");
    let arguments = ["--captures", captures.to_str().expect("UTF-8"), "--validate"];
    let scene = SCENE.replace("[imaging]", "[imaging]\nexam = \"small parts\"");
    let Some(mut desk) = Desk::open(&scene, &arguments) else {
        return;
    };
    desk.press(Key::Letter('c'));
    desk.press(Key::Letter('v'));
    desk.wait_for("an image", |d| brightness(&d.grab([500, 200, 300, 300])) > 10.0);
    desk.press(Key::Space);
    desk.press(Key::Letter('l'));
    desk.drag((560, 250), (700, 350));
    desk.still(ALL);
    assert!(brightness(&desk.grab(TOOLS)) > 15.0, "the tools are on the screen");
    desk.press(Key::F2);
    let marked = captures.join("cyst-and-wires-0001-marked.png");
    let sidecar = captures.join("cyst-and-wires-0001.json");
    let whole =
        |file: &std::path::Path| std::fs::read(file).is_ok_and(|text| text.ends_with(b"}\n"));
    desk.wait_for("the still", |_| whole(&sidecar));
    let picture = image::open(marked).expect("a picture").to_rgb8();
    let (left, bottom) = (8, picture.height() - 8);
    let bright = (left..left + 30)
        .flat_map(|x| (bottom - 200..bottom).map(move |y| (x, y)))
        .filter(|&(x, y)| picture.get_pixel(x, y).0.iter().any(|&c| c > 40))
        .count();
    assert_eq!(bright, 0, "pixels of buttons");
    let yellow = picture.pixels().filter(|p| p.0[0] > 200 && p.0[2] < 120).count();
    assert!(yellow > 20, "the measurement is in it: {yellow}");

    // The message about the still goes by itself.
    desk.wait_for("the tools again", |d| brightness(&d.grab(TOOLS)) > 15.0);
    let before = desk.grab([0, 0, 300, 200]);
    desk.press(Key::Letter('x'));
    desk.wait_for("the worksheet", |d| difference(&d.grab([0, 0, 300, 200]), &before) > 5.0);
    desk.still([0, 0, 300, 200]);
    desk.click((44, 20));
    let report = captures.join("cyst-and-wires-report-0001.html");
    let ended = |file: &std::path::Path| {
        std::fs::read_to_string(file).is_ok_and(|text| text.ends_with("</html>\n"))
    };
    desk.wait_for("the report", |_| ended(&report));
    let text = std::fs::read_to_string(report).expect("there");
    for part in ["small parts", "Cyst and wires", "data:image/png;base64,", "0001-marked"] {
        assert!(text.contains(part), "{part}");
    }

    // Letters that are typed beside a field of the form are no keys; after a click into the image they are.
    // Above the message about the report, which goes by itself; and the image is made again where the loop stands.
    let console = [1280 - 336, 0, 336, 500];
    let shut = desk.settle(console);
    desk.click((150, 600));
    desk.press(Key::Letter('c'));
    desk.still(console);
    assert!(difference(&desk.grab(console), &shut) < 1.0, "the console stays shut");
    desk.press(Key::Letter('l'));
    desk.click((700, 600));
    desk.press(Key::Letter('c'));
    desk.wait_for("the console", |d| difference(&d.grab(console), &shut) > 5.0);
    desk.quit();
}

/// Pixels in the colour of the first mark.
fn yellow(pixels: &[u8]) -> usize {
    pixels.chunks_exact(3).filter(|p| p[0] > 200 && p[1] > 150 && p[2] < 120).count()
}

#[test]
fn marks_leave_the_image_with_the_freeze_and_stay_on_the_worksheet() {
    let folder = tempfile::tempdir().expect("a folder");
    let captures = folder.path().join("captures");
    let arguments = ["--captures", captures.to_str().expect("UTF-8"), "--validate"];
    let scene = SCENE.replace("[imaging]", "[imaging]\nexam = \"obstetric\"");
    let Some(mut desk) = Desk::open(&scene, &arguments) else {
        return;
    };
    desk.press(Key::Letter('c'));
    desk.press(Key::Letter('v'));
    desk.wait_for("an image", |d| brightness(&d.grab([500, 200, 300, 300])) > 10.0);
    desk.press(Key::Space);
    desk.press(Key::Letter('l'));
    desk.drag((560, 250), (700, 350));
    desk.wait_for("the measurement", |d| yellow(&d.grab(ALL)) > 20);
    desk.still(ALL);
    // The name is chosen from the list of the table.
    desk.click((100, 78));
    desk.still(ALL);
    desk.click((100, 130));
    desk.still(ALL);
    desk.press(Key::F2);
    let frozen = sidecar(&mut desk, &captures, "cyst-and-wires-0001.json");
    assert_eq!(frozen["measurements"][0]["label"], "BPD");
    assert_eq!(frozen["measurements"][0]["of_this_image"], true);
    desk.press(Key::Space);
    desk.wait_for("the marks to leave", |d| yellow(&d.grab(ALL)) < 20);
    desk.press(Key::F2);
    let live = sidecar(&mut desk, &captures, "cyst-and-wires-0002.json");
    assert_eq!(live["measurements"].as_array().map(Vec::len), Some(0));
    assert_eq!(live["worksheet"][0]["length_mm"], frozen["measurements"][0]["length_mm"]);
    // Its row in the worksheet has a button that removes it.
    desk.press(Key::Letter('x'));
    desk.still(ALL);
    desk.click((151, 60));
    desk.press(Key::F2);
    let removed = sidecar(&mut desk, &captures, "cyst-and-wires-0003.json");
    assert_eq!(removed["worksheet"].as_array().map(Vec::len), Some(0));
    desk.quit();
}

/// Stands in for `ffmpeg`: the film is the number of bytes that it was given.
const ENCODER: &str = "#!/bin/sh\nfor last; do :; done\nwc -c | tr -d ' ' > \"${last#file:}\"\n";

#[test]
fn a_loop_becomes_a_film_where_there_is_an_encoder() {
    use std::os::unix::fs::PermissionsExt as _;
    let folder = tempfile::tempdir().expect("a folder");
    let captures = folder.path().join("captures");
    let arguments = ["--captures", captures.to_str().expect("UTF-8"), "--validate"];
    let Some(display) = Display::open() else {
        return;
    };
    let encoder = folder.path().join("ffmpeg");
    std::fs::write(&encoder, ENCODER).expect("written");
    std::fs::set_permissions(&encoder, std::fs::Permissions::from_mode(0o755)).expect("mine");
    let path = std::env::var_os("PATH").unwrap_or_default();
    let paths = [folder.path().to_owned()].into_iter().chain(std::env::split_paths(&path));
    let path = std::env::join_paths(paths).expect("plain names");
    let with_encoder = |_: &std::path::Path, command: &mut std::process::Command| {
        command.env("PATH", path);
    };
    let Some(mut desk) = Desk::open_on(display, SCENE, &arguments, with_encoder) else {
        return;
    };
    desk.wait_for("an image", |d| brightness(&d.grab(super::IMAGE)) > 10.0);
    desk.settle(super::IMAGE);
    desk.press(Key::Space);
    desk.settle(super::IMAGE);
    // The list at the bar's right end: GIF, MP4, PNGs, DICOM.
    desk.click((907, 702));
    desk.click((900, 637));
    desk.press(Key::F3);
    let clip = sidecar(&mut desk, &captures, "cyst-and-wires-0001.json");
    assert_eq!(clip["file"], "cyst-and-wires-0001.mp4");
    let count = std::fs::read_to_string(captures.join("cyst-and-wires-0001.mp4")).expect("a film");
    let side = |key: &str| clip["image"][key].as_u64().expect("a size").next_multiple_of(2);
    let frame = 3 * side("width") * side("height");
    let bytes: u64 = count.trim().parse().expect("a number");
    assert!(bytes > 0 && bytes.is_multiple_of(frame), "{bytes} bytes in frames of {frame}");
    // An encoder that fails leaves nothing, and the next format goes on.
    std::fs::write(&encoder, "#!/bin/sh\necho half > \"$0.half\"\necho broken >&2\nexit 1\n")
        .expect("written");
    let before = desk.grab(super::IMAGE);
    desk.press(Key::F3);
    desk.wait_for("the reason", |d| difference(&d.grab(super::IMAGE), &before) > 0.2);
    let mut left: Vec<_> = std::fs::read_dir(&captures)
        .expect("a folder")
        .map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned())
        .collect();
    left.sort();
    assert_eq!(left, ["cyst-and-wires-0001.json", "cyst-and-wires-0001.mp4"]);
    desk.quit();
}

/// Pixels in the colour of the electrocardiogram.
fn green(pixels: &[u8]) -> usize {
    pixels.chunks_exact(3).filter(|p| p[1] > 150 && p[0] < 130 && p[2] < 160).count()
}

#[test]
fn texts_of_the_examination_are_chosen_from_a_list() {
    let folder = tempfile::tempdir().expect("a folder");
    let captures = folder.path().join("captures");
    let arguments = ["--captures", captures.to_str().expect("UTF-8"), "--validate"];
    let scene = SCENE.replace("[imaging]", "[imaging]\nexam = \"cardiac\"");
    let Some(mut desk) = Desk::open(&scene, &arguments) else {
        return;
    };
    desk.press(Key::Letter('c'));
    desk.press(Key::Letter('v'));
    desk.wait_for("an image", |d| brightness(&d.grab([500, 200, 300, 300])) > 10.0);
    desk.press(Key::Space);
    desk.press(Key::Letter('n'));
    desk.click((560, 250));
    desk.still(ALL);
    // The first text of the list below the field.
    desk.click((575, 278));
    desk.still(ALL);
    desk.press(Key::F2);
    let said = sidecar(&mut desk, &captures, "cyst-and-wires-0001.json");
    assert_eq!(said["texts"][0]["text"], "PLAX");
    assert_eq!(green(&desk.grab(ALL)), 0, "nothing beats in this scene");
    desk.quit();
}

/// A cube whose side is 10 mm times `size`.
fn cube(size: f64) -> String {
    let corners = [(0, 0), (1, 0), (1, 1), (0, 1)];
    let corner = |z: u32| {
        corners.map(|(x, y)| [x, y, z].map(|side| (10.0 * size * f64::from(side)).to_string()))
    };
    let vertices = [corner(0), corner(1)].concat();
    let vertices: String = vertices.iter().map(|v| format!("v {}\n", v.join(" "))).collect();
    vertices + "f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n"
}

#[test]
fn a_beating_scene_has_its_electrocardiogram() {
    let Some(display) = Display::open() else {
        return;
    };
    let beating = "[[selector]]\nname = \"beat\"\nperiod = \"0.8 s\"\n[[mesh]]\nname = \"heart\"\n\
        parent = \"beat\"\ntissue = \"blood\"\nkeyframes = [\"large.obj\", \"small.obj\"]\n\
        translate = [-5, -5, 10]\n";
    let scene = SCENE.replace("[imaging]", "[imaging]\nexam = \"cardiac\"") + beating;
    let prepare = |folder: &std::path::Path, _: &mut std::process::Command| {
        std::fs::write(folder.join("large.obj"), cube(1.0)).expect("written");
        std::fs::write(folder.join("small.obj"), cube(0.8)).expect("written");
    };
    let Some(mut desk) = Desk::open_on(display, &scene, &["--validate"], prepare) else {
        return;
    };
    desk.press(Key::Letter('c'));
    desk.press(Key::Letter('v'));
    let edge = [0, 600, 1280, 84];
    desk.wait_for("the trace", |d| green(&d.grab(edge)) > 200);
    // Frozen it stands, and its mark goes back with the images.
    desk.wait_for("some images", |d| brightness(&d.grab([500, 200, 300, 300])) > 10.0);
    std::thread::sleep(std::time::Duration::from_millis(500));
    desk.press(Key::Space);
    desk.still(edge);
    let newest = desk.grab(edge);
    desk.press(Key::Letter(','));
    desk.wait_for("the mark to go back", |d| d.grab(edge) != newest);
    desk.still(edge);
    assert!(green(&desk.grab(edge)) > 200);
    desk.quit();
}

#[test]
fn a_body_mark_is_placed_turned_and_saved() {
    let folder = tempfile::tempdir().expect("a folder");
    let captures = folder.path().join("captures");
    let arguments = ["--captures", captures.to_str().expect("UTF-8"), "--validate"];
    let scene = SCENE.replace("[imaging]", "[imaging]\nexam = \"vascular\"");
    let Some(mut desk) = Desk::open(&scene, &arguments) else {
        return;
    };
    desk.press(Key::Letter('c'));
    desk.press(Key::Letter('v'));
    desk.wait_for("an image", |d| brightness(&d.grab([500, 200, 300, 300])) > 10.0);
    desk.press(Key::Space);
    let room = [88, 546, 76, 76];
    let before = brightness(&desk.grab(room));
    // The topmost button of the tools.
    desk.click((23, 414));
    desk.wait_for("the figure", |d| brightness(&d.grab(room)) > before + 5.0);
    desk.still(ALL);
    desk.drag((126, 584), (144, 600));
    // Its second end, 0.3 of half the figure to the right, goes down.
    desk.drag((155, 600), (144, 625));
    desk.still(ALL);
    desk.press(Key::F2);
    let said = sidecar(&mut desk, &captures, "cyst-and-wires-0001.json");
    let mark = &said["body_mark"];
    assert_eq!(mark["figure"], "neck");
    let number = |value: &serde_json::Value| value.as_f64().expect("a number");
    let [x, y] = [0, 1].map(|axis| number(&mark["probe"][axis]));
    assert!((x - 18.0 / 38.0).abs() < 0.05 && (y - 16.0 / 38.0).abs() < 0.05, "{x} {y}");
    assert!((number(&mark["turn_deg"]) - 90.0).abs() < 5.0, "{mark}");
    assert!(captures.join("cyst-and-wires-0001-marked.png").exists(), "the figure is in a picture");
    assert_eq!(
        said["measurements"].as_array().map(Vec::len),
        Some(0),
        "the drags measured nothing"
    );
    // Through the other figures, and away.
    for _ in 1..5 {
        desk.click((23, 414));
        desk.still(ALL);
    }
    desk.click((23, 414));
    desk.wait_for("no figure", |d| brightness(&d.grab(room)) < before + 1.0);
    desk.quit();
}
