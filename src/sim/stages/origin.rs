//! `origin`: the media that enclose the start of each line, and the place where its paths begin.

use super::super::layout::START_WORDS;
use super::super::pass::{Array, Pass, Sizes, Variants, per_line};
use crate::output::npy::Element::Word;

/// The stage.
pub const ORIGIN: Pass = Pass {
    name: "origin",
    variants: Variants::Counting,
    binds: &[
        "frame",
        "instances",
        "vertices",
        "normals",
        "triangles",
        "nodes",
        "stacks",
        "counters",
        "tissues",
        "scanlines",
    ],
    makes: &[Array::new("stacks", Word, START_WORDS, Sizes::lines)],
    extent: Some(per_line),
    ..Pass::USUAL
};
