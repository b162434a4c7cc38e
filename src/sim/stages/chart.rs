//! `chart`: the labels from the scanlines to the pixels; runs only where labels are wanted.

use super::super::layout::Label;
use super::super::pass::{Array, Pass, Sizes, per_pixel};
use super::label::wanted;
use crate::output::npy::Element::Word;

/// The stage.
pub const CHART: Pass = Pass {
    name: "chart",
    binds: &["frame", "labels", "pixel_labels"],
    makes: &[Array::of::<Label>("pixel_labels", Word, Sizes::pixels)],
    extent: Some(per_pixel),
    needed: wanted,
    ..Pass::USUAL
};
