//! Live quality: coarse while something moves, the scene's own at rest.

use serde_json::Value;

use super::desk::{Desk, Key};
use super::tools::{rendered, sidecar};
use super::{IMAGE, SCENE, brightness, difference};

#[test]
fn moving_scenes_are_coarse_and_resting_ones_have_the_scenes_own_quality() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).to_str().expect("UTF-8").to_owned();
    let json = path("times.json");
    // No device makes an image of a whole scene in a millisecond.
    let budget = "live.budget=\"1 ms\"";
    let captures = folder.path().to_str().expect("UTF-8").to_owned();
    let arguments = ["--validate", "--set", budget, "--json", &json, "--captures", &captures];
    let Some(mut desk) = Desk::open(SCENE, &arguments) else {
        return;
    };
    desk.wait_for("an image", |d| brightness(&d.grab(IMAGE)) > 10.0);
    let still = desk.rest(IMAGE);
    for _ in 0..6 {
        desk.press(Key::Right);
    }
    desk.wait_for("the image to move", |d| difference(&d.grab(IMAGE), &still) > 4.0);
    desk.press(Key::Home);
    desk.wait_for("the first image, with its noise", |d| d.grab(IMAGE) == still);
    desk.press(Key::F2);
    let still = sidecar(&mut desk, folder.path(), "cyst-and-wires-0001.json");
    assert_eq!(still["quality"]["level"], 0);
    desk.quit();

    let saved = image::open(path("cyst-and-wires-0001.png")).expect("a picture");
    assert!(saved == rendered(folder.path(), &still), "the pixels differ");

    let text = std::fs::read_to_string(json).expect("written");
    let said: Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!(said["live"]["level"], 0, "{text}");
    assert_eq!(said["live"]["budget_ms"], 1.0, "{text}");
    let levels = said["live"]["levels"].as_array().expect("a list");
    let counts = |level: &Value| level["counts"]["scanlines"].as_u64().expect("a number");
    let [own, coarse] = [levels.first(), levels.last()].map(|level| level.expect("one"));
    assert!(counts(own) == 64 && counts(coarse) < 64, "{text}");
    assert!(said["settled_ms"]["median"].is_number(), "{text}");
}
