//! `aperture`: what the aperture that converges on a target lets through, of what the scanline's main path alone loses.

use super::super::layout::{APERTURE_BANDS, APERTURE_GROUPS, Frame};
use super::super::pass::{Array, Extent, Pass, Sizes};
use crate::output::npy::Element::Float;

/// The stage; it runs behind the main paths and in front of all that echoes there.
pub const APERTURE: Pass = Pass {
    name: "aperture",
    binds: &["frame", "rows", "scanlines", "apertures"],
    makes: &[
        // Nepers of gain and of loss, by layer, node and scanline.
        Array::new("apertures", Float, 2, nodes),
    ],
    extent: Some(|f: &Frame| Extent::Groups([f.scanlines.div_ceil(64), APERTURE_GROUPS, f.layers])),
    // Kernels that read nothing of it bind it, too.
    needed: |_| true,
    ..Pass::USUAL
};

/// The losses of an acquired volume's shadows, for which the stage runs once more.
pub(super) const SHADES: Array = Array::new("shades", Float, 2, nodes);

/// Nodes of depth of all lines.
fn nodes(sizes: &Sizes) -> u64 {
    sizes.lines() * u64::from(APERTURE_BANDS + 1)
}
