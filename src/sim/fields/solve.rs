//! Displacements on a grid from those of surfaces, by conjugate gradients.

use glam::{DAffine3, DMat3, DVec3, IVec3, UVec3};

use super::Grid;
use crate::scene::Mesh;

/// Samples of a surface lie this part of the spacing apart.
const SAMPLE_PITCH: f64 = 0.5;
/// Most parts of a triangle's edge: triangles much larger than the grid are cut coarser.
const MOST_PARTS: f64 = 128.0;
/// Weight of the membrane, in units of the spacing: surfaces are missed by about this fraction of the
/// spacing times the change of strain across them.
const STIFFNESS: f64 = 0.01;
/// Residual, relative to the first, at which the displacements are good enough: they are those of the
/// remainder that is not affine, a few mm, and the carrier's phase asks for 1e-3 mm.
const RESIDUAL: f64 = 1e-4;
/// Steps after which the iteration ends in any case; it needs about a hundred.
const MOST_STEPS: usize = 400;

/// A surface that moves with the tissue.
pub(super) struct Patch<'a> {
    /// One per keyframe, of equal triangles.
    pub(super) meshes: Vec<&'a Mesh>,
    pub(super) texture_from_object: DAffine3,
}

/// One place of a surface.
struct SurfaceSample {
    cell: UVec3,
    weights: [f64; 8],
    place: DVec3,
    /// mm^2.
    area: f64,
    patch: usize,
    /// Vertices and their shares.
    corners: [u32; 3],
    shares: DVec3,
}

/// The normal equations, which all keyframes share.
pub(super) struct Solver<'a> {
    grid: &'a Grid,
    patches: &'a [Patch<'a>],
    samples: Vec<SurfaceSample>,
    matrix: Matrix,
    centre: DVec3,
    /// Inverse of the samples' second moments about `centre`.
    moments: DMat3,
}

/// A sparse matrix over the nodes, row by row.
struct Matrix {
    /// The place of each row's first entry, then the number of all.
    starts: Vec<u32>,
    /// Columns and values.
    entries: Vec<(u32, f64)>,
    diagonal: Vec<f64>,
}

impl<'a> Solver<'a> {
    pub(super) fn new(grid: &'a Grid, patches: &'a [Patch<'a>]) -> Self {
        let samples: Vec<SurfaceSample> =
            (patches.iter().enumerate()).flat_map(|(i, patch)| patch.samples(grid, i)).collect();
        let area: f64 = samples.iter().map(|s| s.area).sum();
        let sum: DVec3 = samples.iter().map(|s| s.area * s.place).sum();
        let centre = sum / area;
        let outer = |a: DVec3, b: DVec3| DMat3::from_cols(a * b.x, a * b.y, a * b.z);
        let mut moments = DMat3::ZERO;
        for s in &samples {
            moments += s.area * outer(s.place - centre, s.place - centre);
        }
        // A flat patch has no second moment across it; without this term the matrix would be singular.
        let trace = moments.x_axis.x + moments.y_axis.y + moments.z_axis.z;
        moments += DMat3::from_diagonal(DVec3::splat(1e-9 * trace + f64::MIN_POSITIVE));
        let matrix = Matrix::of(grid, &samples);
        Self { grid, patches, samples, matrix, centre, moments: moments.inverse() }
    }

    /// Displacement of every node from keyframe 0 to `keyframe`, mm.
    pub(super) fn displacements(&self, keyframe: usize) -> Vec<[f32; 3]> {
        let moved: Vec<DVec3> = (self.samples.iter())
            .map(|s| self.patches[s.patch].displacement(s, keyframe))
            .collect();
        let weighed = self.samples.iter().zip(&moved);
        let area: f64 = self.samples.iter().map(|s| s.area).sum();
        let mean = weighed.clone().map(|(s, &d)| s.area * d).sum::<DVec3>() / area;
        let mut linear = DMat3::ZERO;
        for (s, &d) in weighed {
            let (d, p) = (s.area * (d - mean), s.place - self.centre);
            linear += DMat3::from_cols(d * p.x, d * p.y, d * p.z);
        }
        linear *= self.moments;
        let affine = |p: DVec3| mean + linear * (p - self.centre);

        let mut load = vec![DVec3::ZERO; self.grid.nodes()];
        for (s, &d) in self.samples.iter().zip(&moved) {
            let rest = s.area * (d - affine(s.place));
            for (a, w) in s.weights.iter().enumerate() {
                load[self.grid.index(s.cell + corner(a))] += *w * rest;
            }
        }
        let rest = self.solve(load);
        let place = |i: usize| self.grid.place(self.grid.node(i));
        let total = rest.iter().enumerate().map(|(i, &u)| affine(place(i)) + u);
        total.map(|v| v.as_vec3().to_array()).collect()
    }

    /// Conjugate gradients with Jacobi's preconditioner, all three components at once.
    fn solve(&self, load: Vec<DVec3>) -> Vec<DVec3> {
        let inner = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| a * b).sum::<DVec3>();
        let precondition = |r: &[DVec3]| -> Vec<DVec3> {
            r.iter().zip(&self.matrix.diagonal).map(|(r, d)| r / *d).collect()
        };
        let mut u = vec![DVec3::ZERO; load.len()];
        let mut residual = load;
        let mut direction = precondition(&residual);
        let mut norm = inner(&residual, &direction);
        let enough = norm * RESIDUAL * RESIDUAL;
        let mut image = vec![DVec3::ZERO; u.len()];
        for _ in 0..MOST_STEPS {
            if norm.cmple(enough).all() {
                break;
            }
            self.matrix.apply(&direction, &mut image);
            let step = quotient(norm, inner(&direction, &image));
            for i in 0..u.len() {
                u[i] += step * direction[i];
                residual[i] -= step * image[i];
            }
            let next = precondition(&residual);
            let new = inner(&residual, &next);
            let keep = quotient(new, norm);
            for (d, n) in direction.iter_mut().zip(next) {
                *d = n + keep * *d;
            }
            norm = new;
        }
        u
    }
}

