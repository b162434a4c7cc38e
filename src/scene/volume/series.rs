//! Volumes that follow each other in time, in one file or one in each.

use std::path::{Path, PathBuf};

use glam::DAffine3;

use super::source::MAX_BYTES;
use super::{Statistics, Volume, Warning};
use crate::issue::FileError;

/// Largest difference of positions between equal grids, voxels: files round them.
const SAME_PLACE: f64 = 0.01;

impl Volume {
    /// Reads one file, of one volume or several over time, or several files of one volume each, in the
    /// order of time. The files must agree in grid and type. A warning about several files is given
    /// once.
    ///
    /// # Errors
    /// Those of [`Volume::load`]; files that do not agree, or are too large together. Also the number of the
    /// file.
    ///
    /// # Panics
    /// Without files.
    pub fn load_series(files: &[PathBuf]) -> Result<(Self, Vec<Warning>), (usize, FileError)> {
        let (first, rest) = files.split_first().expect("a file");
        let (mut series, mut warnings) = Self::load(first).map_err(|e| (0, e))?;
        if rest.is_empty() {
            return Ok((series, warnings));
        }
        series.alone(first).map_err(|e| (0, e))?;
        series.fits(files.len(), first).map_err(|e| (0, e))?;
        for (number, file) in (1..).zip(rest) {
            let (next, found) = Self::load(file).map_err(|e| (number, e))?;
            next.alone(file).map_err(|e| (number, e))?;
            if let Some(difference) = series.difference(&next) {
                let message = format!("{difference} in {}", first.display());
                let remedy = "give volumes of the same grid and type";
                return Err((number, FileError::file(file, message, remedy)));
            }
            let new = |w: &Warning| !warnings.iter().any(|old: &Warning| old.message == w.message);
            let new: Vec<_> = found.into_iter().filter(new).collect();
            warnings.extend(new);
            series.later.push(next.voxels);
        }
        series.statistics = Statistics::of(series.volumes());
        Ok((series, warnings))
    }

    /// One volume over time: this one, and those that follow it every `interval` seconds.
    ///
    /// # Panics
    /// When they differ in size.
    pub fn followed_by(mut self, later: Vec<Self>, interval: f64) -> Self {
        assert!(later.iter().all(|v| v.size == self.size), "one grid");
        self.later = later.into_iter().map(|v| v.voxels).collect();
        self.interval = Some(interval);
        self.statistics = Statistics::of(self.volumes());
        self
    }

    /// Fails unless this is one volume.
    fn alone(&self, file: &Path) -> Result<(), FileError> {
        match self.later.len() {
            0 => Ok(()),
            more => Err(FileError::file(
                file,
                format!("holds {} volumes, where each file is to hold one", more + 1),
                "name it alone, or save its volumes one by one",
            )),
        }
    }

    /// Fails where `count` volumes like this one, of `file`, exceed the size limit.
    ///
    /// # Errors
    /// They exceed it.
    pub fn fits(&self, count: usize, file: &Path) -> Result<(), FileError> {
        let each = (self.voxels.len() * self.voxels.kind().bytes()) as u64;
        match each.checked_mul(count as u64) {
            Some(bytes) if bytes <= MAX_BYTES => Ok(()),
            _ => Err(FileError::file(
                file,
                format!(
                    "{count} volumes of {:.1} MB are more than {} GB",
                    each as f64 / 1e6,
                    MAX_BYTES >> 30
                ),
                "leave out volumes, or crop or resample all of them",
            )),
        }
    }

    /// The difference of `next` from this volume, in words that `in FILE` may follow.
    fn difference(&self, next: &Self) -> Option<String> {
        let (kind, own) = (next.voxels.kind(), self.voxels.kind());
        let of_kind = || format!("holds values of {}, not {} as", kind.name(), own.name());
        let grid = next.grid_difference(self.size, &self.world_from_voxel);
        grid.or_else(|| (kind != own).then(of_kind))
    }

    /// The difference of this volume's grid from one of another size or place, in words that `in FILE` may follow; none
    /// where both have as many voxels in the same places.
    pub fn grid_difference(&self, size: [usize; 3], world_from_voxel: &DAffine3) -> Option<String> {
        let words = |[x, y, z]: [usize; 3]| format!("{x} x {y} x {z}");
        if self.size != size {
            return Some(format!("has {} voxels, not {} as", words(self.size), words(size)));
        }
        // Affine: the largest difference is at a corner.
        let voxel_from_own = world_from_voxel.inverse() * self.world_from_voxel;
        let corners = (0..8usize).map(|i| {
            let at = [0, 1, 2].map(|axis| (i >> axis & 1) as f64 * (size[axis] - 1) as f64);
            voxel_from_own.transform_point3(at.into()).distance(at.into())
        });
        let off = corners.fold(0.0, f64::max);
        (off > SAME_PLACE).then(|| format!("lies up to {off:.2} voxels from where it does"))
    }
}
