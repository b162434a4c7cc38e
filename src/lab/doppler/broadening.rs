//! Broadening of spectra: the width that one velocity has, and how far the edge of a spectrum lies beyond the fastest velocity by it.

use crate::probe::Probe;
use crate::settings::{Spectral, Wave};

/// Half of the width of a spectrum at half of its weighted mean, and how far its edge lies beyond the fastest velocity, both over the
/// deviation of a line: of velocities that are equally frequent between two ends, each a Gaussian line. The first is one velocity
/// alone. (Compared with the integral by a test.)
const BEYOND: [[f64; 2]; 15] = [
    [1.442, 1.442],
    [1.457, 1.207],
    [1.502, 1.002],
    [1.578, 0.828],
    [1.685, 0.685],
    [1.821, 0.571],
    [1.982, 0.482],
    [2.361, 0.361],
    [2.787, 0.287],
    [3.238, 0.238],
    [4.178, 0.178],
    [6.118, 0.118],
    [10.071, 0.071],
    [20.035, 0.035],
    [40.018, 0.018],
];
/// Times that a corrected edge is put into its own correction: each changes it by a hundredth of the last.
const TIMES: usize = 3;

/// Deviation of the line that a velocity makes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Broadening {
    /// That by the time in which scatterers cross the point-spread function, over the velocity.
    pub transit: f64,
    /// That by the length of the window, mm/s.
    pub window: f64,
}

impl Broadening {
    /// The broadening of spectra with these settings, for flow at the angle that they state, in the image's plane. `scales` are
    /// those of `imaging.psf_scale`.
    ///
    /// Echoes correlate by exp(-T^2 / 4 sum v_i^2 / sigma_i^2) (T41): the line's deviation is
    /// sqrt(sum v_i^2 / sigma_i^2) / (2 sqrt 2 pi) Hz. The mean over the gate lengthens the point-spread function by the gate's own
    /// deviation; a continuous wave has no length. Hann's window has a deviation of 1 / (sqrt 3 T) Hz.
    pub fn of(probe: &Probe, scales: [f64; 3], spectral: &Spectral) -> Self {
        // mm/s of velocity along the scanline for each Hz.
        let scale = probe.speed / probe.frequency / 2.0;
        let along = (probe.sigma_axial() * scales[0]).hypot(spectral.gate / 12.0_f64.sqrt());
        let along = match spectral.wave {
            Wave::Pulsed => along.recip(),
            Wave::Continuous => 0.0,
        };
        let across = probe.sigma_lateral(spectral.depth) * scales[1];
        let crossing = along.hypot(spectral.angle.tan() / across);
        let window = 1.0 / (3.0_f64.sqrt() * spectral.window);
        Self {
            transit: scale * crossing / (2.0 * std::f64::consts::SQRT_2 * std::f64::consts::PI),
            window: scale * window / spectral.angle.cos(),
        }
    }

    /// Deviation of the line of a velocity, mm/s.
    fn deviation(&self, velocity: f64) -> f64 {
        (self.transit * velocity).hypot(self.window)
    }

    /// Half of the width of a spectrum between two edges of one sign, over the deviation of a line in its middle.
    pub(super) fn half_width(&self, [inner, outer]: [f64; 2]) -> f64 {
        (outer - inner).abs() / 2.0 / self.deviation(f64::midpoint(inner, outer))
    }

    /// The fastest velocity of a spectrum with this outer edge and half width.
    pub(super) fn fastest(&self, outer: f64, half_width: f64) -> f64 {
        let beyond = beyond(half_width);
        (0..TIMES).fold(outer, |found, _| {
            let less = beyond * self.deviation(found);
            outer.signum() * (outer.abs() - less).max(0.0)
        })
    }
}

/// The part of a deviation by which the edge of a spectrum of this half width lies beyond the fastest velocity.
fn beyond(half_width: f64) -> f64 {
    let [narrowest, _] = BEYOND[0];
    if half_width <= narrowest {
        // Narrower than one line, by chance: its middle.
        return half_width.max(0.0);
    }
    let pair = BEYOND.windows(2).find(|pair| half_width <= pair[1][0]);
    pair.map_or(0.0, |pair| {
        let [[w0, b0], [w1, b1]] = [pair[0], pair[1]];
        b0 + (b1 - b0) * (half_width - w0) / (w1 - w0)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The spectrum of velocities between -2 `half` and 0, with lines of deviation 1, by the midpoint rule.
    fn spectrum(half: f64, at: f64) -> f64 {
        let line = |x: f64| (-x * x / 2.0).exp() / std::f64::consts::TAU.sqrt();
        let parts = (half * 40.0).ceil().max(1.0) as usize;
        let step = 2.0 * half / parts as f64;
        (0..parts).map(|n| line(at + (n as f64 + 0.5) * step)).sum::<f64>() / parts as f64
    }

    #[test]
    fn the_table_is_that_of_flat_spectra_with_gaussian_lines() {
        let halves =
            [0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 2.0, 2.5, 3.0, 4.0, 6.0, 10.0, 20.0, 40.0];
        for (half, [width, beyond]) in halves.into_iter().zip(BEYOND) {
            let step = 0.02;
            let places = (0..).map(|n| -2.0 * half - 7.0 + step * f64::from(n));
            let squares: f64 =
                places.take_while(|x| *x < 7.0).map(|x| spectrum(half, x).powi(2) * step).sum();
            let (mut low, mut high) = (-half, 7.0);
            for _ in 0..40 {
                let middle = f64::midpoint(low, high);
                match spectrum(half, middle) > squares / 2.0 {
                    true => low = middle,
                    false => high = middle,
                }
            }
            assert!((low - beyond).abs() < 2e-3, "{half}: {low} {beyond}");
            assert!((half + low - width).abs() < 2e-3, "{half}: {width}");
        }
    }

    #[test]
    fn a_fast_velocity_is_found_below_the_edge_that_lines_put_beyond_it() {
        let lines = Broadening { transit: 0.1, window: 5.0 };
        for fastest in [300.0_f64, -300.0] {
            // One velocity alone, and half of the range.
            for (half, [_, beyond]) in [(0.0, BEYOND[0]), (2.5, BEYOND[8])] {
                let deviation = lines.deviation(fastest);
                let outer = fastest + fastest.signum() * beyond * deviation;
                let found = lines.fastest(outer, half + beyond);
                assert!((found / fastest - 1.0).abs() < 1e-3, "{found} of {fastest}");
            }
        }
        // Without broadening nothing is taken off.
        assert_eq!(Broadening::default().fastest(250.0, f64::INFINITY), 250.0);
    }
}
