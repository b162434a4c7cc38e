//! Strips of scatterers: which part of the beam's width a scanline hears itself, and which part `beam` adds by smoothing over
//! its neighbours.
//!
//! A scatterer `x` beside a line is heard by the lines l with the amplitude K(l - x) = sum_j g(l - j) w(j - x). w is the
//! strip's: a trapezoid of height 1, or a Gaussian where the beam is narrower than what lines could share. g are the weights
//! of `beam`, chosen such that speckle of neighbouring lines is as alike as that of two Gaussian beams a pitch apart.

use std::f64::consts::PI;
use std::sync::LazyLock;

use super::{Calibration, autocorrelation, lateral_taps};
use crate::layout::{LATERAL_REACH, LEAST_PITCH, STRIP_CUT};
use crate::settings::ScatterMode;
use crate::special::erf;

/// Loss of likeness between two images half a pitch apart, beyond that of a Gaussian beam, up to which neighbouring lines need
/// not share scatterers: a strip with abrupt edges loses 1 / (16 s^2), s the beam's deviation in pitches, and one that shares
/// the part b of them (1 - b) times that.
const UNLIKENESS: f64 = 0.005;
/// Least part of a strip that is shared: rounding of a scatterer's place must not decide which line hears it.
const LEAST_SHARED: f64 = 0.125;
/// Deviation of the beam, in pitches, from which on K is a Gaussian as far as speckle tells, if it has its variance.
const SMOOTH: f64 = 2.0;
/// Deviations of the beam below that for which the smoothing is found; between two it is interpolated.
const STEPS: usize = 64;

/// The core of a strip that is a narrow Gaussian beam's.
const NARROW: f64 = -1.0;

/// The strip of a scanline at a depth. Lengths in pitches of the scanlines there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Strip {
    /// Half its width.
    pub half: f64,
    /// Share of its width that is heard whole; to its edges the rest falls linearly. Below 0: the strip is a Gaussian of
    /// [`STRIP_CUT`] deviations to its edges.
    pub core: f64,
    /// Deviation of the Gaussian by which `beam` smooths over lines; 0: it does not.
    pub smoothing: f64,
}

impl Strip {
    /// The strip for a two-way beam of deviation `sigma`, in pitches.
    pub fn new(sigma: f64) -> Self {
        if sigma * sigma <= 1.0 / 6.0 {
            // Narrower than what two lines would share.
            return Self { half: f64::from(STRIP_CUT) * sigma, core: NARROW, smoothing: 0.0 };
        }
        let smoothing = if sigma < SMOOTH {
            found(sigma)
        } else {
            (smoothed(sigma) - (1.0 + shared(sigma).powi(2)) / 12.0).sqrt()
        };
        Self::smoothed_by(sigma, smoothing)
    }

    /// The strip for a beam of deviation `sigma` of which `beam` adds this smoothing: the convolution of a box of one pitch
    /// with one as wide as neighbouring lines share; where `beam` does not reach over the beam, both are wider.
    fn smoothed_by(sigma: f64, smoothing: f64) -> Self {
        let missing = 6.0 * (sigma * sigma - smoothed(sigma));
        let (p, q) = ((1.0 + missing).sqrt(), (shared(sigma).powi(2) + missing).sqrt());
        Self { half: (p + q) / 2.0, core: (p - q) / (p + q), smoothing }
    }

    /// The amplitude with which a scatterer is heard by the line `x` pitches beside it, before `beam`.
    pub fn share(&self, x: f64) -> f64 {
        let off = x.abs() / self.half;
        match self.core < 0.0 {
            _ if off >= 1.0 => 0.0,
            true => (-(f64::from(STRIP_CUT) * off).powi(2) / 2.0).exp(),
            false => ((1.0 - off) / (1.0 - self.core)).min(1.0),
        }
    }

