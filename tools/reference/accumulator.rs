//! Complex baseband accumulators, filled as in the kernels, and a second time without rounding.

use std::f64::consts::TAU;

use insonify::sim::layout::{Frame, SAMPLE_BLEND};

/// Fixed-point values are clamped to this magnitude.
const LIMIT: f64 = (1u32 << 30) as f64;

/// Sums over echoes for every scanline and sample: index 2 (l K + k) + {0: real, 1: imaginary}.
#[derive(Clone, Debug, PartialEq)]
pub struct Accumulator {
    /// Sum of amplitude times scale, not rounded.
    pub exact: Vec<f64>,
    /// Sum of the rounded terms: the device's value if it rounds each deposit in the same way.
    pub fixed: Vec<i64>,
    /// Deposits that reached each (l, k): their number bounds the rounding, half a unit each.
    pub deposits: Vec<u32>,
    /// Terms that were clamped.
    pub saturated: u32,
    samples: i64,
    speed: f64,
    pitch: f64,
    frequency: f64,
}

/// Dither that rounds to the nearest unit.
pub const NEAREST: [f64; 8] = [0.5; 8];

/// Shares of four samples in an echo that lies `f` behind the second of them, 0 to 1, by the cubic through
/// them. They keep the echo's centre, its width and its symmetry.
fn shares(f: f64) -> [f64; 4] {
    let (behind, ahead) = (1.0 - f, 2.0 - f);
    [
        -f * behind * ahead / 6.0,
        (1.0 + f) * behind * ahead / 2.0,
        (1.0 + f) * f * ahead / 2.0,
        -(1.0 + f) * f * behind / 6.0,
    ]
}

/// Fixed point, rounded as on the device; and true if it was clamped.
fn to_fixed(scaled: f64, dither: f64) -> (i64, bool) {
    let rounded = (scaled + dither).floor();
    (rounded.clamp(-LIMIT, LIMIT) as i64, rounded.abs() > LIMIT)
}

impl Accumulator {
    /// An accumulator for `frame`, all zero.
    pub fn new(frame: &Frame) -> Self {
        let size = frame.scanlines as usize * frame.samples as usize;
        Self {
            exact: vec![0.0; 2 * size],
            fixed: vec![0; 2 * size],
            deposits: vec![0; size],
            saturated: 0,
            samples: frame.samples.into(),
            speed: frame.speed.into(),
            pitch: frame.sample_pitch.into(),
            frequency: frame.frequency.into(),
        }
    }

    /// Fractional sample of one-way time `time`, us.
    pub fn kappa(&self, time: f64) -> f64 {
        self.speed * time / self.pitch
    }

    /// The sample of one-way time `time`: floor, clamped into the line.
    pub fn sample(&self, time: f64) -> usize {
        (self.kappa(time).floor() as i64).clamp(0, self.samples - 1) as usize
    }

    /// Adds one echo of `amplitude` at one-way time `time` (us) on scanline `l`, turned by `phase` (rad)
    /// beyond the carrier and shared by four samples; `gain` is per sample and includes the
    /// fixed-point scale. `dither` is added before rounding down: real and imaginary part of the first
    /// sample, then of the next ones. Echoes at a time that is not finite are lost.
    pub fn deposit(
        &mut self,
        l: u32,
        time: f64,
        amplitude: f64,
        phase: f64,
        gain: impl Fn(usize) -> f64,
        dither: [f64; 8],
    ) {
        let kappa = self.kappa(time);
        if !kappa.is_finite() {
            return;
        }
        let angle = phase + self.angle(time);
        let before = kappa.floor();
        for (i, share) in shares(kappa - before).into_iter().enumerate() {
            let k = before as i64 + i as i64 - 1;
            self.add(l, k, share * amplitude, angle, &gain, [dither[2 * i], dither[2 * i + 1]]);
        }
    }

    /// Adds one echo to the nearest sample, with the phase of its own time: the sum of many echoes, which lie anywhere
    /// between samples, is as fine as the pulse. Within [`SAMPLE_BLEND`] of the middle between
    /// two samples each gets a share, so that rounding of the place has little effect.
    pub fn deposit_nearest(
        &mut self,
        l: u32,
        time: f64,
        amplitude: f64,
        gain: impl Fn(usize) -> f64,
    ) {
        let kappa = self.kappa(time);
        if kappa.is_finite() {
            let before = kappa.floor();
            let beyond = (kappa - before - 0.5) / f64::from(SAMPLE_BLEND);
            let first = (0.5 - beyond).clamp(0.0, 1.0);
            for (k, share) in [(before, first), (before + 1.0, 1.0 - first)] {
                if share > 0.0 {
                    let angle = self.angle(time);
                    self.add(l, k as i64, share * amplitude, angle, &gain, [0.5; 2]);
                }
            }
        }
    }

    /// Phase of the two-way carrier at one-way time `time`, rad.
    fn angle(&self, time: f64) -> f64 {
        let turns = 2.0 * self.frequency * time;
        -TAU * (turns - turns.floor())
    }

