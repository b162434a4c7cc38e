//! Effects of displays and devices on a window: many sizes at once, a large scale, a lost device.

use std::process::Command;
use std::time::Duration;

use super::desk::{Desk, Display, Key};
use super::skip::{Lacking, skip};
use super::{IMAGE, SCENE, brightness, difference};

#[test]
fn a_window_resized_many_times_shows_its_image_at_last() {
    let Some(mut desk) = Desk::open(SCENE, &["--validate"]) else {
        return;
    };
    desk.wait_for("an image", |d| brightness(&d.grab(IMAGE)) > 10.0);
    for step in 0..60_u16 {
        // Sizes that differ from one event to the next, among them the least size of a window.
        let size = match step % 5 {
            0 => (1, 1),
            n => (300 + 200 * n + 3 * step, 250 + 90 * n + step),
        };
        desk.resize(size.0, size.1);
        if step % 20 == 19 {
            desk.hide();
            std::thread::sleep(Duration::from_millis(20));
            desk.show();
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    desk.resize(1280, 720);
    desk.wait_for("the console at the edge", |d| {
        brightness(&d.grab([1280 - 20, 640, 16, 30])) > 15.0
    });
    desk.wait_for("the image", |d| brightness(&d.grab(IMAGE)) > 10.0);
    desk.quit();
}

#[test]
fn at_twice_the_scale_clicks_meet_what_they_show() {
    let Some(display) = Display::sized([3840, 2160]) else {
        return;
    };
    let scaled = |_: &std::path::Path, command: &mut Command| {
        command.env("WINIT_X11_SCALE_FACTOR", "2");
    };
    let Some(mut desk) = Desk::open_on(display, SCENE, &["--validate"], scaled) else {
        return;
    };
    let image = [120, 200, 800, 1000];
    desk.wait_for("an image", |d| brightness(&d.grab(image)) > 10.0);
    let before = desk.settle(image);
    // "Freeze", at twice the place that it has at the usual scale.
    let button = (2 * (1280 - 336 + 30), 2 * 12);
    desk.click(button);
    desk.press(Key::Right);
    desk.press(Key::Right);
    std::thread::sleep(Duration::from_millis(700));
    assert!(difference(&desk.grab(image), &before) < 0.5, "frozen");
    desk.click(button);
    desk.wait_for("the image to follow", |d| difference(&d.grab(image), &before) > 2.0);
    // The whole of a large screen.
    desk.resize(3840, 2160);
    desk.wait_for("the console at the edge", |d| {
        brightness(&d.grab([3840 - 40, 1900, 30, 100])) > 15.0
    });
    desk.quit();
}

#[test]
fn a_zoomed_interface_keeps_its_clicks() {
    let Some(mut desk) = Desk::open(SCENE, &["--validate", "--scale", "1.5"]) else {
        return;
    };
    desk.wait_for("an image", |d| brightness(&d.grab([60, 150, 500, 400])) > 10.0);
    // Movement in the 3D view has tests of its own.
    desk.press(Key::Letter('v'));
    let part = [60, 150, 500, 400];
    let before = desk.settle(part);
    // The word above the image.
    let state = [600, 0, 176, 50];
    let live = desk.grab(state);
    let button = (1280 - 504 + 45, 18);
    desk.click(button);
    desk.wait_for("the word that it is frozen", |d| difference(&d.grab(state), &live) > 1.0);
    desk.press(Key::Right);
    desk.press(Key::Right);
    std::thread::sleep(Duration::from_millis(500));
    assert!(difference(&desk.grab(part), &before) < 0.5, "frozen");
    desk.click(button);
    desk.wait_for("the word that it is live", |d| difference(&d.grab(state), &live) < 0.5);
    desk.wait_for("the image to follow", |d| difference(&d.grab(part), &before) > 2.0);
    // Back to the usual size by the keyboard: the console's edge moves to the right.
    let edge = [1280 - 420, 300, 60, 200];
    let wide = desk.settle(edge);
    desk.hold_control(Key::Letter('0'));
    desk.wait_for("the usual size", |d| difference(&d.grab(edge), &wide) > 3.0);
    desk.quit();
}

/// The folder of a Vulkan layer that loses the device, built by the C compiler; none where there is no
/// compiler.
fn layer() -> Option<tempfile::TempDir> {
    let folder = tempfile::tempdir().expect("a folder");
    let source = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/view/loss.c");
    let library = folder.path().join("libloss.so");
    let built =
        Command::new("cc").args(["-shared", "-fPIC", "-o"]).arg(&library).arg(source).status();
    match built {
        Ok(status) => assert!(status.success(), "the layer does not compile"),
        Err(error) => {
            skip(Lacking::Tool, &format!("no C compiler (cc: {error})"));
            return None;
        }
    }
    let manifest = r#"{ "file_format_version": "1.2.0", "layer": {
        "name": "VK_LAYER_INSONIFY_loss", "type": "INSTANCE", "library_path": "./libloss.so",
        "api_version": "1.3.0", "implementation_version": "1", "description": "loses the device" } }"#;
    std::fs::write(folder.path().join("loss.json"), manifest).expect("written");
    Some(folder)
}

