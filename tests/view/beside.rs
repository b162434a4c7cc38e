//! What is set at the image's edges: the transmit focus on the ruler, the time-gain curve.

use super::desk::{Desk, Key};
use super::{IMAGE, SCENE, brightness, difference};

/// Colours of the focus' mark and of the curve's points.
const MARK: [u8; 3] = [92, 176, 196];
const POINT: [u8; 3] = [140, 146, 152];
/// Between image and 3D view: the ruler. Beside the grey bar: the curve, a point's width about its zero.
const RULER: [u16; 4] = [500, 60, 80, 616];
const ZERO: [u16; 4] = [58, 50, 5, 626];

/// Mean place of all pixels of a colour, none where there are fewer than ten.
fn middle(desk: &Desk, part: [u16; 4], colour: [u8; 3]) -> Option<(u16, u16)> {
    let width = usize::from(part[2]);
    let pixels = desk.grab(part);
    let is_it = |pixel: &[u8]| pixel.iter().zip(colour).all(|(a, b)| a.abs_diff(b) < 12);
    let found: Vec<usize> =
        pixels.chunks_exact(3).enumerate().filter(|(_, p)| is_it(p)).map(|(i, _)| i).collect();
    let mean = |of: fn(usize, usize) -> usize| {
        (found.iter().map(|&i| of(i, width)).sum::<usize>() / found.len()) as u16
    };
    (found.len() >= 10).then(|| (part[0] + mean(|i, w| i % w), part[1] + mean(|i, w| i / w)))
}

/// Rows in which a point of the curve stands at zero.
fn points(desk: &Desk) -> Vec<u16> {
    let pixels = desk.grab(ZERO);
    let rows = pixels.chunks_exact(3 * usize::from(ZERO[2]));
    // Wider than the line between the points.
    let wide =
        rows.map(|row| row.chunks_exact(3).filter(|p| p[0].abs_diff(POINT[0]) < 50).count() >= 4);
    let mut found: Vec<u16> = Vec::new();
    for (row, _) in wide.enumerate().filter(|(_, wide)| *wide) {
        let y = ZERO[1] + row as u16;
        if found.last().is_none_or(|last| y > last + 20) {
            found.push(y);
        }
    }
    found
}

#[test]
fn the_focus_is_dragged_along_the_ruler_and_comes_back() {
    let Some(mut desk) = Desk::open(SCENE, &["--validate"]) else {
        return;
    };
    desk.wait_for("an image", |d| brightness(&d.grab(IMAGE)) > 10.0);
    desk.settle(IMAGE);
    let from = middle(&desk, RULER, MARK).expect("a mark on the ruler");
    let to = (from.0, from.1 - 90);
    desk.pull(from, to);
    let at = |y: u16| {
        move |d: &mut Desk| middle(d, RULER, MARK).is_some_and(|(_, now)| now.abs_diff(y) < 9)
    };
    desk.wait_for("the mark at its new depth", at(to.1));
    // Nowhere near the face's end of the ruler or the image's lower end.
    desk.hold_control(Key::Letter('s'));
    desk.wait_for("it to be saved", |d| d.scene().contains("focus = "));
    desk.hold_control(Key::Letter('z'));
    desk.wait_for("the mark to come back", at(from.1));
    desk.quit();
}

#[test]
fn the_time_gain_is_dragged_at_its_depth() {
    let Some(mut desk) = Desk::open(SCENE, &["--validate"]) else {
        return;
    };
    desk.wait_for("an image", |d| brightness(&d.grab(IMAGE)) > 10.0);
    desk.settle(IMAGE);
    let rows = points(&desk);
    assert_eq!(rows.len(), 8, "{rows:?}");
    // Where the words about the slider under the pointer do not reach.
    let band = |y: u16| [380, y - 20, 120, 40];
    let (near, far) = (band(rows[1]), band(rows[6]));
    let before = (desk.grab(near), desk.grab(far));
    desk.pull((60, rows[6] + 1), (42, rows[6] + 1));
    let darker = 0.7 * brightness(&before.1);
    desk.wait_for("the deep part to darken", |d| brightness(&d.grab(far)) < darker);
    desk.settle(IMAGE);
    assert!(difference(&desk.grab(near), &before.0) < 1.5, "only there");
    desk.hold_control(Key::Letter('z'));
    desk.wait_for("it to come back", |d| difference(&d.grab(far), &before.1) < 1.5);
    desk.quit();
}
