//! Shapes that an instance takes over time, and how the device goes from one to the next.

use std::fmt;

use serde::Deserialize;

/// How the structures that rays walk follow an instance that changes its shape. The same shape gives
/// the same image by every strategy that can show it; they differ in what is stored and what is built.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Strategy {
    /// Every keyframe's structure is built once; the top level is rebuilt over the one that is shown
    /// (Starkov et al. 2019, section II-B, with the tight box of an exchanged node).
    #[default]
    Selector,
    /// As `selector`, but the top level is refitted. The compute tracer, whose top level is made on
    /// the host, keeps its tree and recomputes its boxes.
    Update,
    /// Every keyframe is in the top level at all times, and rays pass by all but one: nothing is built.
    Mask,
    /// Selector node of Starkov et al. 2019: one entry in the top level with the box around all
    /// keyframes, whose child is exchanged: nothing is built. Compute tracer only.
    Union,
    /// The keyframe's geometry is uploaded and its structure built, fast, when it is shown.
    Rebuild,
    /// As `rebuild`, from geometry that has stayed on the device.
    Cached,
    /// One structure for all keyframes, which must have equal triangles; its boxes follow the vertices.
    Refit,
    /// As `refit`, over vertices between the keyframes.
    Interpolate,
}

impl Strategy {
    /// All of them, in the order in which tables list them.
    pub const ALL: [Self; 8] = [
        Self::Selector,
        Self::Update,
        Self::Mask,
        Self::Union,
        Self::Rebuild,
        Self::Cached,
        Self::Refit,
        Self::Interpolate,
    ];

    /// Whether keyframes must have equal triangles.
    pub fn needs_shared_topology(self) -> bool {
        matches!(self, Self::Refit | Self::Interpolate)
    }
}

impl fmt::Display for Strategy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Selector => "selector",
            Self::Update => "update",
            Self::Mask => "mask",
            Self::Union => "union",
            Self::Rebuild => "rebuild",
            Self::Cached => "cached",
            Self::Refit => "refit",
            Self::Interpolate => "interpolate",
        })
    }
}

/// Keyframes of one instance.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Keyframes {
    /// Indices into [`super::Scene::meshes`], in order; empty where the shape is constant.
    pub meshes: Vec<usize>,
    /// How the device follows.
    pub strategy: Strategy,
    /// Numbers of up to four keyframes and their weights, which sum to 1: the present shape under
    /// [`Strategy::Interpolate`]. Weights of cubic interpolation may be negative.
    pub blend: [(usize, f64); 4],
    /// What changes shape together: instances of one group have keyframes of the same times, and move
    /// the tissue between them. None: the instance alone.
    pub group: Option<usize>,
}

impl Keyframes {
    /// The keyframe nearest to the present shape: the one of largest weight.
    pub fn nearest(&self) -> usize {
        let heaviest = |a: &(usize, f64), b: &(usize, f64)| a.1.total_cmp(&b.1);
        // The first of equals.
        let found = self.blend.iter().rev().copied().max_by(heaviest);
        found.map_or(0, |(keyframe, _)| keyframe)
    }
}