    /// Integral of the product of the strip and itself `lag` pitches aside: of boxes of widths p and q, p + q = 2 half,
    /// of which the trapezoid is the convolution over q, the fourth difference of |x|^3 / 12.
    fn product(&self, lag: f64) -> f64 {
        if self.core < 0.0 {
            // Nothing is smoothed: only its own square counts.
            debug_assert!(lag == 0.0 || self.smoothing == 0.0);
            let sigma = self.half / f64::from(STRIP_CUT);
            return PI.sqrt() * sigma * erf(f64::from(STRIP_CUT));
        }
        let (p, q) = (self.half * (1.0 + self.core), self.half * (1.0 - self.core));
        // Second differences by p and by q: shifts and their factors.
        let ways = |step: f64| [(-step, 1.0), (0.0, -2.0), (step, 1.0)];
        let mut sum = 0.0;
        for (a, m) in ways(p) {
            for (b, n) in ways(q) {
                sum += m * n * (lag + a + b).abs().powi(3);
            }
        }
        sum / (12.0 * q * q)
    }

    /// Integral of the square of what a line hears itself of scatterers, over their distance.
    pub fn own_energy(&self) -> f64 {
        self.product(0.0)
    }

    /// Integral of K^2 over the distance of scatterers.
    pub fn energy(&self) -> f64 {
        self.together(0)
    }

    /// Integral of the product of K and itself `lines` aside, over the distance of scatterers.
    fn together(&self, lines: i64) -> f64 {
        let taps = lateral_taps(self.smoothing);
        // Farther apart neither two strips nor two of their smoothings meet.
        let reach = ((2.0 * self.half).ceil() as i64).min(2 * taps.len() as i64 + lines.abs());
        let lag = |m: i64| autocorrelation(&taps, m.unsigned_abs() as usize);
        (-reach..=reach).map(|m| lag(m + lines) * self.product(m as f64)).sum()
    }
}

/// Part of the scatterers that neighbouring lines share.
fn shared(sigma: f64) -> f64 {
    (1.0 - 16.0 * UNLIKENESS * sigma * sigma).clamp(LEAST_SHARED, 1.0)
}

/// The part of the variance of a beam of deviation `sigma` that strips of one pitch and `beam` have, which smooths by a third
/// of its reach at most; all of it but near that.
fn smoothed(sigma: f64) -> f64 {
    let most = f64::from(LATERAL_REACH) / 3.0;
    sigma * sigma * (1.0 + (sigma / most).powi(8)).powf(-0.25)
}

/// The smoothing for a beam of deviation `sigma` below [`SMOOTH`], in pitches.
fn found(sigma: f64) -> f64 {
    static FOUND: LazyLock<Vec<f64>> =
        LazyLock::new(|| (0..=STEPS).map(|i| search(step(i))).collect());
    let least = step(0);
    let at = (sigma - least) / (SMOOTH - least) * STEPS as f64;
    let below = (at as usize).min(STEPS - 1);
    let share = at - below as f64;
    FOUND[below] * (1.0 - share) + FOUND[below + 1] * share
}

fn step(i: usize) -> f64 {
    let least = (1.0_f64 / 6.0).sqrt();
    least + (SMOOTH - least) * i as f64 / STEPS as f64
}

/// The same by halving: neighbouring lines are the more alike, the more is smoothed.
fn search(sigma: f64) -> f64 {
    let wanted = (-1.0 / (4.0 * sigma * sigma)).exp();
    let (mut low, mut high) = (0.0, sigma);
    for _ in 0..40 {
        let middle = (low + high) / 2.0;
        let strip = Strip::smoothed_by(sigma, middle);
        if strip.together(1) < wanted * strip.energy() { low = middle } else { high = middle }
    }
    high
}

