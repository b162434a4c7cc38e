//! A volume from tracked frames: each pixel goes to the voxels at its place, and voxels that no pixel
//! reached are filled from their surroundings. The method, its settings and their names are those of
//! PLUS (vtkIGSIOVolumeReconstructor; Lasso et al., IEEE Trans. Biomed. Eng. 61:2527, 2014).

use glam::{DAffine3, DVec3};

use super::source::MAX_BYTES;
use super::{Format, Frame, Sequence, Volume, Voxels};
use crate::issue::FileError;

mod config;
pub(super) mod fan;
mod grid;
mod holes;
mod insert;
mod poses;

pub use config::Config;
pub use fan::Fan;
pub use grid::Lattice;
pub use poses::{Transforms, names as frames_of_pose};

/// Distribution of a pixel over voxels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Interpolation {
    /// To the voxel at its place.
    Nearest,
    /// To the eight voxels around it, by the weights of trilinear interpolation.
    Linear,
}

/// Value of a voxel that several pixels reach.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Compounding {
    /// Their mean, by the weights of the interpolation.
    Mean,
    /// The largest. With `linear` only pixels of a weight of at least 1/8 count.
    Maximum,
    /// The one of the latest frame. With `linear` as for the largest.
    Latest,
}

/// A method to fill a voxel that no pixel reached.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Filling {
    /// Interpolation between two reached voxels, opposite to each other along one of the 13 lines through
    /// neighbours: the mean over the shortest such lines, at least `count`.
    Stick {
        /// Most voxels from one end to the other, both included.
        length: usize,
        /// Lines to use.
        count: usize,
    },
    /// Mean of the nearest reached voxels in a cube of at most `size` voxels along each side, where they are
    /// more than `share` of that cube.
    Nearest {
        /// Voxels along a side, odd.
        size: usize,
        /// Smallest share, 0 to 1.
        share: f64,
    },
}

/// Settings of a reconstruction.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Distance of voxel centres, mm.
    pub spacing: DVec3,
    /// Centre of the first voxel (mm) and voxels along each axis. None: a volume that holds all frames.
    pub lattice: Option<(DVec3, [usize; 3])>,
    /// Rectangle of the frame to use: x, y, width and height in pixels.
    pub clip: Option<[i32; 4]>,
    /// Fan of the frame to use.
    pub fan: Option<Fan>,
    /// Pixels below this value are left out.
    pub reject_below: Option<f64>,
    /// Step through the frames, from 1: 2 uses every second one.
    pub every: usize,
    /// Distribution of a pixel over voxels.
    pub interpolation: Interpolation,
    /// Value of a voxel that several pixels reach.
    pub compounding: Compounding,
    /// Methods for voxels that no pixel reached; the first that succeeds counts.
    pub holes: Vec<Filling>,
}

impl Settings {
    /// Nearest voxels, means, sticks of 9 voxels, everything that the frames show.
    pub fn new(spacing: DVec3) -> Self {
        Self {
            spacing,
            lattice: None,
            clip: None,
            fan: None,
            reject_below: None,
            every: 1,
            interpolation: Interpolation::Nearest,
            compounding: Compounding::Mean,
            holes: vec![Filling::Stick { length: 9, count: 1 }],
        }
    }
}

/// A reconstructed volume, and counts.
#[derive(Clone, Debug)]
pub struct Reconstruction {
    /// The volume, along the axes of the frame of reference.
    pub volume: Volume,
    /// Number of frames used; the others have no image or no pose.
    pub frames: usize,
    /// Number of voxels that pixels reached.
    pub reached: usize,
    /// Number of filled voxels. All others are 0.
    pub filled: usize,
}

/// Most voxels: each takes 8 bytes here and up to 4 in the result.
const MAX_VOXELS: u64 = MAX_BYTES / 12;

/// Reconstructs a volume. `reference_from_image` has one entry per frame: from pixels (integers at their
/// centres) to mm in the frame of reference, none where unknown ([`Transforms`]).
///
/// # Errors
/// When no frame has both image and pose, when the orientation of the pixels is none of a B-mode
/// image, and when the volume would be empty or too large.
pub fn reconstruct(
    sequence: &Sequence,
    reference_from_image: &[Option<DAffine3>],
    settings: &Settings,
) -> Result<Reconstruction, FileError> {
    assert_eq!(sequence.frames.len(), reference_from_image.len(), "frames");
    let source = insert::Source::new(sequence, settings)?;
    let usable = (0..sequence.frames.len()).step_by(settings.every.max(1));
    let usable = usable.filter(|&i| sequence.frames[i].has_image());
    let frames: Vec<_> = usable.filter_map(|i| Some((i, reference_from_image[i]?))).collect();
    if frames.is_empty() {
        return Err(FileError::data(
            "no frame has both an image and a pose that is OK",
            "check the status of the poses with `insonify check`, and the names of the frames",
        ));
    }
    let lattice = match settings.lattice {
        Some((origin, size)) => Lattice::new(origin, settings.spacing, size)?,
        None => Lattice::around(&source, &frames, settings.spacing)?,
    };
    let mut sums = insert::Sums::new(&lattice, settings);
    for (index, reference_from_image) in &frames {
        let voxel_from_image = lattice.voxel_from_reference() * *reference_from_image;
        sums.insert(&source, *index, voxel_from_image);
    }
    let reached = sums.reached();
    let (values, filled) = holes::fill(sums.values(), &sums, &settings.holes);
    let voxels = like(&sequence.pixels, &values);
    let statistics = voxels.statistics();
    Ok(Reconstruction {
        volume: Volume {
            format: Format::MetaImage,
            frame: Frame::Lps,
            stored_as: voxels.kind(),
            size: lattice.size(),
            world_from_voxel: lattice.reference_from_voxel(),
            voxels,
            later: Vec::new(),
            interval: None,
            statistics,
        },
        frames: frames.len(),
        reached,
        filled,
    })
}

/// The values in the type of `pixels`, rounded to nearest.
fn like(pixels: &Voxels, values: &[f32]) -> Voxels {
    let rounded = values.iter().map(|v| v.round());
    match pixels {
        Voxels::U8(_) => Voxels::U8(rounded.map(|v| v as u8).collect()),
        Voxels::I8(_) => Voxels::I8(rounded.map(|v| v as i8).collect()),
        Voxels::U16(_) => Voxels::U16(rounded.map(|v| v as u16).collect()),
        Voxels::I16(_) => Voxels::I16(rounded.map(|v| v as i16).collect()),
        Voxels::F32(_) => Voxels::F32(values.to_vec()),
    }
}