#[test]
fn a_lost_device_is_opened_again_and_a_second_loss_says_what_to_do() {
    let (Some(layer), Some(display)) = (layer(), Display::open()) else {
        return;
    };
    let lose = layer.path().join("lose");
    let told = layer.path().join("told");
    let with_layer = |_: &std::path::Path, command: &mut Command| {
        command
            .env("VK_ADD_LAYER_PATH", layer.path())
            .env("VK_INSTANCE_LAYERS", "VK_LAYER_INSONIFY_loss")
            .env("INSONIFY_TEST_LOSS", &lose)
            .stderr(std::fs::File::create(&told).expect("made"));
    };
    let Some(mut desk) = Desk::open_on(display, SCENE, &[], with_layer) else {
        return;
    };
    desk.wait_for("an image", |d| brightness(&d.grab(IMAGE)) > 10.0);
    // A setting that has to outlast the device.
    desk.press(Key::Letter('-'));
    let before = desk.settle(IMAGE);
    std::fs::write(&lose, "").expect("written");
    desk.press(Key::Right);
    desk.wait_for("the loss", |_| !lose.exists());
    desk.press(Key::Home);
    desk.wait_for("the image on another device", |d| difference(&d.grab(IMAGE), &before) < 1.5);
    // It is the live one. While the other device is being opened there is none.
    for _ in 0..6 {
        desk.press(Key::Right);
    }
    desk.wait_for("the image to move", |d| {
        let now = d.grab(IMAGE);
        difference(&now, &before) > 4.0 && brightness(&now) > 5.0
    });
    std::fs::write(&lose, "").expect("written");
    desk.press(Key::Right);
    // On a busy machine so much time has passed that it is opened once more; then the next loss comes at once.
    let status = desk.ended_by(|| std::fs::write(&lose, "").expect("written"));
    assert_eq!(status.code(), Some(1));
    let text = std::fs::read_to_string(&told).expect("there");
    // It is wrapped into text lines with a bar at the left.
    let words = text.split_whitespace().filter(|word| *word != "│");
    let text = words.collect::<Vec<_>>().join(" ");
    for words in ["lost", "last pass", "--quality draft", "--device"] {
        assert!(text.contains(words), "{text}");
    }
}

/// The left half of the image, beside the message over it.
const BESIDE: [u16; 4] = [60, 100, 320, 500];
/// The message, and its first button.
const TOLD: [u16; 4] = [420, 70, 440, 60];
const START: (u16, u16) = (455, 112);

#[test]
#[cfg_attr(not(debug_assertions), ignore = "a program that is released dies for no test")]
fn a_simulation_that_dies_is_told_and_started_again() {
    let Some(display) = Display::open() else {
        return;
    };
    let folder = tempfile::tempdir().expect("a folder");
    let (die, told) = (folder.path().join("die"), folder.path().join("told"));
    let mortal = |_: &std::path::Path, command: &mut Command| {
        command.env("INSONIFY_TEST_DEATH", &die);
        command.stderr(std::fs::File::create(&told).expect("made"));
    };
    let Some(mut desk) = Desk::open_on(display, SCENE, &["--validate"], mortal) else {
        return;
    };
    let kill = |desk: &mut Desk| {
        std::fs::write(&die, "").expect("written");
        desk.press(Key::Right);
        desk.wait_for("the death", |_| !die.exists());
    };
    desk.wait_for("an image", |d| brightness(&d.grab(BESIDE)) > 10.0);
    // A setting that has to outlast the simulation.
    desk.press(Key::Letter('-'));
    let (before, bare) = (desk.settle(BESIDE), desk.grab(TOLD));
    kill(&mut desk);
    desk.wait_for("what is told", |d| difference(&d.grab(TOLD), &bare) > 5.0);
    desk.press(Key::Home);
    desk.wait_for("the same image", |d| difference(&d.grab(BESIDE), &before) < 1.5);
    (0..6).for_each(|_| desk.press(Key::Right));
    desk.wait_for("the image to move", |d| {
        let now = d.grab(BESIDE);
        difference(&now, &before) > 4.0 && brightness(&now) > 5.0
    });
    // Where the next one dies as well, it stands still, and the message says so.
    let message = desk.settle(TOLD);
    kill(&mut desk);
    std::fs::write(&die, "").expect("written");
    desk.wait_for("it to stand still", |d| difference(&d.grab(TOLD), &message) > 1.0);
    let still = desk.settle(BESIDE);
    // It is still there where the first of the two came too soon after the last.
    let _ = std::fs::remove_file(&die);
    desk.press(Key::Right);
    desk.press(Key::Right);
    std::thread::sleep(Duration::from_millis(500));
    assert!(difference(&desk.grab(BESIDE), &still) < 0.5, "there is nothing new");
    // A key held while the simulation is made is still held for those that follow.
    desk.hold(Key::Control, true);
    desk.click(START);
    desk.wait_for("the image to move", |d| difference(&d.grab(BESIDE), &still) > 1.0);
    let message = desk.settle(TOLD);
    desk.press(Key::Letter('q'));
    desk.wait_for("the question", |d| difference(&d.grab(TOLD), &message) > 1.0);
    desk.hold(Key::Control, false);
    desk.quit();
    let text = std::fs::read_to_string(&told).expect("there");
    assert!(text.contains("a test has asked for it"), "{text}");
}
