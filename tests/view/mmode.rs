//! The M-mode strip: echoes at the places of their structures, and its display in the window.

use std::time::Duration;

use insonify::scene::Scene;
use insonify::sim::shaders::Library;
use insonify::sim::{Simulator, Tracer};
use insonify::view::engine::{Pixels, Sector};
use insonify::view::model::mmode::{ROWS, Strip};

use super::desk::{Desk, Key};
use super::{brightness, difference};

/// A ball of bone that goes 6 mm up and down every second below a linear probe.
const SCENE: &str = r#"
name = "Ball"
background = "water"

[probe]
preset = "linear"
scanlines = 32
elevation_layers = 1
samples = 1024
depth = "60 mm"

[imaging]
image_height = 480

[[mesh]]
name = "ball"
shape = { sphere = { radius = "12 mm" } }
tissue = "cortical_bone"
parent = "way"

[[transform]]
name = "way"
translate = [0, 0, "40 mm"]
motion = { kind = "sine", period = "1 s", translate = [0, 0, "6 mm"] }
"#;

/// Depth of the ball's upper side at a time, mm.
fn way(seconds: f64) -> f64 {
    28.0 + 6.0 * (std::f64::consts::TAU * seconds).sin()
}

#[test]
fn a_moving_wall_is_drawn_where_it_is() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("scene.toml");
    std::fs::write(&file, SCENE).expect("written");
    let (mut scene, _) = Scene::load(&file, &[]).expect("a scene");
    let device = insonify::gpu::test_device();
    let library = Library::embedded();
    let made = Simulator::new(&device, &library, &scene, Tracer::Bvh);
    let mut simulator = made.expect("a simulator");
    let mut strip = Strip::new(16);
    for i in 0..20 {
        let seconds = f64::from(i) * 0.05;
        scene.set_time(seconds);
        simulator.frame(&scene, i).expect("a frame");
        let (width, height, rgba) = simulator.pixels().expect("pixels");
        let constants = simulator.constants();
        let sector = Sector {
            left: f64::from(constants.image_left),
            top: f64::from(constants.image_top),
            pitch: f64::from(constants.pixel_pitch),
        };
        let size = [width, height];
        strip.add(seconds, &scene.probe, sector, &Pixels { size, rgba });
    }
    let raster = strip.raster(0.95, 0.95, 190);
    let brightest = |x: usize| {
        let top = (0..ROWS).map(|row| raster[row * 190 + x]).max().unwrap();
        assert!(top > 100, "an echo at {x}: {top}");
        let first = (0..ROWS).find(|row| raster[row * 190 + x] == top).unwrap();
        (first as f64 + 0.5) / ROWS as f64 * 60.0
    };
    let off = |amplitude: f64| {
        let apart = (1..19).map(|i| {
            let seconds = f64::from(i) * 0.05;
            let there = 28.0 + amplitude / 6.0 * (way(seconds) - 28.0);
            // The column begins at its moment.
            (brightest(10 * i as usize) - there).abs()
        });
        apart.fold(0.0, f64::max)
    };
    // A row is 0.23 mm, a pixel 0.125, half the echo's envelope (6 MHz and more) 0.3 mm.
    assert!(off(6.0) < 0.7, "{} mm", off(6.0));
    assert!(off(5.0) > 0.7, "another way is noticed");
    assert_eq!(device.validation_messages(), Vec::<String>::new());
}

#[test]
fn the_strip_opens_runs_and_stands() {
    let Some(mut desk) = Desk::open(SCENE, &["--validate"]) else {
        return;
    };
    let image = [200, 100, 500, 300];
    desk.wait_for("an image", |d| brightness(&d.grab(image)) > 2.0);
    let strip = [200, 530, 690, 160];
    let before = brightness(&desk.grab(strip));
    desk.press(Key::Letter('m'));
    desk.wait_for("a strip", |d| (brightness(&d.grab(strip)) - before).abs() > 3.0);
    let now = desk.grab(strip);
    desk.wait_for("the strip to run", |d| difference(&d.grab(strip), &now) > 1.0);
    desk.press(Key::Space);
    desk.settle(strip);
    let frozen = desk.grab(strip);
    std::thread::sleep(Duration::from_millis(700));
    assert!(difference(&desk.grab(strip), &frozen) < 0.1, "frozen");
    desk.press(Key::Letter('m'));
    desk.wait_for("the strip to go", |d| difference(&d.grab(strip), &frozen) > 3.0);
    desk.quit();
}
