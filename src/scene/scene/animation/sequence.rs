//! The sequence of keyframes over time, and the shapes between them.

use super::EDGE;
use super::clock::{Clock, Loop};
use crate::settings::words;

words! {
    /// Interpolation of shapes between keyframes.
    #[derive(Default)]
    pub enum Interpolation {
        /// On the straight line between two.
        #[default]
        Linear = "linear",
        /// On the cubic through four whose velocity is continuous (Catmull and Rom 1974).
        Cubic = "cubic",
    }
}

/// Numbers of up to four keyframes and their weights, which sum to 1; unused ones weigh nothing.
pub type Blend = [(usize, f64); 4];

/// The order of keyframes over the periods of a clock.
#[derive(Clone, Debug, PartialEq)]
pub struct Sequence {
    clock: Clock,
    interpolation: Interpolation,
    /// Instants and keyframes over one cycle of the clock: periods from its begin, increasing.
    stations: Vec<(f64, usize)>,
    /// Length of the cycle where the first keyframe follows the last, periods.
    cycle: Option<f64>,
    count: usize,
}

impl Sequence {
    /// `count` keyframes, at least one, each for an equal time. Repeated, keyframe k of K stands at
    /// k/K of the period, and the first follows the last; played once, the last one stays. To and
    /// fro, keyframe k stands at k/(K-1), the first one at the begin and the last one at the end of
    /// the period.
    pub fn even(clock: Clock, count: usize, interpolation: Interpolation) -> Self {
        let steps = match clock.mode {
            Loop::PingPong => count.saturating_sub(1).max(1),
            Loop::Repeat | Loop::Once => count,
        };
        let times = (0..count).map(|k| k as f64 / steps as f64);
        Self::new(clock, times.collect(), interpolation, true)
    }

    /// Keyframes at these times from the begin of the period, s, increasing, within the period.
    /// The last one stays until its end, and the first one is there from its begin.
    pub fn timed(clock: Clock, times: &[f64], interpolation: Interpolation) -> Self {
        let times = times.iter().map(|t| t / clock.period).collect();
        Self::new(clock, times, interpolation, false)
    }

    fn new(clock: Clock, times: Vec<f64>, interpolation: Interpolation, closed: bool) -> Self {
        assert!(!times.is_empty(), "a sequence has a keyframe");
        let count = times.len();
        let mut stations: Vec<_> = times.into_iter().zip(0..).collect();
        if clock.mode == Loop::PingPong {
            let (first, last) = (stations[0].0, stations[count - 1].0);
            for k in (0..count).rev() {
                let back = 2.0 - stations[k].0;
                if back > last + EDGE && back < first + 2.0 - EDGE {
                    stations.push((back, k));
                }
            }
        }
        let cycle = match clock.mode {
            Loop::Once => None,
            Loop::Repeat => closed.then_some(1.0),
            Loop::PingPong => Some(2.0),
        };
        Self { clock, interpolation, stations, cycle, count }
    }

    /// Periods of the keyframes.
    pub fn clock(&self) -> &Clock {
        &self.clock
    }

    /// Number of keyframes.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Instant and keyframe of station `i`, which may lie before the first or behind the last one where
    /// these follow each other.
    fn station(&self, i: isize) -> Option<(f64, usize)> {
        let n = self.stations.len() as isize;
        let (time, keyframe) = self.stations[i.rem_euclid(n) as usize];
        match i.div_euclid(n) {
            0 => Some((time, keyframe)),
            turns => self.cycle.map(|cycle| (time + turns as f64 * cycle, keyframe)),
        }
    }

    /// Number of the last station that has been reached, -1 before the first.
    fn reached(&self, position: f64) -> isize {
        let passed = self.stations.partition_point(|s| s.0 <= position + EDGE);
        passed as isize - 1
    }

    /// The present keyframe at `seconds`.
    pub fn step(&self, seconds: f64) -> usize {
        let reached = self.reached(self.clock.position(seconds));
        self.station(reached).map_or(self.stations[0].1, |s| s.1)
    }

