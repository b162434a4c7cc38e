//! Live quality: coarse while something moves, the scene's own at rest.

use serde_json::Value;

use super::desk::{Desk, Key};
use super::mmode;
use super::tools::{rendered, rendered_of, sidecar};
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

#[test]
fn an_image_of_the_loop_is_made_again_where_one_stops() {
    let folder = tempfile::tempdir().expect("a folder");
    let captures = folder.path().to_str().expect("UTF-8").to_owned();
    // Every image of the loop is coarse.
    let arguments = ["--validate", "--set", "live.budget=\"1 ms\"", "--captures", &captures];
    let Some(mut desk) = Desk::open(mmode::SCENE, &arguments) else {
        return;
    };
    let image = [200, 100, 500, 300];
    desk.wait_for("an image", |d| brightness(&d.grab(image)) > 2.0);
    for _ in 0..12 {
        let before = desk.grab(image);
        desk.wait_for("the ball to move", |d| difference(&d.grab(image), &before) > 0.2);
    }
    let mut stills = 0;
    let mut still = |desk: &mut Desk, wanted: &str| loop {
        desk.press(Key::F2);
        stills += 1;
        let still = sidecar(desk, folder.path(), &format!("ball-{stills:04}.json"));
        match still["quality"]["level"] == 0 {
            true => return (still, folder.path().join(format!("ball-{stills:04}.png"))),
            false => assert!(stills < 200, "{wanted} stays coarse"),
        }
    };
    desk.press(Key::Space);
    let (newest, _) = still(&mut desk, "the newest");
    for _ in 0..5 {
        desk.press(Key::Letter(','));
    }
    let (earlier, picture) = still(&mut desk, "the one before");
    let time = |still: &Value| still["time_s"].as_f64().expect("a number");
    assert!(time(&earlier) < time(&newest), "{} {}", time(&earlier), time(&newest));
    let saved = image::open(picture).expect("a picture");
    assert!(saved == rendered_of(mmode::SCENE, folder.path(), &earlier), "the pixels differ");
    desk.quit();
}
