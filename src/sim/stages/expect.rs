//! `expect` and `level`: the power that the echoes of each sample have on the average; they run only where labels with
//! levels are wanted.

use super::super::layout::{Counters, Frame};
use super::super::pass::{Array, Extent, Pass, Sizes};
use crate::output::npy::Element::{Float, Integer, Word};

/// The stage that sums the power of scatterers along the segments.
pub const EXPECT: Pass = Pass {
    name: "expect",
    binds: &[
        "frame",
        "tissues",
        "instances",
        "rows",
        "segments",
        "segment_count",
        "scanlines",
        "speckle",
        "expected",
        "apertures",
    ],
    makes: &[
        Array::new("speckle", Float, 1, |s| u64::from(s.frame.samples) * u64::from(s.frame.layers)),
        // Two powers of 64 bits for every sample.
        Array::new("expected", Word, 4, Sizes::samples).zeroed(),
    ],
    extent: Some(|f: &Frame| Extent::Groups([f.scanlines, f.samples.div_ceil(64), 1])),
    needed: |scene| scene.simulation.levelled(),
    ..Pass::USUAL
};

/// The stage that adds the surfaces' echoes, of which [`super::super::expected`] makes the samples.
pub const LEVEL: Pass = Pass {
    name: "level",
    binds: &["frame", "rows", "contact", "expected", "surface_iq", "direct_iq", "labels"],
    makes: &[
        Array::new("surface_iq", Float, 2, Sizes::samples),
        Array::new("direct_iq", Float, 2, Sizes::samples),
        // What stands in for the frame's own where its kernels work for the labels.
        Array::of::<Frame>("direct_frame", Word, |_| 1),
        Array::new("direct_echoes", Integer, 2, Sizes::samples).zeroed(),
        Array::new("direct_count", Word, 1, Sizes::lines),
        Array::of::<Counters>("direct_counters", Word, |_| 1).zeroed(),
        Array::new("no_echoes", Integer, 2, Sizes::samples).zeroed(),
        Array::new("label_lateral", Float, 2, Sizes::samples),
        Array::new("label_log_image", Float, 1, Sizes::samples),
    ],
    extent: Some(|f: &Frame| Extent::Threads([f.samples, f.scanlines, 1])),
    needed: |scene| scene.simulation.levelled(),
    ..Pass::USUAL
};
