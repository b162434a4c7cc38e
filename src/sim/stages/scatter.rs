//! `scatter`: the echoes of scatterers along the segments.

use super::super::batches::per_path;
use super::super::layout::{Frame, SCATTER_WINDOW};
use super::super::pass::{Array, Extent, Pass, Sizes, Variants};
use super::aperture::APERTURES;
use super::inputs::{COUNTERS, FIELDS, FRAME, INSTANCES, POINTS, ROWS, SCANLINES, TISSUES};
use super::trace::{SEGMENT_COUNT, SEGMENTS};
use crate::output::npy::Element::Integer;

/// Echoes of scatterers: complex, fixed-point sums by scanline and sample.
pub const VOLUME_ECHOES: Array = Array::new("volume_echoes", Integer, 2, Sizes::samples).zeroed();

/// Point targets are as wide as the beam at once, and are not smoothed with the scatterers.
pub const POINT_ECHOES: Array =
    Array::new("point_echoes", Integer, 2, |s| if s.frame.points > 0 { s.samples() } else { 1 })
        .zeroed();

/// The stage.
pub const SCATTER: Pass = Pass {
    name: "scatter",
    variants: Variants::Tissue,
    binds: &[
        &FRAME,
        &TISSUES,
        &INSTANCES,
        &ROWS,
        &POINTS,
        &SEGMENTS,
        &SEGMENT_COUNT,
        &VOLUME_ECHOES,
        &COUNTERS,
        &SCANLINES,
        &FIELDS,
        &POINT_ECHOES,
        &APERTURES,
    ],
    makes: &[&VOLUME_ECHOES, &POINT_ECHOES],
    ..Pass::USUAL
};

/// Parts into which the segments of a scanline are divided to keep a large GPU busy. Each part weighs all segments
/// against each other once more, so that more of them are slower again: H200, segments of 7 layers, 1 / 2 / 4 / 8
/// parts: `heart` 1.69 / 1.22 / 1.03 / 1.19 ms, `abdomen` 1.34 / 1.17 / 0.97 / 1.00. Without a GPU 4 parts take a third
/// longer than 1.
const MOST_PARTS: u32 = 4;

/// Work groups per scanline that is heard, part of its segments, and window of its samples, for a device that runs about `at_once`
/// groups at once. Long lists of segments are divided among groups, and so are short ones where they leave more than half
/// of the device idle; each group clears and writes its own window.
pub fn extent(frame: &Frame, at_once: u32) -> Extent {
    let lines = frame.echo_lines;
    let windows = frame.samples.div_ceil(SCATTER_WINDOW);
    let paths = frame.segment_capacity / per_path(frame);
    let long = paths.div_ceil(8).clamp(1, 16);
    let idle = at_once / (2 * lines * windows).max(1);
    Extent::Groups([lines, long.max(idle.min(MOST_PARTS)), windows])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn segments_are_divided_where_a_device_would_be_idle() {
        let frame =
            Frame { echo_lines: 192, samples: 2048, segment_capacity: 64, ..Frame::default() };
        let groups = |frame: &Frame, at_once| match extent(frame, at_once) {
            Extent::Groups(groups) => groups,
            Extent::Threads(_) => unreachable!("work groups"),
        };
        let long = groups(&frame, 0)[1];
        assert_eq!(groups(&frame, 8), [192, long, 2]);
        assert_eq!(groups(&frame, 1 << 12), [192, long.max(MOST_PARTS), 2]);
    }
}
