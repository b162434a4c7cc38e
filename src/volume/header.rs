//! What the headers of all formats come to, and the volume that it makes.

use std::path::Path;

use super::error::VolumeError;
use super::grid::Grid;
use super::source::{Coding, MAX_BYTES, Payload};
use super::voxels::{self, VoxelType, Voxels};
use super::{Format, Volume, Warning};

/// A header that has been read and found sound in itself.
pub(super) struct Header {
    pub format: Format,
    pub kind: VoxelType,
    pub big_endian: bool,
    /// Values per voxel, next to each other.
    pub channels: usize,
    pub size: [usize; 3],
    /// Volumes after each other.
    pub frames: usize,
    pub grid: Grid,
    /// Slope and intercept of values, where they are not as written.
    pub scale: Option<(f64, f64)>,
    pub payload: Payload,
    pub warnings: Vec<Warning>,
}

impl Header {
    /// Notes something that does not stop the loading.
    pub fn warn(&mut self, path: &Path, count: usize, message: impl Into<String>, remedy: &str) {
        self.warnings
            .push(Warning::warning(path, count, message, remedy));
    }

    /// Reads the voxels of the first frame and channel.
    pub fn load(mut self, path: &Path) -> Result<(Volume, Vec<Warning>), VolumeError> {
        let world_from_voxel = self.grid.world_from_voxel().map_err(|cause| {
            VolumeError::file(path, cause, "correct the direction or export it again")
        })?;
        let product = |factors: &[usize]| {
            factors
                .iter()
                .try_fold(1u64, |p, &f| p.checked_mul(f as u64))
                .filter(|&p| p <= MAX_BYTES)
        };
        let [x, y, z] = self.size;
        let values = product(&[x, y, z, self.channels]);
        let total = product(&[x, y, z, self.channels, self.frames, self.kind.bytes()]);
        let (Some(values), Some(total)) = (values, total) else {
            return Err(VolumeError::file(
                path,
                format!(
                    "{x} x {y} x {z} voxels of {} values, {} times, are more than {} GB",
                    self.channels,
                    self.frames,
                    MAX_BYTES >> 30
                ),
                "correct the sizes in the header, or crop or resample the volume",
            ));
        };
        let width = self.kind.bytes() as u64;
        let (bytes, more) = if self.payload.coding == Coding::Text {
            self.big_endian = false;
            voxels::parse_text(&self.payload, self.kind, total / width, values)?
        } else {
            self.payload.read(total, values * width)?
        };
        if more {
            let message = "data go on after the declared voxels; the rest is ignored";
            self.warn(path, 1, message, "compare the sizes in the header");
        }
        let (mut voxels, rounded) =
            Voxels::decode(&bytes, self.kind, self.big_endian, self.channels);
        drop(bytes);
        if rounded > 0 {
            let message = format!("{rounded} values are rounded to 24 bits");
            self.warn(path, rounded, message, "");
        }
        if let Some((slope, intercept)) = self.scale {
            voxels = voxels.scaled(slope, intercept);
        }
        self.describe_extras(path);
        let statistics = voxels.statistics();
        if statistics.not_finite > 0 {
            let message = format!("{} voxels are not finite numbers", statistics.not_finite);
            self.warn(path, statistics.not_finite, message, "replace them");
        }
        let volume = Volume {
            format: self.format,
            frame: self.grid.frame,
            stored_as: self.kind,
            size: self.size,
            world_from_voxel,
            voxels,
            statistics,
        };
        volume.warn_of_shear(path, &mut self.warnings);
        Ok((volume, self.warnings))
    }

    fn describe_extras(&mut self, path: &Path) {
        if self.channels > 1 {
            let message = format!("{} values per voxel; only the first is read", self.channels);
            self.warn(
                path,
                self.channels,
                message,
                "save the channel that you need",
            );
        }
        if self.frames > 1 {
            let message = format!("{} volumes in a row; only the first is read", self.frames);
            self.warn(path, self.frames, message, "save the one that you need");
        }
    }
}

/// A warning about keys that mean nothing here, if there are any.
pub(super) fn unused(path: &Path, keys: &[&str]) -> Option<Warning> {
    let named = keys.iter().take(3).copied().collect::<Vec<_>>().join(", ");
    let dots = if keys.len() > 3 { ", ..." } else { "" };
    let message = format!("{} keys are not used: {named}{dots}", keys.len());
    (!keys.is_empty()).then(|| Warning::warning(path, keys.len(), message, ""))
}
