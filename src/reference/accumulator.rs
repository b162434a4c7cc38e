//! Complex baseband accumulators, filled as the kernels fill theirs and once more without rounding.

use std::f64::consts::TAU;

use crate::sim::layout::Frame;

/// Fixed-point values are clamped to this magnitude.
const LIMIT: f64 = (1u32 << 30) as f64;

/// Sums over echoes for every scanline and sample: index 2 (l K + k) + {0: real, 1: imaginary}.
#[derive(Clone, Debug, PartialEq)]
pub struct Accumulator {
    /// Sum of amplitude times scale, not rounded.
    pub exact: Vec<f64>,
    /// Sum of the rounded terms: what the device holds where it rounds each deposit likewise.
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

/// Rounding to the nearest unit.
pub const NEAREST: [f64; 4] = [0.5; 4];

/// Fixed point as the device rounds it; also whether it was clamped.
fn to_fixed(scaled: f64, dither: f64) -> (i64, bool) {
    let rounded = (scaled + dither).floor();
    (rounded.clamp(-LIMIT, LIMIT) as i64, rounded.abs() > LIMIT)
}

impl Accumulator {
    /// All zero, sized for `frame`.
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

    /// Sample that owns one-way time `time`: floor, clamped into the line.
    pub fn sample(&self, time: f64) -> usize {
        (self.kappa(time).floor() as i64).clamp(0, self.samples - 1) as usize
    }

    /// One echo of `amplitude` at one-way time `time` (us) on scanline `l`, turned by `phase` (rad)
    /// beyond the carrier and split linearly over two samples; `gain` is per sample and includes the
    /// fixed-point scale. `dither` is added before rounding down: real and imaginary part of the first
    /// sample, then of the second. Echoes at no finite time are lost.
    pub fn deposit(
        &mut self,
        l: u32,
        time: f64,
        amplitude: f64,
        phase: f64,
        gain: impl Fn(usize) -> f64,
        dither: [f64; 4],
    ) {
        let kappa = self.kappa(time);
        if !kappa.is_finite() {
            return;
        }
        let turns = 2.0 * self.frequency * time;
        let (sin, cos) = (phase - TAU * (turns - turns.floor())).sin_cos();
        let k = kappa.floor() as i64;
        let f = kappa - kappa.floor();
        for (i, (k, share)) in [(k, 1.0 - f), (k + 1, f)].into_iter().enumerate() {
            if !(0..self.samples).contains(&k) {
                continue;
            }
            let at = l as usize * self.samples as usize + k as usize;
            let scaled = share * amplitude * gain(k as usize);
            self.deposits[at] += 1;
            for (part, value) in [scaled * cos, scaled * sin].into_iter().enumerate() {
                let (fixed, clamped) = to_fixed(value, dither[2 * i + part]);
                self.exact[2 * at + part] += value;
                self.fixed[2 * at + part] += fixed;
                self.saturated += u32::from(clamped);
            }
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

    /// Largest difference between the accumulator and echoes (l, k real, amplitude) summed in place.
    fn worst(exact: &[f64], echoes: &[(usize, f64, f64)]) -> f64 {
        let mut expected = vec![0.0; 32];
        for &(l, kappa, amplitude) in echoes {
            let time = kappa * 0.25 / 1.5;
            let k = kappa.floor() as usize;
            let angle = -2.0 * TAU * 5.0 * time;
            for (k, share) in [(k, 1.0 - kappa.fract()), (k + 1, kappa.fract())] {
                if k < 8 {
                    expected[2 * (8 * l + k)] += amplitude * share * angle.cos();
                    expected[2 * (8 * l + k) + 1] += amplitude * share * angle.sin();
                }
            }
        }
        let pairs = exact.iter().zip(&expected);
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn echoes_are_summed_where_their_time_says() {
        let echoes = [
            (0, 2.25, 1.0),
            (0, 2.75, 0.5),
            (1, 7.5, 2.0),
            (1, 0.0, -1.0),
        ];
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
        assert!(
            worst(&overwritten.exact, &echoes) > 0.1,
            "overwriting is caught"
        );
        assert_eq!(sum.deposits.iter().sum::<u32>(), 7, "sample 8 is outside");
    }

    #[test]
    fn fixed_point_rounds_each_term_and_reports_clamping() {
        let mut a = Accumulator::new(&frame());
        a.deposit(0, 0.0, 0.4, 0.0, |_| 1.0, NEAREST);
        a.deposit(0, 0.0, 0.4, 0.0, |_| 1.0, NEAREST);
        assert_eq!((a.fixed[0], a.saturated), (0, 0));
        assert!((a.exact[0] - 0.8).abs() < 1e-15);
        a.deposit(0, 0.0, -2e9, 0.0, |_| 1.0, NEAREST);
        assert_eq!((a.fixed[0], a.saturated), (-(1 << 30), 1));
    }
}
