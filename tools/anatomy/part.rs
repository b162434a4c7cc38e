//! One mesh of a scene before it is meshed.

use fidget::context::Tree;

/// One mesh of the scene.
#[derive(Clone)]
pub struct Part {
    /// Name of the mesh and of its file.
    pub name: &'static str,
    /// Tissue inside.
    pub tissue: &'static str,
    /// Coarsest cell that still resolves the part, mm.
    pub cell: f32,
    /// Weight of an error of the surface, mm2, when triangles are shared out.
    pub weight: f64,
    /// The signed distance field.
    pub field: Tree,
}

/// A part from its name, tissue, coarsest cell with weight, and field.
pub fn part(
    name: &'static str,
    tissue: &'static str,
    (cell, weight): (f32, f64),
    field: Tree,
) -> Part {
    Part { name, tissue, cell, weight, field }
}
