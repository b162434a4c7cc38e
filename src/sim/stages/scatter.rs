//! `scatter`: the echoes of scatterers along the segments.

use super::super::batches::per_path;
use super::super::layout::{FLAG_LINE, FLAG_VOXEL, Frame, SCATTER_WINDOW};
use super::super::pass::{Array, Extent, Pass, Sizes, Variants};
use crate::output::npy::Element::Integer;

/// The stage.
pub const SCATTER: Pass = Pass {
    name: "scatter",
    variants: Variants::Tissue,
    binds: &[
        "frame",
        "tissues",
        "instances",
        "rows",
        "points",
        "segments",
        "segment_count",
        "volume_echoes",
        "counters",
        "scanlines",
        "fields",
    ],
    makes: &[Array::new("volume_echoes", Integer, 2, Sizes::samples).zeroed()],
    extent: Some(extent),
    ..Pass::USUAL
};

/// Work groups per scanline, part of its segments, and window of its samples. Long lists of segments are
/// divided among groups; each group clears and writes its own window.
fn extent(frame: &Frame) -> Extent {
    let paths = frame.segment_capacity / per_path(frame);
    let parts = paths.div_ceil(8).clamp(1, 16);
    // The scatterers of lines beside one that is made alone are not heard: see the kernel.
    let alone = frame.flags & (FLAG_LINE | FLAG_VOXEL) == FLAG_LINE;
    let lines = if alone { 1 } else { frame.scanlines };
    Extent::Groups([lines, parts, frame.samples.div_ceil(SCATTER_WINDOW)])
}