    /// The blend of keyframes at `seconds`.
    pub fn blend(&self, seconds: f64) -> Blend {
        let position = self.clock.position(seconds);
        let reached = self.reached(position);
        let (Some(here), Some(next)) = (self.station(reached), self.station(reached + 1)) else {
            return [(self.step(seconds), 1.0), (0, 0.0), (0, 0.0), (0, 0.0)];
        };
        let step = next.0 - here.0;
        let t = ((position - here.0) / step).clamp(0.0, 1.0);
        let weights = match self.interpolation {
            Interpolation::Linear => vec![(here.1, 1.0 - t), (next.1, t)],
            Interpolation::Cubic => {
                // Hermite's cubic; the slope at a station is that between its neighbours, which for
                // even times is Catmull and Rom's.
                let (t2, t3) = (t * t, t * t * t);
                let before = self.station(reached - 1).unwrap_or(here);
                let after = self.station(reached + 2).unwrap_or(next);
                let at_here = (t3 - 2.0 * t2 + t) * step / (next.0 - before.0);
                let at_next = (t3 - t2) * step / (after.0 - here.0);
                let value = 3.0 * t2 - 2.0 * t3;
                vec![
                    (here.1, 1.0 - value - at_next),
                    (next.1, value + at_here),
                    (before.1, -at_here),
                    (after.1, at_next),
                ]
            }
        };
        collect(&weights)
    }
}

