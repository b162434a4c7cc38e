//! The recipe that turns a file's vertices into a mesh: made from one shape of a surface, applied to all.

use std::collections::HashMap;
use std::path::Path;

use super::soup::{Mesh, Soup};
use crate::issue::Issue;
use crate::scene::normals::{self, Split};
use crate::scene::topology;

/// Dihedral angle above which shading normals are split, degrees.
const CREASE: f32 = 40.0;

/// The vertices of a file's surface after repair, each with the file's vertices that it comes from.
pub struct Recipe {
    /// The file's vertex at the place of each welded vertex.
    welded: Vec<u32>,
    /// Welded vertices around each opening; their centres are the vertices after the welded ones.
    rings: Vec<Vec<u32>>,
    split: Split,
}

impl Recipe {
    /// Welds, cleans, orients, caps and splits `raw`. `others` are further positions of its vertices: vertices
    /// that separate, and triangles that have an area, in one of them are kept. Also returns the repaired surface
    /// before the split, and the repairs.
    pub fn new(
        path: &Path,
        raw: &Soup,
        others: &[Vec<[f32; 3]>],
        cap_openings: bool,
    ) -> (Self, Soup, Vec<Issue>) {
        let (mut soup, welded) = weld_shapes(raw, others);
        let others: Vec<Vec<[f32; 3]>> = others.iter().map(|p| pick(p, &welded)).collect();
        let mut issues = topology::clean(path, &mut soup, &others);
        drop(others);
        issues.extend(topology::orient(path, &mut soup));
        let mut rings = Vec::new();
        if cap_openings {
            let more;
            (rings, more) = topology::cap(path, &mut soup);
            issues.extend(more);
        }
        let split = normals::split(&soup, CREASE);
        let recipe = Self { welded, rings, split };
        (recipe, soup, issues)
    }

    /// Vertices of the repaired surface for some positions of the file's vertices.
    pub fn surface(&self, raw: &[[f32; 3]]) -> Vec<[f32; 3]> {
        let mut positions = pick(raw, &self.welded);
        for ring in &self.rings {
            positions.push(topology::centre(&positions, ring));
        }
        positions
    }

    /// The mesh for vertices of the repaired surface, as [`Recipe::surface`] gives them.
    pub fn mesh(&self, name: &str, surface: &[[f32; 3]]) -> Mesh {
        self.split.mesh(name, surface)
    }
}

fn pick(positions: &[[f32; 3]], which: &[u32]) -> Vec<[f32; 3]> {
    which.iter().map(|&i| positions[i as usize]).collect()
}

/// Unites vertices of exactly equal position, for topology; drops unused ones.
pub fn weld(soup: &Soup) -> Soup {
    weld_shapes(soup, &[]).0
}

/// Position as bits; adding zero makes -0 and +0 equal.
fn place(position: [f32; 3]) -> [u32; 3] {
    position.map(|v| (v + 0.0).to_bits())
}

/// Unites vertices that coincide in every shape; also returns the original of each.
fn weld_shapes(soup: &Soup, others: &[Vec<[f32; 3]>]) -> (Soup, Vec<u32>) {
    // Vertices of one class coincide in all shapes seen so far.
    let mut class = vec![0u32; soup.positions.len()];
    for positions in others {
        let mut seen: HashMap<(u32, [u32; 3]), u32> = HashMap::new();
        for (class, &position) in class.iter_mut().zip(positions) {
            let next = seen.len() as u32;
            *class = *seen.entry((*class, place(position))).or_insert(next);
        }
    }
    let mut seen: HashMap<(u32, [u32; 3]), u32> = HashMap::new();
    let mut welded = Vec::new();
    let mut out = Soup {
        name: soup.name.clone(),
        triangles: Vec::with_capacity(soup.triangles.len()),
        ..Soup::default()
    };
    for triangle in &soup.triangles {
        out.triangles.push(triangle.map(|i| {
            let position = soup.positions[i as usize];
            let key = (class[i as usize], place(position));
            *seen.entry(key).or_insert_with(|| {
                out.positions.push(position.map(|v| v + 0.0));
                welded.push(i);
                (out.positions.len() - 1) as u32
            })
        }));
    }
    (out, welded)
}
