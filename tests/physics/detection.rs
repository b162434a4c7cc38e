//! The envelope.

use std::f64::consts::{PI, TAU};

use crate::physics::check::{Bench, Check, Curve, Outcome, Physics, Plot};
use crate::physics::hilbert::envelope;
use crate::physics::scenes::{add_point, linear, silent};

/// Depth (mm) and amplitude of a row of points, some closer than a pulse is long, all near the focus.
const ECHOES: [(f64, f64); 9] = [
    (49.0, 1.0),
    (49.11, 0.8),
    (49.43, -0.5),
    (49.9, 0.2),
    (50.313, 1.0),
    (50.331, -1.0),
    (51.0, 0.7),
    (51.11, 0.7),
    (51.22, 0.7),
];

/// Envelope by the Hilbert transform of the echoes' radio-frequency scanline: pulses
/// exp(-t^2 / 2 sigma^2) cos(2 pi f t) sampled every `pitch` mm of depth from `start` on. `n` samples, periodic.
fn hilbert([start, pitch]: [f64; 2], n: usize, frequency: f64) -> Vec<f64> {
    let sigma = 1.540 / 2.0 * (2.0 * std::f64::consts::LN_2).sqrt() / (PI * 0.6 * 7.0);
    let pulse =
        |z: f64| (-z * z / (2.0 * sigma * sigma)).exp() * (2.0 * TAU * frequency * z / 1.540).cos();
    let line: Vec<f64> = (0..n)
        .map(|k| ECHOES.iter().map(|(z, a)| a * pulse(start + k as f64 * pitch - z)).sum())
        .collect();
    envelope(&line)
}

/// Check T26.
pub fn the_baseband_envelope_is_the_hilbert_envelope() -> Check {
    Check {
        row: "T26",
        name: "the_baseband_envelope_is_the_hilbert_envelope",
        claim: "The magnitude of the complex baseband is the envelope of the radio-frequency line by \
            the Hilbert transform, here of echoes closer together than a pulse is long, at fs = 9 f0, \
            where the line is well sampled and the split over two samples hardly shows. 1 % of the \
            largest echo: the pulse at zero frequency, exp(-(2 pi f sigma)^2 / 2) = 4e-4, and the \
            split's varying width.",
        planted: "A carrier of 7.2 instead of 7 MHz: echoes interfere differently.",
        run: envelopes,
    }
}

fn envelopes(bench: &Bench, physics: Physics) -> Outcome {
    let mut scene = linear(1, 1.0, silent(1.540, 1.600, 0.0));
    scene.probe.samples = 8192;
    // A long focus: points are equally bright over the few millimetres.
    scene.probe.f_number_transmit = 20.0;
    let pitch: f64 = 100.0 / 8192.0;
    for (z, amplitude) in ECHOES {
        add_point(&mut scene, [0.0, 0.0, z], 0.1 * amplitude);
    }
    let frequency = match physics {
        Physics::Right => 7.0,
        Physics::Planted => 7.2,
    };
    let (first, n) = ((45.0 / pitch).round() as usize, 1024);
    let expected = hilbert([first as f64 * pitch, pitch], n, frequency);
    let largest = expected.iter().copied().fold(0.0, f64::max);
    let place = |i: usize| (first + i) as f64 * pitch;
    let shown = |v: &[f64]| -> Vec<[f64; 2]> {
        let near = |i: &usize| (48.6..51.6).contains(&place(*i));
        (0..n).filter(near).map(|i| [place(i), v[i]]).collect()
    };
    let mut curves = vec![Curve::line("Hilbert transform", shown(&expected))];
    let mut out = Outcome::default();
    for (name, render) in &bench.renderers {
        let got = &render(&scene).envelope(0)[first..first + n];
        // The level of points is tested elsewhere: one factor for the whole scanline.
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
        let scale = dot(got, &expected) / dot(got, got);
        let got: Vec<f64> = got.iter().map(|g| scale * g).collect();
        let pairs = got.iter().zip(&expected);
        let worst = pairs.map(|(g, e)| (g - e).abs()).fold(0.0, f64::max) / largest;
        let what = format!("{name}: largest difference of envelopes, of the largest echo");
        out.compare(what, worst, 0.0, 0.01);
        if *name == "bvh" {
            curves.push(Curve::dots("bvh", shown(&got)));
        }
    }
    out.plots.push(Plot::linear(
        "Nine echoes, some closer together than a pulse is long",
        ["depth, mm", "envelope"],
        curves,
    ));
    out
}
