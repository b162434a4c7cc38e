//! Brightness over depth, and the sector that it is shown in.

use insonify::probe::Probe;
use insonify::scene::Scene;

use crate::render::{Frame, twin};
use crate::scenes::{linear, tissue};

const RANGE: f64 = 120.0;

/// Homogeneous speckle attenuating `attenuation` dB/(cm MHz), seen over a range that clips nothing.
fn homogeneous(attenuation: f64) -> Scene {
    let mut scene = linear(48, 30.0, tissue(1.540, 1.630, attenuation));
    scene.imaging.dynamic_range = RANGE;
    scene.imaging.gain = 0.0;
    scene
}

/// Mean power in ten stretches of depth, dB, without the first.
fn powers(frame: &Frame) -> Vec<f64> {
    let samples = frame.levels[0].len();
    let stretch = samples / 10;
    let power = |v: f64| 10f64.powf((v - 1.0) * RANGE / 10.0);
    let mean = |i: usize| {
        let range = i * stretch..(i + 1) * stretch;
        let all = frame.levels.iter().flat_map(|l| &l[range.clone()]);
        all.map(|&v| power(v)).sum::<f64>() / (stretch * frame.levels.len()) as f64
    };
    (1..10).map(|i| 10.0 * mean(i).log10()).collect()
}

fn spread(powers: &[f64]) -> f64 {
    let fold = |f: fn(f64, f64) -> f64| powers.iter().copied().reduce(f).expect("stretches");
    fold(f64::max) - fold(f64::min)
}

// Within 0.5 dB of each other's middle. A stretch holds about 60 x 48 speckle grains: 0.1 dB.
#[test]
fn matched_compensation_makes_homogeneous_tissue_flat() {
    let flat = powers(&twin(&homogeneous(0.5)));
    assert!(spread(&flat) < 1.0, "{flat:?}");
    // 0.03 dB/(cm MHz) more: 2 x 0.03 x 7 x 8 = 3.4 dB from the second stretch to the last.
    let tilted = powers(&twin(&homogeneous(0.53)));
    assert!(spread(&tilted) > 1.0, "{tilted:?}");
    let fall = tilted[0] - tilted[8];
    assert!((fall - 3.36).abs() < 1.0, "{fall}");
}

// The same speckle twice: 1e-5 is the f32 of gains and levels.
#[test]
fn sliders_add_their_decibels_at_their_depths() {
    let mut scene = homogeneous(0.5);
    let plain = twin(&scene);
    scene.imaging.tgc_sliders = [0.0, 0.0, 6.0, 0.0, 0.0, 0.0, 0.0, -3.0];
    let slid = twin(&scene);
    for (k, z) in [
        (585, 585.0 / 2048.0),
        (440, 440.0 / 2048.0),
        (2000, 2000.0 / 2048.0),
    ] {
        let position: f64 = 7.0 * z;
        let expected = match position {
            p if p > 6.0 => -3.0 * (p - 6.0),
            p => 6.0 * (1.0 - (p - 2.0).abs()),
        };
        let got = (slid.levels[5][k] - plain.levels[5][k]) * RANGE;
        assert!(
            (got - expected).abs() < 1e-5 * RANGE,
            "{k}: {got} {expected}"
        );
    }
}

// Pixels inside the sector against its area in closed form: 0.5 % is a fifth of a pixel along the
// outline of an image of 800.
#[test]
fn sectors_have_the_area_of_their_geometry() {
    use insonify::probe::Kind;
    let presets = [
        Probe::paper_table1(),
        Probe::abdominal(),
        Probe::cardiac(),
        Probe::linear(),
        Probe::phased(),
    ];
    for probe in presets {
        let d = probe.depth;
        let fan = |r: f64, angle: f64| angle / 2.0 * ((r + d).powi(2) - r * r);
        let expected = match probe.kind {
            Kind::Convex {
                radius,
                field_of_view,
            } => fan(radius, field_of_view),
            Kind::Phased { field_of_view } => fan(0.0, field_of_view),
            Kind::Linear { width } => width * d,
        };
        let mut scene = homogeneous(0.5);
        scene.tissues[0].echogenicity = f64::NEG_INFINITY;
        scene.probe = Probe {
            elevation_layers: 1,
            ..probe
        };
        let pixels = twin(&scene).pixels;
        let width = pixels.len() / 800;
        // The picture spans the sector's height: for a fan from the edges of its face down.
        let height = match scene.probe.kind {
            Kind::Convex {
                radius,
                field_of_view,
            } => d + radius * (1.0 - (field_of_view / 2.0).cos()),
            Kind::Linear { .. } | Kind::Phased { .. } => d,
        };
        let pixel = (height / 800.0).powi(2);
        let inside = pixels.iter().filter(|&&p| p >> 24 == 255).count();
        let area = inside as f64 * pixel;
        assert!(
            (area / expected - 1.0).abs() < 0.005,
            "{width} x 800: {area} {expected}"
        );
    }
}
