//! How the speed of a flow changes over time.

use crate::scene::animation::Clock;

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
