//! Files edited beside the window: read again with the session kept, errors shown in place.

use super::desk::Key;
use super::unsaved::open;
use super::{IMAGE, SCENE, difference};

/// The middle of the image, with the cyst.
const PART: [u16; 4] = [60, 100, 300, 300];
/// The part at the image's lower edge where errors are shown.
const BELOW: [u16; 4] = [60, 560, 380, 70];

#[test]
fn an_edited_scene_is_read_again_where_the_probe_is_and_a_mistake_is_told() {
    let Some(mut desk) = open(SCENE, &[]) else {
        return;
    };
    let home = desk.settle(IMAGE);
    // Somewhere else, and darker: both have to stay.
    (0..2).for_each(|_| desk.press(Key::Right));
    (0..6).for_each(|_| desk.press(Key::Letter('-')));
    let before = desk.settle(PART);
    let folder = desk.keep();
    let write =
        |text: &str| std::fs::write(folder.path().join("scene.toml"), text).expect("written");
    let bare = desk.grab(BELOW);
    write(&SCENE.replace("5 mm", "5 mmm"));
    desk.wait_for("the mistake", |d| difference(&d.grab(BELOW), &bare) > 3.0);
    assert!(difference(&desk.grab(PART), &before) < 0.5, "the image stays");
    // Without the cyst there is speckle in its place, as dark as before.
    write(&SCENE.replace("cyst_fluid", "liver"));
    desk.wait_for("another image", |d| difference(&d.grab(PART), &before) > 1.5);
    desk.wait_for("the mistake to go", |d| difference(&d.grab(BELOW), &bare) < 1.0);
    desk.settle(PART);
    // As it was, and where it was: the gain and the pose of the session.
    write(SCENE);
    desk.wait_for("the image before", |d| difference(&d.grab(PART), &before) < 0.8);
    // Home and the gain of the beginning: all of the session has stayed.
    desk.press(Key::Home);
    (0..6).for_each(|_| desk.press(Key::Letter('=')));
    desk.wait_for("the beginning", |d| difference(&d.grab(IMAGE), &home) < 1.5);
    desk.quit();
}

#[test]
fn a_right_click_names_what_is_there_and_opens_its_settings() {
    let Some(mut desk) = open(SCENE, &[]) else {
        return;
    };
    let console = [1280 - 336, 380, 336, 330];
    // The cyst in the image, and its tissue.
    let (x, y) = (221, 262);
    let beside = [x + 12, y + 8, 60, 40];
    let before = (desk.settle(beside), desk.settle(console));
    desk.click_right((x, y));
    desk.wait_for("a name", |d| difference(&d.grab(beside), &before.0) > 3.0);
    desk.still(beside);
    desk.click((x + 45, y + 60));
    desk.wait_for("its settings", |d| difference(&d.grab(console), &before.1) > 1.0);
    desk.quit();
}
