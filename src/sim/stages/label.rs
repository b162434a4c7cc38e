//! `label`: what each sample shows, where that is, and what became of the sound on the way; runs only where labels are
//! wanted.

use super::super::layout::{Frame, Label};
use super::super::pass::{Array, Extent, Pass, Sizes, Variants};
use crate::output::npy::Element::Word;
use crate::scene::Scene;

/// The stage.
pub const LABEL: Pass = Pass {
    name: "label",
    variants: Variants::Tracer,
    binds: &[
        "frame",
        "tissues",
        "instances",
        "vertices",
        "normals",
        "smoothed",
        "triangles",
        "nodes",
        "counters",
        "scanlines",
        "rows",
        "contact",
        "fields",
        "frame_before",
        "instances_before",
        "fields_before",
        "labels",
        "apertures",
    ],
    makes: &[
        Array::of::<Frame>("frame_before", Word, |_| 1),
        Array::of::<Label>("labels", Word, Sizes::samples),
    ],
    extent: Some(|frame: &Frame| Extent::Groups([frame.scanlines, 1, 1])),
    needed: wanted,
    ..Pass::USUAL
};

/// True if frames of the scene have labels.
pub(in super::super) fn wanted(scene: &Scene) -> bool {
    scene.simulation.labels
}
