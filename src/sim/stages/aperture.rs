//! `aperture`: what the aperture that converges on a target lets through, of what the scanline's main path alone loses.

use super::super::layout::{APERTURE_BANDS, Aperture, Frame, LEVEL_STEP};
use super::super::pass::{Array, Extent, Pass, Sizes};
use super::inputs::{FRAME, ROWS, SCANLINES};
use crate::output::npy::Element::Float;

/// By layer, node and scanline.
pub const APERTURES: Array = Array::of::<Aperture>("apertures", Float, nodes);

/// The stage; it runs behind the main paths and in front of all that echoes there.
pub const APERTURE: Pass = Pass {
    name: "aperture",
    binds: &[&FRAME, &ROWS, &SCANLINES, &APERTURES],
    makes: &[&APERTURES],
    extent: Some(|frame: &Frame| extent(frame, u32::MAX)),
    // Kernels that read nothing of it bind it, too.
    needed: |_| true,
    ..Pass::USUAL
};

/// Scanlines of a work group.
const LINES: u32 = 64 * LEVEL_STEP;

/// Most work groups among which the nodes of as many scanlines are dealt out.
const MOST_GROUPS: u32 = 4;

/// Work groups for a device that runs about `at_once` of them at once: each finds out by itself where scanlines differ, so
/// that more than keep the device busy are slower.
pub fn extent(frame: &Frame, at_once: u32) -> Extent {
    // A thread begins with one whose number on the face LEVEL_STEP divides.
    let lines = (frame.scanlines + frame.first_line % LEVEL_STEP).div_ceil(LINES);
    let groups = at_once / (lines * frame.layers).max(1);
    Extent::Groups([lines, groups.clamp(1, MOST_GROUPS), frame.layers])
}

/// The losses of an acquired volume's shadows, for which the stage runs once more.
pub(super) const SHADES: Array = Array::of::<Aperture>("shades", Float, nodes);

/// Nodes of depth of all lines.
fn nodes(sizes: &Sizes) -> u64 {
    sizes.lines() * u64::from(APERTURE_BANDS + 1)
}
