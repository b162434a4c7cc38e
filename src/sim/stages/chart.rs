//! `chart`: the labels from the scanlines to the pixels; runs only where labels are wanted.

use super::super::layout::Label;
use super::super::pass::{Array, Pass, Sizes, per_pixel};
use super::inputs::FRAME;
use super::label::{LABELS, wanted};
use crate::output::npy::Element::Word;

/// Labels of the pixels: those of the samples that they show.
pub const PIXEL_LABELS: Array = Array::of::<Label>("pixel_labels", Word, Sizes::pixels);

/// The stage.
pub const CHART: Pass = Pass {
    name: "chart",
    binds: &[&FRAME, &LABELS, &PIXEL_LABELS],
    makes: &[&PIXEL_LABELS],
    extent: Some(per_pixel),
    needed: wanted,
    ..Pass::USUAL
};
