//! Normals averaged over an area about each vertex: the surface as a wide beam refracts at it.
//!
//! A beam refracts as a wavefront, not as a ray: by the mean slope of the surface over its width. The mean of the
//! unit normals over an area has just that slope, of a plane exactly and wherever normals are weighted by area. Bumps
//! smaller than the width cancel; a plane, a sphere and a cylinder keep their normals, as they lie alike around every
//! point. The average is diffusion along the surface (backward Euler steps on linear finite elements, from one scale
//! to the next), so that it does not depend on the triangulation and never leaves a connected patch: a surface that
//! is near only through space, as the next vessel of a bundle, has no part in it. Neither has a surface behind an
//! edge sharper than [`CREASE`].
//!
//! The mean is short where a body is thinner than the beam is wide, as at the edge of the liver: the area reaches around
//! it to the far side, whose normals cancel those of the near one. That length goes with the direction, as the measure
//! of how much of the wavefront the surface turns; the rest passes the body by.

use glam::DVec3;

use super::Mesh;
use super::mesh::{Soup, weld};
use super::normals::split;

mod elements;

use elements::Elements;

/// Number of scales per vertex; each is twice the one before.
pub const LEVELS: usize = 4;

/// The finest of them, mm of the world where a mesh is placed first, to within a factor of two for what is scaled.
/// Below it the vertices' own normals are mixed in.
pub const FINEST: f64 = 2.0;

/// Dihedral angle from which on two sides refract apart, degrees: a box's sides do, the steps of a segmentation that
/// was smoothed at all are flatter.
const CREASE: f32 = 80.0;

/// Lengths of a mean of unit normals from which its direction begins to count, and counts in full. If the two sides
/// of a thin sheet are averaged, they cancel, and the direction of the rest is arbitrary.
const LENGTH: [f64; 2] = [0.05, 0.15];

/// Relative lengths of a mean from which on it begins to stand for a surface that covers the whole beam, and does: a
/// sphere 2.7 times as large as the deviation refracts by Snell's law.
const WHOLE: [f64; 2] = [0.6, 0.9];

/// For each vertex the normals averaged with standard deviations of 1, 2, 4 and 8 times `finest` (in the mesh's unit)
/// along the surface: outward, [`pack`]ed with their coherence. Where a mean has no direction it is the next finer
/// one, in the end the vertex's own normal.
///
/// The coherence is the length of the mean relative to that which the finest bumps leave: 1 on a surface that is
/// large against the deviation, however bumpy; 0 where two sides cancel. That of the finest scale is 1, since bumps
/// and edges are one there.
pub fn smoothed(mesh: &Mesh, finest: f64) -> Vec<[u32; LEVELS]> {
    let soup = Soup {
        positions: mesh.positions.clone(),
        triangles: mesh.triangles.clone(),
        ..Soup::default()
    };
    let nodes = split(&weld(&soup), CREASE);
    let corners = || mesh.triangles.iter().flatten().zip(nodes.triangles.iter().flatten());
    let places: Vec<DVec3> = place_nodes(mesh, &nodes.triangles, nodes.source.len());
    let elements = Elements::new(&places, &nodes.triangles);
    let normal = |v: u32| DVec3::from(mesh.normals[v as usize].map(f64::from));
    let mut means = elements.means(corners().map(|(&v, _)| normal(v)));
    let mut directions: Vec<DVec3> =
        means.iter().map(|m| m.truncate().normalize_or_zero()).collect();
    let mut levels = vec![[0; LEVELS]; nodes.source.len()];
    let mut variance = 0.0;
    for level in 0..LEVELS {
        let deviation = finest * f64::from(1 << level);
        means = elements.diffused(means, (deviation * deviation - variance) / 2.0);
        variance = deviation * deviation;
        for ((direction, mean), packed) in directions.iter_mut().zip(&mut means).zip(&mut levels) {
            let sum = mean.truncate();
            if level == 0 {
                // What the finest bumps leave is averaged along with the normals from here on.
                mean.w = sum.length();
            }
            *direction = accepted(*direction, sum);
            let length = if mean.w > 0.0 { sum.length() / mean.w } else { 1.0 };
            packed[level] = pack(*direction, length + (1.0 - length) * rise(WHOLE, length));
        }
    }
    let mut out: Vec<[u32; LEVELS]> =
        (0..mesh.normals.len() as u32).map(|v| [pack(normal(v), 1.0); LEVELS]).collect();
    for (&vertex, &node) in corners() {
        if directions[node as usize] != DVec3::ZERO {
            out[vertex as usize] = levels[node as usize];
        }
    }
    out
}

/// Positions of the nodes of `triangles`, which follow each other as those of the mesh do.
fn place_nodes(mesh: &Mesh, triangles: &[[u32; 3]], count: usize) -> Vec<DVec3> {
    let mut places = vec![DVec3::ZERO; count];
    for (&vertex, &node) in mesh.triangles.iter().flatten().zip(triangles.iter().flatten()) {
        places[node as usize] = DVec3::from(mesh.positions[vertex as usize].map(f64::from));
    }
    places
}

/// The direction of a mean of normals, or that of the next `finer` one where it has none.
fn accepted(finer: DVec3, mean: DVec3) -> DVec3 {
    let length = mean.length();
    if length == 0.0 {
        return finer;
    }
    finer.lerp(mean / length, rise(LENGTH, length)).normalize_or(finer)
}

/// Smooth step from 0 to 1 between the two.
fn rise([from, to]: [f64; 2], x: f64) -> f64 {
    let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// A unit vector and a `coherence` of 0 to 1 (what is above counts as 1) in a word. The vector is projected onto an
/// octahedron (Meyer et al. 2010), x in bits 0 to 12 and y in bits 13 to 25 in steps of 1/4095, signed; within
/// 5e-4 rad. The coherence is in the 6 bits above, in steps of 1/63. The zero vector becomes an arbitrary unit vector.
pub fn pack(v: DVec3, coherence: f64) -> u32 {
    let size = v.abs().element_sum();
    let p = if size > 0.0 { v / size } else { DVec3::Z };
    let fold = |a: f64, b: f64| (1.0 - b.abs()).copysign(a);
    let [x, y] = if p.z < 0.0 { [fold(p.x, p.y), fold(p.y, p.x)] } else { [p.x, p.y] };
    let part = |e: f64| (e * 4095.0).round() as i32 as u32 & 0x1fff;
    let share = (coherence.clamp(0.0, 1.0) * 63.0).round() as u32;
    part(x) | part(y) << 13 | share << 26
}

#[cfg(test)]
mod tests;
