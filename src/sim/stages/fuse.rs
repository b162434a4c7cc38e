//! `fuse`: simulated and acquired image mixed.

use super::super::pass::{Array, Pass, Sizes, per_pixel};
use crate::gpu::Stage;
use crate::output::npy::Element::Word;
use crate::scene::Scene;

/// The stage.
pub const FUSE: Pass = Pass {
    name: "fuse",
    binds: &["frame", "fusion", "pixels", "background", "sums", "fused", "change"],
    makes: &[Array::new("fused", Word, 1, Sizes::pixels)],
    extent: Some(per_pixel),
    then: Stage::Transfer,
    needed: Scene::shows_volume,
    ..Pass::USUAL
};
