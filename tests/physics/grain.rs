//! Second-order statistics of speckle: the size of its grains, and its correlation under probe motion.

use glam::{DAffine3, DVec3};
use insonify::scene::Scene;
use insonify::settings::ScatterMode;
use insonify::sim::layout::LATERAL_REACH;

use crate::common::moments::{autocovariance, correlation, gaussian_fwhm, transposed};
use crate::physics::check::{Bench, Check, Curve, Outcome, Physics, Plot};
use crate::physics::profile::width;
use crate::physics::render::Frame;
use crate::physics::speckle::{DEPTHS, homogeneous, intensities, sigma_axial, sigma_lateral};

/// Check T12.
pub fn speckle_grains_are_as_large_as_the_point_spread_function() -> Check {
    Check {
        row: "T12",
        name: "speckle_grains_are_as_large_as_the_point_spread_function",
        claim: "The autocovariance of intensities is exp(-d^2 / 2 sigma^2), as wide as a point's echo at -6 dB: \
            2.355 sigma, axially and laterally. That of envelopes, which is the series \
            sum ((-1/2)_n / n!)^2 |gamma|^2n without its first term, is 3.7 % narrower.",
        planted: "Beams as wide as one way of theirs; pulses of a quarter less bandwidth.",
        run: |bench, physics| grains(bench, physics, 1),
    }
}

/// Full width at half maximum of an autocovariance, samples.
fn fwhm(half: &[f64]) -> f64 {
    // The rest of chance beyond the first fall under 10 % has no logarithm to fit.
    let end = half.iter().position(|v| *v < 0.1).unwrap_or(half.len());
    let right = &half[..end];
    let both: Vec<f64> = right[1..].iter().rev().chain(right).copied().collect();
    width(&both)
}

/// Covariance of Rayleigh envelopes whose complex samples correlate by gamma, over their variance; `x` = |gamma|^2
/// (Middleton 1960, An Introduction to Statistical Communication Theory, 9.1).
fn envelope_covariance(x: f64) -> f64 {
    let sum = |x: f64| {
        let (mut term, mut sum) = (1.0, 0.0);
        for n in 0..2000 {
            let n = f64::from(n);
            term *= ((n - 0.5) / (n + 1.0)).powi(2) * x;
            sum += term;
        }
        sum
    };
    sum(x) / sum(1.0)
}

/// Full width at half maximum of the envelope's covariance, in sigmas.
fn envelope_width() -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        if envelope_covariance(middle) < 0.5 {
            low = middle;
        } else {
            high = middle;
        }
    }
    2.0 * (-2.0 * f64::ln(low)).sqrt()
}

/// Tolerance, the table's; a frame has 3 000 to 40 000 grains, which make 1 %.
const SIZE: f64 = 0.05;

/// Distance between the scanlines that show lateral grains, mm: a third of the narrower beam's sigma.
const LINE_PITCH: f64 = 0.08;

/// Scanlines at either edge of the image that are left out of the lateral ones, as `beam` reaches over the edge from there: of a
/// beam that lies in part beside the image only the part within it is heard, so that grains of neighbours are more alike.
/// Over all 120 lines and sixteen seeds they are 2.7 % wider for it, by the sum over the cut beams 2.5 %.
const BESIDE: u32 = LATERAL_REACH as u32;

/// Axial and lateral size of grains with two beams and two pulses.
pub fn grains(bench: &Bench, physics: Physics, seed: u32) -> Outcome {
    let mut out = Outcome::default();
    let (name, render) = &bench.renderers[1];
    for bandwidth in [0.6, 0.4] {
        let mut truth = homogeneous(48, 1.0, seed);
        truth.probe.samples = 4096;
        truth.probe.bandwidth = bandwidth;
        let mut scene = truth.clone();
        if physics == Physics::Planted {
            scene.probe.bandwidth *= 0.75;
        }
        let rows = intensities(&render(&scene), &truth, DEPTHS, 1);
        let pitch = truth.probe.sample_pitch();
        compare(&mut out, name, "axially", &rows, pitch, sigma_axial(&truth));
    }
    for f_number in [2.0, 3.5] {
        let mut truth = homogeneous(120 + 2 * BESIDE, LINE_PITCH, seed);
        truth.probe.f_number_receive = f_number;
        let mut scene = truth.clone();
        if physics == Physics::Planted {
            scene.probe.f_number_receive *= std::f64::consts::SQRT_2;
        }
        let lines = intensities(&render(&scene), &truth, DEPTHS, 2);
        let whole = BESIDE as usize..lines.len() - BESIDE as usize;
        let rows = transposed(&lines[whole]);
        compare(&mut out, name, "laterally", &rows, LINE_PITCH, sigma_lateral(&truth, 60.0));
    }
    out
}

