//! Closed surfaces as voxels: which centres of voxels they enclose.

use std::ops::Range;

use glam::{DAffine3, DVec3};

use crate::scene::mesh::Soup;

/// Calls `inside` with the voxels of each row whose centres lie in a closed surface: their indices along x, and
/// the row's along y and z. `voxel_from_world` leads to voxel indices (integers at centres). A centre is inside
/// where a line along x from it crosses the surface an odd number of times. A centre in line with an edge lies as if it
/// were beside it by less than any number, so that no edge counts twice or not at all.
pub fn rasterise(
    soup: &Soup,
    voxel_from_world: &DAffine3,
    size: [usize; 3],
    mut inside: impl FnMut(Range<usize>, usize, usize),
) {
    let place = |p: &[f32; 3]| voxel_from_world.transform_point3(DVec3::from(p.map(f64::from)));
    let positions: Vec<DVec3> = soup.positions.iter().map(place).collect();
    let mut crossings: Vec<(u64, f64)> = Vec::new();
    for triangle in &soup.triangles {
        let corners = triangle.map(|v| positions[v as usize]);
        let low = corners[0].min(corners[1]).min(corners[2]).ceil();
        let high = corners[0].max(corners[1]).max(corners[2]).floor();
        let span = |a: usize| {
            let last = (high[a] as isize).min(size[a] as isize - 1);
            (low[a] as isize).max(0)..last + 1
        };
        for k in span(2) {
            for j in span(1) {
                if let Some(x) = crossing(*triangle, corners, j as f64, k as f64) {
                    crossings.push(((j as usize + size[1] * k as usize) as u64, x));
                }
            }
        }
    }
    crossings.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    for row in crossings.chunk_by(|a, b| a.0 == b.0) {
        for pair in row.as_chunks::<2>().0 {
            let index = |x: f64| (x.ceil().max(0.0) as usize).min(size[0]);
            let (from, to) = (index(pair[0].1), index(pair[1].1));
            if from < to {
                inside(from..to, row[0].0 as usize % size[1], row[0].0 as usize / size[1]);
            }
        }
    }
}

/// The x at which the line along x through (y, z) crosses a triangle; none where it does not.
fn crossing(triangle: [u32; 3], corners: [DVec3; 3], y: f64, z: f64) -> Option<f64> {
    let mut weights = [0.0; 3];
    let mut sides = [false; 3];
    for n in 0..3 {
        let (m, o) = ((n + 1) % 3, (n + 2) % 3);
        // The same sum for both triangles of an edge: from the smaller number to the larger.
        let turned = triangle[m] > triangle[o];
        let (a, b) = if turned { (corners[o], corners[m]) } else { (corners[m], corners[o]) };
        let d = b - a;
        let area = d.y * (z - a.z) - d.z * (y - a.y);
        // On the line: as if y were larger by a little, and z by far less.
        let beside = if area != 0.0 {
            area
        } else if d.z != 0.0 {
            -d.z
        } else {
            d.y
        };
        sides[n] = (beside > 0.0) != turned;
        weights[n] = if turned { -area } else { area };
    }
    let total: f64 = weights.iter().sum();
    if sides[0] != sides[1] || sides[1] != sides[2] || total == 0.0 {
        return None;
    }
    Some((0..3).map(|n| corners[n].x * weights[n] / total).sum())
}
