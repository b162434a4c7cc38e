//! The side of a body along the beam: as wide as the beam is.

use std::f64::consts::FRAC_2_SQRT_PI;

use glam::{DAffine3, DVec3};
use insonify::scene::Scene;

use crate::check::{Bench, Check, Curve, Outcome, Physics, Plot};
use crate::contrast::region;
use crate::moments::{mean, signal_to_noise};
use crate::scenes::{add_box, silent};
use crate::speckle::{homogeneous, sigma_lateral};

/// Check T14.
pub fn a_border_along_the_beam_is_as_wide_as_the_beam() -> Check {
    Check {
        row: "T14",
        name: "a_border_along_the_beam_is_as_wide_as_the_beam",
        claim: "Across the side of an anechoic body, along the beam, mean intensity falls as the part of a Gaussian \
            beam that lies outside: 1/2 erfc(x / sigma), from 90 to 10 % over 1.81 sigma, 0.77 of the full width at \
            half of the intensity's lateral autocovariance, 2.355 sigma. 20 %, of which chance makes 5 %.",
        planted: "Lines that take the tissue from their axes alone: a border one scanline sharp.",
        run: borders,
    }
}

/// Depths, mm, between which lines are averaged: inside the body.
const DEPTHS: [f64; 2] = [32.0, 88.0];
const SEEDS: u32 = 6;
/// From 90 to 10 % of erfc(x) / 2.
const FALL: f64 = 1.812;

/// Speckle beside a silent body that begins at x = 0 and has the same impedance and speed: no surface echoes, nothing
/// refracts.
fn beside_a_body(pitch: f64, f_number: f64, seed: u32) -> Scene {
    let mut scene = homogeneous((8.0 / pitch) as u32, pitch, seed);
    scene.probe.f_number_receive = f_number;
    let at = DAffine3::from_translation(DVec3::new(25.0, 5.3, 25.0));
    add_box(&mut scene, [50.0, 50.0, 70.0], silent(1.540, 1.630, 0.0), at);
    scene
}

/// erfc(x) / 2: by Simpson's rule of its derivative.
fn outside(x: f64) -> f64 {
    const STEPS: u32 = 200;
    let end = x.clamp(-4.0, 4.0);
    let step = end / f64::from(STEPS);
    let term = |i: u32| {
        let factor =
            [1.0, 4.0, 2.0][if i == 0 || i == STEPS { 0 } else { 1 + (i as usize + 1) % 2 }];
        factor * (-(f64::from(i) * step).powi(2)).exp()
    };
    let erf = FRAC_2_SQRT_PI * (0..=STEPS).map(term).sum::<f64>() * step / 3.0;
    (1.0 - erf) / 2.0
}

/// Deviation of the beam whose fall, wherever it lies, is nearest to the points (place, share of the power).
fn fitted(points: &[[f64; 2]]) -> f64 {
    let misfit = |sigma: f64, at: f64| {
        points.iter().map(|[x, power]| (power - outside((x - at) / sigma)).powi(2)).sum::<f64>()
    };
    let best = |sigma: f64| {
        (-20..=20).map(|i| misfit(sigma, 0.02 * f64::from(i))).fold(f64::INFINITY, f64::min)
    };
    let sigmas = (1..=120).map(|i| 0.01 * f64::from(i));
    sigmas.min_by(|a, b| best(*a).total_cmp(&best(*b))).expect("some")
}

fn borders(bench: &Bench, physics: Physics) -> Outcome {
    let mut out = Outcome::default();
    let (name, render) = &bench.renderers[1];
    let mut curves = Vec::new();
    for (pitch, f_number) in [(0.1, 2.0), (0.25, 2.0), (0.25, 4.0)] {
        let mut lines = Vec::new();
        let mut tissue = Vec::new();
        for seed in 0..SEEDS {
            let scene = beside_a_body(pitch, f_number, seed);
            let frame = render(&scene);
            tissue.extend(region(&frame, &scene, [-4.0, -1.5], DEPTHS));
            lines.resize((8.0 / pitch) as usize, [0.0; 2]);
            for (l, line) in (0..).zip(&mut lines) {
                let x = scene.probe.ray(l, 0).0.x;
                line[0] = x;
                line[1] +=
                    mean(&region(&frame, &scene, [x - 0.01, x + 0.01], DEPTHS)) / f64::from(SEEDS);
            }
        }
        let whole = mean(&tissue);
        let points: Vec<[f64; 2]> = lines.iter().map(|[x, power]| [*x, power / whole]).collect();
        let mut near: Vec<[f64; 2]> =
            points.iter().copied().filter(|[x, _]| x.abs() < 2.0).collect();
        if physics == Physics::Planted {
            near.iter_mut().for_each(|point| point[1] = f64::from(point[0] < 0.0));
        }
        let scene = beside_a_body(pitch, f_number, 0);
        let sigma = sigma_lateral(&scene, 60.0);
        let what = format!("{name}: from 90 to 10 %, lines {pitch} mm apart, F/{f_number}; mm");
        out.compare(what, FALL * fitted(&near), FALL * sigma, 0.2 * FALL * sigma);
        let what =
            format!("{name}: mean / deviation beside it, lines {pitch} mm apart, F/{f_number}");
        let envelopes: Vec<f64> = tissue.iter().map(|i| i.sqrt()).collect();
        out.compare(what, signal_to_noise(&envelopes), 1.913, 0.05)
            .unlike("that of intensities", 1.0);
        curves.push(Curve::line(
            format!("1/2 erfc(x / sigma), F/{f_number}"),
            (-40..=40).map(|i| 0.05 * f64::from(i)).map(|x| [x, outside(x / sigma)]).collect(),
        ));
        curves.push(Curve::dots(format!("lines {pitch} mm apart, F/{f_number}"), near));
    }
    let axes = ["lateral position, mm", "mean intensity"];
    out.plots.push(Plot::linear("The side of an anechoic body", axes, curves));
    out
}

#[test]
fn the_fall_is_that_of_tables() {
    // Abramowitz and Stegun, table 7.1: erf(0.9) = 0.7969082, erf(0.5) = 0.5204999.
    for (x, erf) in [(0.9, 0.796_908_2), (0.5, 0.520_499_9), (-0.5, -0.520_499_9), (0.0, 0.0)] {
        assert!((outside(x) - (1.0 - erf) / 2.0).abs() < 1e-6, "{x}: {}", outside(x));
    }
    assert!((outside(FALL / 2.0) - 0.1).abs() < 1e-4);
}
