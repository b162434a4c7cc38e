//! How loud echoes are expected to be, and which part of them came by detours.

use glam::{DAffine3, DVec3};
use insonify::gpu::test_device;
use insonify::scene::Scene;
use insonify::sim::Tracer;
use insonify::sim::labels::Labels;
use insonify::sim::layout::LEAST_POWER;

use super::scenes::{add_box, add_layer, linear, silent, tissue};
use super::tracers::tracers;
use super::{at, frame, labels, simulator};

/// Frames over which power is averaged.
const SEEDS: u32 = 24;

/// Mean power of each sample of IQ over the seeds, and the labels of the last frame.
fn mean_power(scene: &mut Scene, tracer: Tracer) -> (Vec<f64>, Labels) {
    let mut simulator = simulator(scene, tracer);
    let mut sum = Vec::new();
    let mut last = None;
    for seed in 1..=SEEDS {
        scene.simulation.seed = seed;
        last = Some(frame(&mut simulator, scene, seed));
        let iq = simulator.iq().expect("IQ");
        let powers = iq.as_chunks::<2>().0.iter().map(|v| f64::from(v[0] * v[0] + v[1] * v[1]));
        sum.resize(iq.len() / 2, 0.0);
        sum.iter_mut().zip(powers).for_each(|(sum, power)| *sum += power / f64::from(SEEDS));
    }
    (sum, last.expect("frames"))
}

fn level(power: f64) -> f64 {
    10.0 * power.log10()
}

/// A scene of speckle behind a layer, with an echo from its face: absorbing, with half the echoes behind.
fn layered() -> Scene {
    let mut scene = linear(48, 40.0, tissue(1.54, 1.6, 0.4));
    scene.probe.depth = 60.0;
    scene.probe.samples = 1024;
    scene.probe.elevation_layers = 5;
    scene.simulation.max_reflections = 2;
    add_layer(&mut scene, 25.0, tissue(1.6, 1.75, 0.8));
    scene.tissues[1].echogenicity = -3.0;
    let reflector = DAffine3::from_translation(DVec3::new(3.1, 5.3, 45.0));
    add_box(&mut scene, [90.0, 90.0, 4.0], silent(1.54, 1.75, 0.5), reflector);
    scene
}

#[test]
fn the_mean_power_of_many_frames_is_the_expected_level() {
    for tracer in tracers(&test_device()) {
        let mut scene = layered();
        let (powers, labels) = mean_power(&mut scene, tracer);
        let [lines, samples] = labels.samples.shape;
        let per_mm = scene.probe.sample_pitch().recip();
        // Windows in depth of the two tissues, and one that holds the faces' echoes.
        for [a, b] in [[5.0, 10.0], [12.0, 22.0], [28.0, 34.0], [36.0, 43.0], [50.0, 58.0]] {
            let window = (a * per_mm) as usize..(b * per_mm) as usize;
            let (mut found, mut expected) = (0.0, 0.0);
            for l in 0..lines {
                for k in window.clone() {
                    found += powers[l * samples + k];
                    expected += 10_f64.powf(f64::from(at(&labels, l, k).level) / 10.0);
                }
            }
            let [found, expected] = [found, expected].map(level);
            println!("{tracer} {a} to {b} mm: {found:.3} dB, expected {expected:.3} dB");
            // Each window has at least 24 x 20 x 10 resolution cells, of which the mean of exponential powers has a
            // standard error of 1.5 %: 0.06 dB, of which three.
            assert!((found - expected).abs() < 0.2, "{tracer} {a}: {found} {expected}");
        }
        // The face is smooth: its echo, 15 dB above speckle, is the same on all scanlines and in every frame.
        let sum = |k: usize| (0..lines).map(|l| powers[l * samples + k]).sum::<f64>();
        let near = (24.0 * per_mm) as usize..(26.0 * per_mm) as usize;
        let peak = near.max_by(|a, b| sum(*a).total_cmp(&sum(*b))).expect("samples");
        let powers = (0..lines).map(|l| 10_f64.powf(f64::from(at(&labels, l, peak).level) / 10.0));
        let (found, expected) = (level(sum(peak)), level(powers.sum()));
        println!("{tracer} face: {found:.3} dB, expected {expected:.3} dB");
        assert!((found - expected).abs() < 0.2, "{tracer}: {found} {expected}");
    }
}

