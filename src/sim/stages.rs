//! The stages of a frame, each in a file of its own and described by a [`Pass`].

use super::pass::{Array, Pass};
use crate::scene::Scene;
pub use aperture::APERTURE;
pub use axial::AXIAL;
pub use beam::BEAM;
pub use blur::BLUR;
pub use chart::CHART;
pub use colour::COLOUR;
pub use convert::CONVERT;
pub use display::DISPLAY;
pub use enhance::ENHANCE;
pub use expect::{EXPECT, LEVEL};
pub use fuse::FUSE;
pub use inputs::{ANATOMY, INPUTS};
pub use label::LABEL;
pub use mask::MASK;
pub use origin::ORIGIN;
pub use paint::PAINT;
pub use pyramid::{COLLAPSE, DIFFERENCE, REDUCE};
pub use scatter::SCATTER;
pub use shadow::{DARKEN, SHADOW};
pub use tiles::TILES;
pub use tint::TINT;
pub use trace::TRACE;

pub mod aperture;
pub mod axial;
pub mod beam;
pub mod blur;
pub mod chart;
pub mod colour;
pub mod convert;
pub mod display;
pub mod enhance;
pub mod expect;
pub mod fuse;
pub mod inputs;
pub mod label;
pub mod mask;
pub mod origin;
pub mod paint;
pub mod pyramid;
pub mod scatter;
pub mod shadow;
pub mod tiles;
pub mod tint;
pub mod trace;

/// Stages of the simulated image, in order.
pub const IMAGE: [&Pass; 11] = [
    &ORIGIN,
    &TRACE[0],
    &TRACE[1],
    &APERTURE,
    &TRACE[2],
    &SCATTER,
    &BEAM,
    &AXIAL,
    &ENHANCE[0],
    &ENHANCE[1],
    &DISPLAY,
];

/// Stages of frames that have labels, in order; the first after each [`SCATTER`].
pub const LABELS: [&Pass; 4] = [&EXPECT, &LABEL, &LEVEL, &CHART];

/// Stages of frames that show an acquired volume, in order.
pub const FUSION: [&Pass; 11] = [
    &MASK,
    &SHADOW,
    &DARKEN,
    &TILES,
    &CONVERT,
    &DIFFERENCE,
    &REDUCE,
    &COLLAPSE,
    &BLUR,
    &FUSE,
    &TINT,
];

/// All stages.
pub fn all() -> impl Iterator<Item = &'static Pass> {
    IMAGE.into_iter().chain(LABELS).chain([&PAINT]).chain(FUSION).chain(&COLOUR)
}

/// Names of all stages, in order; the time of a stage is reported under its name.
pub fn names() -> Vec<&'static str> {
    let mut names: Vec<&str> = all().map(|pass| pass.name).collect();
    names.dedup();
    names
}

/// Stages that frames of a scene may run, with any settings.
pub(super) fn of(scene: &Scene) -> impl Iterator<Item = &'static Pass> {
    let fusion = scene.volume.is_some().then_some(FUSION);
    let always = IMAGE.into_iter().chain(LABELS).chain([&PAINT]);
    always.chain(fusion.into_iter().flatten()).chain(&COLOUR)
}

/// The buffers that a frame of `scene` needs.
pub(super) fn needed(scene: &Scene) -> impl Iterator<Item = &'static Array> {
    let passes = of(scene).filter(|pass| (pass.needed)(scene));
    INPUTS.iter().chain(passes.flat_map(|pass| pass.makes)).copied()
}

/// The array of this name that a stage, the processor or the anatomy makes, for folders of arrays; none if nothing makes it.
pub fn array(name: &str) -> Option<&'static Array> {
    let mut made = all().flat_map(|pass| pass.makes).chain(&INPUTS).chain(&ANATOMY).copied();
    made.find(|array| array.name == name)
}
