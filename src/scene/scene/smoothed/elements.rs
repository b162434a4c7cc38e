//! Diffusion on a triangulated surface: linear finite elements, lumped masses.

use std::cmp::Ordering;

use glam::{DVec3, DVec4};

/// Residual, relative to the first, at which a step is good enough: what is left turns normals by less than a
/// thousandth of what the step does.
const RESIDUAL: f64 = 1e-3;
/// Iterations after which a step ends in any case; meshes with ten edges to the scale need about fifty.
const ITERATIONS: usize = 300;

/// A surface's masses and stiffnesses.
pub(super) struct Elements {
    /// Nodes of each triangle's corners, and a third of its area.
    corners: Vec<(u32, f64)>,
    /// A third of the area of the triangles around each node.
    mass: Vec<f64>,
    /// Stiffness of each node with itself.
    own: Vec<f64>,
    /// Start of the links of each node; one more entry for the end.
    first: Vec<u32>,
    /// Neighbour and stiffness.
    links: Vec<(u32, f64)>,
}

impl Elements {
    pub(super) fn new(places: &[DVec3], triangles: &[[u32; 3]]) -> Self {
        let mut mass = vec![0.0; places.len()];
        let mut own = vec![0.0; places.len()];
        let mut corners = Vec::with_capacity(3 * triangles.len());
        let mut pairs: Vec<(u32, u32, f64)> = Vec::with_capacity(6 * triangles.len());
        for triangle in triangles {
            let p = triangle.map(|v| places[v as usize]);
            let area2 = (p[1] - p[0]).cross(p[2] - p[0]).length();
            corners.extend(triangle.map(|v| (v, area2 / 6.0)));
            if area2 == 0.0 {
                continue;
            }
            for k in 0..3 {
                let [opposite, a, b] = [k, (k + 1) % 3, (k + 2) % 3];
                mass[triangle[k] as usize] += area2 / 6.0;
                // Half the cotangent of the angle opposite the edge (Pinkall and Polthier 1993).
                let [u, v] = [p[a] - p[opposite], p[b] - p[opposite]];
                let stiffness = 0.5 * u.dot(v) / area2;
                let [a, b] = [triangle[a], triangle[b]];
                pairs.extend([(a, b, -stiffness), (b, a, -stiffness)]);
                own[a as usize] += stiffness;
                own[b as usize] += stiffness;
            }
        }
        pairs.sort_unstable_by_key(|&(a, b, _)| (a, b));
        let mut first = vec![0; places.len() + 1];
        let mut links: Vec<(u32, f64)> = Vec::with_capacity(pairs.len() / 2);
        let mut last = None;
        for (a, b, stiffness) in pairs {
            if last == Some((a, b)) {
                links.last_mut().expect("the edge's other triangle").1 += stiffness;
            } else {
                links.push((b, stiffness));
                last = Some((a, b));
            }
            first[a as usize + 1] = links.len() as u32;
        }
        for i in 1..first.len() {
            first[i] = first[i].max(first[i - 1]);
        }
        Self { corners, mass, own, first, links }
    }

    /// Means over the area around each node of the vectors at the corners of the triangles; the fourth part is 0.
    pub(super) fn means(&self, at_corners: impl Iterator<Item = DVec3>) -> Vec<DVec4> {
        let mut sums = vec![DVec4::ZERO; self.mass.len()];
        for (&(node, share), value) in self.corners.iter().zip(at_corners) {
            sums[node as usize] += (share * value).extend(0.0);
        }
        let means = sums.iter().zip(&self.mass);
        means.map(|(&sum, &mass)| if mass > 0.0 { sum / mass } else { DVec4::ZERO }).collect()
    }

    /// `values` after a backward Euler step of `time` (half the growth of the variance along each direction).
    pub(super) fn diffused(&self, mut values: Vec<DVec4>, time: f64) -> Vec<DVec4> {
        let inner = |a: &[DVec4], b: &[DVec4]| a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum::<f64>();
        let diagonal: Vec<f64> =
            self.mass.iter().zip(&self.own).map(|(mass, own)| mass + time * own).collect();
        let precondition = |r: &[DVec4]| -> Vec<DVec4> {
            let pairs = r.iter().zip(&diagonal);
            pairs.map(|(&r, &d)| if d > 0.0 { r / d } else { DVec4::ZERO }).collect()
        };
        let mut image = vec![DVec4::ZERO; values.len()];
        self.apply(&values, time, &mut image);
        let loads = values.iter().zip(&self.mass).map(|(&v, &mass)| mass * v);
        let mut residual: Vec<DVec4> = loads.zip(&image).map(|(load, &i)| load - i).collect();
        let mut direction = precondition(&residual);
        let mut norm = inner(&residual, &direction);
        let enough = norm * RESIDUAL * RESIDUAL;
        for _ in 0..ITERATIONS {
            // Also where a corner is no number: then there is no order.
            if norm.partial_cmp(&enough).is_none_or(Ordering::is_le) {
                break;
            }
            self.apply(&direction, time, &mut image);
            let step = norm / inner(&direction, &image);
            for i in 0..values.len() {
                values[i] += step * direction[i];
                residual[i] -= step * image[i];
            }
            let next = precondition(&residual);
            let new = inner(&residual, &next);
            let keep = new / norm;
            for (d, n) in direction.iter_mut().zip(next) {
                *d = n + keep * *d;
            }
            norm = new;
        }
        values
    }

    /// Masses and `time` times the stiffnesses, applied to `u`.
    fn apply(&self, u: &[DVec4], time: f64, out: &mut [DVec4]) {
        for (i, out) in out.iter_mut().enumerate() {
            let links = &self.links[self.first[i] as usize..self.first[i + 1] as usize];
            let around: DVec4 = links.iter().map(|&(j, stiffness)| stiffness * u[j as usize]).sum();
            *out = self.mass[i] * u[i] + time * (self.own[i] * u[i] + around);
        }
    }
}
