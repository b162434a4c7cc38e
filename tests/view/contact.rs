//! The probe on the skin: the pointer on the 3D view slides it, and off the skin the image is dark.

use std::path::PathBuf;
use std::time::Instant;

use glam::{DVec2, DVec3};
use insonify::scene::Scene;
use insonify::sim::Tracer;
use insonify::view::Model;
use insonify::view::model::File;

use super::desk::{Desk, Key};
use super::{brightness, difference};

/// A cyst below flat skin, and a linear probe on it.
const SCENE: &str = r#"
name = "Cyst below skin"
background = "gel"

[probe]
preset = "linear"
scanlines = 64
elevation_layers = 1
samples = 512

[imaging]
image_height = 400

[contact]
mesh = ["skin"]
gel = "3 mm"

[[mesh]]
name = "skin"
shape = { box = { size = [200, 120, 100] } }
tissue = "liver"
translate = [0, 0, 50]

[[mesh]]
name = "cyst"
shape = { sphere = { radius = "6 mm" } }
tissue = "cyst_fluid"
priority = 1
translate = [0, 0, "2 cm"]
"#;

/// Part of the default window with the 3D view: left of the console, right of the image, above the bar.
const VIEW: [u16; 4] = [586, 0, 358, 684];
/// Within the image, beside the texts.
const IMAGE: [u16; 4] = [120, 120, 230, 230];

/// Position on the display of a point of the world, mm, before the camera has been moved.
fn seen(point: DVec3) -> (u16, u16) {
    let folder = tempfile::tempdir().expect("a folder");
    let file: PathBuf = folder.path().join("scene.toml");
    std::fs::write(&file, SCENE).expect("written");
    let (scene, _) = Scene::load(&file, &[]).expect("a scene");
    let file = File::new(file, Vec::new(), &scene);
    let model = Model::new(&scene, file, Tracer::Bvh, 0.0, Instant::now());
    let [left, top, width, height] = VIEW.map(f64::from);
    let camera = model.view3d.camera;
    let at = camera.project(DVec2::new(width, height), point);
    let at = at.expect("in front of the eye") + DVec2::new(left, top);
    (at.x as u16, at.y as u16)
}

#[test]
fn lifted_off_the_skin_the_image_is_dark_and_pressed_it_is_back() {
    let Some(mut desk) = Desk::open(SCENE, &["--validate"]) else {
        return;
    };
    desk.wait_for("an image", |d| brightness(&d.grab(IMAGE)) > 10.0);
    let still = desk.settle(IMAGE);
    // 2 mm are within the gel, 4 mm are not.
    desk.press(Key::PageUp);
    desk.press(Key::PageUp);
    desk.wait_for("the image to go dark", |d| brightness(&d.grab(IMAGE)) < 2.0);
    desk.settle(IMAGE);
    desk.press(Key::PageDown);
    desk.press(Key::PageDown);
    desk.wait_for("the image to come back", |d| difference(&d.grab(IMAGE), &still) < 1.5);
    desk.quit();
}

#[test]
fn the_pointer_slides_leans_and_turns_the_probe() {
    let Some(mut desk) = Desk::open(SCENE, &["--validate"]) else {
        return;
    };
    desk.wait_for("an image", |d| brightness(&d.grab(IMAGE)) > 10.0);
    let still = desk.settle(IMAGE);
    let home = |desk: &mut Desk| {
        desk.press(Key::Home);
        desk.wait_for("the image at home", |d| difference(&d.grab(IMAGE), &still) < 1.5);
        desk.settle(IMAGE);
    };

    // By its handle 12 mm to the right, in the image plane: the cyst moves out of the middle, and all of the face
    // stays in contact.
    let (handle, to) = (DVec3::new(0.0, 0.0, -12.0), DVec3::new(12.0, 0.0, -12.0));
    desk.pull(seen(handle), seen(to));
    desk.wait_for("the cyst to move", |d| difference(&d.grab(IMAGE), &still) > 4.0);
    let slid = desk.settle(IMAGE);
    assert!(brightness(&slid) > 10.0, "it has not left the skin");
    home(&mut desk);

    // With Shift it leans: a flat face that stands on its edge loses contact on one side.
    desk.hold(Key::Shift, true);
    desk.pull(seen(handle), seen(DVec3::new(9.0, 0.0, -12.0)));
    desk.hold(Key::Shift, false);
    desk.wait_for("the image to tilt", |d| difference(&d.grab(IMAGE), &still) > 4.0);
    desk.settle(IMAGE);
    home(&mut desk);

    // Beside the body the drag turns the view, and the image stays.
    let view = desk.rest(VIEW);
    desk.pull((920, 60), (860, 90));
    desk.wait_for("the view to turn", |d| difference(&d.grab(VIEW), &view) > 0.5);
    assert!(difference(&desk.settle(IMAGE), &still) < 1.5);
    desk.quit();
}

#[test]
fn held_to_the_skin_the_keys_slide_along_it() {
    let Some(mut desk) = Desk::open(SCENE, &["--validate"]) else {
        return;
    };
    desk.wait_for("an image", |d| brightness(&d.grab(IMAGE)) > 10.0);
    for _ in 0..3 {
        desk.press(Key::PageUp);
    }
    desk.wait_for("the image to go dark", |d| brightness(&d.grab(IMAGE)) < 2.0);
    desk.settle(IMAGE);
    // It is held already, at that height; let go and taken again it is pressed on.
    desk.press(Key::Letter('h'));
    desk.press(Key::Letter('h'));
    desk.wait_for("the skin", |d| brightness(&d.grab(IMAGE)) > 10.0);
    let middle = desk.settle(IMAGE);
    for _ in 0..5 {
        desk.press(Key::Right);
    }
    desk.wait_for("the image to slide", |d| difference(&d.grab(IMAGE), &middle) > 4.0);
    assert!(brightness(&desk.settle(IMAGE)) > 10.0, "it is on the skin");
    desk.quit();
}
