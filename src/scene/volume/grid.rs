//! Places of voxels: the only module that turns frames of files into LPS.

use glam::{DAffine3, DMat3, DVec3};

use crate::settings::units::FARTHEST;

/// Smallest volume of the box that the unit vectors of the axes span; below it two axes are nearly
/// parallel (three degrees apart, the third upright) and positions mean nothing.
const MIN_DETERMINANT: f64 = 0.05;

/// Anatomical frame of a file. The letters name the directions in which x, y and z grow.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Frame {
    /// Left, posterior, superior: DICOM, ITK and this program.
    Lps,
    /// Right, anterior, superior: NIfTI and 3D Slicer.
    Ras,
    /// Left, anterior, superior.
    #[value(skip)]
    Las,
    /// None is stated; taken for LPS.
    #[value(skip)]
    Unstated,
}

impl Frame {
    /// Signs that turn a point of this frame into LPS.
    pub fn lps_signs(self) -> DVec3 {
        match self {
            Self::Lps | Self::Unstated => DVec3::ONE,
            Self::Ras => DVec3::new(-1.0, -1.0, 1.0),
            Self::Las => DVec3::new(1.0, -1.0, 1.0),
        }
    }

    /// Name in words.
    pub fn name(self) -> &'static str {
        match self {
            Self::Lps => "LPS",
            Self::Ras => "RAS",
            Self::Las => "LAS",
            Self::Unstated => "not stated, taken for LPS",
        }
    }
}

/// Part of a length by which two statements of it may differ: single precision and rounded headers.
pub(super) const UNEQUAL: f64 = 0.01;

/// Position of voxels in the frame and the unit of a file.
pub(super) struct Grid {
    /// Step from one voxel to the next along each axis.
    pub steps: [DVec3; 3],
    /// Centre of the first voxel.
    pub origin: DVec3,
    /// Frame of these vectors.
    pub frame: Frame,
    /// mm per unit of these vectors.
    pub unit: f64,
}

impl Grid {
    /// Transform from voxel indices (integers at centres) to LPS in mm.
    ///
    /// # Errors
    /// The fault of the numbers.
    pub fn world_from_voxel(&self) -> Result<DAffine3, String> {
        let finite = self.steps.iter().all(|s| s.is_finite()) && self.origin.is_finite();
        if !finite {
            return Err("direction or origin is not a finite number".to_owned());
        }
        for (axis, step) in ["first", "second", "third"].iter().zip(self.steps) {
            if step.length() == 0.0 || !step.length().is_finite() {
                return Err(format!("the {axis} axis has a step of length {}", step.length()));
            }
        }
        let [a, b, c] = self.steps.map(DVec3::normalize);
        let determinant = DMat3::from_cols(a, b, c).determinant();
        // Also false for a step too short to have a direction.
        if !determinant.is_finite() || determinant.abs() < MIN_DETERMINANT {
            return Err(format!("the direction is singular: its unit axes span {determinant:.4}"));
        }
        let far = self.origin.abs().max_element() * self.unit;
        if far > FARTHEST {
            return Err(format!(
                "the first voxel is {far:.3e} mm away, and at most {FARTHEST:e} mm can be resolved: the origin or its unit is wrong"
            ));
        }
        let place = |v: DVec3| v * self.frame.lps_signs() * self.unit;
        let [x, y, z] = self.steps.map(place);
        Ok(DAffine3::from_mat3_translation(DMat3::from_cols(x, y, z), place(self.origin)))
    }
}

/// The transform from voxel indices to LPS of one to a frame, mm.
///
/// # Errors
/// The fault of the numbers.
pub fn lps_from_voxel(frame_from_voxel: &DAffine3, frame: Frame) -> Result<DAffine3, String> {
    let DMat3 { x_axis, y_axis, z_axis } = frame_from_voxel.matrix3;
    let (steps, origin) = ([x_axis, y_axis, z_axis], frame_from_voxel.translation);
    Grid { steps, origin, frame, unit: 1.0 }.world_from_voxel()
}

/// Steps of a volume of two or three axes with these spacings, whose directions are the rows of `rows`
/// (`n` by `n`, n at least 2; parts beyond three are ignored).
pub(super) fn steps(n: usize, rows: &[f64], spacings: &[f64]) -> [DVec3; 3] {
    std::array::from_fn(|axis| {
        if axis >= n {
            return DVec3::Z;
        }
        let at = |k: usize| if k < n { rows[axis * n + k] } else { 0.0 };
        DVec3::new(at(0), at(1), at(2)) * spacings[axis]
    })
}

/// The first three of `values`, zeros after their end.
pub(super) fn point(values: &[f64]) -> DVec3 {
    let at = |k: usize| values.get(k).copied().unwrap_or(0.0);
    DVec3::new(at(0), at(1), at(2))
}
