//! Comparison of the device with a convolution-based simulator: exact sums over point scatterers.

use std::f64::consts::{LN_2, PI, SQRT_2, TAU};

use insonify::scene::Scene;

use crate::common::signal::Random;
use crate::physics::check::{Bench, Check, Curve, Outcome, Physics, Picture, Plot};
use crate::physics::resolution::gaussian_beam;
use crate::physics::scenes::{add_point, linear, silent};

/// Number of scanlines over a width, mm; samples over 100 mm.
const LINES: u32 = 96;
const WIDTH: f64 = 12.0;
const SAMPLES: u32 = 4096;
const PITCH: f64 = 100.0 / SAMPLES as f64;
/// Compared depths, in samples: 35 to 65 mm about the focus.
const SHOWN: [usize; 2] = [1434, 2662];
/// Phase of the carrier per mm of depth: out and back at 7 MHz and 1540 m/s.
const WAVENUMBER: f64 = 2.0 * TAU * 7.0 / 1.540;

/// Check T35.
pub fn points_and_scatterers_are_those_of_a_convolution_simulator() -> Check {
    Check {
        row: "T35",
        name: "points_and_scatterers_are_those_of_a_convolution_simulator",
        claim: "Convolution-based echography (Gao et al. 2009) sums, over points, a Gaussian pulse \
            times Gaussian beams times the carrier's phase. The radio-frequency lines of the same \
            points correlate by more than 0.99: sixty targets, and three thousand scatterers of normal \
            amplitudes in a slice 5 mm thick. A point's level falls as the root of the beam's area, from \
            the transmit focus on. Echoes between two samples are as high as on one, within 0.05 dB.",
        planted: "A convolution simulator whose pulses lie half a sample deeper.",
        run: beside_cole,
    }
}

/// A point: place, mm, and amplitude.
type Point = ([f64; 3], f64);

fn targets() -> Vec<Point> {
    let place = |i: u32| {
        let (column, row) = (f64::from(i % 6), f64::from(i / 6));
        // Off scanlines and samples, by different amounts.
        [2.0 * column - 5.0 + 0.037 * row, 0.0, 36.5 + 3.0 * row + 0.0173 * column]
    };
    (0..60).map(|i| (place(i), 0.1)).collect()
}

fn scatterers() -> Vec<Point> {
    let mut random = Random(35);
    let mut within = |size: f64| size * (random.uniform() - 0.5);
    let places: Vec<[f64; 3]> =
        (0..3000).map(|_| [within(13.0), within(5.0), 50.0 + within(30.0)]).collect();
    let mut random = Random(36);
    let amplitude = |p| (p, 0.02 * random.gaussian());
    places.into_iter().map(amplitude).collect()
}

/// In a silent medium with the machine's speed of sound.
fn scene(points: &[Point]) -> Scene {
    let mut scene = linear(LINES, WIDTH, silent(1.540, 1.600, 0.0));
    scene.probe.samples = SAMPLES;
    scene.probe.elevation_layers = 3;
    scene.probe.slice_thickness = 6.0;
    for &(p, amplitude) in points {
        add_point(&mut scene, p, amplitude);
    }
    scene
}

/// Lateral and elevational two-way deviations at depth `z`, mm.
fn beams(z: f64) -> [f64; 2] {
    let receive: f64 = 0.6 * 0.22 * 2.0;
    let lateral = (gaussian_beam(2.0, 50.0, z).powi(-2) + receive.powi(-2)).powf(-0.5);
    [lateral, gaussian_beam(10.0, 60.0, z) / SQRT_2]
}

/// Deviation of the pulse in depth, mm.
fn axial() -> f64 {
    1.540 / 2.0 * (2.0 * LN_2).sqrt() / (PI * 0.6 * 7.0)
}

