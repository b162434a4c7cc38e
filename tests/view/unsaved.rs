//! Work is never lost: questions on the ways out, dialogs that have the keyboard, undo, named poses.

use std::path::Path;
use std::process::Command;

use super::desk::{Desk, Display, Key};
use super::{IMAGE, SCENE, brightness, difference};

/// The part of the window over which dialogs lie.
pub const CENTRE: [u16; 4] = [430, 40, 420, 300];

/// The window in the folder of its scene file.
pub fn open(scene: &str, more: &[(&str, &str)]) -> Option<Desk> {
    let within = |folder: &Path, command: &mut Command| {
        command.current_dir(folder);
        for (name, text) in more {
            std::fs::write(folder.join(name), text).expect("written");
        }
    };
    let mut desk = Desk::open_on(Display::open()?, scene, &["--validate"], within)?;
    desk.wait_for("an image", |d| brightness(&d.grab(IMAGE)) > 10.0);
    desk.settle(IMAGE);
    Some(desk)
}

/// Waits for a dialog after `act`, which is not there before.
fn opens(desk: &mut Desk, what: &str, act: impl FnOnce(&Desk)) -> Vec<u8> {
    let before = desk.grab(CENTRE);
    act(desk);
    desk.wait_for(what, |d| difference(&d.grab(CENTRE), &before) > 5.0);
    desk.still(CENTRE);
    before
}

fn closes(desk: &mut Desk, before: &[u8]) {
    desk.wait_for("the dialog to close", |d| difference(&d.grab(CENTRE), before) < 1.5);
}

fn text(desk: &Desk, name: &str) -> String {
    std::fs::read_to_string(desk.folder().join(name)).unwrap_or_default()
}

#[test]
fn every_way_out_asks_and_saving_keeps_settings_trajectory_and_measurements() {
    let Some(mut desk) = open(SCENE, &[("trajectory.csv", "another's")]) else {
        return;
    };
    desk.press(Key::Letter('-'));
    desk.press(Key::Letter('r'));
    desk.press(Key::Right);
    desk.settle(IMAGE);
    desk.press(Key::Letter('l'));
    desk.drag((150, 200), (250, 300));
    desk.settle(IMAGE);
    // Escape and Cancel go back; nothing has been written.
    for way in [|desk: &Desk| desk.hold_control(Key::Letter('q')), |desk: &Desk| desk.close()] {
        let before = opens(&mut desk, "the question", way);
        desk.press(Key::Escape);
        closes(&mut desk, &before);
    }
    assert_eq!(desk.scene(), SCENE);
    opens(&mut desk, "the question", |desk| desk.close());
    desk.press(Key::Enter);
    let folder = desk.keep();
    assert!(desk.ended().success());
    let kept = |name: &str| std::fs::read_to_string(folder.path().join(name)).expect(name);
    let measured = kept("cyst-and-wires-0001.json");
    let (scene, way) = (kept("scene.toml"), kept("trajectory-2.csv"));
    assert!(scene.contains("gain = "), "{scene}");
    assert!(way.contains("# keyboard") && way.lines().count() > 4, "{way}");
    assert!(measured.contains("\"distance"), "{measured}");
    assert_eq!(kept("trajectory.csv"), "another's");
}

#[test]
fn another_scene_opens_by_enter_and_a_dialog_keeps_the_keyboard() {
    // Black, whatever the quality of its image: noise is lowered, too.
    let other = "name = \"Water\"\n# mine\n[imaging]\ngain = -60\n";
    let Some(mut desk) = open(SCENE, &[("water.toml", other)]) else {
        return;
    };
    let image = desk.grab([60, 300, 300, 200]);
    let before = opens(&mut desk, "the dialog", |desk| desk.hold_control(Key::Letter('o')));
    desk.retype("nofolder/x.toml");
    desk.still(CENTRE);
    let typed = desk.grab(CENTRE);
    desk.press(Key::Enter);
    desk.wait_for("the error", |d| difference(&d.grab(CENTRE), &typed) > 1.0);
    // What is typed next goes into the field, and opens neither strip nor 3D view, moves no probe, changes no gain.
    desk.retype("mvt-qa");
    desk.still(CENTRE);
    assert!(difference(&desk.grab([60, 300, 300, 200]), &image) < 0.5, "keys act");
    // Save as, on the name of another file: Enter alone replaces nothing.
    desk.press(Key::Escape);
    closes(&mut desk, &before);
    desk.hold(Key::Shift, true);
    opens(&mut desk, "the dialog", |desk| desk.hold_control(Key::Letter('s')));
    desk.hold(Key::Shift, false);
    desk.retype("water.toml");
    desk.still(CENTRE);
    let asked = desk.grab(CENTRE);
    for _ in 0..3 {
        desk.press(Key::Enter);
        desk.still(CENTRE);
    }
    assert!(difference(&desk.grab(CENTRE), &asked) > 0.5, "it asks");
    assert_eq!(text(&desk, "water.toml"), other);
    desk.press(Key::Escape);
    closes(&mut desk, &before);
    // Enter opens; changes are asked about before.
    desk.press(Key::Letter('-'));
    desk.settle(IMAGE);
    opens(&mut desk, "the dialog", |desk| desk.hold_control(Key::Letter('o')));
    // Not for a file that is not there: the field keeps the keyboard.
    desk.retype("gone.toml");
    desk.still(CENTRE);
    let typed = desk.grab(CENTRE);
    desk.press(Key::Enter);
    desk.wait_for("the error", |d| difference(&d.grab(CENTRE), &typed) > 1.0);
    desk.retype("water.toml");
    desk.still(CENTRE);
    desk.press(Key::Enter);
    desk.discard("the other scene", |d| brightness(&d.grab([60, 300, 300, 200])) < 5.0);
    desk.quit();
}

