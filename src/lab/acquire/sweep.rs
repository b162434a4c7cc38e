//! Sweeps and trajectories of a probe, as lists of poses.

use glam::{DAffine3, DVec3};

use crate::scene::Scene;
use crate::scene::animation::{Track, Trs};

/// Pose of the probe at a moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Station {
    /// Timestamp, s.
    pub time: f64,
    /// World from probe space, mm.
    pub world_from_probe: DAffine3,
}

/// A sweep about the pose that the scene gives the probe, in the probe's own axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sweep {
    /// Shift along the elevation axis by so many mm from the first frame to the last.
    Linear(f64),
    /// Turn about the lateral axis through the face's centre (a fan) by so many rad from first to last.
    Tilt(f64),
    /// Turn about the depth axis by so many rad from first to last.
    Rotate(f64),
}

impl Sweep {
    /// Evenly spaced poses, the scene's own in the middle, `rate` of them per second from time 0 on.
    pub fn stations(self, scene: &Scene, frames: u32, rate: f64) -> Vec<Station> {
        let last = f64::from(frames.max(2) - 1);
        (0..frames)
            .map(|i| {
                let part = match frames {
                    1 => 0.0,
                    _ => f64::from(i) / last - 0.5,
                };
                Station {
                    time: f64::from(i) / rate,
                    world_from_probe: scene.world_from_probe * self.at(part),
                }
            })
            .collect()
    }

    /// The transform of the middle pose at `part` of the sweep, -1/2 to 1/2.
    fn at(self, part: f64) -> DAffine3 {
        match self {
            Self::Linear(length) => DAffine3::from_translation(DVec3::Y * (part * length)),
            Self::Tilt(angle) => DAffine3::from_rotation_x(part * angle),
            Self::Rotate(angle) => DAffine3::from_rotation_z(part * angle),
        }
    }
}

/// Poses of the probe in the world from a trajectory: one at each of its times, or `frames` evenly from its
/// first time to its last. Position or rotation that it lacks stays the scene's.
pub fn stations_of(track: &Track, scene: &Scene, frames: Option<u32>) -> Vec<Station> {
    let times: Vec<f64> = match (frames, track.span()) {
        (Some(frames), Some((first, last))) => {
            let step = (last - first) / f64::from(frames.max(2) - 1);
            (0..frames).map(|i| first + f64::from(i) * step).collect()
        }
        _ => {
            let mut times: Vec<f64> = track.times().collect();
            times.sort_by(f64::total_cmp);
            times.dedup();
            times
        }
    };
    stations(track, scene, times)
}

/// The same, `rate` poses a second from its first time on.
pub fn stations_at(track: &Track, scene: &Scene, rate: f64, frames: u32) -> Vec<Station> {
    let (first, _) = track.span().unwrap_or_default();
    let times = (0..frames).map(|i| first + f64::from(i) / rate);
    stations(track, scene, times.collect())
}

/// Poses from a trajectory's first time up to its last at `rate` a second; there may be more than anything holds.
pub fn poses_at(track: &Track, rate: f64) -> f64 {
    let (first, last) = track.span().unwrap_or_default();
    // The last one must not be lost to rounding.
    ((last - first) * rate + 1e-6).floor() + 1.0
}

fn stations(track: &Track, scene: &Scene, times: Vec<f64>) -> Vec<Station> {
    let (_, rotation, translation) = scene.world_from_probe.to_scale_rotation_translation();
    let rest = Trs { translation, rotation, ..Trs::default() };
    let station = |time| Station { time, world_from_probe: track.at(rest, time).matrix() };
    times.into_iter().map(station).collect()
}
