//! Named poses of the probe.

use glam::DAffine3;

/// A pose of the probe with a name: a standard view, a structure that is seen from there.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedPose {
    /// Its name, once in a scene.
    pub name: String,
    /// World from probe space, rigid, mm.
    pub world_from_probe: DAffine3,
}
