//! Registration of a model with an acquired volume by surfaces (Starkov et al. 2019, figure 3): points of a
//! structure segmented in the volume are fitted to the same structure of the model.
//!
//! Everything here is in the scene's world, mm: points of the volume have been transformed by the scene's
//! placement of it. The result is the similarity that takes them from there to the model.
//! [`landmarks`] give a start in closed form; [`icp`] does the rest.

use glam::DAffine3;

pub mod icp;
pub mod landmarks;
pub mod placement;
pub mod points;
pub mod surface;
mod symmetric;

pub use icp::{Fit, Residuals};
pub use placement::Placement;
pub use surface::TriangleSurface;

/// Degrees of freedom of a registration. Neither mirrors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Transformation {
    /// Rotation and shift.
    Rigid,
    /// Rotation, shift and one scale for all axes.
    Similarity,
}

/// The scale of a similarity: the cube root of the factor on volumes.
pub fn scale_of(similarity: &DAffine3) -> f64 {
    similarity.matrix3.determinant().cbrt()
}
