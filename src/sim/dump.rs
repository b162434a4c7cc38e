//! Each stage by number and name, as arrays with their axes beside them.

use std::path::Path;

use serde_json::json;

use crate::npy::{self, Element};
use crate::probe::Probe;

/// One axis of a dumped array.
pub struct Axis {
    /// What it runs over.
    pub name: &'static str,
    /// Unit of `start` and `step`.
    pub unit: &'static str,
    /// Coordinate of the first entry.
    pub start: f64,
    /// Distance between entries.
    pub step: f64,
    /// Entries.
    pub size: usize,
}

/// Writes `NAME.npy` and its sidecar `NAME.json` (axes from slowest to fastest, meaning).
///
/// # Errors
/// What the file system says.
pub fn stage(
    dir: &Path,
    name: &str,
    meaning: &str,
    axes: &[Axis],
    data: &[f32],
) -> std::io::Result<()> {
    let shape: Vec<usize> = axes.iter().map(|axis| axis.size).collect();
    let path = dir.join(format!("{name}.npy"));
    npy::write(&path, Element::Float, &shape, bytemuck::cast_slice(data))?;
    sidecar(dir, name, meaning, axes)
}

/// Writes the sidecar `NAME.json` of a stage.
///
/// # Errors
/// What the file system says.
pub fn sidecar(dir: &Path, name: &str, meaning: &str, axes: &[Axis]) -> std::io::Result<()> {
    let axes: Vec<_> = axes
        .iter()
        .map(|a| json!({"name": a.name, "unit": a.unit, "start": a.start, "step": a.step, "size": a.size}))
        .collect();
    let text = serde_json::to_string_pretty(&json!({"meaning": meaning, "axes": axes}))
        .expect("plain JSON");
    std::fs::write(dir.join(format!("{name}.json")), text + "\n")
}

/// Samples of the RF line per axial sample, so that its rate is at least four times f0.
pub fn rf_oversampling(probe: &Probe) -> usize {
    let rate = probe.speed / (2.0 * probe.sample_pitch());
    (4.0 * probe.frequency / rate).ceil().max(1.0) as usize
}

/// RF lines from the complex baseband before the axial kernel ([L][K] pairs): the Gaussian kernel
/// is evaluated at the finer positions, so nothing is interpolated. Shape [L][K * factor].
pub fn rf(
    probe: &Probe,
    sigma: f32,
    lines: usize,
    samples: usize,
    lateral: &[f32],
    factor: usize,
) -> Vec<f32> {
    let reach = (4.0 * sigma).ceil() as isize;
    let cycles = 2.0 * probe.frequency * probe.sample_pitch() / probe.speed;
    let mut out = Vec::with_capacity(lines * samples * factor);
    for l in 0..lines {
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
