//! `label`: what each sample shows, where that is, and what became of the sound on the way; runs only where labels are
//! wanted.

use super::super::layout::{Frame, Label};
use super::super::pass::{Array, Extent, Pass, Sizes, Variants};
use super::aperture::APERTURES;
use super::inputs::{
    CONTACT, COUNTERS, FIELDS, FIELDS_BEFORE, FRAME, INSTANCES, INSTANCES_BEFORE, NODES, NORMALS,
    ROWS, SCANLINES, SMOOTHED, TISSUES, TRIANGLES, VERTICES,
};
use crate::output::npy::Element::Word;
use crate::scene::Scene;

/// Constants of the frame before.
pub const FRAME_BEFORE: Array = Array::of::<Frame>("frame_before", Word, |_| 1);

/// Labels of the samples: tissue, instance, place, loss and more.
pub const LABELS: Array = Array::of::<Label>("labels", Word, Sizes::samples);

/// The stage.
pub const LABEL: Pass = Pass {
    name: "label",
    variants: Variants::Tracer,
    binds: &[
        &FRAME,
        &TISSUES,
        &INSTANCES,
        &VERTICES,
        &NORMALS,
        &SMOOTHED,
        &TRIANGLES,
        &NODES,
        &COUNTERS,
        &SCANLINES,
        &ROWS,
        &CONTACT,
        &FIELDS,
        &FRAME_BEFORE,
        &INSTANCES_BEFORE,
        &FIELDS_BEFORE,
        &LABELS,
        &APERTURES,
    ],
    makes: &[&FRAME_BEFORE, &LABELS],
    extent: Some(|frame: &Frame| Extent::Groups([frame.scanlines, 1, 1])),
    needed: wanted,
    ..Pass::USUAL
};

/// True if frames of the scene have labels.
pub(in super::super) fn wanted(scene: &Scene) -> bool {
    scene.simulation.labels
}