#[test]
fn without_surfaces_nothing_is_reflected_and_without_echoes_there_is_no_level() {
    let mut scene = linear(4, 4.0, tissue(1.54, 1.6, 0.5));
    scene.simulation.max_reflections = 3;
    let speckle = labels(&mut scene, Tracer::Bvh);
    assert!(speckle.samples.labels.iter().all(|l| l.reverberation == 0.0 && l.level > -200.0));
    let mut scene = linear(4, 4.0, silent(1.54, 1.6, 0.5));
    let silent = labels(&mut scene, Tracer::Bvh);
    let least = 10.0 * LEAST_POWER.log10();
    assert!(silent.samples.labels.iter().all(|l| (l.level - least).abs() < 1e-3));
}

/// Pressure reflection coefficients of a slab's faces; its depth and thickness, mm.
const FACES: [f64; 2] = [0.5, 0.8];
const SLAB: [f64; 2] = [20.0, 8.0];

#[test]
fn echoes_between_two_faces_are_reverberation_as_their_series_says() {
    let impedances = FACES.map(|r| (1.0 + r) / (1.0 - r));
    let build = |filled: bool| {
        let make = if filled { tissue } else { silent };
        let mut scene = linear(1, 1.0, make(1.54, 1.5, 0.0));
        let z1 = 1.5 * impedances[0];
        add_layer(&mut scene, SLAB[0], make(1.54, z1, 0.0));
        add_layer(&mut scene, SLAB[0] + SLAB[1], make(1.54, z1 * impedances[1], 0.0));
        // Every reflection is followed, and nothing is left to chance.
        scene.simulation.max_reflections = 8;
        scene.simulation.paths = 64;
        scene.simulation.branch_floor = f64::NEG_INFINITY;
        scene
    };
    let series = |m: i32| (1.0 - FACES[0].powi(2)) * FACES[1] * (-FACES[0] * FACES[1]).powi(m);
    for tracer in tracers(&test_device()) {
        let mut scene = build(false);
        let dark = labels(&mut scene, tracer);
        let per_mm = scene.probe.sample_pitch().recip();
        let sample = |m: i32| ((SLAB[0] + f64::from(m + 1) * SLAB[1]) * per_mm).round() as usize;
        for m in -1..=2 {
            let label = at(&dark, 0, sample(m));
            let expected = if m > 0 { 1.0 } else { 0.0 };
            assert!(
                (f64::from(label.reverberation) - expected).abs() < 1e-3,
                "{tracer} {m}: {label:?}"
            );
        }
        // Of the second detour's echo on the direct speckle behind the slab: its power over the sum of both.
        let mut scene = build(true);
        let filled = labels(&mut scene, tracer);
        let label = at(&filled, 0, sample(1));
        let speckle = 10_f64.powf(f64::from(at(&filled, 0, sample(1) + 40).level) / 10.0);
        let beside = f64::from(at(&filled, 0, sample(1) + 40).reverberation);
        let echo = series(1).powi(2);
        let total = echo + speckle;
        let share = (echo + speckle * beside) / total;
        println!("{tracer}: {} of {share}, beside {beside}", label.reverberation);
        assert!(
            (f64::from(label.reverberation) - share).abs() < 0.01,
            "{tracer}: {label:?} {share}"
        );
        // The slab's own speckle is heard again behind it, after a reflection at its back.
        assert!(beside > 0.0 && beside < 1.0);
    }
}
