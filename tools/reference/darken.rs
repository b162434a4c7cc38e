//! Twin of `darken`: the acquired volume along the scanlines behind the simulated anatomy.

use super::aperture::{counted, loses_by_aperture, lost_of, nepers};
use super::shadow::{Piece, level};
use insonify::sim::layout::{Aperture, Frame};

/// Nepers lost at a level, limited as on main paths.
pub fn lost(level: f64) -> f64 {
    (-level).clamp(-lost_of(0.0), lost_of(0.0))
}

/// Mean over the layers of the two-way amplitude transmitted to sample `k` of scanline `l`, relative
/// to that in the tissue around the mask. `lines` are the pieces of each line, `shades` what `aperture` makes of them.
pub fn transmitted(
    frame: &Frame,
    lines: &[Vec<Piece>],
    shades: &[Aperture],
    l: u32,
    k: u32,
) -> f64 {
    let amplitudes = (0..frame.layers).map(|e| {
        let line = e * frame.scanlines + l;
        let level = level(&lines[line as usize], k.into());
        if !loses_by_aperture(frame) {
            return level.clamp(-80.0, 80.0).exp();
        }
        let lost = lost(level);
        let time = f64::from(k) * f64::from(frame.sample_pitch) / f64::from(frame.speed);
        (nepers(frame, counted(shades), line, time, lost) - lost).exp()
    });
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
