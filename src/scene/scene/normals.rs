//! Shading normals: angle-weighted means over the triangles of a smooth fan, split at creases.

use glam::Vec3;

use super::Mesh;
use super::mesh::Soup;
use super::topology::Edges;

/// A surface whose vertices are split at creases, for any positions of its vertices.
pub struct Split {
    /// Indices of split vertices, triangle by triangle as in the surface.
    pub triangles: Vec<[u32; 3]>,
    /// The surface's vertex that each split vertex copies.
    pub source: Vec<u32>,
}

/// Splits vertices where neighbouring triangles meet at more than `crease` degrees, and shades.
pub fn shade(soup: &Soup, crease: f32) -> Mesh {
    split(soup, crease).mesh(&soup.name, &soup.positions)
}

/// Splits vertices where neighbouring triangles meet at more than `crease` degrees.
pub fn split(soup: &Soup, crease: f32) -> Split {
    let face = |t: usize| face_normal(soup.triangles[t], &soup.positions);
    let smooth = crease.to_radians().cos();
    let mut fans = Fans::new(soup.triangles.len() * 3);
    for pair in Edges::of(soup).manifold() {
        let [s, t] = pair.map(|e| e.triangle as usize);
        if face(s).dot(face(t)) < smooth {
            continue;
        }
        for vertex in [pair[0].low, pair[0].high] {
            fans.unite(corner(soup, s, vertex), corner(soup, t, vertex));
        }
    }
    let mut out = Split { triangles: Vec::with_capacity(soup.triangles.len()), source: Vec::new() };
    let mut vertex_of_fan = vec![u32::MAX; soup.triangles.len() * 3];
    for (t, triangle) in soup.triangles.iter().enumerate() {
        out.triangles.push([0, 1, 2].map(|k| {
            let fan = fans.root(t * 3 + k);
            if vertex_of_fan[fan] == u32::MAX {
                vertex_of_fan[fan] = out.source.len() as u32;
                out.source.push(triangle[k]);
            }
            vertex_of_fan[fan]
        }));
    }
    out
}

impl Split {
    /// The surface with its vertices at `positions`, and the normals of that shape.
    ///
    /// The weights of the faces are the corner angles (Thurmer and Wuthrich 1998), so that a normal
    /// does not depend on the triangulation of a flat part.
    pub fn mesh(&self, name: &str, positions: &[[f32; 3]]) -> Mesh {
        let positions: Vec<_> = self.source.iter().map(|&i| positions[i as usize]).collect();
        let mut sums = vec![Vec3::ZERO; positions.len()];
        for triangle in &self.triangles {
            let normal = face_normal(*triangle, &positions);
            // A triangle without area has no direction, and its angles are not numbers.
            if normal == Vec3::ZERO {
                continue;
            }
            let points = triangle.map(|i| Vec3::from(positions[i as usize]));
            for k in 0..3 {
                let to_next = points[(k + 1) % 3] - points[k];
                let to_last = points[(k + 2) % 3] - points[k];
                sums[triangle[k] as usize] += normal * to_next.angle_between(to_last);
            }
        }
        let mut normals = vec![[0.0; 3]; positions.len()];
        for triangle in &self.triangles {
            for &i in triangle {
                // Opposite faces of a folded surface can cancel; any face normal is then as good. No ray asks for the
                // normal of a fan without any area.
                let face = || face_normal(*triangle, &positions).try_normalize();
                let unit = sums[i as usize].try_normalize().or_else(face);
                normals[i as usize] = unit.unwrap_or(Vec3::Z).to_array();
            }
        }
        Mesh { name: name.to_owned(), positions, normals, triangles: self.triangles.clone() }
    }
}

fn face_normal(triangle: [u32; 3], positions: &[[f32; 3]]) -> Vec3 {
    let [a, b, c] = triangle.map(|i| Vec3::from(positions[i as usize]));
    (b - a).cross(c - a).normalize_or_zero()
}

fn corner(soup: &Soup, triangle: usize, vertex: u32) -> usize {
    let k = soup.triangles[triangle].iter().position(|&i| i == vertex);
    triangle * 3 + k.expect("an edge's vertices belong to its triangles")
}

/// Union-find over triangle corners.
struct Fans(Vec<u32>);

impl Fans {
    fn new(corners: usize) -> Self {
        Self((0..corners as u32).collect())
    }

    fn root(&mut self, mut i: usize) -> usize {
        while self.0[i] as usize != i {
            self.0[i] = self.0[self.0[i] as usize];
            i = self.0[i] as usize;
        }
        i
    }

    fn unite(&mut self, a: usize, b: usize) {
        let (a, b) = (self.root(a), self.root(b));
        let (low, high) = (a.min(b), a.max(b));
        self.0[high] = low as u32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wedge(degrees: f32) -> Soup {
        // Two triangles sharing the x axis, folded by `degrees`.
        let (sin, cos) = degrees.to_radians().sin_cos();
        Soup {
            positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.5, 1.0, 0.0], [0.5, -cos, -sin]],
            triangles: vec![[0, 1, 2], [1, 0, 3]],
            ..Soup::default()
        }
    }

    #[test]
    fn creases_split_and_smooth_edges_do_not() {
        assert_eq!(shade(&wedge(30.0), 40.0).positions.len(), 4);
        assert_eq!(shade(&wedge(50.0), 40.0).positions.len(), 6);
    }

    #[test]
    fn a_smooth_edge_has_the_mean_normal() {
        let mesh = shade(&wedge(30.0), 40.0);
        let n = Vec3::from(mesh.normals[0]);
        // Equal corner angles: the bisector, 15 degrees from either face; f32 rounding.
        assert!((n.angle_between(Vec3::Z).to_degrees() - 15.0).abs() < 1e-3, "{n}");
        assert!((n.length() - 1.0).abs() < 1e-6);
    }
}
