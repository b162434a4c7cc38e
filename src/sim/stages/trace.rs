//! `trace`: paths through the anatomy, their surface echoes and their segments. One kernel per role of
//! its paths ([`Round::role`]), which [`super::super::rounds`] dispatches.

use super::super::layout::{Interaction, ROLE_BRANCHES, ROLE_MAIN, ROLE_WHOLE, Segment};
use super::super::pass::{Array, Pass, Sizes, Variants};
#[cfg(doc)]
use super::super::rounds::Round;
use super::aperture::APERTURES;
use super::beam::LATERAL;
use super::inputs::{
    COUNTERS, FIELDS, FRAME, INSTANCES, NODES, NORMALS, ROWS, SCANLINES, SMOOTHED, SURFACES,
    TISSUES, TRIANGLES, VERTICES,
};
use super::origin::STACKS;
use crate::output::npy::Element::{Integer, Word};
use crate::scene::Scene;
use crate::settings::Sampling;

/// Echoes of surfaces: complex, fixed-point sums by scanline and sample.
pub const SURFACE_ECHOES: Array = Array::new("surface_echoes", Integer, 2, Sizes::samples).zeroed();

/// Parts of paths between surfaces, by line.
pub const SEGMENTS: Array =
    Array::of::<Segment>("segments", Word, |s| s.lines() * u64::from(s.frame.segment_capacity));

/// Number of segments that each line has, including those without room.
pub const SEGMENT_COUNT: Array = Array::new("segment_count", Word, 1, Sizes::lines).zeroed();

/// Interactions of main paths. `beam` fills `lateral`, whose memory they use, when they are no longer needed.
pub const INTERACTIONS: Array =
    Array::of::<Interaction>("interactions", Word, |s| s.interactions).within(&LATERAL);

/// Number of interactions of each main path.
pub const INTERACTION_COUNT: Array = Array::new("interaction_count", Word, 1, |s| s.main_paths);

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
        &FRAME,
        &TISSUES,
        &SURFACES,
        &INSTANCES,
        &VERTICES,
        &NORMALS,
        &SMOOTHED,
        &TRIANGLES,
        &NODES,
        &STACKS,
        &ROWS,
        &SURFACE_ECHOES,
        &SEGMENTS,
        &SEGMENT_COUNT,
        &COUNTERS,
        &FIELDS,
        &INTERACTIONS,
        &INTERACTION_COUNT,
        &SCANLINES,
        &APERTURES,
    ],
    makes: &[&SURFACE_ECHOES, &SEGMENTS, &SEGMENT_COUNT, &INTERACTIONS, &INTERACTION_COUNT],
    ..Pass::USUAL
};

fn has_main_paths(scene: &Scene) -> bool {
    scene.simulation.sampling == Sampling::MainPath
}
