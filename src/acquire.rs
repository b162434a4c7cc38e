//! Acquisition of tracked sweeps: B-mode frames of a scene with the probe's pose at each, as a tracked
//! ultrasound system records them, and the volume made from them.
//!
//! The world of the scene is the frame `Tracker`. `Reference`, in which PLUS reconstructs volumes, is the
//! same: a reconstructed volume lies at the place of the scene's anatomy.

use std::collections::BTreeMap;

use glam::{DAffine3, DMat3, DVec3};
use thiserror::Error;

use crate::issue::FileError;
use crate::probe::Kind;
use crate::scene::Scene;
use crate::sim::layout::Frame;
use crate::sim::{SimError, Simulator};
use crate::volume::{
    Fan, Pose, Reconstruction, Sequence, Settings, TrackedFrame, Voxels, reconstruct,
};

mod sweep;

pub use sweep::{Station, Sweep, poses_at, stations_at, stations_of};

/// Most pixels of all frames, bytes: the whole sequence is in memory.
const MAX_PIXELS: u64 = 2 << 30;

/// Name of the transform from pixels to the probe.
const CALIBRATION: &str = "ImageToProbe";
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
    #[error("{frames} frames of {width} x {height} pixels are more than {} GiB", MAX_PIXELS >> 30)]
    TooLarge {
        /// Number of frames.
        frames: usize,
        /// Number of pixels along x.
        width: u32,
        /// Number of pixels along y.
        height: u32,
    },
}

/// Transform from pixels (integers at their centres; x along the scanlines' order, y with depth, z so that the
/// three are right-handed) to probe space, mm: the calibration of PLUS and 3D Slicer.
pub fn probe_from_image(frame: &Frame) -> DAffine3 {
    let pitch = f64::from(frame.pixel_pitch);
    let centre = |first: f32| f64::from(first) + 0.5 * pitch;
    DAffine3::from_mat3_translation(
        DMat3::from_cols(DVec3::X * pitch, DVec3::Z * pitch, DVec3::NEG_Y * pitch),
        DVec3::new(centre(frame.image_left), 0.0, centre(frame.image_top)),
    )
}

/// The part of the image that holds echoes, pixels; none where it is the whole image.
fn fan(scene: &Scene, probe_from_image: &DAffine3) -> Option<Fan> {
    let (radius, angle) = match scene.probe.kind {
        Kind::Convex { radius, field_of_view } => (radius, field_of_view),
        Kind::Phased { field_of_view } => (0.0, field_of_view),
        Kind::Linear { .. } => return None,
    };
    let apex = DVec3::new(0.0, 0.0, -radius);
    let origin = probe_from_image.inverse().transform_point3(apex);
    let pixels = 1.0 / probe_from_image.matrix3.x_axis.length();
    let half = (angle / 2.0).to_degrees();
    Some(Fan {
        origin: [origin.x, origin.y],
        angles: [-half, half],
        radii: [radius * pixels, (radius + scene.probe.depth) * pixels],
    })
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
    let mut pixels = Vec::new();
    let mut frames = Vec::with_capacity(stations.len());
    let (mut size, mut fields) = ([0, 0], Vec::new());
    for (index, station) in stations.iter().enumerate() {
        if let Some(from) = moving {
            scene.set_time(from + station.time - start);
        }
        scene.world_from_probe = station.world_from_probe;
        simulator.frame(scene, index as u32)?;
        let (width, height, rgba) = simulator.pixels()?;
        let bytes = u64::from(width) * u64::from(height) * stations.len() as u64;
        if bytes > MAX_PIXELS {
            return Err(AcquireError::TooLarge { frames: stations.len(), width, height });
        }
        pixels.reserve_exact(bytes as usize - pixels.len());
        pixels.extend(rgba.chunks_exact(4).map(|p| p[0]));
        let calibration = probe_from_image(simulator.constants());
        if index == 0 {
            size = [width as usize, height as usize];
            fields.push(("UltrasoundImageType".to_owned(), "BRIGHTNESS".to_owned()));
            let fan = fan(scene, &calibration);
            fields.extend(fan.iter().flat_map(Fan::entries));
        }
        let poses = [
            (CALIBRATION, calibration),
            (TRACKED, station.world_from_probe),
            (REFERENCE, DAffine3::IDENTITY),
        ];
        frames.push(TrackedFrame {
            timestamp: Some(station.time),
            image: Some(true),
            poses: BTreeMap::from(poses.map(|(name, m)| (name.to_owned(), Pose::ok(m)))),
            fields: Vec::new(),
        });
        done(index);
    }
    Ok(Sequence {
        size,
        spacing: [1.0, 1.0],
        orientation: Some("MFA".to_owned()),
        pixels: Voxels::U8(pixels),
        frames,
        fields,
    })
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
    let middle = &sequence.frames[sequence.frames.len() / 2];
    let world_from_middle = pose(middle, TRACKED);
    let poses = sequence.frames.iter().map(|frame| {
        Some(world_from_middle.inverse() * pose(frame, TRACKED) * pose(frame, CALIBRATION))
    });
    let poses: Vec<_> = poses.collect();
    if settings.fan.is_none() {
        settings.fan = Fan::of(sequence)?;
    }
    let mut made = reconstruct(sequence, &poses, &settings)?;
    made.volume.world_from_voxel = world_from_middle * made.volume.world_from_voxel;
    Ok(made)
}
