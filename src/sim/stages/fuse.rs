//! `fuse`: simulated and acquired image mixed.

use super::super::pass::{Array, Pass, Sizes};
use super::tiles::per_tile;
use crate::gpu::Stage;
use crate::output::npy::Element::Word;
use crate::scene::Scene;

/// The stage.
pub const FUSE: Pass = Pass {
    name: "fuse",
    binds: &[
        "frame",
        "fusion",
        "log_image",
        "grey",
        "prescan",
        "tiles",
        "sums",
        "fused",
        "background",
        "change",
    ],
    makes: &[Array::new("fused", Word, 1, Sizes::pixels)],
    extent: Some(per_tile),
    then: Stage::Transfer,
    needed: Scene::shows_volume,
    ..Pass::USUAL
};
