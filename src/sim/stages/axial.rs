//! `axial`: the pulse's envelope along each scanline, and its logarithm.

use super::super::layout::AXIAL_SAMPLES;
use super::super::pass::{Array, Extent, Pass, Sizes};
use crate::output::npy::Element::Float;

/// The stage.
pub const AXIAL: Pass = Pass {
    name: "axial",
    binds: &["frame", "rows", "lateral", "iq", "log_image"],
    makes: &[
        Array::new("iq", Float, 2, Sizes::samples),
        Array::new("log_image", Float, 1, Sizes::samples),
    ],
    extent: Some(|f| Extent::Threads([f.samples.div_ceil(AXIAL_SAMPLES), f.scanlines, 1])),
    ..Pass::USUAL
};
