//! Live quality: levels are as bright as the scene's own, and going through them leaves no trace.

use insonify::gpu::lone_test_device;
use insonify::live::Ladder;
use insonify::probe::Probe;

use insonify::scene::{Scene, Tissue};
use insonify::sim::shaders::Library;
use insonify::sim::{Simulator, Tracer};

/// A difference of brightness that nobody notices, dB.
const SEEN: f64 = 0.3;

/// Liver without structure of its own, wide and deep enough for the speckle's mean.
fn phantom() -> Scene {
    let mut liver = Tissue::shipped("liver").expect("shipped");
    liver.texture_depth = 0.0;
    let probe = Probe {
        scanlines: 160,
        elevation_layers: 7,
        samples: 1536,
        depth: 100.0,
        ..Probe::abdominal()
    };
    let mut scene = Scene::homogeneous(liver, probe);
    scene.imaging.image_height = 640;
    scene
}

/// Mean level of the speckle, dB relative to white, over depths neither at the face nor at the end: of
/// log-compressed samples, so that the visible brightness is compared.
fn level(simulator: &mut Simulator, scene: &Scene) -> f64 {
    simulator.frame(scene, 0).expect("a frame");
    let log = simulator.log_image().expect("read back");
    let (lines, samples) = (scene.probe.scanlines as usize, scene.probe.samples as usize);
    let rows = samples / 5..samples * 9 / 10;
    let (mut sum, mut count) = (0.0, 0);
    for line in lines / 20..lines * 19 / 20 {
        let line = &log[line * samples..][rows.clone()];
        sum += line.iter().map(|&v| f64::from(v)).sum::<f64>();
        count += line.len();
    }
    (sum / count as f64 - 1.0) * scene.imaging.dynamic_range
}

/// Differences of all levels of the ladder from the scene's own, dB; `plant` spoils the levels.
fn differences(plant: impl Fn(&mut Scene)) -> Vec<f64> {
    let device = lone_test_device();
    let own = phantom();
    let ladder = Ladder::of(&own);
    let library = Library::embedded();
    let mut simulator = Simulator::new(&device, &library, &own, Tracer::Bvh).expect("a simulator");
    let mut levels = Vec::new();
    for (index, counts) in ladder.levels().iter().enumerate() {
        let mut scene = own.clone();
        counts.apply(&mut scene);
        if index > 0 {
            plant(&mut scene);
        }
        levels.push(level(&mut simulator, &scene));
        println!("{index} {counts}: {:.2} dB", levels[index]);
    }
    assert!(levels.len() > 5, "a ladder");
    levels.iter().map(|level| level - levels[0]).collect()
}

#[test]
fn every_level_of_the_ladder_is_as_bright_as_the_scene() {
    let found = differences(|_| {});
    assert!(found.iter().all(|d| d.abs() <= SEEN), "{found:?}");
}

#[test]
fn a_level_that_is_brighter_is_noticed() {
    let found = differences(|scene| scene.simulation.speckle_gain = 0.5);
    assert!(found[1..].iter().any(|d| d.abs() > SEEN), "{found:?}");
}

#[test]
fn levels_take_turns_in_the_same_buffers_and_leave_no_trace() {
    let device = lone_test_device();
    let library = Library::embedded();
    let mut own = phantom();
    own.probe.scanlines = 64;
    own.probe.samples = 512;
    own.probe.elevation_layers = 3;
    let ladder = Ladder::of(&own);
    let new = || Simulator::new(&device, &library, &own, Tracer::Bvh).expect("a simulator");
    let mut used = new();
    let picture = |simulator: &mut Simulator, scene: &Scene| {
        simulator.frame(scene, 0).expect("a frame");
        simulator.pixels().expect("read back")
    };
    let memory = || device.memory().current;
    let first = picture(&mut used, &own);
    // Both slots have their buffers for handing over.
    assert_eq!(picture(&mut used, &own), first);
    let before = memory();
    for level in ladder.levels().iter().rev() {
        let mut scene = own.clone();
        level.apply(&mut scene);
        let taken = picture(&mut used, &scene);
        assert_eq!(memory(), before, "nothing is made anew");
        assert!(!used.fit(&scene).expect("fits"), "and nothing has to be");
        if level.layers == 1 {
            assert_eq!(taken, picture(&mut new(), &scene), "{level}");
        }
    }
    assert_eq!(picture(&mut used, &own), first, "the scene's own is the same again");
}
