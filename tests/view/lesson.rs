//! The lesson, as a learner takes it: tasks, scores, history.

use std::path::{Path, PathBuf};

use serde_json::Value;

use super::desk::{Desk, Display, Key};
use super::tools::sidecar;
use super::{IMAGE, SCENE, brightness, difference};

/// Depth of the image, mm.
const DEPTH: f64 = 40.0;

/// A view beside the start, by 12.5 mm along the image.
const VIEW_TASK: &str = r#"
[[pose]]
name = "beside"
position = [-12, 0, 0]

[[task]]
name = "Cyst"
text = "Show the cyst."
start = "beside"
position = [0.5, 0, 0]
distance = "3 mm"
plane_angle = "5 deg"
turn = "5 deg"
hold = "0 s"
"#;

const MEASURE_TASK: &str = r#"
[[task]]
name = "Diameter"
kind = "measure"
text = "Measure the cyst."
value = 10.5
"#;

/// The 3D view without its buttons and texts.
const VIEW: [u16; 4] = [590, 60, 350, 590];
/// What the panel may cover, above the bar.
const PANEL: [u16; 4] = [46, 200, 540, 478];
/// What is clicked in it before a task is begun; it grows upwards from the bar.
const START: (u16, u16) = (70, 660);
const LEARNER: (u16, u16) = (184, 638);
const EXAMINATION: (u16, u16) = (60, 617);
/// While it is done.
const SUBMIT: (u16, u16) = (77, 661);
const GIVE_UP: (u16, u16) = (134, 661);
const GUIDE: (u16, u16) = (60, 640);
const TAKE: (u16, u16) = (69, 640);
/// Above the score of a view that was reached, and of one that was not.
const START_AGAIN: (u16, u16) = (70, 513);
const HISTORY: (u16, u16) = (121, 480);
/// In the history of two attempts: the older one, and with that one chosen the way back.
const OLDER: (u16, u16) = (300, 524);
const BACK: (u16, u16) = (70, 442);

/// Opens a scene with a task, its panel, and a folder for the histories; a software driver takes some milliseconds
/// for a frame.
fn opened(task: &str, data: &Path, arguments: &[&str]) -> Option<Desk> {
    let scene = SCENE.replace("[imaging]", &format!("depth = {DEPTH}\n\n[imaging]")) + task;
    let prepare = |_: &Path, command: &mut std::process::Command| {
        command.env("XDG_DATA_HOME", data);
    };
    let arguments = [arguments, &["--validate"]].concat();
    let mut desk = Desk::open_on(Display::open()?, &scene, &arguments, prepare)?;
    desk.wait_for("an image", |d| brightness(&d.grab(IMAGE)) > 10.0);
    let before = desk.settle(PANEL);
    desk.click((286, 702));
    desk.wait_for("the panel", |d| difference(&d.grab(PANEL), &before) > 2.0);
    Some(desk)
}

fn learner_ann(desk: &mut Desk) {
    desk.click(LEARNER);
    desk.still(PANEL);
    desk.retype("ann");
    desk.still(PANEL);
}

fn history(data: &Path) -> PathBuf {
    data.join("insonify/learners/ann.json")
}

/// The attempts in a history, once there are so many.
fn attempts(desk: &mut Desk, data: &Path, count: usize) -> Vec<Value> {
    let mut found = Vec::new();
    desk.wait_for("the attempt in the history", |_| {
        let text = std::fs::read_to_string(history(data)).unwrap_or_default();
        found = serde_json::from_str(&text).unwrap_or_default();
        found.len() == count
    });
    found
}

fn number(entry: &Value, key: &str) -> f64 {
    entry[key].as_f64().unwrap_or_else(|| panic!("{key}: {entry}"))
}

/// Places of the pixels in the colour of a target, a way, and of what is reached.
fn green(pixels: &[u8]) -> Vec<usize> {
    let is =
        |p: &[u8]| p[0].abs_diff(120) < 20 && p[1].abs_diff(210) < 20 && p[2].abs_diff(120) < 20;
    let all = pixels.chunks_exact(3).enumerate();
    all.filter(|(_, p)| is(p)).map(|(at, _)| at).collect()
}

