//! Import of segmentations and meshes: scenes made of them.
//!
//! A label map (`labels`, with `names` from the file) becomes one closed surface per label, with the same faces on both
//! sides of a border: `composed` parts what touches along an edge, `nets` makes all surfaces at once, `relax` smooths
//! them, `surface` takes one out; `map` does all of this, for the `masks` of a folder, too. A folder of meshes goes through
//! `folder`, compared with each other by `raster`. `table` says which tissue a structure is made of, `hull`
//! makes up a skin where there is none, `pose` finds a place on it from which an organ is seen, `plausible` doubts volumes
//! that no organ has, `draft` writes the scene. Configurations of PLUS (`plus`) become scenes by `device_set`, poses of
//! sequences rows of a `trajectory`. Knows no Vulkan.

use glam::DVec3;

use crate::scene::mesh::Units;
use crate::scene::tissue::table as tissues;
use crate::settings::suggest;
use crate::volume::Frame;

pub mod composed;
pub mod device_set;
mod draft;
pub mod folder;
pub mod grid;
mod hull;
mod labels;
pub mod map;
mod masks;
mod names;
pub mod nets;
mod plausible;
mod plus;
mod pose;
pub mod raster;
pub mod relax;
pub mod surface;
pub mod table;
#[cfg(test)]
mod tests;
pub mod trajectory;

pub use draft::{Draft, Part, way};
pub use labels::{LabelMap, summary};
pub use pose::View;

/// A fault of an option: its name, the cause, the remedy.
pub type Fault = (&'static str, String, String);

/// The options of an import.
#[derive(Clone, Debug)]
pub struct Options {
    /// The tissue of each structure.
    pub table: table::Table,
    /// Distance of voxels to resample to, mm.
    pub spacing: Option<DVec3>,
    /// Organ that the probe looks at.
    pub look_at: Option<String>,
    /// Tissue of the space inside the skin that belongs to no structure.
    pub around: String,
    /// Unit of mesh files, where they are in another than their format's.
    pub units: Option<Units>,
    /// Frame of mesh files that do not state theirs; LPS without it.
    pub frame: Option<Frame>,
    /// Replaces a scene that is there.
    pub force: bool,
}

impl Options {
    /// The first fault of an option by itself; none of those that are right.
    pub fn fault(&self) -> Option<Fault> {
        if !tissues::names().any(|tissue| tissue == self.around) {
            let cause = format!("unknown tissue `{}`", self.around);
            return Some(("around", cause, suggest::among(&self.around, tissues::names())));
        }
        let is_one =
            |spacing: DVec3| spacing.is_finite() && spacing.cmpgt(DVec3::splat(1e-3)).all();
        let wrong = self.spacing.is_some_and(|spacing| !is_one(spacing));
        wrong.then(|| {
            ("spacing", "it has to be above 0.001 mm".into(), "give mm, such as 1.5".into())
        })
    }
}
