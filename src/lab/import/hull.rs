//! A skin around structures that have none: their convex hull, seen from many directions, and a margin.

use glam::DVec3;

use super::grid::Grid;
use crate::scene::mesh::Soup;
use crate::scene::shapes;

/// Halvings of the icosahedron whose corners are the directions: 2562 of them, 4 degrees apart.
const SUBDIVISIONS: u32 = 4;

/// A convex closed surface around all labelled voxels, at least about `margin` mm away from them; none without any.
///
/// It is the polyhedron of the planes that touch the voxels from each of the directions, moved out by the margin, cut by
/// rays from its middle: its corners lie on the polyhedron, its triangles under it by less than a thousandth of
/// its radius.
pub fn around(grid: &Grid, margin: f64) -> Option<Soup> {
    let sphere = shapes::sphere(1.0, SUBDIVISIONS);
    let directions: Vec<DVec3> =
        sphere.positions.iter().map(|p| DVec3::from(p.map(f64::from)).normalize()).collect();
    let points = ends(grid);
    let (low, high) = points
        .iter()
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| (l.min(*p), h.max(*p)));
    if points.is_empty() {
        return None;
    }
    let middle = (low + high) / 2.0;
    let height = |d: &DVec3| {
        let most = points.iter().map(|p| (*p - middle).dot(*d)).fold(0.0, f64::max);
        most + margin
    };
    let heights: Vec<f64> = directions.iter().map(height).collect();
    let place = |ray: &DVec3| {
        let planes = directions.iter().zip(&heights);
        let reach = planes
            .filter_map(|(d, h)| {
                let along = d.dot(*ray);
                (along > 1e-3).then_some(h / along)
            })
            .fold(f64::INFINITY, f64::min);
        (middle + *ray * reach).as_vec3().to_array()
    };
    Some(Soup {
        name: "skin".to_owned(),
        positions: directions.iter().map(place).collect(),
        triangles: sphere.triangles,
    })
}

/// The corners of the first and the last labelled voxel of each row: nothing labelled lies outside their hull.
fn ends(grid: &Grid) -> Vec<DVec3> {
    let [x, y, z] = grid.size;
    let mut out = Vec::new();
    for (k, j) in (0..z).flat_map(|k| (0..y).map(move |j| (k, j))) {
        let row = &grid.voxels[x * (j + y * k)..][..x];
        let Some(first) = row.iter().position(|l| *l > 0) else { continue };
        let last = row.iter().rposition(|l| *l > 0).expect("there is one");
        for (i, side) in [(first, -0.5), (last, 0.5)] {
            for corner in 0..4 {
                let half = |bit: i32| f64::from(corner >> bit & 1) - 0.5;
                let p = DVec3::new(i as f64 + side, j as f64 + half(0), k as f64 + half(1));
                out.push(grid.world_from_voxel.transform_point3(p));
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use glam::DAffine3;

    use super::*;
    use crate::scene::topology;

    #[test]
    fn a_ball_gets_a_ball_around_it() {
        let middle = DVec3::new(20.0, 19.0, 21.0);
        let mut voxels = Vec::new();
        for (k, j) in (0..42).flat_map(|k| (0..42).map(move |j| (k, j))) {
            voxels.extend((0..42).map(|i| {
                let p = DVec3::new(f64::from(i), f64::from(j), f64::from(k));
                u8::from(p.distance(middle) < 15.0)
            }));
        }
        let world_from_voxel = DAffine3::from_scale(DVec3::new(-2.0, 2.0, 2.0));
        let grid = Grid { size: [42; 3], world_from_voxel, voxels };
        let skin = around(&grid, 5.0).expect("voxels");
        let centre = world_from_voxel.transform_point3(middle);
        for p in &skin.positions {
            // The outermost voxels end 1 mm inside the ball along the axes; corners stand out by up to 1.7 mm.
            let off = DVec3::from(p.map(f64::from)).distance(centre) - 35.0;
            assert!((-1.01..2.0).contains(&off), "{off}");
        }
        assert!(topology::volume(&skin) > 0.0 && topology::boundary_loops(&skin).is_empty());
        assert!(around(&Grid { voxels: vec![0; 42 * 42 * 42], ..grid }, 5.0).is_none());
    }
}
