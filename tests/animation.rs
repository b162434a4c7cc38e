//! Whole frames of scenes that move: every strategy shows the same image of the same instant, by both
//! tracers, also when it is exchanged while frames are in flight.

use std::path::Path;

use insonify::gpu::test_device;
use insonify::scene::{Scene, Strategy};
use insonify::settings::{Refraction, TextureSpace, Words};
use insonify::sim::shaders::Library;
use insonify::sim::{Simulator, Tracer};

use crate::common::tracers::tracers;

/// A shipped scene at a size that a software driver renders in a second.
fn small(name: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
    let smaller = [
        ("probe.scanlines", "48"),
        ("probe.elevation_layers", "1"),
        ("probe.samples", "768"),
        ("simulation.paths", "2"),
        ("imaging.image_height", "240"),
    ]
    .map(|(key, value)| (key.to_owned(), value.to_owned()));
    Scene::load(&path, &smaller).expect(name).0
}

fn strategies(tracer: Tracer) -> impl Iterator<Item = Strategy> {
    let has = move |s: &Strategy| tracer == Tracer::Bvh || *s != Strategy::Selector;
    Strategy::ALL.iter().copied().filter(has)
}

fn choose(scene: &mut Scene, strategy: Strategy, seconds: f64) {
    for instance in &mut scene.instances {
        instance.keyframes.strategy = strategy;
    }
    scene.set_time(seconds);
}

fn image(simulator: &mut Simulator, scene: &Scene) -> Vec<u8> {
    simulator.frame(scene, 0).expect("a frame");
    simulator.pixels().expect("pixels").2
}

fn differing(a: &[u8], b: &[u8]) -> usize {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).filter(|(a, b)| a != b).count()
}

/// Keyframe instants, so that `interpolate` shows keyframes too; back and forth.
const INSTANTS: [f64; 4] = [0.0, 5.0 / 8.0, 1.0 / 8.0, 0.0];

#[test]
fn every_strategy_shows_the_same_image() {
    let device = test_device();
    let library = Library::embedded();
    let mut scene = small("limbs.toml");
    let period = 2.0;
    let mut expected: Vec<Vec<u8>> = Vec::new();
    for tracer in tracers(&device) {
        // One simulator, whose strategy is exchanged while it runs.
        let mut simulator = Simulator::new(&device, &library, &scene, tracer).expect("a simulator");
        for strategy in strategies(tracer) {
            for (i, instant) in INSTANTS.iter().enumerate() {
                choose(&mut scene, strategy, instant * period + 1e-9);
                let found = image(&mut simulator, &scene);
                if expected.len() == i {
                    expected.push(found.clone());
                }
                // The two tracers may see a seam differently; each tracer repeats exactly.
                let allowed = if tracer == Tracer::Bvh { 0 } else { found.len() / 1000 };
                let far = match strategy {
                    // A billionth of a second from its keyframe: single precision may see that.
                    Strategy::Interpolate => {
                        differing(&found, &expected[i]).saturating_sub(found.len() / 1000)
                    }
                    // At an edge, the tree decides which of its two triangles a ray meets where their distances differ
                    // only by rounding: a pixel of 100,000 may differ.
                    Strategy::Refit => {
                        differing(&found, &expected[i]).saturating_sub(found.len() / 100_000)
                    }
                    _ => differing(&found, &expected[i]),
                };
                assert!(
                    far <= allowed,
                    "{strategy}, {tracer}, {instant}: {far} of {} bytes",
                    found.len()
                );
            }
        }
    }
    assert!(
        differing(&expected[0], &expected[1]) > expected[0].len() / 100,
        "the limb does not move"
    );
    assert_eq!(expected[0], expected[3], "the same instant is the same image");
    let messages = device.validation_messages();
    assert!(messages.is_empty(), "{messages:#?}");
}

/// A moving scene looks like the same anatomy at rest: the animation leaves no trace.
#[test]
fn a_moving_scene_looks_like_the_still_one() {
    let device = test_device();
    let library = Library::embedded();
    for (name, seconds) in [("heart.toml", 0.3), ("fetus.toml", 3.1), ("limbs.toml", 0.9)] {
        let mut scene = small(name);
        if name == "heart.toml" {
            // The device interpolates in its own precision: the test below.
            choose(&mut scene, Strategy::Exchange, 0.0);
        }
        // Without keyframes there is no reference shape that tissue could follow.
        scene.simulation.texture_space = TextureSpace::Object;
        // Slopes of beams are averaged over each keyframe and then interpolated, not over the shape between them.
        scene.simulation.refraction = Refraction::Ray;
        let mut simulator =
            Simulator::new(&device, &library, &scene, Tracer::Bvh).expect("a simulator");
        let rest = image(&mut simulator, &scene);
        scene.set_time(seconds);
        let moved = image(&mut simulator, &scene);
        let still = scene.still();
        let mut fresh =
            Simulator::new(&device, &library, &still, Tracer::Bvh).expect("a simulator");
        assert_eq!(differing(&moved, &image(&mut fresh, &still)), 0, "{name}");
        assert!(differing(&moved, &rest) > rest.len() / 500, "{name} does not move");
    }
    let messages = device.validation_messages();
    assert!(messages.is_empty(), "{messages:#?}");
}

/// Between keyframes: the image on the device is that of vertices interpolated on the host.
#[test]
fn between_keyframes_the_device_moves_vertices_as_the_host_does() {
    let device = test_device();
    let library = Library::embedded();
    let mut scene = small("heart.toml");
    scene.simulation.texture_space = TextureSpace::Object;
    scene.simulation.refraction = Refraction::Ray;
    choose(&mut scene, Strategy::Interpolate, 0.0);
    for tracer in tracers(&device) {
        let mut simulator = Simulator::new(&device, &library, &scene, tracer).expect("a simulator");
        let mut last = image(&mut simulator, &scene);
        for seconds in [0.05, 0.33, 0.71] {
            choose(&mut scene, Strategy::Interpolate, seconds);
            let found = image(&mut simulator, &scene);
            let still = scene.still();
            let mut fresh = Simulator::new(&device, &library, &still, tracer).expect("a simulator");
            // Vertices differ in their last bits, which moves some echoes by a grey level.
            let far = differing(&found, &image(&mut fresh, &still));
            assert!(far < found.len() / 200, "{tracer}, {seconds} s: {far} of {}", found.len());
            assert!(differing(&found, &last) > found.len() / 100, "{tracer}: nothing moves");
            last = found;
        }
    }
    let messages = device.validation_messages();
    assert!(messages.is_empty(), "{messages:#?}");
}

/// The ray query has no node with a union box; the message names a strategy to take instead.
#[test]
fn the_ray_query_refuses_a_selector_node() {
    let device = test_device();
    let mut scene = small("limbs.toml");
    choose(&mut scene, Strategy::Selector, 0.0);
    if !tracers(&device).contains(&Tracer::RayQuery) {
        return;
    }
    let refused = Simulator::new(&device, &Library::embedded(), &scene, Tracer::RayQuery);
    let message = refused.err().expect("refused").to_string();
    assert!(message.contains("`selector`") && message.contains("`mask`"), "{message}");
}
