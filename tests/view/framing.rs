//! The image in its pane: enlarged, moved, turned over.

use super::desk::{Desk, Key};
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
