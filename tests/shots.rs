//! Several images of one frame: each is what it is alone.

use std::path::Path;

use glam::{DAffine3, DVec3};
use insonify::gpu::test_device;
use insonify::scene::Scene;
use insonify::sim::shaders::Library;
use insonify::sim::{Shot, Simulator, Tracer};

use crate::common::tracers::tracers;

/// A shipped scene with few lines.
fn scene(name: &str, more: &[(&str, &str)]) -> Scene {
    let small = [
        ("probe.scanlines", "40"),
        ("probe.elevation_layers", "2"),
        ("probe.samples", "400"),
        ("imaging.image_height", "120"),
        ("simulation.paths", "3"),
    ];
    let set = small.iter().chain(more).map(|&(k, v)| (k.to_owned(), v.to_owned()));
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
    Scene::load(&path, &set.collect::<Vec<_>>()).expect("a shipped scene").0
}

/// Shots beside each other, of other seeds and numbers.
fn shots(scene: &Scene, count: u32) -> Vec<Shot> {
    let shot = |i: u32| {
        let aside = DAffine3::from_translation(DVec3::new(1.3 * f64::from(i), 0.0, 0.0));
        let turned = DAffine3::from_rotation_y(0.02 * f64::from(i));
        Shot {
            world_from_probe: scene.world_from_probe * aside * turned,
            seed: scene.simulation.seed + i / 2,
            index: i,
        }
    };
    (0..count).map(shot).collect()
}

/// Everything that is read of an image.
#[derive(Debug, PartialEq)]
struct Results {
    pixels: Vec<u8>,
    iq: Vec<f32>,
    log: Vec<f32>,
    labels: Vec<u8>,
}

fn results(simulator: &mut Simulator) -> Results {
    let labels = simulator.labels().expect("read");
    let bytes = labels.map(|labels| {
        let grids = [&labels.samples.labels, &labels.pixels.labels];
        grids.map(|grid| bytemuck::cast_slice::<_, u8>(grid).to_vec()).concat()
    });
    Results {
        pixels: simulator.pixels().expect("read").2,
        iq: simulator.iq().expect("read"),
        log: simulator.log_image().expect("read"),
        labels: bytes.unwrap_or_default(),
    }
}

/// The shots of a frame.
fn together(simulator: &mut Simulator, scene: &Scene, shots: &[Shot]) -> Vec<Results> {
    simulator.frames(scene, shots).expect("a frame");
    let chosen = (0..shots.len()).map(|i| {
        simulator.choose(i);
        results(simulator)
    });
    chosen.collect()
}

/// The shots one after the other.
fn alone(simulator: &mut Simulator, scene: &Scene, shots: &[Shot]) -> Vec<Results> {
    let mut scene = scene.clone();
    let image = |shot: &Shot| {
        scene.world_from_probe = shot.world_from_probe;
        scene.simulation.seed = shot.seed;
        simulator.frame(&scene, shot.index).expect("a frame");
        results(simulator)
    };
    shots.iter().map(image).collect()
}

/// Compares the images of frames of several shots with those of frames of one.
fn compare(scene: &Scene, tracer: Tracer) {
    let device = test_device();
    let simulator = || Simulator::new(&device, &Library::embedded(), scene, tracer);
    let shots = shots(scene, 5);
    let expected = alone(&mut simulator().expect("a simulator"), scene, &shots);
    for (i, one) in expected.iter().enumerate() {
        // Otherwise it would not be noticed if a lane showed another one's image.
        assert!(expected[..i].iter().all(|other| other.pixels != one.pixels), "image {i}");
    }
    let mut simulator = simulator().expect("a simulator");
    assert!(simulator.most_shots() >= shots.len());
    let rest = in_two(&mut simulator, scene, &shots);
    assert!(rest == expected, "{tracer} of {}", scene.name);
    // The results come from copies now, which those of other shots must not reach.
    let again = together(&mut simulator, scene, &shots);
    let images = |all: &[Results]| all.iter().map(|r| r.pixels.clone()).collect::<Vec<_>>();
    assert!(images(&again) == images(&expected), "{tracer} of {}, again", scene.name);
    assert_eq!(device.validation_messages(), [""; 0]);
}

/// Frames of three and of two shots.
fn in_two(simulator: &mut Simulator, scene: &Scene, shots: &[Shot]) -> Vec<Results> {
    let (first, last) = shots.split_at(3);
    let mut all = together(simulator, scene, first);
    all.extend(together(simulator, scene, last));
    all
}

#[test]
fn images_beside_each_other_are_those_one_after_the_other() {
    for tracer in tracers(&test_device()) {
        // Contact with the skin, a deforming organ; several batches of paths, each with random numbers of its own.
        compare(&scene("abdomen.toml", &[("simulation.labels", "true")]), tracer);
        let mut heart = scene("heart.toml", &[("simulation.rough_transmission", "true")]);
        heart.set_time(0.2);
        compare(&heart, tracer);
    }
}

#[test]
fn images_with_an_acquired_volume_beside_each_other() {
    for blend in ["multiband", "linear"] {
        compare(&scene("pregnancy.toml", &[("fusion.blend", blend)]), Tracer::Bvh);
    }
}

#[test]
fn lanes_are_made_again_when_settings_change() {
    let device = test_device();
    let scene = scene("phantom.toml", &[]);
    let mut louder = scene.clone();
    louder.imaging.gain += 6.0;
    louder.simulation.labels = true;
    let shots = shots(&scene, 3);
    let new = || Simulator::new(&device, &Library::embedded(), &scene, Tracer::Bvh).expect("one");
    let mut simulator = new();
    together(&mut simulator, &scene, &shots);
    let changed = together(&mut simulator, &louder, &shots);
    assert!(changed.iter().all(|one| !one.labels.is_empty()));
    let mut simulator = new();
    simulator.frame(&scene, 0).expect("a frame");
    // What has moved is since the image before, here as there.
    simulator
        .frame(&Scene { world_from_probe: shots[2].world_from_probe, ..scene.clone() }, 0)
        .expect("a frame");
    assert!(changed == alone(&mut simulator, &louder, &shots));
    assert_eq!(device.validation_messages(), [""; 0]);
}
