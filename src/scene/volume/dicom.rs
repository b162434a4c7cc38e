//! DICOM files (PS3.3, PS3.5): enhanced ultrasound volumes and other images of several frames with
//! placed planes, and single planes with a place.

use std::path::Path;

use super::source::{self, MAX_BYTES};
use super::{Format, Frame, Scalar, Volume, Warning};
use crate::issue::FileError;
use elements::{Elements, Item, Tag};
use image::Image;

mod elements;
mod file;
mod geometry;
mod image;
mod pixels;
pub(super) mod segmentation;

const SAVE: &str = "export it again, or convert it to .nrrd, .mha or .nii.gz";

/// A file with its elements.
struct Dicom<'p> {
    path: &'p Path,
    bytes: Vec<u8>,
    syntax: file::Transfer,
    root: Item,
}

impl Dicom<'_> {
    fn elements(&self) -> Elements<'_> {
        Elements { bytes: &self.bytes, big: self.syntax.elements().big }
    }

    fn error(&self, message: impl Into<String>, remedy: &str) -> FileError {
        FileError::file(self.path, message, remedy)
    }

    fn lacks(&self, name: &str, tag: Tag) -> FileError {
        let (group, element) = tag;
        let message = format!("lacks {name} ({group:04x},{element:04x}), or it is malformed");
        self.error(message, SAVE)
    }
}

/// Reads a volume.
pub(super) fn load(path: &Path) -> Result<(Volume, Vec<Warning>), FileError> {
    let dicom = file::read(path)?;
    let image = Image::of(&dicom)?;
    let planes = geometry::planes(&dicom, &image)?;
    let mut warnings = Vec::new();
    let mut warn = |count: usize, message: String, remedy: &str| {
        warnings.push(Warning::warning(path, count, message, remedy));
    };
    let size = [image.columns, image.rows, planes.frames.len()];
    let world_from_voxel = planes.grid.world_from_voxel().map_err(|cause| {
        dicom.error(cause, "correct the orientation or the positions of the planes")
    })?;
    let mut voxels = pixels::decode(&dicom, &image, &planes.frames)?;
    if let Some((slope, intercept)) = image.scale {
        voxels = voxels.scaled(slope, intercept);
    }
    if image.is_color() {
        warn(1, "is in colour: the brightness is read".to_owned(), "");
    }
    if planes.volumes > 1 {
        let message = format!("{} volumes in a row; only the first is read", planes.volumes);
        warn(planes.volumes, message, "save the one that you need");
    }
    if planes.grid.frame == Frame::Unstated {
        let message = "positions are in the volume's own frame of reference, taken for LPS";
        warn(1, message.to_owned(), "place the volume by a transform");
    }
    if size[2] == 1 {
        let message = "is a plane: one slice".to_owned();
        warn(1, message, "give a volume of several planes");
    }
    let statistics = voxels.statistics();
    if statistics.not_finite > 0 {
        let message = format!("{} voxels are not finite numbers", statistics.not_finite);
        warn(statistics.not_finite, message, "replace them");
    }
    let volume = Volume {
        format: Format::Dicom,
        frame: planes.grid.frame,
        stored_as: image.kind,
        size,
        world_from_voxel,
        voxels,
        later: Vec::new(),
        interval: None,
        statistics,
    };
    volume.warn_of_shear(path, &mut warnings);
    Ok((volume, warnings))
}

/// Most bytes of the voxels: the file is in memory beside them.
const MAX_VOXELS: u64 = MAX_BYTES / 2;

/// Size in bytes of so many frames once read; none where that is more than the limit.
fn bytes_of(image: &Image, frames: usize) -> Option<u64> {
    let factors = [image.rows, image.columns, frames, image.samples, image.kind.bytes()];
    let product = factors.iter().try_fold(1u64, |p, &n| p.checked_mul(n as u64));
    product.filter(|&p| p <= MAX_VOXELS)
}
