//! `convert`: mask and acquired volume from the scanlines to the pixels, where these are wanted for themselves.

use super::super::pass::{Array, Pass, Sizes};
use super::inputs::FRAME;
use super::mask::PRESCAN;
use super::tiles::TILE_LIST;
use super::tiles::per_tile;
use crate::output::npy::Element::Float;
use crate::scene::Scene;

/// Mask and weight of every pixel.
pub const MASK_IMAGE: Array = Array::new("mask", Float, 2, Sizes::pixels);

/// Acquired grey level of every pixel.
pub const BACKGROUND: Array = Array::new("background", Float, 1, Sizes::pixels);

/// The stage.
pub const CONVERT: Pass = Pass {
    name: "convert",
    binds: &[&FRAME, &TILE_LIST, &PRESCAN, &MASK_IMAGE, &BACKGROUND],
    makes: &[&MASK_IMAGE, &BACKGROUND],
    extent: Some(per_tile),
    needed: Scene::shows_volume,
    ..Pass::USUAL
};
