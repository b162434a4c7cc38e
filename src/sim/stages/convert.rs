//! `convert`: mask and acquired volume from the scanlines to the pixels, where these are wanted for themselves.

use super::super::pass::{Array, Pass, Sizes};
use super::tiles::per_tile;
use crate::output::npy::Element::Float;
use crate::scene::Scene;

/// The stage.
pub const CONVERT: Pass = Pass {
    name: "convert",
    binds: &["frame", "tiles", "prescan", "mask", "background"],
    makes: &[
        // Mask and weight of every pixel.
        Array::new("mask", Float, 2, Sizes::pixels),
        Array::new("background", Float, 1, Sizes::pixels),
    ],
    extent: Some(per_tile),
    needed: Scene::shows_volume,
    ..Pass::USUAL
};
