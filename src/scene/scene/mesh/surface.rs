//! Surfaces that a program gives as arrays, and their further shapes.

use std::path::Path;

use super::recipe::Recipe;
use super::{MAX_ELEMENTS, Soup, Units};
use crate::issue::Issue;
use crate::scene::{Mesh, check};

/// A surface of a program: from the positions of its vertices to meshes of one topology.
pub struct Surface {
    name: String,
    recipe: Recipe,
    vertices: usize,
}

impl Surface {
    /// Repairs and checks a surface as one of a file, mm: vertices that coincide are joined, triangles turned alike.
    /// Returns it with its mesh and the repairs.
    ///
    /// # Errors
    /// All findings, if one of them stops loading: indices of no vertex, numbers that are not finite, too much.
    pub fn new(
        name: &str,
        positions: Vec<[f32; 3]>,
        triangles: Vec<[u32; 3]>,
        cap_openings: bool,
    ) -> Result<(Self, Mesh, Vec<Issue>), Vec<Issue>> {
        let path = Path::new(name);
        let refuse = |count, message: String, remedy: &str| {
            Err(vec![Issue::error(path, count, message, remedy)])
        };
        let vertices = positions.len();
        if vertices.max(triangles.len()) > MAX_ELEMENTS {
            let message = format!("{vertices} vertices and {} triangles", triangles.len());
            return refuse(
                1,
                message,
                &format!("at most {MAX_ELEMENTS} of each fit: reduce the mesh"),
            );
        }
        let beyond = triangles.iter().flatten().filter(|v| **v as usize >= vertices).count();
        if beyond > 0 {
            let message =
                format!("{beyond} indices of triangles name no vertex: there are {vertices}");
            return refuse(
                beyond,
                message,
                "indices count from 0 and lie below the number of vertices",
            );
        }
        let raw = Soup { name: name.to_owned(), positions, triangles };
        let (recipe, mut soup, mut issues) = Recipe::new(path, &raw, &[], cap_openings);
        let (_, more) = check::examine(path, &mut soup, Units(1.0), 1.0);
        issues.extend(more);
        if issues.iter().any(Issue::is_error) {
            return Err(issues);
        }
        let mesh = recipe.mesh(name, &soup.positions);
        Ok((Self { name: name.to_owned(), recipe, vertices }, mesh, issues))
    }

    /// Number of vertices as they were given.
    pub fn vertices(&self) -> usize {
        self.vertices
    }

    /// The mesh for other positions of the vertices, in the order in which they were given; its triangles are those of
    /// the first shape.
    ///
    /// # Panics
    /// Not as many positions as vertices.
    pub fn shape(&self, positions: &[[f32; 3]]) -> Mesh {
        assert_eq!(positions.len(), self.vertices, "positions of all vertices");
        self.recipe.mesh(&self.name, &self.recipe.surface(positions))
    }
}
