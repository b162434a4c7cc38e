//! `shadow` and `darken`: shadows of the simulated anatomy in the acquired volume.

use super::super::layout::MAX_PIECES;
use super::super::pass::{Array, Extent, Pass, Sizes, Variants, per_line};
use super::aperture::SHADES;
use crate::output::npy::Element::Float;
use crate::scene::Scene;

/// The stage that computes the transmitted level along each line.
pub const SHADOW: Pass = Pass {
    name: "shadow",
    variants: Variants::Tracer,
    binds: &[
        "frame",
        "tissues",
        "instances",
        "vertices",
        "normals",
        "smoothed",
        "triangles",
        "nodes",
        "stacks",
        "rows",
        "pieces",
        "scanlines",
        "shades",
    ],
    makes: &[Array::new("pieces", Float, 4, |s| MAX_PIECES as u64 * s.lines()), SHADES],
    extent: Some(per_line),
    needed: has_shadows,
    ..Pass::USUAL
};

/// The stage that darkens the prescan behind the anatomy.
pub const DARKEN: Pass = Pass {
    name: "darken",
    binds: &["frame", "pieces", "prescan", "shaded", "shades"],
    makes: &[Array::new("shaded", Float, 2, Sizes::samples)],
    extent: Some(|f| Extent::Threads([f.samples, f.scanlines, 1])),
    needed: has_shadows,
    ..Pass::USUAL
};

fn has_shadows(scene: &Scene) -> bool {
    scene.shows_volume() && scene.fusion.as_ref().is_some_and(|f| f.background_shadows)
}
