//! Fetal movement: bursts of small displacements and rotations between pauses.

use std::ops::Range;

use glam::{DAffine3, DVec3};

use super::clock::held;
use super::motion::Turn;

/// Mean length of one movement of a burst, s. Startles last about a second (de Vries, Visser and
/// Prechtl 1982, "The emergence of fetal behaviour. I. Qualitative aspects", Early Human Development
/// 7, 301-322), and isolated arm movements follow each other about one second apart (the same, 1985,
/// "II. Quantitative aspects", Early Human Development 12, 99-120).
const STROKE: f64 = 1.0;

/// Random movement without drift: a node goes from one random pose to the next in bursts, and rests
/// between bursts. All poses lie within the amplitudes.
///
/// Bursts come at irregular times, as general movements do (de Vries et al. 1985). Each consists of
/// several movements, and each of these starts and ends at rest, with least jerk (Flash and Hogan
/// 1985, "The coordination of arm movements", Journal of Neuroscience 5, 1688-1703), so that
/// velocity and acceleration are continuous.
///
/// Time is divided into slots of `pause` plus `duration`, with one burst somewhere in each. So the pose at
/// any time, also before 0, is found at once, in any order, and depends on the seed alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fetal {
    /// Seed that determines all movements.
    pub seed: u32,
    /// Largest shift along each axis, to either side, mm.
    pub translation: DVec3,
    /// Largest rotation, to either side.
    pub turn: Turn,
    /// Mean length of a burst, s.
    pub duration: f64,
    /// Mean length of a pause, s.
    pub pause: f64,
    /// Updates per second, Hz; none: always up to date.
    pub rate: Option<f64>,
}

/// A pose: shares of the largest shift along x, y, z and of the largest rotation, -1 to 1.
type Pose = [f64; 4];

impl Fetal {
    /// Placement of the node at `seconds`, relative to rest.
    pub fn at(&self, seconds: f64) -> DAffine3 {
        let [x, y, z, angle] = self.pose(held(seconds, self.rate));
        let shift = self.translation * DVec3::new(x, y, z);
        DAffine3::from_translation(shift) * self.turn.by(angle)
    }

    fn slot_length(&self) -> f64 {
        self.duration + self.pause
    }

    /// Times of the burst in a slot, s, and the number of its movements.
    fn burst(&self, slot: i64) -> (Range<f64>, u32) {
        // Up to half longer or shorter than the mean, as far as the slot has room.
        let spread = (self.pause / self.duration).min(0.5);
        let length = self.duration * (1.0 + spread * (2.0 * self.random(slot, 0, 0) - 1.0));
        let room = self.slot_length() - length;
        let begin = slot as f64 * self.slot_length() + room * self.random(slot, 0, 1);
        let movements = (length / STROKE).round().clamp(1.0, 1000.0) as u32;
        (begin..begin + length, movements)
    }

    fn pose(&self, seconds: f64) -> Pose {
        let slot = (seconds / self.slot_length()).floor() as i64;
        let (burst, movements) = self.burst(slot);
        let passed = (seconds - burst.start) / (burst.end - burst.start);
        let passed = passed.clamp(0.0, 1.0) * f64::from(movements);
        let movement = passed.floor().min(f64::from(movements - 1));
        let (from, to) = (movement as u32, movement as u32 + 1);
        let way = least_jerk(passed - movement);
        let end = |number: u32| match number == movements {
            true => self.target(slot + 1, 0),
            false => self.target(slot, number),
        };
        let (from, to) = (end(from), end(to));
        std::array::from_fn(|i| from[i] + (to[i] - from[i]) * way)
    }

    /// The pose from which a movement of a slot's burst starts.
    fn target(&self, slot: i64, movement: u32) -> Pose {
        std::array::from_fn(|i| 2.0 * self.random(slot, movement + 1, i as u32) - 1.0)
    }

