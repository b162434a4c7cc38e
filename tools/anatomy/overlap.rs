//! Test for surfaces that pass through each other or themselves: edges of one that pierce triangles of
//! the other.

use std::collections::HashMap;

use glam::{DVec3, IVec3};

use crate::check::Surface;

/// Triangles by the cells of a grid that their boxes touch.
struct Grid {
    cell: f64,
    cells: HashMap<IVec3, Vec<u32>>,
}

impl Grid {
    fn new(surface: &Surface) -> Self {
        let lengths = surface.triangles.iter().map(|t| {
            let [a, b, _] = corners(surface, t);
            a.distance(b)
        });
        let cell = 1.5 * lengths.sum::<f64>() / surface.triangles.len().max(1) as f64;
        let mut grid = Self { cell, cells: HashMap::new() };
        for (i, t) in surface.triangles.iter().enumerate() {
            let ends = corners(surface, t);
            for at in grid.touched(&ends) {
                grid.cells.entry(at).or_default().push(i as u32);
            }
        }
        grid
    }

    fn touched(&self, points: &[DVec3]) -> Vec<IVec3> {
        let low = points.iter().copied().reduce(DVec3::min).expect("points");
        let high = points.iter().copied().reduce(DVec3::max).expect("points");
        let [low, high] = [low, high].map(|p| (p / self.cell).floor().as_ivec3());
        let mut out = Vec::new();
        for x in low.x..=high.x {
            for y in low.y..=high.y {
                out.extend((low.z..=high.z).map(|z| IVec3::new(x, y, z)));
            }
        }
        out
    }
}

fn corners(surface: &Surface, t: &[u32; 3]) -> [DVec3; 3] {
    t.map(|i| surface.positions[i as usize].as_dvec3())
}

/// Returns whether the segment passes through the triangle's inside.
fn pierces([p, q]: [DVec3; 2], [a, b, c]: [DVec3; 3]) -> bool {
    let side = |u: DVec3, v: DVec3, w: DVec3, x: DVec3| (v - u).cross(w - u).dot(x - u);
    if side(a, b, c, p) * side(a, b, c, q) >= 0.0 {
        return false;
    }
    let around = [(a, b), (b, c), (c, a)].map(|(u, v)| side(p, q, u, v));
    around.iter().all(|s| *s > 0.0) || around.iter().all(|s| *s < 0.0)
}

/// Edges of `a` that pierce `b`, or, where both are the same surface, triangles that they do not
/// belong to.
fn one_way(a: &Surface, b: &Surface, same: bool) -> usize {
    let grid = Grid::new(b);
    let mut count = 0;
    for t in &a.triangles {
        for (i, j) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
            // Each edge once: the other triangle has it the other way round.
            if i > j {
                continue;
            }
            let ends = [i, j].map(|v| a.positions[v as usize].as_dvec3());
            let mut near: Vec<u32> = grid
                .touched(&ends)
                .iter()
                .filter_map(|at| grid.cells.get(at))
                .flatten()
                .copied()
                .collect();
            near.sort_unstable();
            near.dedup();
            let hit = near.iter().any(|&n| {
                let t = &b.triangles[n as usize];
                let own = same && (t.contains(&i) || t.contains(&j));
                !own && pierces(ends, corners(b, t))
            });
            count += usize::from(hit);
        }
    }
    count
}

/// Edges of either surface that pierce the other.
pub fn between(a: &Surface, b: &Surface) -> usize {
    one_way(a, b, false) + one_way(b, a, false)
}

/// Edges of a surface that pierce it elsewhere.
pub fn within(a: &Surface) -> usize {
    one_way(a, a, true)
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::field::{Field, Point, ellipsoid};
    use crate::meshing::mesh;

    fn sphere(radius: f32, at: f32) -> Surface {
        let field = Field::new(&ellipsoid(&Point::world(), Vec3::splat(radius)));
        let mut out = mesh(&field, Vec3::splat(-12.0), Vec3::splat(12.0), 2.0).expect("sound");
        for p in &mut out.positions {
            p.x += at;
        }
        out
    }

    #[test]
    fn spheres_pierce_each_other_where_they_cross() {
        let whole = sphere(10.0, 0.0);
        assert_eq!(within(&whole), 0);
        // Inside, and beside by a tenth of a millimetre: sagittae are h2 / 8 R = 0.05 mm.
        assert_eq!(between(&whole, &sphere(5.0, 0.0)), 0);
        assert_eq!(between(&whole, &sphere(5.0, 15.1)), 0);
        assert!(between(&whole, &sphere(5.0, 9.0)) > 10);

        let mut dented = whole;
        let top = (0..dented.positions.len())
            .max_by(|&a, &b| dented.positions[a].x.total_cmp(&dented.positions[b].x))
            .expect("vertices");
        dented.positions[top].x = -11.0;
        assert!(within(&dented) > 0);
    }
}
