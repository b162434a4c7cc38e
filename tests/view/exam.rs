//! The examination: saved pictures without what is pressed, worksheet and report.

use super::desk::{Desk, Key};
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
