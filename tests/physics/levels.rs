//! Brightness over depth, and the sector of the picture.

use insonify::probe::{Probe, ProbeKind};
use insonify::scene::Scene;

use crate::physics::check::{Bench, Check, Curve, Outcome, Physics, Plot};
use crate::physics::render::Frame;
use crate::physics::scenes::{linear, tissue};

const RANGE: f64 = 120.0;

/// Homogeneous speckle attenuating `attenuation` dB/(cm MHz), shown over a range that clips nothing.
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

/// Check T27.
pub fn matched_compensation_makes_homogeneous_tissue_flat() -> Check {
    Check {
        row: "T27",
        name: "matched_compensation_makes_homogeneous_tissue_flat",
        claim: "Time-gain compensation of 2 x 0.5 dB/(cm MHz) undoes the attenuation of tissue that \
            has it: within 0.5 dB of the mean over depth; a stretch holds about 60 x 48 speckle grains, \
            0.1 dB. Tissue of 0.53 falls by 2 x 0.03 x 7 MHz x 8 cm = 3.36 dB from the second tenth to \
            the last.",
        planted: "Tissue of 0.53 dB/(cm MHz) under the same compensation.",
        run: flatness,
    }
}

fn flatness(bench: &Bench, physics: Physics) -> Outcome {
    let mut out = Outcome::default();
    let alpha = match physics {
        Physics::Right => 0.5,
        Physics::Planted => 0.53,
    };
    let mut curves = vec![Curve::line("flat", vec![[1.0, 0.0], [10.0, 0.0]])];
    for (name, render) in &bench.renderers {
        let scene = homogeneous(alpha);
        let frame = render(&scene);
        let flat = powers(&frame);
        let mean = flat.iter().sum::<f64>() / flat.len() as f64;
        let from_mean: Vec<f64> = flat.iter().map(|p| p - mean).collect();
        let largest = from_mean.iter().fold(0.0, |m, d| f64::max(m, d.abs()));
        out.compare(format!("{name}: largest departure from the mean, dB"), largest, 0.0, 0.5);
        let tilted = powers(&render(&homogeneous(0.53)));
        let what = format!("{name}: fall of tissue of 0.53 dB/(cm MHz), dB");
        out.compare(what, tilted[0] - tilted[8], 3.36, 0.5).unlike("attenuation one way", 1.68);
        let depths = (0..9).map(|i| 1.5 + f64::from(i));
        curves.push(Curve::dots(*name, depths.zip(from_mean).map(|(z, d)| [z, d]).collect()));
        if *name == "bvh" {
            out.pictures.push(frame.picture("bvh, 120 dB", &scene));
        }
    }
    out.plots.push(Plot::linear(
        "Mean power of homogeneous tissue",
        ["depth, cm", "from the mean, dB"],
        curves,
    ));
    out
}

/// Check T27.
pub fn sliders_add_their_decibels_at_their_depths() -> Check {
    Check {
        row: "T27",
        name: "sliders_add_their_decibels_at_their_depths",
        claim: "Eight sliders, evenly spaced from the face to full depth, add their gain in dB, \
            linear in between. The same speckle with and without; 1e-5 of the range of 120 dB is the \
            single precision of gains and levels.",
        planted: "Sliders a hundredth of their spacing deeper than they are.",
        run: sliders,
    }
}

fn sliders(bench: &Bench, physics: Physics) -> Outcome {
    let mut out = Outcome::default();
    let mut scene = homogeneous(0.5);
    let sliders = [0.0, 0.0, 6.0, 0.0, 0.0, 0.0, 0.0, -3.0];
    let moved = match physics {
        Physics::Right => 0.0,
        Physics::Planted => 0.01,
    };
    let expected = |k: usize| match 7.0 * k as f64 / 2048.0 - moved {
        p if p > 6.0 => -3.0 * (p - 6.0),
        p => 6.0 * (1.0 - (p - 2.0).abs()).max(0.0),
    };
    let mut curves = vec![Curve::line(
        "interpolated sliders",
        (0..205).map(|i| 10 * i).map(|k| [k as f64, expected(k)]).collect(),
    )];
    for (name, render) in &bench.renderers {
        scene.imaging.tgc_sliders = [0.0; 8];
        let plain = render(&scene);
        scene.imaging.tgc_sliders = sliders;
        let slid = render(&scene);
        let gain = |k: usize| (slid.levels[5][k] - plain.levels[5][k]) * RANGE;
        for k in [585, 440, 2000] {
            let what = format!("{name}: gain at sample {k}, dB");
            out.compare(what, gain(k), expected(k), 1e-5 * RANGE);
        }
        let dots = (1..25).map(|i| 80 * i).map(|k| [k as f64, gain(k)]);
        curves.push(Curve::dots(*name, dots.collect()));
    }
    out.plots.push(Plot::linear("Gain of the sliders", ["sample", "gain, dB"], curves));
    out
}

/// Check T28.
pub fn sectors_have_the_area_of_their_geometry() -> Check {
    Check {
        row: "T28",
        name: "sectors_have_the_area_of_their_geometry",
        claim: "Pixels inside the sector cover FOV / 2 ((R0 + D)^2 - R0^2), a rectangle's width times \
            depth for a linear array. 0.5 % is a fifth of a pixel along the outline of an image of 800.",
        planted: "Pixels half a percent larger than they are, 1 % in area.",
        run: sectors,
    }
}

/// Sector's area, mm^2, and the height of the picture, mm: for a fan from the edges of its face down.
fn sector(probe: &Probe) -> [f64; 2] {
    let d = probe.depth;
    let fan = |r: f64, angle: f64| angle / 2.0 * ((r + d).powi(2) - r * r);
    match probe.kind {
        ProbeKind::Convex { radius, field_of_view } => {
            [fan(radius, field_of_view), d + radius * (1.0 - (field_of_view / 2.0).cos())]
        }
        ProbeKind::Phased { field_of_view } => [fan(0.0, field_of_view), d],
        ProbeKind::Linear { width } => [width * d, d],
    }
}

fn sectors(bench: &Bench, physics: Physics) -> Outcome {
    let mut out = Outcome::default();
    let presets = [
        ("Table I", Probe::paper_table1()),
        ("abdominal", Probe::abdominal()),
        ("cardiac", Probe::cardiac()),
        ("linear", Probe::linear()),
        ("phased", Probe::phased()),
    ];
    for (preset, probe) in presets {
        let mut scene = homogeneous(0.5);
        scene.tissues[0].echogenicity = f64::NEG_INFINITY;
        scene.probe = Probe { elevation_layers: 1, ..probe };
        let [area, height] = sector(&scene.probe);
        let pixel = match physics {
            Physics::Right => height / 800.0,
            Physics::Planted => 1.005 * height / 800.0,
        };
        for (name, render) in &bench.renderers {
            let frame = render(&scene);
            let inside = frame.pixels.iter().filter(|&&p| p >> 24 == 255).count();
            let what = format!("{name}: area of the {preset} sector, mm^2");
            out.compare(what, inside as f64 * pixel * pixel, area, 0.005 * area);
            if *name == "bvh" && preset == "Table I" {
                out.pictures.push(frame.picture("bvh: the Table I sector, empty", &scene));
            }
        }
    }
    out
}
