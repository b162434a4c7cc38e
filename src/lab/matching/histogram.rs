//! Histogram of grey levels: means that are robust against a few outliers and against clipping.

/// Classes over 0..1. With a dynamic range of 60 dB a class is 0.015 dB.
const CLASSES: usize = 4096;

/// Number of values by class of 0..=1; values beyond count at the ends.
#[derive(Clone)]
pub(super) struct Histogram {
    counts: Vec<u32>,
    total: u64,
}

impl Default for Histogram {
    fn default() -> Self {
        Self { counts: vec![0; CLASSES], total: 0 }
    }
}

impl Histogram {
    pub fn add(&mut self, value: f32) {
        // The cast turns NaN and negative values into 0.
        let class = (value * CLASSES as f32) as usize;
        self.counts[class.min(CLASSES - 1)] += 1;
        self.total += 1;
    }

    pub fn total(&self) -> u64 {
        self.total
    }

    /// Mean of the middle half of the values. It ignores the quarter at either end, whose values may be
    /// clipped or outliers. None where a quarter or more lies in the first class or in the last,
    /// whose values may be anything.
    pub fn midmean(&self) -> Option<f64> {
        let end = |class: usize| 4 * u64::from(self.counts[class]) >= self.total;
        if self.total == 0 || end(0) || end(CLASSES - 1) {
            return None;
        }
        Some(self.middle(&Self::default(), 0.0))
    }

    /// Like [`Self::midmean`], for values that are not clipped at the ends: differences. Those of `beyond`
    /// are only known to be larger than the value at which they are counted, by an exponential amount of mean
    /// `tail`.
    pub fn middle(&self, beyond: &Self, tail: f64) -> f64 {
        let total = (self.total + beyond.total) as f64;
        let (from, to) = (0.25 * total, 0.75 * total);
        // The part of an exponential amount that reaches into the next class.
        let kept = match tail > 0.0 {
            true => (-1.0 / (tail * CLASSES as f64)).exp(),
            false => 0.0,
        };
        let (mut below, mut sum, mut pending) = (0.0, 0.0, 0.0);
        let counts = self.counts.iter().zip(&beyond.counts);
        for (class, (&known, &least)) in counts.enumerate() {
            pending += f64::from(least);
            let above = below + f64::from(known) + (1.0 - kept) * pending;
            pending *= kept;
            let used = (above.min(to) - f64::max(below, from)).max(0.0);
            sum += used * (class as f64 + 0.5);
            below = above;
        }
        sum / (to - from).max(f64::MIN_POSITIVE) / CLASSES as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_middle_half_is_averaged_whatever_lies_at_the_ends() {
        let mut plain = Histogram::default();
        let mut clipped = Histogram::default();
        for i in 0..1000 {
            let v = 0.3 + 0.4 * i as f32 / 1000.0;
            plain.add(v);
            // A fifth at either end is clipped.
            clipped.add(match i {
                0..200 => 0.0,
                800.. => 1.0,
                _ => v,
            });
        }
        // Tolerance: half a class.
        assert!((plain.midmean().expect("some") - 0.5).abs() < 2e-4);
        assert_eq!(plain.midmean(), clipped.midmean());
    }

    #[test]
    fn values_of_which_only_a_bound_is_known_are_spread_above_it() {
        let (mut known, mut beyond) = (Histogram::default(), Histogram::default());
        for _ in 0..1000 {
            known.add(0.1);
            beyond.add(0.2);
        }
        // All known: half of each. The lower half of an exponential tail of mean t above 0.2 has the
        // mean 0.2 + t (1 - ln 2).
        let tail = 0.05;
        let expected = (0.1 + 0.2 + tail * (1.0 - 2f64.ln())) / 2.0;
        let found = known.middle(&beyond, tail);
        // Tolerance: a class.
        assert!((found - expected).abs() < 2.5e-4, "{found} {expected}");
        let without = known.middle(&beyond, 0.0);
        assert!((without - 0.15).abs() < 2.5e-4, "{without}");
    }

    #[test]
    fn too_much_is_clipped() {
        let mut values = Histogram::default();
        assert_eq!(values.midmean(), None, "nothing");
        (0..30).for_each(|_| values.add(0.0));
        (0..70).for_each(|i| values.add(0.2 + 0.001 * i as f32));
        assert_eq!(values.midmean(), None, "30 of 100 are black");
        (0..30).for_each(|_| values.add(0.5));
        assert!(values.midmean().is_some(), "30 of 130 are");
    }
}
