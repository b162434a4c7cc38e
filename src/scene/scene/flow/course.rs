//! How the speed of a flow changes over time.

use crate::scene::animation::Clock;

/// The rate of flow through a common carotid artery over a heartbeat, which begins at the end of diastole, over its mean, as a
/// Fourier series: factors of cosine and sine of each harmonic. They are fitted to the inflow of the benchmark of
/// the common carotid artery of Boileau et al. 2015 (Int. J. Numer. Meth. Biomed. Engng. 31, e02732; 6.5 ml/s in the
/// mean, 13.3 at its height, 3.8 at its least), which they leave by no more than 0.6 % of its height.
const CAROTID: [[f64; 2]; 10] = [
    [-0.012, 0.507],
    [-0.274, 0.113],
    [-0.175, -0.131],
    [0.024, -0.100],
    [0.014, -0.050],
    [0.051, -0.029],
    [0.032, 0.012],
    [0.021, 0.011],
    [0.002, 0.029],
    [0.001, 0.006],
];
/// The length of that heartbeat, s.
pub const CAROTID_PERIOD: f64 = 1.1;
/// Knots of that heartbeat: ten for each turn of the fastest harmonic.
const CAROTID_KNOTS: u32 = 100;

/// Knots of the waveform of a common carotid artery, of which the largest is 1. The vessel is taken to be as wide at all
/// times, so that speeds are as rates of flow.
pub fn carotid() -> Vec<[f64; 2]> {
    let rate = |share: f64| {
        let turns = CAROTID.iter().zip(1..).map(|([a, b], harmonic)| {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(harmonic) * share).sin_cos();
            a * cos + b * sin
        });
        1.0 + turns.sum::<f64>()
    };
    let knots = (0..=CAROTID_KNOTS).map(|i| f64::from(i) / f64::from(CAROTID_KNOTS));
    let mut knots: Vec<[f64; 2]> = knots.map(|share| [share, rate(share)]).collect();
    let largest = knots.iter().fold(0.0, |most, knot| f64::max(most, knot[1]));
    knots.iter_mut().for_each(|knot| knot[1] /= largest);
    knots
}

/// The speed over time, of which the largest is usually 1. Below zero it flows back.
#[derive(Clone, Debug, PartialEq)]
pub enum Course {
    /// Always 1.
    Steady,
    /// Again and again the same.
    Pulsatile(
        /// One period.
        Pulse,
    ),
}

/// One period of a speed: linear between its knots.
#[derive(Clone, Debug, PartialEq)]
pub struct Pulse {
    clock: Clock,
    /// Place in the period, 0 to 1, and speed.
    knots: Vec<[f64; 2]>,
    /// For each knot the integral of the speed up to it, over the period.
    sums: Vec<f64>,
}

impl Course {
    /// The course that repeats `knots`, places in the period from 0 to 1 that increase, each with a speed.
    ///
    /// # Panics
    /// With fewer than two knots.
    pub fn pulsatile(clock: Clock, knots: Vec<[f64; 2]>) -> Self {
        assert!(knots.len() >= 2, "a period has two ends");
        let mut sums = vec![0.0];
        for ends in knots.windows(2) {
            let [[from, a], [to, b]] = [ends[0], ends[1]];
            sums.push(sums[sums.len() - 1] + (to - from) * a.midpoint(b));
        }
        Self::Pulsatile(Pulse { clock, knots, sums })
    }

    /// The speed at `seconds`.
    pub fn at(&self, seconds: f64) -> f64 {
        match self {
            Self::Steady => 1.0,
            Self::Pulsatile(pulse) => {
                let at = seconds / pulse.clock.period + pulse.clock.phase;
                pulse.value(at - at.floor())
            }
        }
    }

    /// The integral of the speed from time 0 to `seconds`, s.
    pub fn way(&self, seconds: f64) -> f64 {
        match self {
            Self::Steady => seconds,
            Self::Pulsatile(pulse) => {
                let Clock { period, phase, .. } = pulse.clock;
                period * (pulse.integral(seconds / period + phase) - pulse.integral(phase))
            }
        }
    }

    /// The largest speed, whatever its direction.
    pub fn largest(&self) -> f64 {
        match self {
            Self::Steady => 1.0,
            Self::Pulsatile(pulse) => {
                pulse.knots.iter().fold(0.0, |most, k| f64::max(most, k[1].abs()))
            }
        }
    }
}

impl Pulse {
    /// The knots before and behind a place in the period.
    fn part(&self, at: f64) -> usize {
        let behind = self.knots.partition_point(|knot| knot[0] <= at);
        behind.clamp(1, self.knots.len() - 1) - 1
    }

    fn value(&self, at: f64) -> f64 {
        let i = self.part(at);
        let [[from, a], [to, b]] = [self.knots[i], self.knots[i + 1]];
        let t = ((at - from) / (to - from)).clamp(0.0, 1.0);
        a + t * (b - a)
    }

    /// The integral from the beginning of a period to a place in it or in another one.
    fn integral(&self, at: f64) -> f64 {
        let whole = at.floor();
        let on = at - whole;
        let i = self.part(on);
        let [from, a] = self.knots[i];
        let part = self.sums[i] + (on - from) * a.midpoint(self.value(on));
        whole * self.sums[self.sums.len() - 1] + part
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Figures of the published curve: mean, height and least 6.5, 13.30 and 3.80 ml/s, its height at 0.18 of the beat, the
    /// dicrotic notch at 0.41 with 5.89 ml/s and the wave behind it at 0.475 with 6.46.
    #[test]
    fn the_carotid_waveform_is_the_published_one() {
        let beat = Course::pulsatile(Clock::default(), carotid());
        let off = |share: f64, expected: f64| (beat.at(share) - expected / 13.30).abs();
        assert!((beat.way(1.0) - 6.5 / 13.30).abs() < 0.005, "{}", beat.way(1.0));
        assert_eq!(beat.largest(), 1.0);
        for (share, rate) in
            [(0.0, 4.52), (0.0505, 3.80), (0.182, 13.30), (0.414, 5.89), (0.475, 6.46), (0.8, 4.42)]
        {
            assert!(off(share, rate) < 0.01, "{share}: {} {rate}", 13.30 * beat.at(share));
        }
        // An error planted: a tenth of a heartbeat late, or the slowest half of the series alone, which misses the notch.
        assert!(off(0.282, 13.30) > 0.01 && off(0.151, 3.80) > 0.01);
        assert!((beat.at(0.0) - beat.at(1.0 - 1e-9)).abs() < 1e-6, "it closes");
    }
}
