//! Which meshes are the body's surface, and how closely the probe must be held to it.

/// Where sound gets from the probe into the body, and back.
#[derive(Clone, Debug, PartialEq)]
pub struct Contact {
    /// The meshes, all closed, of which the union is the body that the probe is held to: indices into
    /// [`super::Scene::instances`].
    pub skin: Vec<usize>,
    /// Widest gap between face and skin, along the beam, that sound still crosses, mm.
    pub gel: f64,
}
