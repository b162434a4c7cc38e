//! How the probe was moved: time, ways, peaks.

use glam::{DAffine3, DQuat, DVec3};
use serde::{Deserialize, Serialize};

use crate::scene::animation::{Track, Trs};

/// Steps a second in which speed is looked at.
const RATE: f64 = 50.0;
/// Standard deviation of the Gaussian that smooths the speed, s: chosen by this project, so that about 1 % is left
/// of what a tremor of 8 Hz adds.
const SMOOTH: f64 = 0.06;
/// Speed below which the probe counts as at rest, mm/s: a peak rises above it, and a valley between two peaks is no
/// more than half as high as the lower one.
const REST: f64 = 5.0;
/// Most steps: longer trajectories are looked at in longer steps.
const STEPS: usize = 1_000_000;
/// Least distance between the points of a thinned way, mm.
const APART: f64 = 0.5;
/// Most points of a thinned way; one more may be its end.
const MOST: usize = 256;

/// The poses of the probe at times that increase; straight lines and great circles lie between them.
#[derive(Clone, Debug, Default)]
pub struct Path {
    /// Times, s.
    pub times: Vec<f64>,
    /// World from probe at each, mm.
    pub poses: Vec<DAffine3>,
}

/// How the probe was moved.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Movement {
    /// Time from the first to the last pose, s.
    pub seconds: f64,
    /// Way of the middle of the probe's face, mm.
    pub path_mm: f64,
    /// Sum of all rotations, deg.
    pub angle_deg: f64,
    /// Peaks of the speed of the face's middle.
    pub peaks: usize,
}

impl Path {
    /// The rows of a trajectory; position or rotation that it lacks is that of `home`.
    pub fn of(track: &Track, home: &DAffine3) -> Self {
        let rest = Trs {
            translation: home.translation,
            rotation: DQuat::from_mat3(&home.matrix3).normalize(),
            ..Trs::default()
        };
        let mut times: Vec<f64> = track.times().collect();
        times.sort_by(f64::total_cmp);
        times.dedup();
        let poses = times.iter().map(|&t| track.at(rest, t).matrix()).collect();
        Self { times, poses }
    }

    /// The last pose; none of an empty path.
    pub fn last(&self) -> Option<DAffine3> {
        self.poses.last().copied()
    }

    /// The pose at a time between the first and the last one.
    ///
    /// # Panics
    /// Without poses.
    pub fn at(&self, time: f64) -> DAffine3 {
        let next = self.times.partition_point(|&t| t <= time).clamp(1, self.times.len().max(2) - 1);
        let Some(to) = self.poses.get(next) else { return self.poses[0] };
        let (from, span) = (&self.poses[next - 1], self.times[next] - self.times[next - 1]);
        let share = ((time - self.times[next - 1]) / span).clamp(0.0, 1.0);
        let [a, b] = [from, to].map(|pose| DQuat::from_mat3(&pose.matrix3).normalize());
        let place = from.translation.lerp(to.translation, share);
        DAffine3::from_rotation_translation(a.slerp(b, share), place)
    }

    /// The way of the face's middle, mm to a tenth, thinned for a history: what lies nearer than half a millimetre to
    /// the point before is left out, and of a way that is longer still, all but about 256 points.
    pub fn way(&self) -> Vec<[f64; 3]> {
        let mut points: Vec<DVec3> = Vec::new();
        for place in self.poses.iter().map(|pose| pose.translation) {
            if points.last().is_none_or(|last| last.distance(place) >= APART) {
                points.push(place);
            }
        }
        let each = points.len().div_ceil(MOST).max(1);
        let thinned = points.into_iter().step_by(each);
        let rounded = |point: DVec3| point.to_array().map(|mm| (10.0 * mm).round() / 10.0);
        let mut way: Vec<[f64; 3]> = thinned.map(rounded).collect();
        if let Some(end) = self.last().map(|pose| rounded(pose.translation))
            && way.last() != Some(&end)
        {
            way.push(end);
        }
        way
    }

    /// How the probe was moved.
    pub fn movement(&self) -> Movement {
        let pairs = self.poses.windows(2);
        let (path_mm, angle) = pairs.fold((0.0, 0.0), |(way, angle), pair| {
            let [a, b] = [&pair[0], &pair[1]];
            let turn = DQuat::from_mat3(&(a.matrix3.transpose() * b.matrix3)).normalize();
            let axis = DVec3::new(turn.x, turn.y, turn.z).length();
            (way + a.translation.distance(b.translation), angle + 2.0 * axis.atan2(turn.w.abs()))
        });
        let seconds = match (self.times.first(), self.times.last()) {
            (Some(first), Some(last)) => last - first,
            _ => 0.0,
        };
        let peaks = peaks(&self.speeds(seconds));
        Movement { seconds, path_mm, angle_deg: f64::to_degrees(angle), peaks }
    }

    /// The smoothed speed of the face's middle in even steps, mm/s; at rest before and after.
    fn speeds(&self, seconds: f64) -> Vec<f64> {
        let Some(&first) = self.times.first() else { return Vec::new() };
        if seconds <= 0.0 {
            return Vec::new();
        }
        let count = ((seconds * RATE).ceil() as usize).clamp(1, STEPS);
        let step = seconds / count as f64;
        let place = |i: usize| self.at(first + i as f64 * step).translation;
        let mut raw = Vec::with_capacity(count);
        let mut here = place(0);
        for i in 1..=count {
            let next = place(i);
            raw.push(here.distance(next) / step);
            here = next;
        }
        smoothed(&raw, SMOOTH / step)
    }
}

