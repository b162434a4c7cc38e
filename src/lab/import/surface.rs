//! The surface of one body out of a net: the faces between it and everything else.

use glam::DVec3;

use super::grid::Grid;
use super::nets::{Face, Net};
use crate::scene::mesh::Soup;

/// The vertices of a net in the world, and its faces as triangles: each face is cut once for both sides.
pub struct Surfaces<'n> {
    net: &'n Net,
    /// Places, LPS, mm.
    positions: Vec<[f32; 3]>,
    /// True where the axes of the voxels are left-handed.
    mirrored: bool,
    /// Number of each vertex in the present surface; numbers from earlier surfaces have no meaning.
    numbers: Vec<u32>,
}

impl<'n> Surfaces<'n> {
    /// The surfaces of this grid's net.
    pub fn new(grid: &Grid, net: &'n Net) -> Self {
        let place = |v: usize| {
            let p = DVec3::from(net.place(v as u32));
            grid.world_from_voxel.transform_point3(p).as_vec3().to_array()
        };
        Self {
            net,
            positions: (0..net.vertices.len()).map(place).collect(),
            mirrored: grid.world_from_voxel.matrix3.determinant() < 0.0,
            numbers: vec![u32::MAX; net.vertices.len()],
        }
    }

    /// The surface of the union of these labels, outward; empty where they have no voxels.
    pub fn of(&mut self, name: &str, inside: impl Fn(u8) -> bool) -> Soup {
        let mut soup = Soup { name: name.to_owned(), ..Soup::default() };
        for face in &self.net.faces {
            let [first, second] = face.labels.map(&inside);
            if first == second {
                continue;
            }
            for triangle in self.triangles(face) {
                let triangle = triangle.map(|v| {
                    // A number from an earlier surface may be in range by chance: the vertex tells.
                    let number = &mut self.numbers[v as usize];
                    let known = soup.positions.get(*number as usize);
                    if known != Some(&self.positions[v as usize]) {
                        *number = soup.positions.len() as u32;
                        soup.positions.push(self.positions[v as usize]);
                    }
                    *number
                });
                let [a, b, c] = triangle;
                soup.triangles.push(if second != self.mirrored { [a, c, b] } else { [a, b, c] });
            }
        }
        soup
    }

    /// The two triangles of a face: of its diagonals the shorter, unless a triangle then faces the other way.
    fn triangles(&self, face: &Face) -> [[u32; 3]; 2] {
        let [p, q, r, s] = face.vertices;
        let cuts = [[[p, q, r], [p, r, s]], [[q, r, s], [q, s, p]]];
        let length = |a: u32, b: u32| {
            let [a, b] = [a, b].map(|v| DVec3::from(self.positions[v as usize].map(f64::from)));
            a.distance_squared(b)
        };
        let sound = |cut: &[[u32; 3]; 2]| cut.iter().all(|t| self.faces_on(face, *t));
        let [short, long] = match length(p, r) <= length(q, s) {
            true => [cuts[0], cuts[1]],
            false => [cuts[1], cuts[0]],
        };
        if !sound(&short) && sound(&long) { long } else { short }
    }

    /// Returns whether a triangle faces the second label, in voxels.
    fn faces_on(&self, face: &Face, triangle: [u32; 3]) -> bool {
        let [a, b, c] = triangle.map(|v| DVec3::from(self.net.place(v)));
        (b - a).cross(c - a)[usize::from(face.axis)] > 0.0
    }
}
