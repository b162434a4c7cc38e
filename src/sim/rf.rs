//! Radio-frequency (RF) lines, computed from the baseband of a frame.

use crate::probe::Probe;

/// Samples of the RF line per axial sample, so that its rate is at least four times f0.
pub fn oversampling(probe: &Probe) -> usize {
    let rate = probe.speed / (2.0 * probe.sample_pitch());
    (4.0 * probe.frequency / rate).ceil().max(1.0) as usize
}

/// RF lines from the complex baseband before the axial kernel ([L][K] pairs): the Gaussian kernel
/// is evaluated at the finer positions, so nothing is interpolated. Shape [L][K * factor].
pub(super) fn lines(
    probe: &Probe,
    sigma: f32,
    scanlines: usize,
    samples: usize,
    lateral: &[f32],
    factor: usize,
) -> Vec<f32> {
    let reach = (4.0 * sigma).ceil() as isize;
    let cycles = 2.0 * probe.frequency * probe.sample_pitch() / probe.speed;
    let mut out = Vec::with_capacity(scanlines * samples * factor);
    for l in 0..scanlines {
        for i in 0..samples * factor {
            let kappa = i as f64 / factor as f64;
            let centre = kappa.round() as isize;
            let first = (centre - reach).max(0);
            let last = (centre + reach).min(samples as isize - 1);
            let (mut re, mut im) = (0.0, 0.0);
            for j in first..=last {
                let weight = (-0.5 * ((kappa - j as f64) / f64::from(sigma)).powi(2)).exp();
                let at = 2 * (l * samples + j as usize);
                re += weight * f64::from(lateral[at]);
                im += weight * f64::from(lateral[at + 1]);
            }
            let phase = std::f64::consts::TAU * (cycles * kappa).fract();
            out.push((re * phase.cos() - im * phase.sin()) as f32);
        }
    }
    out
}
