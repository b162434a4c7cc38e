//! `shadow` and `darken`: shadows of the simulated anatomy in the acquired volume.

use super::super::layout::MAX_PIECES;
use super::super::pass::{Array, Extent, Pass, Sizes, Variants, per_line};
use super::aperture::SHADES;
use super::inputs::{
    FRAME, INSTANCES, NODES, NORMALS, ROWS, SCANLINES, SMOOTHED, TISSUES, TRIANGLES, VERTICES,
};
use super::mask::PRESCAN;
use super::origin::STACKS;
use crate::output::npy::Element::Float;
use crate::scene::Scene;

/// Loss along each line behind its start, as pieces of straight lines.
pub const PIECES: Array = Array::new("pieces", Float, 4, |s| MAX_PIECES as u64 * s.lines());

/// Mask and acquired grey level of every sample, behind shadows.
pub const SHADED: Array = Array::new("shaded", Float, 2, Sizes::samples);

/// The stage that computes the transmitted level along each line.
pub const SHADOW: Pass = Pass {
    name: "shadow",
    variants: Variants::Tracer,
    binds: &[
        &FRAME, &TISSUES, &INSTANCES, &VERTICES, &NORMALS, &SMOOTHED, &TRIANGLES, &NODES, &STACKS,
        &ROWS, &PIECES, &SCANLINES, &SHADES,
    ],
    makes: &[&PIECES, &SHADES],
    extent: Some(per_line),
    needed: has_shadows,
    ..Pass::USUAL
};

/// The stage that darkens the prescan behind the anatomy.
pub const DARKEN: Pass = Pass {
    name: "darken",
    binds: &[&FRAME, &PIECES, &PRESCAN, &SHADED, &SHADES],
    makes: &[&SHADED],
    extent: Some(|f| Extent::Threads([f.samples, f.scanlines, 1])),
    needed: has_shadows,
    ..Pass::USUAL
};

fn has_shadows(scene: &Scene) -> bool {
    scene.shows_volume() && scene.fusion.as_ref().is_some_and(|f| f.background_shadows)
}
