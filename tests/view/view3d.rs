//! The 3D view.

use super::desk::{Desk, Key};
use super::{CONSOLE, IMAGE, SCENE, brightness, difference};

/// The middle of the view, between the image and the console; without buttons and text.
const VIEW: [u16; 4] = [610, 60, 310, 560];

/// Returns whether a part of the window has the blue of the cyst's surface in it. How fine the picture around it is
/// depends on how busy the machine is: two pictures of one anatomy may differ by more than the section does.
fn shows_cyst(part: &[u8]) -> bool {
    let blue = |p: &&[u8]| i32::from(p[2]) > i32::from(p[1]) + 30 && p[1] > p[0];
    part.chunks_exact(3).filter(blue).count() > 300
}

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
    assert!(shows_cyst(&whole));
    desk.click((663, 17));
    desk.wait_for("the section", |d| !shows_cyst(&d.grab(VIEW)));
    desk.click((663, 17));
    desk.wait_for("the whole cyst", |d| shows_cyst(&d.grab(VIEW)));
    // The list, and "None" in it.
    desk.click((620, 17));
    desk.rest(VIEW);
    desk.click((647, 56));
    desk.wait_for("no cyst", |d| !shows_cyst(&d.grab(VIEW)));
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
    let moved = difference(&desk.rest(VIEW), &view);
    // Two clicks on it; the picture may be of another fineness than before.
    desk.click((690, 300));
    desk.click((690, 300));
    desk.wait_for("the edge to come back", |d| difference(&d.grab(VIEW), &view) < 0.2 * moved);
    desk.wait_for("the edge itself", |d| difference(&d.grab(edge(586)), &before) < 1.0);
    desk.quit();
}