impl Matrix {
    /// The misfit on the samples and the energy of the membrane.
    fn of(grid: &Grid, samples: &[SurfaceSample]) -> Self {
        let stencil = stencil(grid, samples);
        let n = grid.size.as_ivec3();
        let [y, z] = [n.x, n.x * n.y];
        let step =
            |k: usize| k as i32 % 3 - 1 + (k as i32 / 3 % 3 - 1) * y + (k as i32 / 9 - 1) * z;
        let steps: [i32; 27] = std::array::from_fn(step);
        let (mut starts, mut entries) = (vec![0], Vec::with_capacity(8 * stencil.len()));
        for (i, row) in stencil.iter().enumerate() {
            let there = row.iter().zip(steps).filter(|(w, _)| **w != 0.0);
            entries.extend(there.map(|(w, step)| ((i as i32 + step) as u32, *w)));
            starts.push(entries.len() as u32);
        }
        let diagonal = stencil.iter().map(|row| row[around(IVec3::ZERO)]).collect();
        Self { starts, entries, diagonal }
    }

    fn apply(&self, u: &[DVec3], out: &mut [DVec3]) {
        for (ends, out) in self.starts.windows(2).zip(out) {
            let row = &self.entries[ends[0] as usize..ends[1] as usize];
            *out = row.iter().fold(DVec3::ZERO, |sum, &(column, w)| sum + w * u[column as usize]);
        }
    }
}

/// Weights of the 27 nodes around each node; 0 for those outside the grid.
fn stencil(grid: &Grid, samples: &[SurfaceSample]) -> Vec<[f64; 27]> {
    let mut stencil = vec![[0.0; 27]; grid.nodes()];
    for s in samples {
        for (a, wa) in s.weights.iter().enumerate() {
            let row = grid.index(s.cell + corner(a));
            for (b, wb) in s.weights.iter().enumerate() {
                let step = corner(b).as_ivec3() - corner(a).as_ivec3();
                stencil[row][around(step)] += s.area * wa * wb;
            }
        }
    }
    let stiffness = STIFFNESS * grid.spacing * grid.spacing;
    for (index, row) in stencil.iter_mut().enumerate() {
        let node = grid.node(index);
        for axis in 0..3 {
            let mut step = IVec3::ZERO;
            step[axis] = 1;
            let below = (node[axis] > 0).then_some(-step);
            let above = (node[axis] + 1 < grid.size[axis]).then_some(step);
            for step in below.into_iter().chain(above) {
                row[around(IVec3::ZERO)] += stiffness;
                row[around(step)] -= stiffness;
            }
        }
    }
    stencil
}

/// 0 / 0 is 0: a component without load stays where it is.
fn quotient(a: DVec3, b: DVec3) -> DVec3 {
    DVec3::select(b.cmpeq(DVec3::ZERO), DVec3::ZERO, a / b)
}

/// Steps from a cell's first node to node `n`.
fn corner(n: usize) -> UVec3 {
    UVec3::new(n as u32 & 1, n as u32 >> 1 & 1, n as u32 >> 2)
}

/// Index in the stencil of a step of -1, 0 or 1 per axis.
fn around(step: IVec3) -> usize {
    (step.x + 1 + 3 * (step.y + 1) + 9 * (step.z + 1)) as usize
}

impl Patch<'_> {
    fn point(&self, keyframe: usize, vertex: u32) -> DVec3 {
        let p = self.meshes[keyframe].positions[vertex as usize];
        self.texture_from_object.transform_point3(DVec3::from(p.map(f64::from)))
    }

    fn displacement(&self, sample: &SurfaceSample, keyframe: usize) -> DVec3 {
        let moved = sample.corners.map(|v| self.point(keyframe, v) - self.point(0, v));
        sample.shares.x * moved[0] + sample.shares.y * moved[1] + sample.shares.z * moved[2]
    }

    /// Middles of equal parts of every triangle of keyframe 0, where they lie on the grid.
    fn samples(&self, grid: &Grid, patch: usize) -> Vec<SurfaceSample> {
        let mut samples = Vec::new();
        let end = grid.place(grid.size - 1);
        for &corners in &self.meshes[0].triangles {
            let [a, b, c] = corners.map(|v| self.point(0, v));
            let (low, high) = (a.min(b).min(c), a.max(b).max(c));
            if high.cmplt(grid.origin).any() || low.cmpgt(end).any() {
                continue;
            }
            let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
            let parts = (longest / (SAMPLE_PITCH * grid.spacing)).ceil().clamp(1.0, MOST_PARTS);
            let area = (b - a).cross(c - a).length() / 2.0 / (parts * parts);
            let count = parts as u32;
            for (i, j) in (0..count).flat_map(|i| (0..count - i).map(move |j| (i, j))) {
                // Centres of the part with the triangle's orientation and of the reversed part beside it.
                for third in 1..=(if i + j + 1 < count { 2 } else { 1 }) {
                    let inside = f64::from(third) / 3.0;
                    let (u, v) = ((f64::from(i) + inside) / parts, (f64::from(j) + inside) / parts);
                    let shares = DVec3::new(1.0 - u - v, u, v);
                    let place = shares.x * a + shares.y * b + shares.z * c;
                    if let Some((cell, weights)) = grid.weights(place) {
                        samples.push(SurfaceSample {
                            cell,
                            weights,
                            place,
                            area,
                            patch,
                            corners,
                            shares,
                        });
                    }
                }
            }
        }
        samples
    }
}
