//! Whole frames of the shipped scenes on the device: a frame repeats exactly, both tracers show
//! the same image, and nothing is lost on the way.

use std::path::Path;
use std::sync::Arc;

use insonify::gpu::{Device, test_device};
use insonify::scene::Scene;
use insonify::sim::bvh::Splits;
use insonify::sim::layout::Frame;
use insonify::sim::shaders::Library;
use insonify::sim::{Simulator, Tracer, tables};

use crate::common::shared_data::shared_data;
use crate::common::tracers::tracers;

/// A scene at a size that a software driver renders in seconds.
fn small(file: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(file);
    let smaller = [
        ("probe.scanlines", "96"),
        ("probe.elevation_layers", "3"),
        ("probe.samples", "1024"),
        ("imaging.image_height", "400"),
    ]
    .map(|(key, value)| (key.to_owned(), value.to_owned()));
    Scene::load(&path, &smaller).expect(file).0
}

/// The result of a frame.
#[derive(PartialEq)]
struct Shot {
    echoes: [Vec<i32>; 2],
    pixels: Vec<u8>,
}

/// Frame 0 of `scene` from a simulator of its own; nothing may saturate or overflow.
fn shoot(device: &Arc<Device>, scene: &Scene, tracer: Tracer) -> Shot {
    shoot_with(device, scene, tracer, Splits::default())
}

fn shoot_with(device: &Arc<Device>, scene: &Scene, tracer: Tracer, splits: Splits) -> Shot {
    let mut simulator = Simulator::with_splits(device, &Library::embedded(), scene, tracer, splits)
        .expect("a simulator");
    simulator.frame(scene, 0).expect("a frame");
    let counters = simulator.counters().expect("counters");
    let lost = [counters.saturated, counters.segments_dropped, counters.stack_overflow];
    assert_eq!(lost, [0; 3], "saturated, dropped, overflown: {tracer}");
    Shot {
        echoes: simulator.echoes().expect("echoes"),
        pixels: simulator.pixels().expect("pixels").2,
    }
}

/// Share of the pixels inside the sector that differ by more than one grey level.
fn differing(a: &[u8], b: &[u8]) -> f64 {
    assert_eq!(a.len(), b.len());
    let pairs = a.chunks(4).zip(b.chunks(4));
    let inside: Vec<_> = pairs.filter(|(p, q)| p[3] > 0 || q[3] > 0).collect();
    let far = inside.iter().filter(|(p, q)| p[3] != q[3] || p[0].abs_diff(q[0]) > 1);
    far.count() as f64 / inside.len() as f64
}

/// The other tracer's image with echoes weaker by `decibels`: an error planted on the device.
fn fainter(device: &Arc<Device>, scene: &Scene, decibels: f64) -> Vec<u8> {
    let mut scene = scene.clone();
    scene.imaging.gain -= decibels;
    shoot(device, &scene, Tracer::Bvh).pixels
}

/// A shot of each tracer, made twice. Accumulators are integers, so the order of additions leaves no trace: the runs are
/// equal bit for bit.
fn repeats(device: &Arc<Device>, scene: &Scene) -> Vec<Shot> {
    let shots = tracers(device).into_iter().map(|tracer| {
        let first = shoot(device, scene, tracer);
        assert!(first.echoes.concat().iter().any(|&v| v != 0), "{tracer}: silence");
        assert!(first == shoot(device, scene, tracer), "{tracer} twice");
        first
    });
    let shots: Vec<Shot> = shots.collect();
    let mut other = scene.clone();
    other.simulation.seed += 1;
    assert!(shots[0] != shoot(device, &other, Tracer::Bvh), "another seed is noticed");
    shots
}

/// Asserts that the tracers agree. Both compute the hit on the found triangle alike; 99.9 % of the pixels within
/// one grey level allows for the few rays near an edge for which a device's own test finds the neighbour.
fn agree(device: &Arc<Device>, scene: &Scene, shots: &[Shot]) {
    let [bvh, query] = shots else {
        return; // `tracers` has said so.
    };
    let share = differing(&bvh.pixels, &query.pixels);
    assert!(share <= 0.001, "{:.3} % of the pixels differ", 100.0 * share);
    let planted = differing(&fainter(device, scene, 0.5), &query.pixels);
    assert!(planted > 0.001, "half a decibel is noticed: {planted}");
}

fn repeats_and_agrees(file: &str) {
    let (device, scene) = (test_device(), small(file));
    agree(&device, &scene, &repeats(&device, &scene));
    assert_eq!(device.validation_messages(), Vec::<String>::new());
}

/// A simulator shows changed settings as a new one does.
#[test]
fn changed_settings_take_effect_from_frame_to_frame() {
    let device = test_device();
    let before = small("scenes/phantom.toml");
    let mut after = before.clone();
    // Scales, gains, surfaces and tissues: each reaches the kernels by another table.
    after.simulation.paths = 4 * before.simulation.paths;
    after.simulation.surface_gain = -3.0;
    after.imaging.tgc_sliders[4] = 5.0;
    after.tissues[0].echogenicity -= 4.0;
    for instance in &mut after.instances {
        instance.surface[0].thickness = 0.3;
    }
    let mut simulator =
        Simulator::new(&device, &Library::embedded(), &before, Tracer::Bvh).expect("a simulator");
    simulator.frame(&before, 0).expect("a frame");
    let first = simulator.echoes().expect("echoes");
    simulator.frame(&after, 0).expect("a frame");
    let changed = Shot {
        echoes: simulator.echoes().expect("echoes"),
        pixels: simulator.pixels().expect("pixels").2,
    };
    assert!(first != changed.echoes, "a change is noticed");
    assert!(changed == shoot(&device, &after, Tracer::Bvh));
}

