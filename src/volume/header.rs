//! The common content of the headers of all formats, and the volume made from it.

use std::path::Path;

use super::error::VolumeError;
use super::grid::Grid;
use super::layout::Layout;
use super::source::{Coding, MAX_BYTES, Payload};
use super::voxels::{self, VoxelType, Voxels};
use super::{Format, Statistics, Volume, Warning};

/// Most volumes over time: twice the largest count of an axis in NIfTI-1. Each takes memory beside its voxels.
const MAX_VOLUMES: usize = 1 << 16;

/// A header that has been read and checked by itself.
pub(super) struct Header {
    pub format: Format,
    pub kind: VoxelType,
    pub big_endian: bool,
    pub layout: Layout,
    /// Time from one volume to the next, s, where stated.
    pub interval: Option<f64>,
    pub grid: Grid,
    /// Slope and intercept of values, where they have an effect.
    pub scale: Option<(f64, f64)>,
    pub payload: Payload,
    pub warnings: Vec<Warning>,
}

impl Header {
    /// Notes something that does not stop the loading.
    pub fn warn(&mut self, path: &Path, count: usize, message: impl Into<String>, remedy: &str) {
        self.warnings.push(Warning::warning(path, count, message, remedy));
    }

    /// Reads the voxels of all volumes; of several values per voxel the first.
    pub fn load(mut self, path: &Path) -> Result<(Volume, Vec<Warning>), VolumeError> {
        let world_from_voxel = self.grid.world_from_voxel().map_err(|cause| {
            VolumeError::file(path, cause, "correct the direction or export it again")
        })?;
        let total = self.bytes(path)?;
        let (bytes, more) = if self.payload.coding == Coding::Text {
            self.big_endian = false;
            voxels::parse_text(&self.payload, self.kind, total / self.kind.bytes() as u64)?
        } else {
            self.payload.read(total)?
        };
        if more {
            let message = "data go on after the declared voxels; the rest is ignored";
            self.warn(path, 1, message, "compare the sizes in the header");
        }
        let mut rounded = 0;
        let mut volumes = Vec::with_capacity(self.layout.volumes);
        for number in 0..self.layout.volumes {
            let (voxels, lost) =
                Voxels::decode(&bytes, self.kind, self.big_endian, &self.layout, number);
            rounded += lost;
            volumes.push(match self.scale {
                Some((slope, intercept)) => voxels.scaled(slope, intercept),
                None => voxels,
            });
        }
        drop(bytes);
        if rounded > 0 {
            let message = format!("{rounded} values are rounded to 24 bits");
            self.warn(path, rounded, message, "");
        }
        let channels = self.layout.channels;
        if channels > 1 {
            let message = format!("{channels} values per voxel; only the first is read");
            self.warn(path, channels, message, "save the channel that you need");
        }
        let statistics = Statistics::of(&volumes);
        if statistics.not_finite > 0 {
            let message = format!("{} voxels are not finite numbers", statistics.not_finite);
            self.warn(path, statistics.not_finite, message, "replace them");
        }
        let volume = Volume {
            format: self.format,
            frame: self.grid.frame,
            stored_as: self.kind,
            size: self.layout.size,
            world_from_voxel,
            voxels: volumes.remove(0),
            later: volumes,
            interval: self.interval,
            statistics,
        };
        volume.warn_of_shear(path, &mut self.warnings);
        Ok((volume, self.warnings))
    }

    /// Size in bytes of all values in the file; an error where that, or the size in memory, is too large.
    fn bytes(&self, path: &Path) -> Result<u64, VolumeError> {
        let layout = &self.layout;
        if layout.volumes > MAX_VOLUMES {
            return Err(VolumeError::file(
                path,
                format!("{} volumes over time are more than {MAX_VOLUMES}", layout.volumes),
                "correct the sizes in the header, or leave out some",
            ));
        }
        let held = match self.scale {
            Some(_) => VoxelType::F32,
            None => self.kind,
        };
        let fits = |count: Option<u64>, each: usize| {
            let bytes = count.and_then(|count| count.checked_mul(each as u64));
            bytes.filter(|&bytes| bytes <= MAX_BYTES)
        };
        let all = layout.voxels();
        let all = all.and_then(|voxels| voxels.checked_mul(layout.volumes as u64));
        let total = fits(layout.values(), self.kind.bytes());
        total.filter(|_| fits(all, held.held_bytes()).is_some()).ok_or_else(|| {
            let [x, y, z] = layout.size;
            VolumeError::file(
                path,
                format!(
                    "{x} x {y} x {z} voxels of {} values, {} times, are more than {} GB",
                    layout.channels,
                    layout.volumes,
                    MAX_BYTES >> 30
                ),
                "correct the sizes in the header, crop or resample the volume, or leave out \
                     some of several",
            )
        })
    }
}

/// A warning about keys that are not used here, if there are any.
pub(super) fn unused(path: &Path, keys: &[&str]) -> Option<Warning> {
    let named = keys.iter().take(3).copied().collect::<Vec<_>>().join(", ");
    let dots = if keys.len() > 3 { ", ..." } else { "" };
    let message = format!("{} keys are not used: {named}{dots}", keys.len());
    (!keys.is_empty()).then(|| Warning::warning(path, keys.len(), message, ""))
}