fn compare(out: &mut Outcome, name: &str, way: &str, rows: &[Vec<f64>], pitch: f64, sigma: f64) {
    let lags = (3.0 * sigma / pitch) as usize;
    let covariance = autocovariance(rows, lags);
    let expected = gaussian_fwhm() * sigma;
    let what = format!("{name}: grain of intensity {way}, sigma {sigma:.3}; mm");
    out.compare(what, fwhm(&covariance) * pitch, expected, SIZE * expected);
    let envelopes: Vec<Vec<f64>> =
        rows.iter().map(|r| r.iter().map(|v| v.sqrt()).collect()).collect();
    let measured = fwhm(&autocovariance(&envelopes, lags)) * pitch;
    let expected = envelope_width() * sigma;
    let what = format!("{name}: grain of envelope {way}, sigma {sigma:.3}; mm");
    out.compare(what, measured, expected, SIZE * expected);
    let at = |lag: usize| lag as f64 * pitch;
    let law = |lag| [at(lag), (-at(lag).powi(2) / (2.0 * sigma * sigma)).exp()];
    let measured = covariance.iter().enumerate().map(|(l, v)| [at(l), *v]);
    out.plots.push(Plot::linear(
        format!("Autocovariance of intensity {way}, sigma {sigma:.3} mm"),
        ["distance, mm", "covariance / variance"],
        vec![
            Curve::line("exp(-d^2 / 2 sigma^2)", (0..=lags).map(law).collect()),
            Curve::dots("measured", measured.collect()),
        ],
    ));
}

/// Check T13.
pub fn probe_motion_decorrelates_speckle_as_the_beam_overlaps() -> Check {
    Check {
        row: "T13",
        name: "probe_motion_decorrelates_speckle_as_the_beam_overlaps",
        claim: "In a world at rest, intensities before and after a lateral shift d of the probe correlate by \
            exp(-d^2 / 2 sigma^2), whichever way the lattice lies.",
        planted: "Scatterers looked up in a voxel grid at equal steps along the ray, which flicker.",
        run: |bench, physics| motion(bench, physics, 1),
    }
}

/// Shifts in sigmas.
const SHIFTS: [f64; 5] = [0.05, 0.5, 1.0, 1.5, 2.0];

/// Decorrelation by motion. The tolerance is the table's; 18 000 grains make 0.01, and beams that end at 2.5 sigma
/// overlap less at 2 sigma: 0.126 instead of 0.135.
pub fn motion(bench: &Bench, physics: Physics, seed: u32) -> Outcome {
    let mut out = Outcome::default();
    let (name, render) = &bench.renderers[1];
    let shifts = (0..=50).map(|i| f64::from(i) / 20.0);
    let mut curves =
        vec![Curve::line("exp(-d^2 / 2 sigma^2)", shifts.map(|d| [d, law(d)]).collect())];
    for degrees in [0.0f64, 17.0] {
        let mut scene = homogeneous(48, 1.0, seed);
        if physics == Physics::Planted {
            scene.simulation.scatter_mode = ScatterMode::Voxel;
        }
        let turn = DAffine3::from_rotation_y(degrees.to_radians())
            * DAffine3::from_rotation_x(0.3 * degrees.to_radians());
        let seen = |shift: f64| {
            let mut moved = scene.clone();
            moved.world_from_probe = turn * DAffine3::from_translation(shift * DVec3::X);
            flat(&render(&moved), &moved)
        };
        let still = seen(0.0);
        let sigma = sigma_lateral(&scene, 60.0);
        let mut points = Vec::new();
        for shift in SHIFTS {
            let measured = correlation(&still, &seen(shift * sigma));
            let what =
                format!("{name}: correlation after {shift} sigma, lattice at {degrees} degrees");
            out.compare(what, measured, law(shift), 0.05);
            points.push([shift, measured]);
        }
        curves.push(Curve::dots(format!("measured, lattice at {degrees} degrees"), points));
    }
    out.plots.push(Plot::linear(
        "Speckle left after a lateral shift of the probe",
        ["shift / sigma", "correlation of intensity"],
        curves,
    ));
    out
}

fn law(shift: f64) -> f64 {
    (-shift * shift / 2.0).exp()
}

fn flat(frame: &Frame, scene: &Scene) -> Vec<f64> {
    intensities(frame, scene, DEPTHS, 1).concat()
}

// The covariance of envelopes starts as a quarter of |gamma|^2 over 4 / pi - 1, and is half at 1.1337 sigma.
#[test]
fn the_envelopes_covariance_is_narrower() {
    let slope = envelope_covariance(1e-6) / 1e-6;
    assert!((slope - 0.25 / (4.0 / std::f64::consts::PI - 1.0)).abs() < 1e-3, "{slope}");
    let ratio = envelope_width() / (8.0 * std::f64::consts::LN_2).sqrt();
    assert!((ratio - 0.963).abs() < 0.001, "{ratio}");
}