#[test]
fn undo_covers_the_probe_marks_and_recordings_which_another_does_not_replace() {
    let Some(mut desk) = open(SCENE, &[]) else {
        return;
    };
    let home = desk.settle(IMAGE);
    (0..6).for_each(|_| desk.press(Key::Right));
    desk.wait_for("the image to move", |d| difference(&d.grab(IMAGE), &home) > 4.0);
    desk.settle(IMAGE);
    desk.hold_control(Key::Letter('z'));
    desk.wait_for("the way back", |d| difference(&d.grab(IMAGE), &home) < 1.5);
    let bare = desk.settle(IMAGE);
    // A measurement, all of them removed, and back.
    desk.press(Key::Letter('l'));
    desk.drag((150, 200), (250, 300));
    desk.wait_for("a measurement", |d| difference(&d.grab(IMAGE), &bare) > 0.05);
    desk.press(Key::Letter('l'));
    let marked = desk.settle(IMAGE);
    desk.click((23, 594));
    desk.wait_for("none", |d| difference(&d.grab(IMAGE), &bare) < 0.02);
    desk.hold_control(Key::Letter('z'));
    desk.wait_for("it again", |d| difference(&d.grab(IMAGE), &marked) < 0.1);
    // A red sign while it records; another recording asks what becomes of this one.
    let sign = [414, 0, 140, 28];
    let red = |d: &Desk| d.grab(sign).chunks_exact(3).filter(|p| p[0] > 200 && p[2] < 90).count();
    assert_eq!(red(&desk), 0);
    desk.press(Key::Letter('r'));
    desk.wait_for("the red sign", |d| red(d) > 40);
    desk.press(Key::Right);
    desk.settle(IMAGE);
    desk.press(Key::Letter('r'));
    desk.wait_for("no red sign", |d| red(d) == 0);
    let before = opens(&mut desk, "the question", |desk| desk.press(Key::Letter('r')));
    assert_eq!(red(&desk), 0, "nothing is recorded yet");
    desk.press(Key::Escape);
    closes(&mut desk, &before);
    opens(&mut desk, "the question", |desk| desk.press(Key::Letter('r')));
    desk.press(Key::Enter);
    desk.wait_for("the first to be saved", |d| text(d, "trajectory.csv").contains("# keyboard"));
    desk.wait_for("the red sign", |d| red(d) > 40);
    desk.quit();
}

#[test]
fn a_named_pose_is_added_gone_to_and_saved() {
    let Some(mut desk) = open(SCENE, &[]) else {
        return;
    };
    let home = desk.settle(IMAGE);
    let section = [1280 - 336, 435, 336, 60];
    let closed = desk.grab(section);
    desk.click((1000, 443));
    desk.wait_for("the section of poses", |d| difference(&d.grab(section), &closed) > 1.0);
    desk.settle(section);
    let below = [1280 - 336, 478, 336, 20];
    let empty = desk.grab(below);
    // The field, and a name; Enter adds.
    desk.click((1060, 464));
    "cyst".chars().for_each(|letter| desk.press(Key::Letter(letter)));
    desk.press(Key::Enter);
    // The field, which has the keyboard until then, moves into the row below.
    desk.wait_for("the pose", |d| difference(&d.grab(below), &empty) > 1.0);
    desk.still(section);
    (0..6).for_each(|_| desk.press(Key::Right));
    desk.wait_for("the image to move", |d| difference(&d.grab(IMAGE), &home) > 4.0);
    desk.settle(IMAGE);
    desk.click((1020, 464));
    desk.wait_for("the pose again", |d| difference(&d.grab(IMAGE), &home) < 1.5);
    desk.hold_control(Key::Letter('s'));
    desk.wait_for("it to be saved", |d| d.scene().contains("[[pose]]\nname = \"cyst\"\n"));
    assert!(desk.scene().contains("position = [0, 0, 0]"), "{}", desk.scene());
    desk.quit();
}

#[test]
fn what_a_crash_leaves_is_offered_and_taken_up() {
    let Some(mut desk) = open(SCENE, &[]) else {
        return;
    };
    let home = desk.settle(IMAGE);
    desk.press(Key::Letter('r'));
    (0..4).for_each(|_| desk.press(Key::Right));
    desk.settle(IMAGE);
    desk.press(Key::Letter('r'));
    desk.press(Key::Letter('l'));
    desk.drag((150, 200), (250, 300));
    desk.press(Key::Letter('l'));
    desk.press(Key::Letter('-'));
    let before = desk.settle(IMAGE);
    desk.wait_for("it to be kept", |d| {
        let kept = d.kept().concat();
        kept.contains("Settings") && kept.contains("trajectory") && kept.contains("Measurements")
    });
    desk.crash();
    // The offer lies beside this part.
    desk.wait_for("an image", |d| brightness(&d.grab([60, 300, 300, 200])) > 10.0);
    desk.still(IMAGE);
    desk.press(Key::Enter);
    desk.wait_for("what was before", |d| difference(&d.grab(IMAGE), &before) < 1.0);
    // Saved on the way out, nothing is left to offer.
    desk.hold_control(Key::Letter('q'));
    desk.still(CENTRE);
    desk.press(Key::Enter);
    let folder = desk.keep();
    assert!(desk.ended().success());
    let scene = std::fs::read_to_string(folder.path().join("scene.toml")).expect("there");
    assert!(scene.contains("gain = ") && home != before, "{scene}");
    assert!(folder.path().join("trajectory.csv").exists());
}