/// Number of pixels in the colour of warnings.
fn warned(pixels: &[u8]) -> usize {
    let is =
        |p: &&[u8]| p[0].abs_diff(232) < 20 && p[1].abs_diff(170) < 20 && p[2].abs_diff(84) < 20;
    pixels.chunks_exact(3).filter(is).count()
}

#[test]
fn a_view_is_reached_another_is_not_and_both_stand_in_the_history() {
    let data = tempfile::tempdir().expect("a folder");
    let Some(mut desk) = opened(VIEW_TASK, data.path(), &[]) else {
        return;
    };
    learner_ann(&mut desk);
    let home = desk.grab(VIEW);
    desk.click(START);
    desk.wait_for("the start", |d| difference(&d.grab(VIEW), &home) > 2.0);
    desk.settle(VIEW);
    // To the target but for half a millimetre and two degrees.
    for _ in 0..6 {
        desk.press(Key::Right);
    }
    desk.press(Key::Letter('w'));
    desk.settle(VIEW);
    desk.click(SUBMIT);
    let first = attempts(&mut desk, data.path(), 1).remove(0);
    assert_eq!(first["reached"], true, "{first}");
    assert_eq!((&first["task"], &first["scene"]), (&"Cyst".into(), &"Cyst and wires".into()));
    let turn = 2f64.to_radians();
    let arc = 2.0 * (DEPTH / 2.0) * (turn / 2.0).sin();
    for (key, wanted) in [
        ("path_mm", 12.0),
        ("angle_deg", 2.0),
        ("distance_mm", 0.5f64.hypot(arc)),
        ("plane_angle_deg", 2.0),
        ("turn_deg", 0.0),
    ] {
        assert!((number(&first, key) - wanted).abs() < 1e-6, "{key}: {wanted}, {first}");
    }
    assert!(number(&first, "seconds") > 0.0 && number(&first, "peaks") > 0.0, "{first}");
    let way = first["way"].as_array().expect("a way");
    assert_eq!(way[0], serde_json::json!([-12.0, 0.0, 0.0]));
    assert_eq!(way[way.len() - 1], serde_json::json!([0.0, 0.0, 0.0]));
    desk.wait_for("the word that it is reached", |d| green(&d.grab(PANEL)).len() > 20);
    desk.wait_for("the way", |d| green(&d.grab(VIEW)).len() > 20);
    assert_eq!(warned(&desk.grab(PANEL)), 0);

    // Across the image, away from the target.
    desk.still(PANEL);
    desk.click(START_AGAIN);
    desk.wait_for("no way any more", |d| green(&d.grab(VIEW)).is_empty());
    desk.settle(VIEW);
    for _ in 0..5 {
        desk.press(Key::Symbol(0xff52));
    }
    desk.settle(VIEW);
    desk.click(SUBMIT);
    let second = attempts(&mut desk, data.path(), 2).remove(1);
    assert_eq!(second["reached"], false, "{second}");
    let reasons = second["reasons"].as_array().expect("a list");
    assert!(
        reasons.len() == 1 && reasons[0].as_str().expect("a text").contains("beside the target")
    );
    for (key, wanted) in [("path_mm", 10.0), ("distance_mm", 12.5f64.hypot(10.0))] {
        assert!((number(&second, key) - wanted).abs() < 1e-6, "{key}: {wanted}, {second}");
    }
    desk.wait_for("the word that it is not", |d| warned(&d.grab(PANEL)) > 20);

    // The history lists both; a click on the older one shows its way in place of the newest's.
    desk.still(PANEL);
    let newest = green(&desk.grab(VIEW));
    assert!(newest.len() > 20, "{}", newest.len());
    desk.click(HISTORY);
    desk.still(PANEL);
    assert_eq!(green(&desk.grab(VIEW)), newest);
    desk.click(OLDER);
    desk.wait_for("the way along the image", |d| {
        let older = green(&d.grab(VIEW));
        older.len() > 20 && older != newest
    });

    // One that cannot be read is said, and stays.
    std::fs::write(history(data.path()), "[{").expect("written");
    desk.still(PANEL);
    desk.click(BACK);
    desk.still(PANEL);
    desk.click(HISTORY);
    desk.wait_for("what is wrong", |d| {
        warned(&d.grab(PANEL)) > 60 && green(&d.grab(VIEW)).is_empty()
    });
    assert_eq!(std::fs::read_to_string(history(data.path())).expect("there"), "[{");
    desk.quit();
}

