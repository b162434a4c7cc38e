//! `trace`: paths through the anatomy, their surface echoes and their segments. One kernel per role of
//! its paths ([`Round::role`]), which [`super::super::rounds`] dispatches.

use super::super::layout::{Interaction, ROLE_BRANCHES, ROLE_MAIN, ROLE_WHOLE, Segment};
use super::super::pass::{Array, Pass, Sizes, Variants};
#[cfg(doc)]
use super::super::rounds::Round;
use crate::output::npy::Element::{Integer, Word};
use crate::scene::Scene;
use crate::settings::Sampling;

/// The stage, by role.
pub const TRACE: [Pass; 3] = [
    Pass { constants: &[(0, ROLE_WHOLE)], needed: |scene| !has_main_paths(scene), ..ANY },
    Pass { constants: &[(0, ROLE_MAIN)], needed: has_main_paths, ..ANY },
    Pass { constants: &[(0, ROLE_BRANCHES)], needed: has_main_paths, ..ANY },
];

const ANY: Pass = Pass {
    name: "trace",
    variants: Variants::Counting,
    binds: &[
        "frame",
        "tissues",
        "surfaces",
        "instances",
        "vertices",
        "normals",
        "smoothed",
        "triangles",
        "nodes",
        "stacks",
        "rows",
        "surface_echoes",
        "segments",
        "segment_count",
        "counters",
        "fields",
        "interactions",
        "interaction_count",
        "scanlines",
        "apertures",
    ],
    makes: &[
        Array::new("surface_echoes", Integer, 2, Sizes::samples).zeroed(),
        Array::of::<Segment>("segments", Word, |s| s.lines() * u64::from(s.frame.segment_capacity)),
        Array::new("segment_count", Word, 1, Sizes::lines).zeroed(),
        // Interactions of main paths. `beam` fills `lateral`, whose memory they use, when they are no longer needed.
        Array::of::<Interaction>("interactions", Word, |s| s.interactions).within("lateral"),
        Array::new("interaction_count", Word, 1, |s| s.main_paths),
    ],
    ..Pass::USUAL
};

fn has_main_paths(scene: &Scene) -> bool {
    scene.simulation.sampling == Sampling::MainPath
}
