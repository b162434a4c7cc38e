//! `display`: scan conversion and grey map.

use super::super::pass::{Array, Pass, Sizes};
use super::tiles::per_tile;
use crate::gpu::Stage;
use crate::output::npy::Element::Word;

/// The stage.
pub const DISPLAY: Pass = Pass {
    name: "display",
    binds: &["frame", "log_image", "grey", "pixels"],
    makes: &[Array::new("pixels", Word, 1, Sizes::pixels)],
    extent: Some(per_tile),
    // The finished image is copied next.
    then: Stage::Transfer,
    ..Pass::USUAL
};