/// Adds up the weights of equal keyframes; leaves out those without weight.
fn collect(weights: &[(usize, f64)]) -> Blend {
    let mut out = [(0, 0.0); 4];
    let mut used = 0;
    for &(keyframe, weight) in weights.iter().filter(|w| w.1 != 0.0) {
        match out[..used].iter_mut().find(|o| o.0 == keyframe) {
            Some(same) => same.1 += weight,
            None => {
                out[used] = (keyframe, weight);
                used += 1;
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn clock(mode: Loop) -> Clock {
        Clock { mode, ..Clock::default() }
    }

    fn steps(sequence: &Sequence, times: &[f64]) -> Vec<usize> {
        times.iter().map(|&t| sequence.step(t)).collect()
    }

    /// The value of a blend of keyframes whose shapes are these numbers.
    fn value(sequence: &Sequence, shapes: &[f64], t: f64) -> f64 {
        let blend = sequence.blend(t);
        let sum: f64 = blend.iter().map(|b| b.1).sum();
        assert!((sum - 1.0).abs() < 1e-12, "{blend:?}");
        blend.iter().map(|&(k, weight)| shapes[k] * weight).sum()
    }

    #[test]
    fn every_keyframe_has_its_turn() {
        let even = |mode| Sequence::even(clock(mode), 4, Interpolation::Linear);
        let times = [0.0, 0.24, 0.25, 0.5, 0.75, 0.99, 1.0, 1.3, 1.7, 1.99];
        let of = |mode| steps(&even(mode), &times);
        assert_eq!(of(Loop::Repeat), [0, 0, 1, 2, 3, 3, 0, 1, 2, 3]);
        assert_eq!(of(Loop::Once), [0, 0, 1, 2, 3, 3, 3, 3, 3, 3]);
        // In thirds: 0, 1, 2 forwards; 3 at the end, for a third; 2, 1 backwards.
        assert_eq!(of(Loop::PingPong), [0, 0, 0, 1, 2, 2, 3, 3, 1, 1]);
        assert_eq!(steps(&even(Loop::Once), &[-5.0]), [0]);
    }

    #[test]
    fn a_keyframe_is_never_late_by_rounding() {
        let sequence =
            Sequence::even(Clock { period: 0.8, ..Clock::default() }, 8, Interpolation::Linear);
        let mut t = 0.0;
        for i in 0..800 {
            assert_eq!(sequence.step(t), i % 8, "{i}");
            t += 0.1;
        }
    }

    #[test]
    fn at_its_time_a_keyframe_is_shown_whole() {
        for mode in [Loop::Repeat, Loop::Once, Loop::PingPong] {
            for interpolation in [Interpolation::Linear, Interpolation::Cubic] {
                let sequence = Sequence::even(clock(mode), 5, interpolation);
                for i in 0..20 {
                    let steps = if mode == Loop::PingPong { 4.0 } else { 5.0 };
                    let t = f64::from(i) / steps;
                    let blend = sequence.blend(t);
                    let nearest = blend.iter().max_by(|a, b| a.1.total_cmp(&b.1)).copied();
                    let (keyframe, weight) = nearest.expect("four");
                    assert_eq!(keyframe, sequence.step(t), "{mode:?} {t} {blend:?}");
                    assert!((weight - 1.0).abs() < 1e-9, "{mode:?} {t} {blend:?}");
                }
            }
        }
    }

    #[test]
    fn lines_join_neighbours_and_the_last_with_the_first() {
        let shapes = [0.0, 10.0, 4.0, 8.0];
        let of = |mode, t| {
            let sequence = Sequence::even(clock(mode), 4, Interpolation::Linear);
            value(&sequence, &shapes, t)
        };
        for (mode, t, expected) in [
            (Loop::Repeat, 0.125, 5.0),
            (Loop::Repeat, 0.875, 4.0),
            (Loop::Once, 0.875, 8.0),
            (Loop::Once, 7.0, 8.0),
            (Loop::PingPong, 0.5, 7.0),
            (Loop::PingPong, 1.5, 7.0),
            (Loop::PingPong, 1.0 + 1.0 / 6.0, 6.0),
        ] {
            let found = of(mode, t);
            assert!((found - expected).abs() < 1e-12, "{mode:?} {t}: {found}");
        }
    }

    #[test]
    fn even_cubics_are_catmull_and_roms() {
        let shapes = [0.0, 10.0, 4.0, 8.0, -3.0];
        let sequence = Sequence::even(clock(Loop::Repeat), 5, Interpolation::Cubic);
        for (segment, t) in [(0, 0.3), (1, 0.5), (3, 0.9), (4, 0.25)] {
            let [a, b, c, d] = [4, 0, 1, 2].map(|offset: usize| shapes[(segment + offset) % 5]);
            // Catmull and Rom's matrix, tension one half.
            let expected = 0.5
                * (2.0 * b
                    + (c - a) * t
                    + (2.0 * a - 5.0 * b + 4.0 * c - d) * t * t
                    + (3.0 * b - a - 3.0 * c + d) * t * t * t);
            let found = value(&sequence, &shapes, (segment as f64 + t) / 5.0);
            assert!((found - expected).abs() < 1e-9, "{segment} {t}: {found} {expected}");
        }
    }

    #[test]
    fn own_times_are_kept_and_a_cubic_passes_a_line_at_any_spacing() {
        let times = [0.5, 1.0, 3.0, 3.5];
        let own = |mode, interpolation| {
            let clock = Clock { period: 4.0, ..clock(mode) };
            Sequence::timed(clock, &times, interpolation)
        };
        let linear = own(Loop::Repeat, Interpolation::Linear);
        let all = [0.0, 0.4, 0.9, 1.0, 2.9, 3.2, 3.9, 4.2];
        assert_eq!(steps(&linear, &all), [0, 0, 0, 1, 1, 2, 3, 0]);
        // Shapes equal to their times: held before the first and after the last.
        let cubic = own(Loop::Once, Interpolation::Cubic);
        for t in [0.0, 0.5, 0.7, 1.0, 1.9, 3.1, 3.5, 3.8] {
            let expected = f64::clamp(t, 0.5, 3.5);
            assert!((value(&linear, &times, t) - expected).abs() < 1e-12, "{t}");
            assert!((value(&cubic, &times, t) - expected).abs() < 1e-12, "{t}");
        }
        // The way back mirrors the way forward, and both turning points hold.
        let fro = own(Loop::PingPong, Interpolation::Linear);
        for t in [0.2, 0.7, 2.2, 3.4, 3.9] {
            let (out, back) = (value(&fro, &times, t), value(&fro, &times, 8.0 - t));
            assert!((out - back).abs() < 1e-12, "{t}: {out} {back}");
        }
        assert_eq!(fro.step(4.2), 3);
        assert_eq!(fro.step(7.8), 0);
    }

    #[test]
    fn few_keyframes_do_not_disturb() {
        for mode in [Loop::Repeat, Loop::Once, Loop::PingPong] {
            for interpolation in [Interpolation::Linear, Interpolation::Cubic] {
                let one = Sequence::even(clock(mode), 1, interpolation);
                assert_eq!((one.step(0.7), one.blend(0.7)[0]), (0, (0, 1.0)), "{mode:?}");
                let two = Sequence::even(clock(mode), 2, interpolation);
                for i in 0..30 {
                    let found = value(&two, &[2.0, 6.0], f64::from(i) / 10.0);
                    assert!((2.0 - 1e-9..=6.0 + 1e-9).contains(&found), "{mode:?} {found}");
                }
            }
        }
    }
}
