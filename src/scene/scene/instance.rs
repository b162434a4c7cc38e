//! A placed mesh.

use glam::DAffine3;

use super::keyframes::Keyframes;
use crate::settings::Surface;

/// One placed mesh with the tissue that it encloses.
#[derive(Clone, Debug)]
pub struct Instance {
    /// Name in messages and label lists.
    pub name: String,
    /// The present shape: index into [`Scene::meshes`](super::Scene::meshes).
    pub mesh: usize,
    /// Shapes over time; none for a constant one.
    pub keyframes: Keyframes,
    /// True where it is in the scene now: selectors leave out all subtrees but one.
    pub shown: bool,
    /// Index into [`Scene::tissues`](super::Scene::tissues).
    pub tissue: usize,
    /// Priority where enclosed volumes overlap: the highest wins; ties go to the one entered last.
    pub priority: i32,
    /// World from object space, mm.
    pub world_from_object: DAffine3,
    /// Echo properties from outside and from inside.
    pub surface: [Surface; 2],
}
