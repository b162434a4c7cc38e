//! `expect` and `level`: the power that the echoes of each sample have on the average; they run only where labels with
//! levels are wanted.

use super::super::layout::{Counters, Frame};
use super::super::pass::{Array, Extent, Pass, Sizes};
use super::aperture::APERTURES;
use super::inputs::{CONTACT, FRAME, INSTANCES, ROWS, SCANLINES, TISSUES};
use super::label::LABELS;
use super::trace::{SEGMENT_COUNT, SEGMENTS};
use crate::output::npy::Element::{Float, Integer, Word};

/// Of each sample and layer, the power of speckle of 0 dB that nothing weakens.
pub const SPECKLE: Array =
    Array::new("speckle", Float, 1, |s| u64::from(s.frame.samples) * u64::from(s.frame.layers));

/// Two powers of 64 bits for every sample.
pub const EXPECTED: Array = Array::new("expected", Word, 4, Sizes::samples).zeroed();

/// Baseband of the echoes of surfaces alone.
pub const SURFACE_IQ: Array = Array::new("surface_iq", Float, 2, Sizes::samples);

/// Baseband of the direct echoes of surfaces alone.
pub const DIRECT_IQ: Array = Array::new("direct_iq", Float, 2, Sizes::samples);

/// Constants in the place of the frame's own where its kernels work for the labels.
pub const DIRECT_FRAME: Array = Array::of::<Frame>("direct_frame", Word, |_| 1);

/// Direct echoes of surfaces: complex, fixed-point sums.
pub const DIRECT_ECHOES: Array = Array::new("direct_echoes", Integer, 2, Sizes::samples).zeroed();

/// Full counts, so that no segment is written.
pub const DIRECT_COUNT: Array = Array::new("direct_count", Word, 1, Sizes::lines);

/// Counters of the direct echoes.
pub const DIRECT_COUNTERS: Array = Array::of::<Counters>("direct_counters", Word, |_| 1).zeroed();

/// Echoes of nothing: zeros.
pub const NO_ECHOES: Array = Array::new("no_echoes", Integer, 2, Sizes::samples).zeroed();

/// Stands in for `lateral` where kernels work for the labels.
pub const LABEL_LATERAL: Array = Array::new("label_lateral", Float, 2, Sizes::samples);

/// Stands in for `log_image` where kernels work for the labels.
pub const LABEL_LOG_IMAGE: Array = Array::new("label_log_image", Float, 1, Sizes::samples);

/// The stage that sums the power of scatterers along the segments.
pub const EXPECT: Pass = Pass {
    name: "expect",
    binds: &[
        &FRAME,
        &TISSUES,
        &INSTANCES,
        &ROWS,
        &SEGMENTS,
        &SEGMENT_COUNT,
        &SCANLINES,
        &SPECKLE,
        &EXPECTED,
        &APERTURES,
    ],
    makes: &[&SPECKLE, &EXPECTED],
    extent: Some(|f: &Frame| Extent::Groups([f.scanlines, f.samples.div_ceil(64), 1])),
    needed: |scene| scene.simulation.levelled(),
    ..Pass::USUAL
};

/// The stage that adds the surfaces' echoes, of which [`super::super::expected`] makes the samples.
pub const LEVEL: Pass = Pass {
    name: "level",
    binds: &[&FRAME, &ROWS, &CONTACT, &EXPECTED, &SURFACE_IQ, &DIRECT_IQ, &LABELS],
    makes: &[
        &SURFACE_IQ,
        &DIRECT_IQ,
        &DIRECT_FRAME,
        &DIRECT_ECHOES,
        &DIRECT_COUNT,
        &DIRECT_COUNTERS,
        &NO_ECHOES,
        &LABEL_LATERAL,
        &LABEL_LOG_IMAGE,
    ],
    extent: Some(|f: &Frame| Extent::Threads([f.samples, f.scanlines, 1])),
    needed: |scene| scene.simulation.levelled(),
    ..Pass::USUAL
};
