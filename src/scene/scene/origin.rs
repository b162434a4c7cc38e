//! Places in the scene file of the changeable parts of a loaded scene, for writing them back.

/// Places of a scene's parts in its file; empty for a scene that was built in code.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Origins {
    /// Place of each of [`super::Scene::instances`].
    pub instances: Vec<Origin>,
    /// For each of [`super::Scene::tissues`], names of the tissues that give the values it does not state,
    /// the nearest first.
    pub bases: Vec<Vec<String>>,
}

/// Place of an instance in a scene file. Several come from one table where its file holds several moving
/// meshes.
#[derive(Clone, Debug, PartialEq)]
pub struct Origin {
    /// Name of its `[[mesh]]`.
    pub mesh: String,
    /// Name of the `[[selector]]` that switches its keyframes and sets their strategy; none where the mesh
    /// itself does.
    pub selector: Option<String>,
}