impl Calibration<'_> {
    /// The strip of a scanline at depth `z`.
    pub fn strip(&self, z: f64) -> Strip {
        let sigma = self.sigma_lateral(z) / self.pitch(z);
        match self.scene.simulation.scatter_mode {
            ScatterMode::Lattice => Strip::new(sigma),
            // A line looks up its own axis.
            ScatterMode::Voxel => Strip { half: 0.5, core: 0.0, smoothing: self.lateral_lines(z) },
        }
    }

    /// Distance between scanlines at depth `z`, mm; those of a phased array meet at 0.
    pub fn pitch(&self, z: f64) -> f64 {
        self.scene.probe.line_pitch(z).max(f64::from(LEAST_PITCH))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// K at the distance `x`.
    fn heard(strip: &Strip, x: f64) -> f64 {
        let taps = lateral_taps(strip.smoothing);
        let last = taps.len() as i32 - 1;
        (-last..=last)
            .map(|j| taps[j.unsigned_abs() as usize] * strip.share(x - f64::from(j)))
            .sum()
    }

    const STEP: f64 = 1.0 / 64.0;

    fn integral(strip: &Strip, of: impl Fn(f64, f64) -> f64) -> f64 {
        let end = strip.half + 17.0;
        let count = (2.0 * end / STEP) as i32;
        (0..count)
            .map(|i| (f64::from(i) + 0.5) * STEP - end)
            .map(|x| of(x, heard(strip, x)))
            .sum::<f64>()
            * STEP
    }

    const SIGMAS: [f64; 12] = [0.1, 0.3, 0.4, 0.45, 0.55, 0.7, 1.0, 1.7, 2.6, 4.0, 5.3, 30.0];

    #[test]
    fn what_a_line_hears_is_as_wide_as_the_beam_and_has_the_energy_that_is_said() {
        for sigma in SIGMAS {
            let strip = Strip::new(sigma);
            let whole = integral(&strip, |_, k| k);
            let deviation = (integral(&strip, |x, k| x * x * k) / whole).sqrt();
            // A Gaussian cut at three deviations has 1.4 % less deviation, at two and a half 4.5 %; where a strip is as wide
            // as the beam, K is less round than a Gaussian, and for the same likeness of lines as much as a tenth wider.
            let ratio = deviation / sigma;
            assert!((0.95..1.1).contains(&ratio), "{sigma}: {ratio}");
            assert!(ratio < 1.02 || (0.42..0.8).contains(&sigma), "{sigma}: {ratio}");
            let energy = integral(&strip, |_, k| k * k);
            assert!(
                (strip.energy() / energy - 1.0).abs() < 2e-3,
                "{sigma}: {} {energy}",
                strip.energy()
            );
            let own = integral(&strip, |x, _| strip.share(x).powi(2));
            assert!((strip.own_energy() / own - 1.0).abs() < 2e-3, "{sigma}");
        }
    }

    /// Speckle that moves by a part of the pitch stays as like itself as a Gaussian beam would leave it. Planted: strips with
    /// abrupt edges.
    #[test]
    fn a_small_step_costs_as_much_likeness_as_that_of_a_gaussian_beam() {
        let worst = |strip: &Strip, sigma: f64| {
            let whole = integral(strip, |_, k| k * k);
            let likeness = |step: f64| integral(strip, |x, k| k * heard(strip, x + step)) / whole;
            let off = |step: f64| likeness(step) - (-step * step / (4.0 * sigma * sigma)).exp();
            [0.125, 0.25, 0.5, 1.0].map(|step| off(step).abs()).into_iter().fold(0.0, f64::max)
        };
        for sigma in SIGMAS.into_iter().filter(|&sigma| sigma > 0.42) {
            let off = worst(&Strip::new(sigma), sigma);
            println!("{sigma}: {off:.4}");
            assert!(off < 0.015, "{sigma}: {off}");
        }
        let sigma = 0.55_f64;
        let abrupt = Strip { half: 0.5, core: 0.99, smoothing: found(sigma) };
        assert!(worst(&abrupt, sigma) > 0.03, "{}", worst(&abrupt, sigma));
    }

    #[test]
    fn a_scatterer_between_lines_is_heard_as_much_as_one_on_a_line() {
        for sigma in SIGMAS.into_iter().filter(|&sigma| sigma > 0.42) {
            let strip = Strip::new(sigma);
            let sum = |x: f64| (-40..=40).map(|l| strip.share(x - f64::from(l))).sum::<f64>();
            let off = (sum(0.3) / sum(0.0) - 1.0).abs();
            // Boxes that are a little wider than a pitch do not quite meet.
            let allowed = if sigma < 2.0 { 1e-3 } else { 0.1 };
            assert!(off < allowed, "{sigma}: {off}");
        }
    }
}
