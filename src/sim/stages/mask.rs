//! `mask`, in frames that show an acquired volume: masking meshes and volume along the scanlines.

use super::super::layout::{Frame, Fusion};
use super::super::pass::{Array, Extent, Pass, Sizes, Variants};
use crate::output::npy::Element::{Float, Word};
use crate::scene::Scene;

/// The stage.
pub const MASK: Pass = Pass {
    name: "mask",
    variants: Variants::Tracer,
    binds: &[
        "frame",
        "instances",
        "vertices",
        "normals",
        "triangles",
        "nodes",
        "fusion",
        "acquired",
        "counters",
        "prescan",
        "scanlines",
        "tissues",
        "mask_blocks",
    ],
    makes: &[
        Array::of::<Fusion>("fusion", Word, |_| 1),
        // Mask and grey level of every sample.
        Array::new("prescan", Float, 2, Sizes::samples),
        Array::new("mask_blocks", Word, 1, Sizes::mask_blocks),
    ],
    extent: Some(|frame: &Frame| Extent::Groups([frame.scanlines, 1, 1])),
    needed: Scene::shows_volume,
    ..Pass::USUAL
};
