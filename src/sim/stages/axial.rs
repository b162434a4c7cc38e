//! `axial`: the pulse's envelope along each scanline, and its logarithm.

use super::super::layout::AXIAL_SAMPLES;
use super::super::pass::{Array, Extent, Pass, Sizes};
use super::beam::LATERAL;
use super::inputs::{FRAME, ROWS};
use crate::output::npy::Element::Float;

/// Complex baseband by scanline and sample.
pub const IQ: Array = Array::new("iq", Float, 2, Sizes::samples);

/// Compressed envelope by scanline and sample, 0 to 1.
pub const LOG_IMAGE: Array = Array::new("log_image", Float, 1, Sizes::samples);

/// The stage.
pub const AXIAL: Pass = Pass {
    name: "axial",
    binds: &[&FRAME, &ROWS, &LATERAL, &IQ, &LOG_IMAGE],
    makes: &[&IQ, &LOG_IMAGE],
    extent: Some(|f| {
        let samples = f.samples - f.first_sample;
        Extent::Threads([samples.div_ceil(AXIAL_SAMPLES), f.beam_lines, 1])
    }),
    ..Pass::USUAL
};
