//! `label`: the anatomy along the scanlines, without refraction; runs only where labels are wanted.

use super::super::layout::Frame;
use super::super::pass::{Array, Extent, Pass, Sizes, Variants};
use crate::output::npy::Element::Word;
use crate::scene::Scene;

/// The stage.
pub const LABEL: Pass = Pass {
    name: "label",
    variants: Variants::Tracer,
    binds: &[
        "frame",
        "instances",
        "vertices",
        "normals",
        "triangles",
        "nodes",
        "counters",
        "scanlines",
        "labels",
    ],
    // Instance, or none, and tissue of every sample.
    makes: &[Array::new("labels", Word, 2, Sizes::samples)],
    extent: Some(|frame: &Frame| Extent::Groups([frame.scanlines, 1, 1])),
    needed: |scene: &Scene| scene.simulation.labels,
    ..Pass::USUAL
};
