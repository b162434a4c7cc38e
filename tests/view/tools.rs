//! Freeze, loop, calipers, texts.

use super::desk::{Desk, Key};
use super::{IMAGE, SCENE, brightness, difference};

#[test]
fn a_frozen_loop_shows_what_was_imaged_before() {
    let Some(mut desk) = Desk::open(SCENE, &["--validate"]) else {
        return;
    };
    desk.wait_for("an image", |d| brightness(&d.grab(IMAGE)) > 10.0);
    let mut shown = vec![desk.settle(IMAGE)];
    for _ in 0..3 {
        desk.press(Key::Right);
        desk.press(Key::Right);
        let before = shown[shown.len() - 1].clone();
        desk.wait_for("another image", |d| {
            difference(&d.grab(IMAGE), &before) > 2.0
        });
        shown.push(desk.settle(IMAGE));
    }
    desk.press(Key::Space);
    assert_eq!(
        difference(&desk.settle(IMAGE), &shown[3]),
        0.0,
        "the newest"
    );

    // Back through the loop: what came first is there to the last bit, and so is all between.
    let mut back = vec![desk.grab(IMAGE)];
    for _ in 0..12 {
        desk.press(Key::Letter(','));
        back.push(desk.settle(IMAGE));
    }
    assert_eq!(difference(&back[12], &shown[0]), 0.0, "the first");
    for earlier in &shown {
        assert!(back.contains(earlier));
    }
    desk.press(Key::Letter('.'));
    desk.wait_for("the next one", |d| {
        difference(&d.grab(IMAGE), &shown[0]) > 0.5
    });

    // The track of the bar: its left end is the first image again.
    desk.click((330, 702));
    desk.wait_for("the first by the pointer", |d| d.grab(IMAGE) == shown[0]);
    desk.press(Key::Enter);
    desk.wait_for("the loop to play", |d| {
        difference(&d.grab(IMAGE), &shown[0]) > 2.0
    });
    desk.press(Key::Enter);
    desk.settle(IMAGE);

    // Live, the image is the newest but for its noise.
    desk.press(Key::Space);
    desk.wait_for("the newest", |d| {
        difference(&d.grab(IMAGE), &shown[3]) < 1.5
    });
    desk.quit();
}
