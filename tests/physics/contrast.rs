//! Brightness of speckle: over depth, between tissues, in an anechoic cyst.

use std::f64::consts::PI;

use glam::{DAffine3, DVec3};
use insonify::scene::{Scene, Tissue};

use crate::common::moments::{decibel, deviation, gcnr, mean, slope};
use crate::physics::check::{Bench, Check, Curve, Outcome, Physics, Plot};
use crate::physics::render::Frame;
use crate::physics::scenes::{add_box, add_sphere, tissue};
use crate::physics::speckle::{homogeneous, intensities};

/// Intensities of the scanlines between two lateral positions, mm, and two depths.
pub fn region(frame: &Frame, scene: &Scene, lines: [f64; 2], depths: [f64; 2]) -> Vec<f64> {
    let [a, b] = depths.map(|z| (z / scene.probe.sample_pitch()).round() as usize);
    let inside = |l: u32| (lines[0]..lines[1]).contains(&scene.probe.ray(l, 0).0.x);
    let kept = (0..).zip(&frame.iq).filter(|(l, _)| inside(*l));
    let samples = kept.flat_map(|(_, line)| &line[a..b]);
    samples.map(|v| v[0] * v[0] + v[1] * v[1]).collect()
}

/// Check T5.
pub fn attenuation_slope_matches_beer_lambert() -> Check {
    Check {
        row: "T5",
        name: "attenuation_slope_matches_beer_lambert",
        claim: "Speckle darkens with depth by 2 alpha f: 7.0 dB/cm for 0.5 dB/(cm MHz) at 7 MHz.",
        planted: "One-way amplitude: half the loss.",
        run: slopes,
    }
}

/// Depths, mm, between which stretches are averaged for the slope: 5 cm; and the length of a stretch.
const STRETCHES: [f64; 2] = [20.0, 70.0];
const STRETCH: f64 = 2.5;

// 3 % is the table's. 20 stretches of 900 grains are good to 0.14 dB each, which makes 0.5 % of 7 dB/cm.
fn slopes(bench: &Bench, physics: Physics) -> Outcome {
    let mut out = Outcome::default();
    let mut curves = Vec::new();
    for (name, render) in &bench.renderers[1..] {
        for (attenuation, frequency) in [(0.5, 7.0), (0.7, 4.0)] {
            let mut scene = homogeneous(64, 1.0, 1);
            scene.probe.frequency = frequency;
            // As on the machine: echoes must survive the rounding of the sums.
            scene.imaging.tgc_attenuation = 0.5;
            scene.tissues[0].attenuation = match physics {
                Physics::Right => attenuation,
                Physics::Planted => attenuation / 2.0,
            };
            let frame = render(&scene);
            let count = ((STRETCHES[1] - STRETCHES[0]) / STRETCH) as u32;
            let point = |i: u32| {
                let top = STRETCHES[0] + f64::from(i) * STRETCH;
                let power = mean(&intensities(&frame, &scene, [top, top + STRETCH], 1).concat());
                [(top + STRETCH / 2.0) / 10.0, decibel(power)]
            };
            let points: Vec<[f64; 2]> = (0..count).map(point).collect();
            let expected = -2.0 * attenuation * frequency;
            let what =
                format!("{name}: slope of {attenuation} dB/(cm MHz) at {frequency} MHz, dB/cm");
            out.compare(what, slope(&points), expected, -0.03 * expected);
            let [first, last] = [points[0][0], points[points.len() - 1][0]];
            let middle =
                [(first + last) / 2.0, mean(&points.iter().map(|p| p[1]).collect::<Vec<_>>())];
            let at = |z: f64| [z, middle[1] + expected * (z - middle[0])];
            let tissue = format!("{attenuation} dB/(cm MHz) at {frequency} MHz");
            curves.push(Curve::line(format!("2 alpha f, {tissue}"), vec![at(first), at(last)]));
            curves.push(Curve::dots(format!("{name}, {tissue}"), points));
        }
    }
    let axes = ["depth, cm", "mean power of speckle, dB re mirror"];
    out.plots.push(Plot::linear("Speckle before compensation", axes, curves));
    out
}

/// Check T14.
pub fn echogenicity_is_contrast() -> Check {
    Check {
        row: "T14",
        name: "echogenicity_is_contrast",
        claim: "Two tissues differ by the ratio of their scatterers' variances, 10 log10(v1 / v2), however sparse \
            the scatterers are and whatever their mean; and their histograms overlap as two Rayleigh \
            distributions do: gCNR = c^(c / (1 - c)) - c^(1 / (1 - c)), c the ratio of powers.",
        planted: "A variance that forgets how many cells are empty.",
        run: echogenicity,
    }
}

/// Lateral ranges of scanlines beside and inside a box in the middle, mm; and its depths.
const BESIDE: [f64; 2] = [-31.0, -1.0];
const INSIDE: [f64; 2] = [1.0, 31.0];
const BOX: [f64; 2] = [35.0, 85.0];

