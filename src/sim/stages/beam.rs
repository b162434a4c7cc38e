//! `beam`: echoes as complex samples, smoothed across the scanlines, with noise.

use super::super::layout::BEAM_LINES;
use super::super::pass::{Array, Extent, Pass, Sizes};
use super::inputs::{CONTACT, COUNTERS, FRAME, ROWS};
use super::scatter::{POINT_ECHOES, VOLUME_ECHOES};
use super::trace::SURFACE_ECHOES;
use crate::output::npy::Element::Float;

/// Complex samples smoothed across the scanlines.
pub const LATERAL: Array = Array::new("lateral", Float, 2, Sizes::samples);

/// The stage.
pub const BEAM: Pass = Pass {
    name: "beam",
    binds: &[
        &FRAME,
        &ROWS,
        &SURFACE_ECHOES,
        &VOLUME_ECHOES,
        &COUNTERS,
        &LATERAL,
        &CONTACT,
        &POINT_ECHOES,
    ],
    makes: &[&LATERAL],
    extent: Some(|f| {
        Extent::Threads([f.samples - f.first_sample, f.beam_lines.div_ceil(BEAM_LINES), 1])
    }),
    ..Pass::USUAL
};
