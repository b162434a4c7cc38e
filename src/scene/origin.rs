//! Where the scene file says what may be changed of a loaded scene: for those who write it back.

/// Where a scene's parts come from; empty for a scene that was built in code.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Origins {
    /// Of each of [`super::Scene::instances`].
    pub instances: Vec<Origin>,
    /// Of each of [`super::Scene::tissues`] the names of those from which it takes what it does not
    /// say, the nearest first.
    pub bases: Vec<Vec<String>>,
}

/// Where a scene file describes an instance. Several come from one table where its file holds several
/// meshes that move.
#[derive(Clone, Debug, PartialEq)]
pub struct Origin {
    /// Name of its `[[mesh]]`.
    pub mesh: String,
    /// Name of the `[[selector]]` that switches its keyframes and says by which strategy; none where
    /// the mesh says so itself.
    pub selector: Option<String>,
}