/// Scales are bounds over all depths and kept from frame to frame: until any setting from which they follow is another.
#[test]
fn scales_are_those_of_the_scene_as_it_is() {
    let mut scene = small("scenes/phantom.toml");
    (scene.probe.scanlines, scene.probe.samples) = (16, 256);
    let mut simulator = Simulator::new(&test_device(), &Library::embedded(), &scene, Tracer::Bvh)
        .expect("a simulator");
    let scales = |frame: &Frame| [frame.surface_scale, frame.volume_scale];
    let mut before = scales(&tables::frame(&scene, 0));
    let changes: [fn(&mut Scene); 5] = [
        |_| (),
        |scene| scene.simulation.surface_gain += 60.0,
        |scene| scene.instances.iter_mut().for_each(|i| i.surface[1].gain += 20.0),
        |scene| scene.tissues[0].echogenicity += 60.0,
        |scene| scene.wires.iter_mut().for_each(|wire| wire.amplitude *= 1e6),
    ];
    for (number, change) in changes.into_iter().enumerate() {
        change(&mut scene);
        let now = scales(&tables::frame(&scene, 0));
        assert!(number == 0 || now != before, "change {number} is one of the scales");
        simulator.frame(&scene, 0).expect("a frame");
        assert_eq!(scales(simulator.constants()), now, "change {number}");
        simulator.line(&scene, 1, 3, 20).expect("a line");
        assert_eq!(scales(simulator.constants()), now, "change {number}, a line");
        before = now;
    }
}

/// Without a least weight paths end at the image's end: the same frame as with a tiny one.
#[test]
fn no_least_weight_is_a_tiny_one() {
    let device = test_device();
    let with = |least: f64| {
        let mut scene = small("scenes/phantom.toml");
        scene.simulation.min_weight = least;
        shoot(&device, &scene, Tracer::Bvh)
    };
    let tiny = with(1e-12);
    assert!(with(0.0) == tiny);
    assert!(with(0.5) != tiny, "a large one is noticed");
}

#[test]
fn the_phantom_repeats_and_both_tracers_agree() {
    repeats_and_agrees("scenes/phantom.toml");
}

#[test]
fn the_abdomen_repeats_and_both_tracers_agree() {
    repeats_and_agrees("scenes/abdomen.toml");
}

/// Cutting triangles changes no bit of any echo.
#[test]
fn cut_triangles_are_imaged_as_whole_ones() {
    let device = test_device();
    for file in ["scenes/heart.toml", "scenes/abdomen.toml"] {
        let scene = small(file);
        let [whole, cut] = [Splits::Object, Splits::Spatial]
            .map(|splits| shoot_with(&device, &scene, Tracer::Bvh, splits));
        let different = whole.echoes.concat();
        let different = different.iter().zip(cut.echoes.concat());
        let different = different.filter(|(a, b)| **a != *b).count();
        assert!(whole == cut, "{file}: {different} samples differ");
    }
    assert_eq!(device.validation_messages(), Vec::<String>::new());
}

/// Anatomy from patients, unchanged: open valves closed by coincident caps, crossing vessels.
#[test]
fn both_tracers_agree_on_real_anatomy() {
    if shared_data().is_none() {
        return;
    }
    let device = test_device();
    for name in ["liver", "heart", "heart_rodero"] {
        let scene = small(&format!("tests/scenes/{name}.toml"));
        let shots = tracers(&device).into_iter().map(|t| shoot(&device, &scene, t));
        agree(&device, &scene, &shots.collect::<Vec<_>>());
    }
    assert_eq!(device.validation_messages(), Vec::<String>::new());
}

/// A kernel edited while the program runs takes effect in the next frame.
#[cfg(feature = "compile")]
#[test]
fn edited_kernels_replace_those_of_a_running_simulator() {
    let sources = tempfile::tempdir().expect("a folder");
    let glsl = Path::new(env!("CARGO_MANIFEST_DIR")).join("glsl");
    for entry in glsl.read_dir().expect("kernels") {
        let file = entry.expect("a kernel").path();
        let copy = sources.path().join(file.file_name().expect("a name"));
        std::fs::copy(&file, copy).expect("a copy");
    }
    let (device, scene) = (test_device(), small("scenes/phantom.toml"));
    let mut library = Library::with_sources(sources.path()).expect("kernels that compile");
    let mut simulator =
        Simulator::new(&device, &library, &scene, Tracer::Bvh).expect("a simulator");
    let shown = |simulator: &mut Simulator| {
        simulator.frame(&scene, 0).expect("a frame");
        simulator.pixels().expect("pixels").2
    };
    let before = shown(&mut simulator);
    let display = sources.path().join("display.comp");
    let text = std::fs::read_to_string(&display).expect("the kernel");
    let edited = text.replace("0xff000000u", "0xfe000000u");
    assert_ne!(edited, text);
    std::fs::write(&display, edited).expect("the edited kernel");
    assert_eq!(library.poll().expect("it compiles"), ["display"]);
    assert!(shown(&mut simulator) == before, "not yet taken over");
    simulator.reload(&library).expect("pipelines");
    assert!(shown(&mut simulator) != before);
    assert_eq!(device.validation_messages(), Vec::<String>::new());
}