/// Radio-frequency scanlines of the exact sum, pulses `shift` mm deeper.
fn cole(points: &[Point], shift: f64) -> Vec<Vec<f64>> {
    let axial = axial();
    let [focal_x, focal_y] = beams(50.0);
    let mut lines = vec![vec![0.0; SAMPLES as usize]; LINES as usize];
    for &([x, y, z], amplitude) in points {
        let [lateral, elevation] = beams(z);
        let area = (focal_x * focal_y / (lateral * elevation)).sqrt();
        let slice = (-y * y / (2.0 * elevation * elevation)).exp();
        let first = ((z - 5.0 * axial) / PITCH) as usize;
        let last = ((z + 5.0 * axial) / PITCH) as usize + 2;
        for (l, line) in lines.iter_mut().enumerate() {
            let across = WIDTH * ((l as f64 + 0.5) / f64::from(LINES) - 0.5) - x;
            let beam = (-across * across / (2.0 * lateral * lateral)).exp();
            for (k, v) in line.iter_mut().enumerate().take(last).skip(first) {
                let along = k as f64 * PITCH - z - shift;
                let pulse = (-along * along / (2.0 * axial * axial)).exp();
                *v += amplitude * area * slice * beam * pulse * (WAVENUMBER * along).cos();
            }
        }
    }
    lines
}

/// The compared part.
fn shown(lines: &[Vec<f64>]) -> Vec<f64> {
    lines.iter().flat_map(|l| &l[SHOWN[0]..SHOWN[1]]).copied().collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

fn beside_cole(bench: &Bench, physics: Physics) -> Outcome {
    let shift = match physics {
        Physics::Right => 0.0,
        Physics::Planted => 0.5 * PITCH,
    };
    let mut out = Outcome::default();
    for (what, points) in [("points", targets()), ("scatterers", scatterers())] {
        let lines = cole(&points, shift);
        let exact = shown(&lines);
        let scene = scene(&points);
        let (from, to) = (SHOWN[0] + 420, SHOWN[0] + 520);
        let along = |line: &[f64]| (from..to).map(|k| [k as f64 * PITCH, line[k]]).collect();
        let mut curves = vec![Curve::line("sum over points", along(&lines[40]))];
        for (name, render) in &bench.renderers {
            let rf: Vec<Vec<f64>> = render(&scene).iq.iter().map(|l| remodulated(l)).collect();
            let got = shown(&rf);
            let correlation = dot(&got, &exact) / (dot(&got, &got) * dot(&exact, &exact)).sqrt();
            // One-sided: nothing correlates better than perfectly.
            let quantity = format!("{name}: correlation of {what}");
            out.compare(quantity, correlation, 1.0, 0.01);
            let level = 10.0 * (dot(&got, &got) / dot(&exact, &exact)).log10();
            out.compare(format!("{name}: level of {what}, dB"), level, 0.0, 0.05)
                .unlike("echoes one percent stronger", level + 20.0 * 1.01f64.log10());
            if *name == "bvh" {
                curves.push(Curve::dots("bvh", along(&rf[40])));
                out.pictures.push(magnitude(&format!("{what}: bvh"), &got));
                out.pictures.push(magnitude(&format!("{what}: sum over points"), &exact));
            }
        }
        let title = format!("Radio-frequency line of {what}");
        let axes = ["depth, mm", "pressure, perfect mirror = 1"];
        out.plots.push(Plot::linear(title, axes, curves));
    }
    out
}

/// Radio-frequency signal Re{IQ exp(i 4 pi f z / c)}.
fn remodulated(line: &[[f64; 2]]) -> Vec<f64> {
    let real = |(k, [re, im]): (usize, &[f64; 2])| {
        let (sin, cos) = (WAVENUMBER * k as f64 * PITCH).sin_cos();
        re * cos - im * sin
    };
    line.iter().enumerate().map(real).collect()
}

/// Radio-frequency magnitude over 50 dB: columns four pixels wide, rows of four samples' largest.
fn magnitude(title: &str, rf: &[f64]) -> Picture {
    let depth = SHOWN[1] - SHOWN[0];
    let top = rf.iter().fold(0.0, |m, v| f64::max(m, v.abs()));
    let mut grey = vec![];
    for row in 0..depth / 4 {
        for column in 0..4 * LINES as usize {
            let at = column / 4 * depth + 4 * row;
            let largest = rf[at..at + 4].iter().fold(1e-30, |m, v| f64::max(m, v.abs()));
            let level = 1.0 + 20.0 * (largest / top).log10() / 50.0;
            grey.push((255.0 * level.clamp(0.0, 1.0)) as u8);
        }
    }
    Picture { title: title.into(), width: 4 * LINES, grey }
}
