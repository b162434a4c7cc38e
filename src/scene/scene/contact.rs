//! Contact of the probe with the body's surface.

/// The body's surface, and the gap that sound crosses between it and the probe.
#[derive(Clone, Debug, PartialEq)]
pub struct Contact {
    /// Closed meshes whose union is the body that the probe touches: indices into
    /// [`super::Scene::instances`].
    pub skin: Vec<usize>,
    /// Widest gap between face and skin, along the beam, that sound still crosses, mm.
    pub gel: f64,
    /// Tissue that fills the gap: index into [`super::Scene::tissues`].
    pub couplant: usize,
}
