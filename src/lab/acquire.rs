//! Acquisition of tracked sweeps: B-mode frames of a scene with the probe's pose at each, as a tracked
//! ultrasound system records them, and the volume made from them.
//!
//! The world of the scene is the frame `Tracker`. `Reference`, in which PLUS reconstructs volumes, is the
//! same: a reconstructed volume lies at the place of the scene's anatomy.

use glam::DAffine3;
use thiserror::Error;

use crate::issue::FileError;
use crate::scene::Scene;
use crate::sim::{SimError, Simulator};
use crate::volume::{Fan, Reconstruction, Sequence, Settings, TrackedFrame, reconstruct};

mod recording;
mod sweep;

pub use recording::Recording;
pub use sweep::{Station, Sweep, poses_at, stations_at, stations_of};

/// Name of the transform from the probe to the world.
const TRACKED: &str = "ProbeToTracker";
/// Name of the transform from the frame of volumes to the world: the identity.
const REFERENCE: &str = "ReferenceToTracker";

/// The reason why nothing was acquired.
#[derive(Debug, Error)]
pub enum AcquireError {
    /// A frame could not be simulated.
    #[error(transparent)]
    Sim(#[from] SimError),
    /// The frames would not fit into memory.
    #[error("{frames} frames of {width} x {height} pixels are more than {} GiB", recording::MAX_PIXELS >> 30)]
    TooLarge {
        /// Number of frames.
        frames: usize,
        /// Number of pixels along x.
        width: u32,
        /// Number of pixels along y.
        height: u32,
    },
}

/// Images `scene` from each of `stations` and calls `done` after each with its number. With `moving` the
/// anatomy moves on from the given time (s) with the timestamps; without it the anatomy stands still. The
/// scene is left at the last station.
///
/// # Errors
/// An error of the device; frames that would not fit into memory.
///
/// # Panics
/// Without stations.
pub fn acquire(
    simulator: &mut Simulator,
    scene: &mut Scene,
    stations: &[Station],
    moving: Option<f64>,
    mut done: impl FnMut(usize),
) -> Result<Sequence, AcquireError> {
    let start = stations.first().expect("a station").time;
    let mut recording = Recording::new(simulator, scene, stations.len())?;
    for (index, station) in stations.iter().enumerate() {
        if let Some(from) = moving {
            scene.set_time(from + station.time - start);
        }
        scene.world_from_probe = station.world_from_probe;
        simulator.frame(scene, index as u32)?;
        let poses = [(TRACKED, station.world_from_probe), (REFERENCE, DAffine3::IDENTITY)];
        let (_, _, rgba) = simulator.pixels()?;
        recording.add(&rgba, station.time, poses);
        done(index);
    }
    Ok(recording.finish())
}

/// The frame or station along whose probe's axes a volume lies.
///
/// # Panics
/// Without any.
pub fn middle<T>(all: &[T]) -> &T {
    &all[all.len() / 2]
}

/// Reconstructs a volume from an acquired sequence, along the axes of the probe at its middle frame. The
/// axes of `settings` are those too; without a fan in them the sequence's fan is used.
///
/// # Errors
/// Those of [`reconstruct`].
///
/// # Panics
/// When the sequence lacks the poses that [`acquire`] writes.
pub fn volume(sequence: &Sequence, mut settings: Settings) -> Result<Reconstruction, FileError> {
    let pose = |frame: &TrackedFrame, name: &str| frame.poses[name].transform;
    let world_from_middle = pose(middle(&sequence.frames), TRACKED);
    let poses = sequence.frames.iter().map(|frame| {
        Some(
            world_from_middle.inverse()
                * pose(frame, TRACKED)
                * pose(frame, recording::CALIBRATION),
        )
    });
    let poses: Vec<_> = poses.collect();
    if settings.fan.is_none() {
        settings.fan = Fan::of(sequence)?;
    }
    let mut made = reconstruct(sequence, &poses, &settings)?;
    made.volume.world_from_voxel = world_from_middle * made.volume.world_from_voxel;
    Ok(made)
}
