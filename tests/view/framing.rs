//! The image in its pane: enlarged, moved, turned over.

use super::desk::{Desk, Key};
use super::tools::sidecar;
use super::{IMAGE, SCENE, brightness, difference};

/// Width of the grabbed part.
const WIDTH: usize = IMAGE[2] as usize;

/// Columns or rows, first and last, in which something bright is.
fn extent(pixels: &[u8], across: bool) -> (usize, usize) {
    let bright = pixels.chunks_exact(3).enumerate().filter(|(_, p)| p[0] == p[1] && p[0] > 40);
    let at = bright.map(|(i, _)| if across { i % WIDTH } else { i / WIDTH });
    at.fold((usize::MAX, 0), |(low, high), at| (low.min(at), high.max(at)))
}

#[test]
fn the_image_is_turned_over_enlarged_and_comes_back() {
    let Some(mut desk) = Desk::open(SCENE, &["--validate"]) else {
        return;
    };
    desk.wait_for("an image", |d| brightness(&d.grab(IMAGE)) > 10.0);
    let before = desk.settle(IMAGE);
    for key in ['f', 'u'] {
        desk.press(Key::Letter(key));
        desk.wait_for("the other side", |d| difference(&d.grab(IMAGE), &before) > 0.5);
        desk.press(Key::Letter(key));
        desk.wait_for("the image as it was", |d| d.grab(IMAGE) == before);
    }
    let middle = (IMAGE[0] + IMAGE[2] / 2, IMAGE[1] + IMAGE[3] / 2);
    for _ in 0..3 {
        desk.wheel(middle);
    }
    desk.wait_for("it to be larger", |d| difference(&d.grab(IMAGE), &before) > 2.0);
    let large = desk.settle(IMAGE);
    for across in [true, false] {
        let [small, large] = [&before, &large].map(|p| extent(p, across));
        assert!(large.1 - large.0 >= small.1 - small.0, "{small:?} {large:?}");
    }
    desk.press(Key::Letter('z'));
    // The pointer is over the image: its own mark may be drawn there.
    desk.wait_for("the whole of it", |d| difference(&d.grab(IMAGE), &before) < 0.5);
    desk.quit();
}

/// Within the left and the right one of two images that have the window for themselves.
const LEFT: [u16; 4] = [200, 120, 240, 240];
const RIGHT: [u16; 4] = [840, 120, 240, 240];
const WHOLE: [u16; 4] = [0, 0, 1280, 670];

#[test]
fn an_image_is_held_beside_the_live_one_and_they_change_sides() {
    let folder = tempfile::tempdir().expect("a folder");
    let captures = folder.path().join("captures");
    let arguments = ["--captures", captures.to_str().expect("UTF-8"), "--validate"];
    let Some(mut desk) = Desk::open(SCENE, &arguments) else {
        return;
    };
    desk.press(Key::Letter('c'));
    desk.press(Key::Letter('v'));
    desk.wait_for("an image", |d| brightness(&d.grab([500, 200, 300, 300])) > 10.0);
    desk.still(WHOLE);
    let alone = desk.grab(WHOLE);
    desk.press(Key::Letter('y'));
    desk.wait_for("two images", |d| {
        brightness(&d.grab(LEFT)) > 10.0 && brightness(&d.grab(RIGHT)) > 10.0
    });
    desk.still(WHOLE);
    let [left, right] = [LEFT, RIGHT].map(|part| desk.grab(part));
    assert!(difference(&left, &right) < 2.0, "both show the same");
    // The live one, at the right, follows the probe, and the held one stays to the last bit.
    let moved = |desk: &mut Desk, key: Key| (0..6).for_each(|_| desk.press(key));
    moved(&mut desk, Key::Right);
    desk.wait_for("the live one to move", |d| difference(&d.grab(RIGHT), &right) > 4.0);
    desk.still(WHOLE);
    assert_eq!(difference(&desk.grab(LEFT), &left), 0.0);
    let away = desk.grab(RIGHT);
    // Again: what was live is held where it is, and the left one goes on.
    desk.press(Key::Letter('y'));
    desk.still(WHOLE);
    assert!(difference(&desk.grab(RIGHT), &away) < 2.0);
    desk.press(Key::Home);
    desk.wait_for("the left one to come home", |d| difference(&d.grab(LEFT), &left) < 1.5);
    desk.still(WHOLE);
    assert!(difference(&desk.grab(RIGHT), &away) < 2.0);
    // Both are in the picture that is saved as it is shown.
    desk.press(Key::F2);
    sidecar(&mut desk, &captures, "cyst-and-wires-0001.json");
    let picture = image::open(captures.join("cyst-and-wires-0001-marked.png")).expect("saved");
    // Two images of their own size, whatever the window's.
    let own = image::open(captures.join("cyst-and-wires-0001.png")).expect("saved");
    assert!(picture.width() > 2 * own.width() && picture.height() > own.height());
    desk.hold(Key::Shift, true);
    desk.press(Key::Letter('y'));
    desk.hold(Key::Shift, false);
    desk.wait_for("one image", |d| difference(&d.grab(WHOLE), &alone) < 1.5);
    desk.quit();
}
