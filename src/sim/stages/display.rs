//! `display`: scan conversion and grey map.

use super::super::pass::{Array, Pass, Sizes};
use super::axial::LOG_IMAGE;
use super::inputs::{FRAME, GREY};
use super::tiles::per_tile;
use crate::gpu::Stage;
use crate::output::npy::Element::Word;

/// The simulated image, RGBA.
pub const PIXELS: Array = Array::new("pixels", Word, 1, Sizes::pixels);

/// The stage.
pub const DISPLAY: Pass = Pass {
    name: "display",
    binds: &[&FRAME, &LOG_IMAGE, &GREY, &PIXELS],
    makes: &[&PIXELS],
    extent: Some(per_tile),
    // The finished image is copied next.
    then: Stage::Transfer,
    ..Pass::USUAL
};