    fn add(
        &mut self,
        l: u32,
        k: i64,
        amplitude: f64,
        angle: f64,
        gain: &impl Fn(usize) -> f64,
        dither: [f64; 2],
    ) {
        if !(0..self.samples).contains(&k) {
            return;
        }
        let at = l as usize * self.samples as usize + k as usize;
        let scaled = amplitude * gain(k as usize);
        self.deposits[at] += 1;
        let (sin, cos) = angle.sin_cos();
        for (part, value) in [scaled * cos, scaled * sin].into_iter().enumerate() {
            let (fixed, clamped) = to_fixed(value, dither[part]);
            self.exact[2 * at + part] += value;
            self.fixed[2 * at + part] += fixed;
            self.saturated += u32::from(clamped);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame() -> Frame {
        Frame {
            scanlines: 2,
            samples: 8,
            speed: 1.5,
            sample_pitch: 0.25,
            frequency: 5.0,
            ..Frame::default()
        }
    }

    /// Largest difference between the accumulator and the direct sum of echoes (l, k real, amplitude).
    fn worst(exact: &[f64], echoes: &[(usize, f64, f64)]) -> f64 {
        let mut expected = vec![0.0; 32];
        for &(l, kappa, amplitude) in echoes {
            let time = kappa * 0.25 / 1.5;
            let angle = -2.0 * TAU * 5.0 * time;
            // Lagrange's cubic through the four samples about it.
            let four = [-1.0, 0.0, 1.0, 2.0].map(|i| kappa.floor() + i);
            for k in four {
                let others = four.into_iter().filter(|&o| o != k);
                let share: f64 = others.map(|o| (kappa - o) / (k - o)).product();
                if (0.0..8.0).contains(&k) {
                    let at = 2 * (8 * l + k as usize);
                    expected[at] += amplitude * share * angle.cos();
                    expected[at + 1] += amplitude * share * angle.sin();
                }
            }
        }
        let pairs = exact.iter().zip(&expected);
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn echoes_are_summed_where_their_time_says() {
        let echoes = [(0, 2.25, 1.0), (0, 2.75, 0.5), (1, 7.4, 2.0), (1, 0.0, -1.0)];
        let mut sum = Accumulator::new(&frame());
        let mut overwritten = Accumulator::new(&frame());
        for (l, kappa, amplitude) in echoes {
            let time = kappa * 0.25 / 1.5;
            sum.deposit(l as u32, time, amplitude, 0.0, |_| 1.0, NEAREST);
            let mut one = Accumulator::new(&frame());
            one.deposit(l as u32, time, amplitude, 0.0, |_| 1.0, NEAREST);
            for (to, &from) in overwritten.exact.iter_mut().zip(&one.exact) {
                if from != 0.0 {
                    *to = from;
                }
            }
        }
        // Phases of a few turns in f64: rounding is below 1e-14.
        assert!(worst(&sum.exact, &echoes) < 1e-12);
        assert!(worst(&overwritten.exact, &echoes) > 0.1, "overwriting is caught");
        assert_eq!(sum.deposits.iter().sum::<u32>(), 13, "samples -1, 8 and 9 are outside");
    }

    // Four points on a cubic reproduce any cubic: all moments up to the third are the echo's own.
    #[test]
    fn shares_keep_an_echo_s_centre_and_neither_widen_it_nor_make_it_lean() {
        for f in [0.0, 0.1, 0.3, 0.5, 0.99] {
            let moment = |n: i32| -> f64 {
                let places = [-1.0, 0.0, 1.0, 2.0].into_iter();
                places.zip(shares(f)).map(|(k, s)| s * (k - f).powi(n)).sum()
            };
            assert!((moment(0) - 1.0).abs() < 1e-14);
            assert!((1..4).all(|n| moment(n).abs() < 1e-14), "{f}");
            // The linear split widens by f (1 - f).
            let linear: f64 = (1.0 - f) * f * f + f * (1.0 - f).powi(2);
            assert!(!(0.05..0.95).contains(&f) || linear > 0.05);
        }
    }

    #[test]
    fn the_nearest_sample_gets_all_with_the_phase_of_the_echo_s_own_time() {
        let mut a = Accumulator::new(&frame());
        let time = 2.4 * 0.25 / 1.5;
        a.deposit_nearest(0, time, 3.0, |_| 1.0);
        let angle = -2.0 * TAU * 5.0 * time;
        assert!((a.exact[4] - 3.0 * angle.cos()).abs() < 1e-12);
        assert!((a.exact[5] - 3.0 * angle.sin()).abs() < 1e-12);
        assert_eq!(a.deposits.iter().sum::<u32>(), 1);
        // From one sample to the next its share goes without a step.
        let blend = f64::from(SAMPLE_BLEND);
        for (off, later) in [(-0.51, 0.0), (-0.25, 0.25), (0.0, 0.5), (0.25, 0.75), (0.51, 1.0)] {
            let mut a = Accumulator::new(&frame());
            a.deposit_nearest(0, (2.5 + off * blend) * 0.25 / 1.5, 1.0, |_| 1.0);
            let [first, second] = [4, 6].map(|at| a.exact[at].hypot(a.exact[at + 1]));
            assert!((first + later - 1.0).abs() < 1e-12 && (second - later).abs() < 1e-12);
        }
    }

    #[test]
    fn fixed_point_rounds_each_term_and_reports_clamping() {
        let mut a = Accumulator::new(&frame());
        a.deposit_nearest(0, 0.0, 0.4, |_| 1.0);
        a.deposit_nearest(0, 0.0, 0.4, |_| 1.0);
        assert_eq!((a.fixed[0], a.saturated), (0, 0));
        assert!((a.exact[0] - 0.8).abs() < 1e-15);
        a.deposit_nearest(0, 0.0, -2e9, |_| 1.0);
        assert_eq!((a.fixed[0], a.saturated), (-(1 << 30), 1));
    }
}
