//! Volumes acquired elsewhere: MetaImage, NRRD, NIfTI-1 and DICOM files, placed in LPS and mm.
//!
//! Knows no Vulkan and no ultrasound. Frames and units of the files are turned into LPS and mm in
//! `grid`, once. No statement of a header makes the program allocate or unpack more than the header
//! declares and the file can hold (`source`).

use std::path::Path;

use glam::{DAffine3, DVec3};

use crate::issue::FileError;
/// A finding on a volume that could be loaded.
pub use crate::issue::Warning;

mod dicom;
mod fields;
mod grid;
mod header;
mod layout;
mod meta;
mod nifti;
mod nrrd;
pub mod plus;
mod reconstruct;
mod report;
mod scalar;
mod sequence;
mod series;
mod source;
#[cfg(test)]
mod tests;
mod voxels;
mod write;

pub use dicom::segmentation::{DicomSegment, Segmentation};
pub use grid::{Frame, lps_from_voxel};
pub use reconstruct::{
    Compounding, Config, Fan, Filling, Interpolation, Lattice, Reconstruction, Settings,
    Transforms, frames_of_pose, reconstruct,
};
pub use scalar::Scalar;
pub use sequence::frames::matrix as transform;
pub use sequence::{Pose, Sequence, Summary, TrackedFrame, track};
pub use voxels::{Statistics, Voxels};
pub use write::write_meta;

/// Format of a volume file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// MetaImage (.mha, .mhd).
    MetaImage,
    /// Nearly raw raster data (.nrrd, .nhdr).
    Nrrd,
    /// NIfTI-1 (.nii, .nii.gz).
    Nifti,
    /// DICOM (.dcm).
    Dicom,
}

impl Format {
    /// Name.
    pub fn name(self) -> &'static str {
        match self {
            Self::MetaImage => "MetaImage",
            Self::Nrrd => "NRRD",
            Self::Nifti => "NIfTI-1",
            Self::Dicom => "DICOM",
        }
    }
}

/// A scalar volume, or several of one grid that follow each other in time.
#[derive(Clone, Debug)]
pub struct Volume {
    /// Format of its file.
    pub format: Format,
    /// Frame that its file is written in.
    pub frame: Frame,
    /// Type of the values in its file.
    pub stored_as: Scalar,
    /// Voxels along each axis, all at least 1.
    pub size: [usize; 3],
    /// Voxel indices (integers at voxel centres) to LPS, mm.
    pub world_from_voxel: DAffine3,
    /// Values, first axis fastest; of several volumes those of the first.
    pub voxels: Voxels,
    /// Values of the volumes after the first.
    pub later: Vec<Voxels>,
    /// Time from one volume to the next, s, where stated.
    pub interval: Option<f64>,
    /// Range and mean of the values of all volumes.
    pub statistics: Statistics,
}

/// Cosine between two axes from which on they count as not perpendicular.
const SHEAR: f64 = 1e-3;

/// Extensions of volume files.
const EXTENSIONS: [&str; 8] =
    [".mha", ".mhd", ".nrrd", ".nhdr", ".nii", ".nii.gz", ".dcm", ".dicom"];

/// The same in a message.
pub const KINDS: &str = ".mha, .mhd, .nrrd, .nhdr, .nii, .nii.gz or .dcm";

/// Returns whether a file is a volume by its extension, readable or not.
pub fn is_volume(path: &Path) -> bool {
    let name = path.to_string_lossy().to_ascii_lowercase();
    EXTENSIONS.iter().any(|e| name.ends_with(e))
}

/// Returns whether a file is of DICOM by its extension.
pub fn is_dicom(path: &Path) -> bool {
    let name = path.to_string_lossy().to_ascii_lowercase();
    [".dcm", ".dicom"].iter().any(|end| name.ends_with(end))
}

impl Volume {
    /// Reads a volume, or several over time, by the extension of its file. Of several values per voxel the
    /// first is read, of several DICOM volumes the first; slices of a tracked sequence are stacked in the
    /// file's order.
    ///
    /// # Errors
    /// A file, or a data file that it names, that is missing, cut off or wrong.
    pub fn load(path: &Path) -> Result<(Self, Vec<Warning>), FileError> {
        let name = path.to_string_lossy().to_ascii_lowercase();
        let is = |ends: &[&str]| ends.iter().any(|e| name.ends_with(e));
        if is(&[".mha", ".mhd"]) {
            meta::header(path)?.load(path)
        } else if is(&[".nrrd", ".nhdr"]) {
            nrrd::header(path)?.load(path)
        } else if is(&[".nii", ".nii.gz"]) {
            nifti::header(path)?.load(path)
        } else if is_dicom(path) {
            dicom::load(path)
        } else {
            Err(FileError::file(
                path,
                "is no volume by its extension",
                format!("give a file of the kinds {KINDS}"),
            ))
        }
    }

    /// Values of all volumes in the order of time, at least one.
    pub fn volumes(&self) -> impl Iterator<Item = &Voxels> {
        std::iter::once(&self.voxels).chain(&self.later)
    }

    /// Distance of voxel centres along each axis, mm.
    pub fn spacing(&self) -> DVec3 {
        let m = self.world_from_voxel.matrix3;
        DVec3::new(m.x_axis.length(), m.y_axis.length(), m.z_axis.length())
    }

    /// Unit vectors of the axes in LPS.
    pub fn directions(&self) -> [DVec3; 3] {
        let m = self.world_from_voxel.matrix3;
        [m.x_axis, m.y_axis, m.z_axis].map(DVec3::normalize)
    }

    /// Box in LPS around the voxels, whole voxels and not only their centres: smallest and
    /// largest corner, mm.
    pub fn bounds(&self) -> (DVec3, DVec3) {
        let size = DVec3::from(self.size.map(|n| n as f64));
        let corners = (0..8u32).map(|i| {
            let upper = DVec3::from([0, 1, 2].map(|axis| f64::from(i >> axis & 1)));
            self.world_from_voxel.transform_point3(upper * size - DVec3::splat(0.5))
        });
        corners.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), corner| {
            (low.min(corner), high.max(corner))
        })
    }

    /// Value of the first volume's voxel at these indices.
    ///
    /// # Panics
    /// When there is no such voxel.
    pub fn value(&self, [i, j, k]: [usize; 3]) -> f64 {
        let [x, y, z] = self.size;
        assert!(i < x && j < y && k < z, "voxel ({i}, {j}, {k}) of {x} x {y} x {z}");
        self.voxels.get(i + x * (j + y * k))
    }

    fn warn_of_shear(&self, path: &Path, warnings: &mut Vec<Warning>) {
        let [a, b, c] = self.directions();
        let largest = [a.dot(b), b.dot(c), c.dot(a)].iter().fold(0.0f64, |m, d| m.max(d.abs()));
        if largest > SHEAR {
            let degrees = largest.acos().to_degrees();
            let message = format!("the axes are not perpendicular ({degrees:.2} degrees apart)");
            warnings.push(Warning::warning(path, 1, message, ""));
        }
    }
}
