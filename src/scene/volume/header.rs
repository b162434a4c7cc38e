//! The common content of the headers of all formats, and the volume made from it.

use std::path::Path;

use super::grid::Grid;
use super::layout::{Axis, Layout};
use super::scalar::Scalar;
use super::source::{Coding, MAX_BYTES, Payload, Skip};
use super::voxels::{self, Voxels};
use super::{Format, Statistics, Volume, Warning};
use crate::issue::FileError;

/// Most volumes over time: twice the largest count of an axis in NIfTI-1. Each takes memory beside its voxels.
const MAX_VOLUMES: usize = 1 << 16;
/// Bytes that are read before they are decoded.
const BLOCK: usize = 1 << 20;

/// The voxels of a file.
#[derive(Default)]
struct Decoded {
    volumes: Vec<Voxels>,
    /// Values that lost digits.
    rounded: usize,
    /// True where data follow the voxels.
    more: bool,
}

/// A header that has been read and checked by itself.
pub(super) struct Header {
    pub format: Format,
    pub kind: Scalar,
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
    pub fn load(mut self, path: &Path) -> Result<(Volume, Vec<Warning>), FileError> {
        let world_from_voxel = self.grid.world_from_voxel().map_err(|cause| {
            FileError::file(path, cause, "correct the direction or the origin, or export it again")
        })?;
        let total = self.bytes(path)?;
        let Decoded { mut volumes, rounded, more } = match self.is_streamed() {
            true => self.stream(total)?,
            false => self.decode(total)?,
        };
        if more {
            let message = "data go on after the declared voxels; the rest is ignored";
            self.warn(path, 1, message, "compare the sizes in the header");
        }
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

    /// Returns whether voxels are decoded while they are read, so that nothing else is in memory.
    fn is_streamed(&self) -> bool {
        let payload = &self.payload;
        let forward = payload.skip != Skip::AllButLast || payload.coding == Coding::Raw;
        forward && payload.coding != Coding::Text && self.layout.is_in_order()
    }

    /// Type of the voxels in memory.
    fn held(&self) -> Scalar {
        match self.scale {
            Some(_) => Scalar::F32,
            None => self.kind,
        }
    }

    fn scaled(&self, voxels: Voxels) -> Voxels {
        match self.scale {
            Some((slope, intercept)) => voxels.scaled(slope, intercept),
            None => voxels,
        }
    }

    /// Decodes the voxels block by block as they are read.
    fn stream(&self, total: u64) -> Result<Decoded, FileError> {
        let mut stream = self.payload.stream(total)?;
        let mut out = Decoded::default();
        let each = self.kind.bytes() * self.layout.channels;
        let most = (BLOCK / each).max(1);
        let (mut block, mut done) = (Vec::new(), 0);
        for _ in 0..self.layout.volumes {
            let mut left: usize = self.layout.size.iter().product();
            let mut voxels =
                Voxels::with_room(self.held(), left).map_err(|_| self.payload.too_large(total))?;
            while left > 0 {
                let count = left.min(most);
                block.resize(count * each, 0);
                self.payload.fill(&mut stream, &mut block, done, total)?;
                done += block.len() as u64;
                left -= count;
                let values = [(Axis::Values, self.layout.channels), (Axis::Space, count)];
                let layout = Layout::new(values);
                let (part, lost) = Voxels::decode(&block, self.kind, self.big_endian, &layout, 0);
                out.rounded += lost;
                voxels.append(self.scaled(part));
            }
            out.volumes.push(voxels);
        }
        out.more = self.payload.goes_on(&mut stream, total)?;
        Ok(out)
    }

    /// Reads all bytes, then decodes them.
    fn decode(&self, total: u64) -> Result<Decoded, FileError> {
        let text = self.payload.coding == Coding::Text;
        let (bytes, more) = match text {
            true => voxels::parse_text(&self.payload, self.kind, total / self.kind.bytes() as u64)?,
            false => self.payload.read(total)?,
        };
        let mut out = Decoded { more, ..Decoded::default() };
        for number in 0..self.layout.volumes {
            // Numbers in text have become little-endian values.
            let big = self.big_endian && !text;
            let (voxels, lost) = Voxels::decode(&bytes, self.kind, big, &self.layout, number);
            out.rounded += lost;
            out.volumes.push(self.scaled(voxels));
        }
        Ok(out)
    }

    /// Size in bytes of all values in the file; an error where that, or the size in memory, is too large.
    fn bytes(&self, path: &Path) -> Result<u64, FileError> {
        let layout = &self.layout;
        if layout.volumes > MAX_VOLUMES {
            return Err(FileError::file(
                path,
                format!("{} volumes over time are more than {MAX_VOLUMES}", layout.volumes),
                "correct the sizes in the header, or leave out some",
            ));
        }
        let bytes = |count: Option<u64>, each: usize| count?.checked_mul(each as u64);
        let all = layout.voxels().and_then(|n| n.checked_mul(layout.volumes as u64));
        let held = bytes(all, self.held().held_bytes());
        let total = bytes(layout.values(), self.kind.bytes());
        // Values that are not streamed are in memory twice.
        let peak = held.zip(total).and_then(|(held, total)| match self.is_streamed() {
            true => Some(held.max(total)),
            false => held.checked_add(total),
        });
        let total = total.filter(|_| peak.is_some_and(|peak| peak <= MAX_BYTES));
        total.ok_or_else(|| {
            let [x, y, z] = layout.size;
            FileError::file(
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