    /// A number from 0 to 1 that depends on all arguments and the seed.
    fn random(&self, slot: i64, movement: u32, number: u32) -> f64 {
        let parts = [u64::from(self.seed), slot as u64, u64::from(movement), u64::from(number)];
        let bits = parts.into_iter().fold(0, |state, part| mix(state ^ part));
        (bits >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// One step of SplitMix64 (Steele, Lea and Flood 2014): every bit of the result depends on every bit
/// of the argument.
fn mix(state: u64) -> u64 {
    let z = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Share of the distance after share `t` of the time, with least jerk between two rests.
fn least_jerk(t: f64) -> f64 {
    t * t * t * (10.0 + t * (6.0 * t - 15.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fetal(seed: u32) -> Fetal {
        Fetal {
            seed,
            translation: DVec3::new(2.0, 3.0, 0.5),
            turn: Turn { centre: DVec3::new(0.0, 0.0, 20.0), axis: DVec3::Y, angle: 0.3 },
            duration: 4.0,
            pause: 6.0,
            rate: None,
        }
    }

    #[test]
    fn it_depends_on_the_seed_alone_and_has_no_memory() {
        let (a, b) = (fetal(1), fetal(2));
        let late = a.at(77.7);
        assert_eq!(a.at(-3.0), fetal(1).at(-3.0));
        assert_eq!(a.at(77.7), late);
        assert_ne!(a.at(77.7), b.at(77.7));
    }

    #[test]
    fn it_stays_within_its_amplitudes_and_uses_them() {
        let fetal = fetal(3);
        let mut most = [0.0f64; 4];
        for i in 0..40_000 {
            let pose = fetal.pose(f64::from(i) * 0.05 - 500.0);
            for (most, share) in most.iter_mut().zip(pose) {
                *most = most.max(share.abs());
            }
        }
        assert!(most.iter().all(|&m| m > 0.9 && m <= 1.0), "{most:?}");
        // The centre of the rotation is only shifted.
        let centre = fetal.turn.centre;
        for t in [0.3, 5.0, 123.0] {
            let [x, y, z, _] = fetal.pose(t);
            let moved = fetal.at(t).transform_point3(centre) - centre;
            let expected = DVec3::new(2.0 * x, 3.0 * y, 0.5 * z);
            assert!((moved - expected).length() < 1e-12);
        }
    }

    /// Differences of poses over a small step, per s.
    fn velocity(fetal: &Fetal, t: f64) -> Pose {
        let h = 1e-5;
        let (a, b) = (fetal.pose(t - h), fetal.pose(t + h));
        std::array::from_fn(|i| (b[i] - a[i]) / (2.0 * h))
    }

    #[test]
    fn velocity_is_continuous_everywhere() {
        let fetal = fetal(4);
        // The steepest change of velocity of a least-jerk movement of length T over a way of 2 is
        // 2 * 10 / sqrt(3) / T^2; the shortest movement of 2 to 6 s in whole seconds lasts 0.8 s.
        let most = 2.0 * 5.7736 / (0.8f64 * 0.8);
        let step = 0.002;
        let mut last = velocity(&fetal, 0.0);
        let mut fastest: f64 = 0.0;
        for i in 1..100_000 {
            let now = velocity(&fetal, f64::from(i) * step);
            for (a, b) in last.iter().zip(now) {
                assert!((a - b).abs() < most * step + 1e-6, "{i}: {a} {b}");
                fastest = fastest.max(b.abs());
            }
            last = now;
        }
        // It does move: at the fastest 1.875 times distance over time.
        assert!(fastest > 1.0, "{fastest}");
    }

    #[test]
    fn bursts_and_pauses_last_as_long_as_they_should() {
        let fetal = fetal(5);
        let moving = |i: i32| {
            let v = velocity(&fetal, f64::from(i) * 0.01);
            v.iter().any(|v| v.abs() > 1e-9)
        };
        let count = 200_000;
        let still = (0..count).filter(|&i| !moving(i)).count() as f64 / f64::from(count);
        // 200 slots of 10 s; the length of a burst spreads evenly over 2 to 6 s, so that the mean
        // share of 0.6 has a standard error of 4 / sqrt(12) / 10 / sqrt(200) = 0.008. Within a
        // burst the velocity vanishes between movements only, for some 2 ms each.
        assert!((still - 0.6).abs() < 0.03, "{still}");
    }

    #[test]
    fn without_pauses_one_burst_follows_the_other() {
        let fetal = Fetal { pause: 0.0, ..fetal(6) };
        for slot in -3..4 {
            let ((burst, movements), next) = (fetal.burst(slot), fetal.burst(slot + 1).0);
            assert!((burst.end - next.start).abs() < 1e-9);
            assert_eq!(movements, 4);
        }
    }

    #[test]
    fn time_is_held_between_updates() {
        let fetal = Fetal { rate: Some(10.0), ..fetal(7) };
        // In the middle of a burst, where nothing rests.
        let (burst, _) = fetal.burst(0);
        let update = (5.0 * (burst.start + burst.end)).floor() / 10.0 + 0.03;
        assert_eq!(fetal.at(update), fetal.at(update + 0.06));
        assert_ne!(fetal.at(update), fetal.at(update + 0.1));
    }
}
