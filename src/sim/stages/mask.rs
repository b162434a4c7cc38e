//! `mask`, in frames that show an acquired volume: masking meshes and volume along the scanlines.

use super::super::layout::{Frame, Fusion};
use super::super::pass::{Array, Extent, Pass, Sizes, Variants};
use super::inputs::{
    COUNTERS, FRAME, INSTANCES, NODES, NORMALS, SCANLINES, TISSUES, TRIANGLES, VERTICES,
};
use crate::output::npy::Element::{Float, Word};
use crate::scene::Scene;

/// Constants of the fusion.
pub const FUSION: Array = Array::of::<Fusion>("fusion", Word, |_| 1);

/// Mask and grey level of every sample.
pub const PRESCAN: Array = Array::new("prescan", Float, 2, Sizes::samples);

/// Bits of each block of samples: whether the mask is open, closed or both in it.
pub const MASK_BLOCKS: Array = Array::new("mask_blocks", Word, 1, Sizes::mask_blocks);

/// The volume, an image.
pub const ACQUIRED: Array = Array::given("acquired", Float, 1);

/// The stage.
pub const MASK: Pass = Pass {
    name: "mask",
    variants: Variants::Tracer,
    binds: &[
        &FRAME,
        &INSTANCES,
        &VERTICES,
        &NORMALS,
        &TRIANGLES,
        &NODES,
        &FUSION,
        &ACQUIRED,
        &COUNTERS,
        &PRESCAN,
        &SCANLINES,
        &TISSUES,
        &MASK_BLOCKS,
    ],
    makes: &[&FUSION, &PRESCAN, &MASK_BLOCKS],
    extent: Some(|frame: &Frame| Extent::Groups([frame.scanlines, 1, 1])),
    needed: Scene::shows_volume,
    ..Pass::USUAL
};