/// Values smoothed by a Gaussian of `sigma` steps; zero lies beyond the ends.
fn smoothed(values: &[f64], sigma: f64) -> Vec<f64> {
    let reach = (3.0 * sigma).ceil() as usize;
    let weights: Vec<f64> = (0..=2 * reach)
        .map(|i| (-0.5 * ((i as f64 - reach as f64) / sigma).powi(2)).exp())
        .collect();
    let sum: f64 = weights.iter().sum();
    (0..values.len() + 2 * reach)
        .map(|i| {
            let terms = weights.iter().enumerate().filter_map(|(k, w)| {
                let at = (i + k).checked_sub(2 * reach)?;
                Some(w * values.get(at)?)
            });
            terms.sum::<f64>() / sum
        })
        .collect()
}

/// Number of peaks that rise above rest, each parted from the next by a valley of half its height or less.
fn peaks(speeds: &[f64]) -> usize {
    let (mut count, mut top, mut valley) = (0, 0.0f64, 0.0f64);
    let mut rising = true;
    for &speed in speeds {
        if rising {
            top = top.max(speed);
            if top > REST && speed < top / 2.0 {
                count += 1;
                (rising, valley) = (false, speed);
            }
        } else {
            valley = valley.min(speed);
            if speed > REST && speed > 2.0 * valley {
                (rising, top) = (true, speed);
            }
        }
    }
    count
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A line of 50 mm in 2 s, a rest of 1 s, and a turn by 90 degrees in 3 s.
    fn line_and_turn() -> Path {
        let start = DAffine3::from_rotation_translation(
            DQuat::from_rotation_x(0.3),
            DVec3::new(1.0, 2.0, 3.0),
        );
        let mut path = Path::default();
        for i in 0..=60 {
            let t = f64::from(i) * 0.1;
            let way = DVec3::new(30.0, 40.0, 0.0) * (t / 2.0).min(1.0);
            let turn =
                DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2 * ((t - 3.0) / 3.0).max(0.0));
            path.times.push(10.0 + t);
            path.poses.push(DAffine3::from_translation(way) * start * DAffine3::from_quat(turn));
        }
        path
    }

    #[test]
    fn a_line_and_a_turn_have_their_length_angle_and_time() {
        let found = line_and_turn().movement();
        assert!((found.seconds - 6.0).abs() < 1e-6, "{found:?}");
        assert!((found.path_mm - 50.0).abs() < 1e-6, "{found:?}");
        assert!((found.angle_deg - 90.0).abs() < 1e-6, "{found:?}");
        assert_eq!(found.peaks, 1);
        // Planted: a row that lies 1 mm beside the line.
        let mut wrong = line_and_turn();
        wrong.poses[7].translation.z += 1.0;
        assert!((wrong.movement().path_mm - 50.0).abs() > 1e-3);
    }

    #[test]
    fn a_sine_has_two_peaks_a_period_at_any_rate_of_rows() {
        for rate in [20, 50, 333] {
            let mut path = Path::default();
            for i in 0..=6 * rate {
                let t = f64::from(i) / f64::from(rate);
                path.times.push(t);
                let x = 20.0 * (std::f64::consts::TAU * 0.5 * t).cos();
                path.poses.push(DAffine3::from_translation(DVec3::X * x));
            }
            let found = path.movement();
            assert_eq!(found.peaks, 6, "{rate}");
            assert!((found.path_mm - 240.0).abs() < 0.5, "{found:?}");
        }
    }

    #[test]
    fn a_kept_way_is_thinned_and_has_both_ends() {
        // Each place twice: steps, and no movement at all.
        let along = |steps: i32, step: f64| {
            let poses = (0..=steps).flat_map(|i| {
                [DAffine3::from_translation(DVec3::new(step * f64::from(i), 0.0, -7.04)); 2]
            });
            Path { poses: poses.collect(), ..Path::default() }.way()
        };
        // Every half millimetre up to 4.5 mm, and the end at 4.875 mm.
        let near = along(39, 0.125);
        assert_eq!((near.len(), near[1], near[10]), (11, [0.5, 0.0, -7.0], [4.9, 0.0, -7.0]));
        let far = along(100_000, 1.0);
        assert!((200..=257).contains(&far.len()), "{}", far.len());
        assert_eq!(far[far.len() - 1], [1e5, 0.0, -7.0]);
        assert_eq!(Path::default().way(), Vec::<[f64; 3]>::new());
    }

    #[test]
    fn tremor_and_rest_are_no_peaks() {
        let mut path = Path::default();
        for i in 0..500 {
            let t = f64::from(i) / 100.0;
            path.times.push(t);
            let x = 0.1 * (std::f64::consts::TAU * 10.0 * t).sin();
            path.poses.push(DAffine3::from_translation(DVec3::X * x));
        }
        assert_eq!(path.movement().peaks, 0);
        assert_eq!(Path::default().movement(), Movement::default());
    }
}
