//! The clock of a period: place in a period at the scene's time.

use super::EDGE;
use crate::settings::words;

words! {
    /// Behaviour after the end of a period.
    #[derive(Default)]
    pub enum Loop {
        /// The same period again.
        #[default]
        Repeat = "repeat",
        /// No change: the last state stays.
        Once = "once",
        /// The period backwards, then forwards again: a cycle lasts two periods.
        PingPong = "ping-pong",
    }
}

/// A clock that counts periods.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clock {
    /// Length of a period, s.
    pub period: f64,
    /// Place in the period at time 0, periods.
    pub phase: f64,
    /// Behaviour after the end of a period.
    pub mode: Loop,
    /// Updates per second, Hz; time stands still between them. None: always up to date.
    pub rate: Option<f64>,
}

impl Default for Clock {
    /// A period of one second, repeated.
    fn default() -> Self {
        Self { period: 1.0, phase: 0.0, mode: Loop::Repeat, rate: None }
    }
}

/// The time of the last update, s, of something that is updated `rate` times a second from time 0.
pub fn held(seconds: f64, rate: Option<f64>) -> f64 {
    match rate {
        Some(rate) => (seconds * rate + EDGE).floor() / rate,
        None => seconds,
    }
}

impl Clock {
    /// Place in the cycle at `seconds`, periods: 0 to 1, and on to 2 on the way back of
    /// [`Loop::PingPong`].
    pub fn position(&self, seconds: f64) -> f64 {
        let elapsed = held(seconds, self.rate) / self.period + self.phase;
        let cycle = match self.mode {
            Loop::Once => return elapsed.clamp(0.0, 1.0),
            Loop::Repeat => 1.0,
            Loop::PingPong => 2.0,
        };
        let position = elapsed.rem_euclid(cycle);
        match position > cycle - EDGE {
            true => 0.0,
            false => position,
        }
    }

    /// Share of the period that has passed at `seconds`, 0 to 1; it falls on the way back.
    pub fn fraction(&self, seconds: f64) -> f64 {
        let position = self.position(seconds);
        position.min(2.0 - position)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_mode_reaches_the_end_in_one_period_and_goes_its_way() {
        let clock = |mode| Clock { period: 4.0, mode, ..Clock::default() };
        for (mode, expected) in [
            (Loop::Repeat, [0.75, 0.0, 0.25, 0.0, 0.5, 0.75]),
            (Loop::Once, [0.0, 0.0, 0.25, 1.0, 1.0, 1.0]),
            (Loop::PingPong, [0.25, 0.0, 0.25, 1.0, 0.5, 0.25]),
        ] {
            let times = [-1.0, 0.0, 1.0, 4.0, 6.0, 7.0];
            let found = times.map(|t| clock(mode).fraction(t));
            assert_eq!(found, expected, "{mode:?}");
        }
    }

    #[test]
    fn the_phase_is_where_time_zero_stands() {
        let clock = Clock { period: 2.0, phase: 0.25, ..Clock::default() };
        assert_eq!(clock.fraction(0.0), 0.25);
        assert_eq!(clock.fraction(1.0), 0.75);
    }

    #[test]
    fn time_stands_between_updates_and_no_frame_is_late() {
        let rate = Some(30.0);
        assert_eq!(held(0.99 / 30.0, rate), 0.0);
        assert_eq!(held(-0.01, rate), -1.0 / 30.0);
        for i in 0..10_000 {
            // A tenth of a frame later the same is shown.
            let t = f64::from(i) / 30.0;
            let expected = f64::from(i) / 30.0;
            assert_eq!(held(t, rate), expected, "{i}");
            assert_eq!(held(t + 0.1 / 30.0, rate), expected, "{i}");
        }
        // 25 frames a second, written as such and summed up as a caller may: 0.04 s has no exact
        // binary value.
        let mut t = 0.0;
        for i in 0..1000 {
            assert_eq!(held(t, Some(25.0)), f64::from(i) / 25.0, "{i}");
            t += 0.04;
        }
    }

    #[test]
    fn a_period_that_ends_within_rounding_has_ended() {
        let clock = Clock { period: 0.8, ..Clock::default() };
        for beat in 1..100 {
            let t = (0..8 * beat).map(|_| 0.1).sum::<f64>();
            assert!(clock.fraction(t) < 1e-9, "{beat}: {}", clock.fraction(t));
        }
    }
}
