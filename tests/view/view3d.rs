//! The 3D view.

use super::desk::{Desk, Key};
use super::{CONSOLE, IMAGE, SCENE, brightness, difference};

/// The middle of the view, between the image and the console; without buttons and text.
const VIEW: [u16; 4] = [610, 60, 310, 560];
/// The same below the words that explain a button under the pointer.
const BELOW: [u16; 4] = [610, 140, 310, 480];

#[test]
fn the_eye_goes_around_and_the_image_stays() {
    let Some(mut desk) = Desk::open(SCENE, &["--validate"]) else {
        return;
    };
    desk.wait_for("an image", |d| brightness(&d.grab(IMAGE)) > 10.0);
    desk.wait_for("the anatomy", |d| brightness(&d.grab(VIEW)) > 15.0);
    let [image, front] = [desk.settle(IMAGE), desk.rest(VIEW)];

    desk.drag((640, 520), (760, 480));
    desk.wait_for("the other side", |d| difference(&d.grab(VIEW), &front) > 3.0);
    let side = desk.rest(VIEW);
    assert_eq!(difference(&desk.grab(IMAGE), &image), 0.0, "no new image");

    // Frozen it can still be turned.
    desk.press(Key::Space);
    let image = desk.settle(IMAGE);
    desk.drag((640, 520), (580, 520));
    desk.wait_for("a third side", |d| difference(&d.grab(VIEW), &side) > 2.0);
    desk.rest(VIEW);
    assert_eq!(difference(&desk.grab(IMAGE), &image), 0.0, "frozen");
    desk.press(Key::Space);

    // It follows the probe.
    let before = desk.rest(VIEW);
    for _ in 0..6 {
        desk.press(Key::Right);
    }
    desk.wait_for("the probe in it", |d| difference(&d.grab(VIEW), &before) > 1.0);
    desk.quit();
}

#[test]
fn tissues_are_hidden_and_the_view_closes() {
    let Some(mut desk) = Desk::open(SCENE, &["--validate"]) else {
        return;
    };
    desk.wait_for("the anatomy", |d| brightness(&d.grab(VIEW)) > 15.0);
    let console = desk.settle(CONSOLE);
    // "Cut": the half before the image plane goes, and comes back.
    let whole = desk.rest(VIEW);
    let anatomy = desk.rest(BELOW);
    desk.click((663, 17));
    desk.wait_for("the section", |d| difference(&d.grab(BELOW), &anatomy) > 0.2);
    desk.click((663, 17));
    desk.wait_for("the whole cyst", |d| difference(&d.grab(BELOW), &anatomy) < 0.1);
    // The list, and "None" in it.
    desk.click((620, 17));
    let open = desk.rest(VIEW);
    desk.click((647, 56));
    desk.wait_for("no cyst", |d| difference(&d.grab(VIEW), &open) > 0.2);
    desk.rest(VIEW);
    desk.press(Key::Letter('v'));
    desk.wait_for("the image in the view's place", |d| difference(&d.grab(VIEW), &whole) > 5.0);
    desk.press(Key::Letter('v'));
    desk.wait_for("the view", |d| difference(&d.grab(VIEW), &whole) < 20.0);
    assert!(difference(&desk.settle(CONSOLE), &console) < 1.0);
    desk.quit();
}

#[test]
fn the_edge_between_image_and_view_is_dragged_and_comes_back() {
    let Some(mut desk) = Desk::open(SCENE, &["--validate"]) else {
        return;
    };
    desk.wait_for("an image", |d| brightness(&d.grab(IMAGE)) > 10.0);
    desk.wait_for("the anatomy", |d| brightness(&d.grab(VIEW)) > 15.0);
    let edge = |x: u16| [x - 40, 200, 80, 200];
    let (before, view) = (desk.rest(edge(586)), desk.rest(VIEW));
    // Over to the right the image takes the room, and the camera stays where it is.
    desk.pull((586, 300), (690, 300));
    desk.wait_for("the edge to move", |d| difference(&d.grab(edge(586)), &before) > 3.0);
    desk.rest(VIEW);
    // Two clicks on it.
    desk.click((690, 300));
    desk.click((690, 300));
    desk.wait_for("the edge to come back", |d| difference(&d.grab(VIEW), &view) < 0.5);
    desk.quit();
}
