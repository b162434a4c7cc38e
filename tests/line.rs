//! A scanline made alone: it is the image's, and many of them are M-mode.

use std::f64::consts::TAU;
use std::path::Path;

use insonify::gpu::test_device;
use insonify::scene::Scene;
use insonify::sim::shaders::Library;
use insonify::sim::{Simulator, Tracer};

use crate::common::tracers::tracers;

/// A shipped scene with few lines.
fn scene(name: &str, more: &[(&str, &str)]) -> Scene {
    let small = [
        ("probe.scanlines", "48"),
        ("probe.elevation_layers", "2"),
        ("probe.samples", "400"),
        ("imaging.image_height", "120"),
        ("simulation.paths", "3"),
    ];
    let set = small.iter().chain(more).map(|&(k, v)| (k.to_owned(), v.to_owned()));
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
    Scene::load(&path, &set.collect::<Vec<_>>()).expect("a shipped scene").0
}

fn simulator(scene: &Scene, tracer: Tracer) -> Simulator {
    Simulator::new(&test_device(), &Library::embedded(), scene, tracer).expect("a simulator")
}

/// Places in the grey map of `rows` depths of a scanline whose values, 0 to 1, are these.
fn levels(values: &[f32], rows: usize) -> Vec<usize> {
    let last = (values.len() - 1) as f64;
    let level = |row: usize| {
        let at = ((row as f64 + 0.5) / rows as f64 * values.len() as f64).clamp(0.0, last);
        let (near, far) = (values[at as usize], values[at.ceil() as usize]);
        let value = f64::from(near) + at.fract() * f64::from(far - near);
        (255.0 * value.clamp(0.0, 1.0)).round() as usize
    };
    (0..rows).map(level).collect()
}

/// Compares lines of their own with those of the image.
fn compare(scene: &Scene, tracer: Tracer) {
    let mut simulator = simulator(scene, tracer);
    simulator.frame(scene, 5).expect("a frame");
    let (image, iq, log) = (
        simulator.pixels().expect("pixels"),
        simulator.iq().expect("samples"),
        simulator.log_image().expect("values"),
    );
    let samples = scene.probe.samples as usize;
    let of = |all: &[f32], line: u32, words: usize| {
        all[line as usize * words * samples..][..words * samples].to_vec()
    };
    let last = scene.probe.scanlines - 1;
    for line in [0, 3, 24, last - 1, last] {
        let shown = simulator.line(scene, 5, line, 300).expect("a line");
        let made = simulator.constants();
        let beside = line - made.first_line;
        assert!(made.scanlines < scene.probe.scanlines, "fewer lines than the image has");
        let own = of(&simulator.iq().expect("samples"), beside, 2);
        assert!(own == of(&iq, line, 2), "{tracer}, {}, line {line}", scene.name);
        // The one beside it is not.
        assert!(own != of(&iq, line.abs_diff(1), 2));
        let grey = &simulator.tables().grey;
        for (shown, level) in shown.iter().zip(levels(&of(&log, line, 1), 300)) {
            // Single precision may round to the place beside it.
            let near = grey[level.saturating_sub(1)]..=grey[(level + 1).min(255)];
            let what = || format!("{tracer}, {}, line {line}: {shown}, {near:?}", scene.name);
            assert!(near.contains(&u32::from(*shown)), "{}", what());
        }
        assert!(shown.iter().any(|&level| level > 60), "something is seen");
    }
    // The image comes back, and its noise is that of its number.
    simulator.frame(scene, 5).expect("a frame");
    assert!(simulator.pixels().expect("pixels") == image);
    let noisy = simulator.line(scene, 6, 24, 300).expect("a line");
    assert!(noisy != simulator.line(scene, 5, 24, 300).expect("a line"));
    assert_eq!(test_device().validation_messages(), [""; 0]);
}

#[test]
fn a_line_alone_is_that_of_the_image() {
    for tracer in tracers(&test_device()) {
        // A curved face on the skin; all lines from one point, random numbers of each line's own; a flat face.
        compare(&scene("abdomen.toml", &[]), tracer);
        let mut heart = scene("heart.toml", &[("simulation.rough_transmission", "true")]);
        heart.set_time(0.2);
        compare(&heart, tracer);
        compare(&scene("artery.toml", &[("simulation.sampling", "plain")]), tracer);
        compare(&scene("phantom.toml", &[("simulation.scatter_mode", "voxel")]), tracer);
    }
}