#[test]
fn a_measurement_is_taken_from_the_image() {
    let data = tempfile::tempdir().expect("a folder");
    let captures = data.path().join("captures");
    let arguments = ["--captures", captures.to_str().expect("UTF-8")];
    let Some(mut desk) = opened(MEASURE_TASK, data.path(), &arguments) else {
        return;
    };
    learner_ann(&mut desk);
    desk.click(START);
    desk.still(PANEL);
    desk.press(Key::Letter('l'));
    // From edge to edge of the cyst.
    desk.drag((150, 288), (272, 288));
    desk.still(PANEL);
    desk.click(TAKE);
    desk.still(PANEL);
    desk.click(SUBMIT);
    let entry = attempts(&mut desk, data.path(), 1).remove(0);
    desk.press(Key::F2);
    let still = sidecar(&mut desk, &captures, "cyst-and-wires-0001.json");
    let drawn = number(&still["measurements"][0], "length_mm");
    let measured = number(&entry, "measured");
    assert!((measured - drawn).abs() <= 0.005, "{measured} {drawn}");
    // 122 pixels of 11.5 to a millimetre.
    assert!((drawn - 10.6).abs() < 0.2, "{drawn}");
    let error = 100.0 * (measured / 10.5 - 1.0);
    assert!((number(&entry, "error_percent") - error).abs() < 1e-9, "{entry}");
    assert_eq!(entry["reached"], true, "{entry}");
    assert_eq!(entry["guided"], false);
    desk.quit();
}

#[test]
fn an_examination_hides_guide_and_overlay() {
    let data = tempfile::tempdir().expect("a folder");
    let Some(mut desk) = opened(VIEW_TASK, data.path(), &[]) else {
        return;
    };
    // What the panel leaves free of the image.
    const FREE: [u16; 4] = [90, 100, 420, 380];
    desk.click(START);
    desk.still(PANEL);
    desk.click(GUIDE);
    desk.wait_for("the target", |d| green(&d.grab(VIEW)).len() > 20);
    let plain = desk.settle(FREE);
    // What lies there has a name, but in an examination.
    const SPOT: (u16, u16) = (250, 200);
    desk.click_right(SPOT);
    desk.wait_for("the name", |d| difference(&d.grab(FREE), &plain) > 0.5);
    desk.press(Key::Escape);
    desk.wait_for("the image alone", |d| difference(&d.grab(FREE), &plain) < 0.5);
    desk.press(Key::Letter('i'));
    desk.wait_for("the colours", |d| difference(&d.grab(FREE), &plain) > 3.0);
    desk.settle(FREE);
    desk.click(GIVE_UP);
    desk.still(PANEL);
    desk.click(EXAMINATION);
    desk.still(PANEL);
    desk.click(START);
    desk.wait_for("the image without colours", |d| difference(&d.grab(FREE), &plain) < 1.5);
    desk.rest(VIEW);
    assert_eq!(green(&desk.grab(VIEW)), [0; 0], "no target");
    desk.press(Key::Letter('i'));
    assert!(difference(&desk.settle(FREE), &plain) < 1.5, "no colours by the key either");
    let image = desk.settle(FREE);
    desk.click_right(SPOT);
    assert!(difference(&desk.settle(FREE), &image) < 0.5, "no name");
    desk.quit();
}
