//! Twin of `darken`: the acquired volume along the scanlines behind the simulated anatomy.

use super::shadow::{Piece, level};
use insonify::sim::layout::Frame;

/// Mean over the layers of the two-way amplitude transmitted to sample `k` of scanline `l`, relative
/// to that in the tissue around the mask. `lines` are the pieces of each line.
pub fn transmitted(frame: &Frame, lines: &[Vec<Piece>], l: u32, k: u32) -> f64 {
    let line = |e: u32| &lines[(e * frame.scanlines + l) as usize];
    let amplitudes = (0..frame.layers).map(|e| level(line(e), k.into()).clamp(-80.0, 80.0).exp());
    amplitudes.sum::<f64>() / f64::from(frame.layers)
}

/// Grey level of the volume behind a transmitted amplitude of `transmitted`; nothing is brightened.
pub fn level_behind(frame: &Frame, grey: f32, transmitted: f64) -> f64 {
    let decibels = 20.0 * transmitted.clamp(1e-30, 1.0).log10();
    match grey > 0.0 {
        true => (f64::from(grey) + decibels * f64::from(frame.inverse_range)).max(0.0),
        false => 0.0,
    }
}
