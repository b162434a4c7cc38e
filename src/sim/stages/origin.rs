//! `origin`: the media that enclose the start of each line, and the place where its paths begin.

use super::super::layout::START_WORDS;
use super::super::pass::{Array, Pass, Sizes, Variants, per_line};
use super::inputs::{
    COUNTERS, FRAME, INSTANCES, NODES, NORMALS, SCANLINES, TISSUES, TRIANGLES, VERTICES,
};
use crate::output::npy::Element::Word;

/// Media in which each line starts.
pub const STACKS: Array = Array::new("stacks", Word, START_WORDS, Sizes::lines);

/// The stage.
pub const ORIGIN: Pass = Pass {
    name: "origin",
    variants: Variants::Counting,
    binds: &[
        &FRAME, &INSTANCES, &VERTICES, &NORMALS, &TRIANGLES, &NODES, &STACKS, &COUNTERS, &TISSUES,
        &SCANLINES,
    ],
    makes: &[&STACKS],
    extent: Some(per_line),
    ..Pass::USUAL
};