#[test]
fn lines_between_images_do_not_change_how_far_labels_say_it_has_moved() {
    let mut scene = scene("heart.toml", &[("simulation.labels", "true")]);
    let labels = |scene: &mut Scene, between: &[f64]| {
        let mut simulator = simulator(scene, Tracer::Bvh);
        scene.set_time(0.1);
        simulator.frame(scene, 0).expect("a frame");
        for seconds in between {
            scene.set_time(*seconds);
            simulator.line(scene, 1, 20, 64).expect("a line");
        }
        scene.set_time(0.2);
        simulator.frame(scene, 1).expect("a frame");
        let labels = simulator.labels().expect("read").expect("labels");
        bytemuck::cast_slice::<_, u8>(&labels.samples.labels).to_vec()
    };
    let expected = labels(&mut scene, &[]);
    assert!(labels(&mut scene, &[0.12, 0.15, 0.18]) == expected);
    assert_eq!(test_device().validation_messages(), [""; 0]);
}

/// A ball of bone that goes 6 mm up and down five times a second below a linear probe.
const BALL: &str = r#"
name = "Ball"
background = "water"
[probe]
preset = "linear"
scanlines = 48
elevation_layers = 1
samples = 1024
depth = "60 mm"
[[mesh]]
name = "ball"
shape = { sphere = { radius = "12 mm" } }
tissue = "cortical_bone"
parent = "way"
[[transform]]
name = "way"
translate = [0, 0, "40 mm"]
motion = { kind = "sine", period = "0.2 s", translate = [0, 0, "6 mm"] }
"#;

/// Amplitude of the sine of period `period` s that fits best, and what is left of the values (RMS).
fn fit(values: &[f64], rate: f64, period: f64) -> [f64; 2] {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let angle = |i: usize| TAU * i as f64 / (rate * period);
    let sum = |part: fn(f64) -> f64| -> f64 {
        values.iter().enumerate().map(|(i, v)| (v - mean) * part(angle(i))).sum()
    };
    let scale = 2.0 / values.len() as f64;
    let (s, c) = (scale * sum(f64::sin), scale * sum(f64::cos));
    let left = |(i, v): (usize, &f64)| (v - mean - s * angle(i).sin() - c * angle(i).cos()).powi(2);
    let left: f64 = values.iter().enumerate().map(left).sum();
    [s.hypot(c), (left / values.len() as f64).sqrt()]
}

#[test]
fn m_mode_of_a_ball_on_a_sine() {
    const RATE: f64 = 500.0;
    const ROWS: u32 = 2000;
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("ball.toml");
    std::fs::write(&file, BALL).expect("written");
    let (mut scene, _) = Scene::load(&file, &[]).expect("a scene");
    // Rows of a line are as many as an image has pixels, at most.
    scene.imaging.image_height = 400;
    let mut simulator = simulator(&scene, Tracer::Bvh);
    // The depth at which a column's first echo is half as bright as it becomes, mm.
    let wall = |column: &[u8]| {
        let most = f64::from(*column.iter().max().expect("levels"));
        let level = |i: usize| f64::from(column[i]);
        let i = (1..column.len()).find(|&i| level(i) >= most / 2.0).expect("an echo");
        let part = (most / 2.0 - level(i - 1)) / (level(i) - level(i - 1));
        (i as f64 - 0.5 + part) / f64::from(ROWS) * 60.0
    };
    // Two periods.
    let way: Vec<f64> = (0..200)
        .map(|i| {
            scene.set_time(f64::from(i) / RATE);
            wall(&simulator.line(&scene, i, 24, ROWS).expect("a line"))
        })
        .collect();
    let periods = (0..=800).map(|i| 0.18 + 5e-5 * f64::from(i));
    let best = periods.min_by(|a, b| fit(&way, RATE, *a)[1].total_cmp(&fit(&way, RATE, *b)[1]));
    let period = best.expect("a period");
    let [amplitude, left] = fit(&way, RATE, period);
    println!("amplitude {amplitude:.4} mm, period {period:.5} s, {left:.4} mm left");
    // Depths are those at the speed that the scanner assumes.
    let expected = 6.0 * scene.probe.speed / scene.tissues[scene.background].speed;
    assert!((amplitude / expected - 1.0).abs() < 0.01, "{amplitude} mm of {expected}");
    assert!((period - 0.2).abs() < 0.002, "{period} s");
    // No staircase: each step is the sine's, as far as a row of 0.03 mm and noise allow.
    let steps: Vec<f64> = way.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let rough = |steps: &[f64]| fit(steps, RATE, 0.2)[1];
    assert!(left < 0.05 && rough(&steps) < 0.05, "{left}, {} mm", rough(&steps));
    // One of 30 columns a second is.
    let held: Vec<f64> = (0..200).map(|i| way[i / 17 * 17]).collect();
    let steps: Vec<f64> = held.windows(2).map(|pair| pair[1] - pair[0]).collect();
    assert!(rough(&steps) > 0.5, "{} mm", rough(&steps));
    assert_eq!(test_device().validation_messages(), [""; 0]);
}
