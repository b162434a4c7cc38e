//! `beam`: echoes as complex samples, smoothed across the scanlines, with noise.

use super::super::layout::BEAM_LINES;
use super::super::pass::{Array, Extent, Pass, Sizes};
use crate::output::npy::Element::Float;

/// The stage.
pub const BEAM: Pass = Pass {
    name: "beam",
    binds: &[
        "frame",
        "rows",
        "surface_echoes",
        "volume_echoes",
        "counters",
        "lateral",
        "contact",
        "point_echoes",
    ],
    makes: &[Array::new("lateral", Float, 2, Sizes::samples)],
    extent: Some(|f| Extent::Threads([f.samples, f.scanlines.div_ceil(BEAM_LINES), 1])),
    ..Pass::USUAL
};
