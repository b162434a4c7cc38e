//! Envelopes by the Hilbert transform.

use std::f64::consts::TAU;

/// Magnitude of the analytic signal of `signal`, by a plain DFT: positive frequencies doubled,
/// negative ones zero.
pub fn envelope(signal: &[f64]) -> Vec<f64> {
    let n = signal.len();
    let turn: Vec<(f64, f64)> = (0..n).map(|i| (TAU * i as f64 / n as f64).sin_cos()).collect();
    let spectrum: Vec<(f64, f64)> = (0..=n / 2)
        .map(|f| {
            let double = if f == 0 || 2 * f == n { 1.0 } else { 2.0 } / n as f64;
            let (mut re, mut im) = (0.0, 0.0);
            for (i, s) in signal.iter().enumerate() {
                let (sin, cos) = turn[f * i % n];
                re += s * cos;
                im -= s * sin;
            }
            (double * re, double * im)
        })
        .collect();
    (0..n)
        .map(|i| {
            let (mut re, mut im) = (0.0, 0.0);
            for (f, (a, b)) in spectrum.iter().enumerate() {
                let (sin, cos) = turn[f * i % n];
                re += a * cos - b * sin;
                im += a * sin + b * cos;
            }
            re.hypot(im)
        })
        .collect()
}
