//! The M-mode strip: echoes at the places of their structures, and its display in the window.

use std::time::Duration;

use insonify::scene::Scene;
use insonify::sim::shaders::Library;
use insonify::sim::{Simulator, Tracer};
use insonify::view::model::mmode::{Aim, ROWS, Strip};
use insonify::view::picture::{Pixels, Sector};

use super::desk::{Desk, Key};
use super::tools::sidecar;
use super::{brightness, difference};

/// A ball of bone that goes 6 mm up and down every second below a linear probe.
pub const SCENE: &str = r#"
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
    let mut strip = Strip::new(Aim::Scanline(16));
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
        strip.add_image(seconds, &scene.probe, sector, &Pixels { size, rgba });
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
fn the_strip_opens_runs_stands_is_measured_and_saved() {
    let folder = tempfile::tempdir().expect("a folder");
    let captures = folder.path().join("captures");
    let arguments = ["--validate", "--captures", captures.to_str().expect("UTF-8")];
    let Some(mut desk) = Desk::open(SCENE, &arguments) else {
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
    // However slowly images come: until it holds as much of the ball's way as is looked for below.
    let held = |still: &serde_json::Value| {
        let file = captures.join(still["mmode"]["file"].as_str().expect("a name"));
        walls(&image::open(file).expect("a picture").to_luma8())
    };
    let mut stills = 0;
    let mut capture = |desk: &mut Desk| {
        desk.press(Key::F2);
        stills += 1;
        sidecar(desk, &captures, &format!("ball-{stills:04}.json"))
    };
    let mut tries = 0;
    while span(&held(&capture(&mut desk))) <= 4.0 {
        tries += 1;
        assert!(tries < 100, "the strip does not show the ball's way");
    }
    desk.press(Key::Space);
    desk.settle(strip);
    let frozen = desk.grab(strip);
    std::thread::sleep(Duration::from_millis(700));
    assert!(difference(&desk.grab(strip), &frozen) < 0.1, "frozen");

    // Two measurements stay, and are saved with the strip.
    for (from, to) in [((400, 560), (460, 600)), ((520, 560), (600, 560))] {
        let last = desk.grab(strip);
        desk.drag(from, to);
        desk.wait_for("a measurement", |d| difference(&d.grab(strip), &last) > 0.02);
    }
    let still = capture(&mut desk);
    let said = &still["mmode"];
    assert_eq!(said["line"]["scanline"], 16);
    let measured = said["measurements"].as_array().expect("a list");
    let letters: Vec<_> = measured.iter().map(|m| m["letter"].as_str()).collect();
    assert_eq!(letters, [Some("A"), Some("B")]);
    assert!(measured[0]["mm"].as_f64() > Some(1.0) && measured[1]["mm"].as_f64() < Some(0.5));
    assert!(measured[1]["seconds"].as_f64() > Some(0.05));
    let file = captures.join(said["file"].as_str().expect("a name"));
    let picture = image::open(file).expect("a picture").to_luma8();
    assert_eq!(picture.height() as usize, ROWS);
    let walls = walls(&picture);
    let within = walls.iter().all(|wall| (21.0..35.0).contains(wall));
    assert!(within && span(&walls) > 4.0, "{walls:?} mm");

    desk.press(Key::Letter('m'));
    desk.wait_for("the strip to go", |d| difference(&d.grab(strip), &frozen) > 3.0);
    desk.quit();
}

/// Distance between the highest and the lowest, mm; 0 without any.
fn span(walls: &[f64]) -> f64 {
    let least = walls.iter().copied().reduce(f64::min);
    let most = walls.iter().copied().reduce(f64::max);
    most.zip(least).map_or(0.0, |(most, least)| most - least)
}

/// For each column that shows something, the depth of its brightest place, mm.
fn walls(picture: &image::GrayImage) -> Vec<f64> {
    let rows = picture.height();
    let wall = |x: u32| {
        let level = |y: u32| picture.get_pixel(x, y).0[0];
        let brightest = (0..rows).max_by_key(|y| (level(*y), rows - y)).expect("rows");
        let mm = (f64::from(brightest) + 0.5) / f64::from(rows) * 60.0;
        (level(brightest) > 100).then_some(mm)
    };
    (0..picture.width()).filter_map(wall).collect()
}
