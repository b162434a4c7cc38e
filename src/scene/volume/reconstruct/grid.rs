//! The voxels of a reconstruction: along the axes of the frame of reference.

use glam::{DAffine3, DVec3};

use super::MAX_VOXELS;
use super::insert::Source;
use crate::issue::FileError;

/// Places of the voxels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lattice {
    origin: DVec3,
    spacing: DVec3,
    size: [usize; 3],
}

impl Lattice {
    /// Voxels from a first centre on (mm).
    ///
    /// # Errors
    /// When there are none or too many, or the numbers are none of space.
    pub fn new(origin: DVec3, spacing: DVec3, size: [usize; 3]) -> Result<Self, FileError> {
        if !(spacing.is_finite() && spacing.cmpgt(DVec3::ZERO).all() && origin.is_finite()) {
            return Err(FileError::data(
                format!("voxels {spacing} mm apart from {origin} on are none"),
                "give a spacing above zero, mm",
            ));
        }
        let count = size
            .iter()
            .try_fold(1u64, |p, &n| p.checked_mul(n as u64))
            .filter(|&n| n > 0 && n <= MAX_VOXELS);
        if count.is_none() {
            let [x, y, z] = size;
            return Err(FileError::data(
                format!("{x} x {y} x {z} voxels are none, or more than {MAX_VOXELS}"),
                "change the spacing or the extent; check the size of a pixel in the transform",
            ));
        }
        Ok(Self { origin, spacing, size })
    }

    /// The voxels that hold the used part of these frames: from the smallest coordinate of its corners
    /// on, the last voxel rounded, as PLUS does.
    pub(super) fn around(
        source: &Source,
        frames: &[(usize, DAffine3)],
        spacing: DVec3,
    ) -> Result<Self, FileError> {
        let corners = source.corners();
        let points = frames.iter().flat_map(|(_, pose)| corners.map(|c| pose.transform_point3(c)));
        let (low, high) =
            points.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| (l.min(p), h.max(p)));
        // A size beyond the number range is refused with the others.
        let size = ((high - low) / spacing).round().to_array();
        Self::new(low, spacing, size.map(|n| (n as usize).saturating_add(1)))
    }

    /// Voxels along each axis.
    pub fn size(&self) -> [usize; 3] {
        self.size
    }

    /// Transform from voxel indices to mm in the frame of reference.
    pub fn reference_from_voxel(&self) -> DAffine3 {
        DAffine3::from_scale_rotation_translation(self.spacing, glam::DQuat::IDENTITY, self.origin)
    }

    /// Transform from mm in the frame of reference to voxel indices.
    pub(super) fn voxel_from_reference(&self) -> DAffine3 {
        self.reference_from_voxel().inverse()
    }
}