// 0.3 dB is the table's; 60 lines of 50 mm hold 9 000 grains each: 0.07 dB on the difference. The histogram's bins
// are a few hundredths of the overlap's width, and chance adds 0.01: 0.03 for gCNR.
fn echogenicity(bench: &Bench, physics: Physics) -> Outcome {
    let mut out = Outcome::default();
    let law = vec![[-15.0, -15.0], [12.0, 12.0]];
    let mut curves = vec![Curve::line("10 log10(v1 / v2)", law)];
    for (name, render) in &bench.renderers[1..] {
        let mut pairs = Vec::new();
        for (contrast, density, ratio) in [(-6.0, 1.0, 0.0), (-12.0, 0.3, 0.0), (9.0, 0.3, 1.0)] {
            let mut scene = homogeneous(64, 1.0, 1);
            let missing = if physics == Physics::Planted { decibel(density) } else { 0.0 };
            let other = Tissue {
                echogenicity: contrast + missing,
                density_of_scatterers: density,
                mean_over_sigma: ratio,
                ..tissue(1.540, 1.630, 0.0)
            };
            let at = DAffine3::from_translation(DVec3::new(25.0, 5.3, 30.0));
            add_box(&mut scene, [50.0, 50.0, 60.0], other, at);
            let frame = render(&scene);
            let inside = region(&frame, &scene, INSIDE, BOX);
            let beside = region(&frame, &scene, BESIDE, BOX);
            let measured = decibel(mean(&inside) / mean(&beside));
            let what = format!("{name}: contrast of density {density}, mean {ratio} sigma; dB");
            let figure = out.compare(what, measured, contrast, 0.3);
            figure.unlike("amplitudes for powers", contrast / 2.0);
            pairs.push([contrast, measured]);
            if density == 1.0 {
                let overlap = |decibels: f64| {
                    let c = 10f64.powf(decibels / 10.0);
                    c.powf(c / (1.0 - c)) - c.powf(1.0 / (1.0 - c))
                };
                let e = |v: &[f64]| v.iter().map(|i| i.sqrt()).collect::<Vec<f64>>();
                let what = format!("{name}: gCNR at {contrast} dB");
                let found = gcnr(&e(&inside), &e(&beside));
                out.compare(what, found, overlap(contrast), 0.03)
                    .unlike("amplitudes for powers", overlap(contrast / 2.0));
            }
        }
        curves.push(Curve::dots(*name, pairs));
    }
    let axes = ["stated contrast, dB", "measured contrast, dB"];
    out.plots.push(Plot::linear("Contrast of two tissues", axes, curves));
    out
}

/// Check T15.
pub fn an_anechoic_cyst_is_as_dark_as_the_noise() -> Check {
    Check {
        row: "T15",
        name: "an_anechoic_cyst_is_as_dark_as_the_noise",
        claim: "Nothing but noise in a cyst without scatterers, without reflections: its level is that of the noise \
            over that of the tissue, (mu_o - mu_i) / sqrt(s_o^2 + s_i^2) = 1.91 as for a black cyst, and gCNR = 1 \
            (Rodriguez-Molares et al. 2020).",
        planted: "Clutter 15 dB under the tissue.",
        run: anechoic,
    }
}

// Noise is complex Gaussian: its 3 000 independent samples in the disc make 0.1 dB; 0.5 dB stays far from what clutter
// 10 dB under the noise would add. CNR and gCNR are the table's; the tissue's 3 000 grains make 0.03 of CNR.
fn anechoic(bench: &Bench, physics: Physics) -> Outcome {
    let mut out = Outcome::default();
    // Noise against liver: 45 dB under a mirror.
    let noise: f64 = -116.0;
    let contrast = noise + 45.0;
    let mut profiles = Vec::new();
    for (name, render) in &bench.renderers[1..] {
        let mut scene = homogeneous(96, 0.3, 1);
        scene.imaging.noise = noise;
        let clutter = match physics {
            Physics::Right => f64::NEG_INFINITY,
            Physics::Planted => -15.0,
        };
        let inside = Tissue { echogenicity: clutter, ..tissue(1.540, 1.630, 0.0) };
        let (radius, depth) = (7.0, 50.0);
        add_sphere(&mut scene, radius, inside, DVec3::new(0.0, 0.0, depth));
        let frame = render(&scene);
        // A square within the disc, four pulses and three beams from its wall; the same depths beside.
        let depths = [depth - 4.0, depth + 4.0];
        let dark = region(&frame, &scene, [-4.0, 4.0], depths);
        let mut bright = region(&frame, &scene, [-14.0, -8.0], depths);
        bright.extend(region(&frame, &scene, [8.0, 14.0], depths));
        let measured = decibel(mean(&dark) / mean(&bright));
        out.compare(format!("{name}: contrast, dB"), measured, contrast, 0.5);
        let [i, o] = [&dark, &bright].map(|v| v.iter().map(|i| i.sqrt()).collect::<Vec<f64>>());
        let cnr = (mean(&o) - mean(&i)) / deviation(&o).hypot(deviation(&i));
        out.compare(format!("{name}: CNR"), cnr, (PI / (4.0 - PI)).sqrt(), 0.1);
        out.compare(format!("{name}: gCNR"), gcnr(&i, &o), 1.0, 0.02);
        // Half a millimetre of the middle lines at a time.
        let level =
            |z: f64| [z, decibel(mean(&region(&frame, &scene, [-2.0, 2.0], [z - 0.25, z + 0.25])))];
        let depths = (0..60).map(|k| depth - 15.0 + 0.5 * f64::from(k));
        profiles.push(Curve::dots(*name, depths.map(level).collect()));
        if *name == "bvh" {
            out.pictures.push(frame.picture("Anechoic sphere of 14 mm, 100 dB", &scene));
            let [top, bottom] = [depth - radius, depth + radius];
            let line = [
                [top - 8.0, -45.0],
                [top, -45.0],
                [top, noise],
                [bottom, noise],
                [bottom, -45.0],
                [bottom + 8.0, -45.0],
            ];
            profiles.push(Curve::line("liver and noise", line.to_vec()));
        }
    }
    let axes = ["depth, mm", "level, dB re mirror"];
    out.plots.push(Plot::linear("Through the middle of the sphere", axes, profiles));
    out
}
