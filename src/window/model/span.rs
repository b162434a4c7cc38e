//! Measurements in strips against time: two points of a strip, and what follows from them.

/// Two points of a strip: seconds, and mm of depth or mm/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// First point.
    pub from: [f64; 2],
    /// Second point.
    pub to: [f64; 2],
}

impl Span {
    /// Time between them, s, 0 or more.
    pub fn seconds(&self) -> f64 {
        (self.to[0] - self.from[0]).abs()
    }

    /// Depth, or velocity, between them, 0 or more.
    pub fn height(&self) -> f64 {
        (self.to[1] - self.from[1]).abs()
    }

    /// Events per minute, if they repeat after this time; none where no time lies between.
    pub fn per_minute(&self) -> Option<f64> {
        (self.seconds() > 0.0).then(|| 60.0 / self.seconds())
    }

    /// Change from the first point to the second over time: of depths the speed, mm/s, positive away from the probe, of
    /// velocities the acceleration, mm/s2. None where no time lies between.
    pub fn slope(&self) -> Option<f64> {
        let [seconds, change] = [self.to[0] - self.from[0], self.to[1] - self.from[1]];
        (seconds != 0.0).then(|| change / seconds)
    }

    /// Resistive index, if the first is the systolic peak of a velocity and the second the end of diastole; none of a first one
    /// at rest.
    pub fn resistive_index(&self) -> Option<f64> {
        let [systole, diastole] = [self.from[1], self.to[1]];
        (systole != 0.0).then(|| (systole - diastole) / systole)
    }
}

#[cfg(test)]
mod tests {
    use super::Span;

    #[test]
    fn spans_are_measured() {
        let span = Span { from: [1.0, 30.0], to: [1.8, 14.0] };
        assert!((span.seconds() - 0.8).abs() < 1e-12);
        assert_eq!(span.height(), 16.0);
        assert!((span.per_minute().unwrap() - 75.0).abs() < 1e-9);
        assert!((span.slope().unwrap() + 20.0).abs() < 1e-9);
        let still = Span { to: span.from, ..span };
        assert_eq!((still.per_minute(), still.slope()), (None, None));
        let beat = Span { from: [0.25, 800.0], to: [0.75, 200.0] };
        assert_eq!((beat.seconds(), beat.resistive_index()), (0.5, Some(0.75)));
        assert_eq!(beat.slope(), Some(-1200.0));
        let rest = Span { from: [0.2, 0.0], to: [0.2, 1.0] };
        assert_eq!((rest.slope(), rest.resistive_index()), (None, None));
    }
}
