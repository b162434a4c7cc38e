//! Signed distance fields: primitives, smooth combinations, evaluation. Negative inside, mm.
//!
//! Primitives and blends after I. Quilez, "Distance functions" and "Smooth minimum"
//! (iquilezles.org); most are bounds rather than exact distances, which dual contouring and the
//! Newton projection of the vertices do not mind.

use std::collections::HashMap;

use fidget::context::Tree;
use fidget::jit::JitShape;
use fidget::shape::EzShape;
use fidget::types::{Grad, Interval};
use fidget::vm::VmShape;
use glam::{IVec3, Vec3};
use rayon::prelude::*;

/// Coordinates of the point at which a field is evaluated, as expressions.
#[derive(Clone)]
pub struct Point(pub Tree, pub Tree, pub Tree);

impl Point {
    /// The world coordinates themselves.
    pub fn world() -> Self {
        let (x, y, z) = Tree::axes();
        Self(x, y, z)
    }

    /// The coordinates relative to `o`.
    pub fn from(&self, o: Vec3) -> Self {
        Self(self.0.clone() - o.x, self.1.clone() - o.y, self.2.clone() - o.z)
    }

    /// Projection on a direction.
    pub fn dot(&self, v: Vec3) -> Tree {
        self.0.clone() * v.x + self.1.clone() * v.y + self.2.clone() * v.z
    }

    /// Coordinates along three orthonormal axes.
    pub fn along(&self, axes: [Vec3; 3]) -> Self {
        Self(self.dot(axes[0]), self.dot(axes[1]), self.dot(axes[2]))
    }

    fn length_of(&self, scale: Vec3) -> Tree {
        let part = |t: &Tree, s: f32| (t.clone() * s).square();
        (part(&self.0, scale.x) + part(&self.1, scale.y) + part(&self.2, scale.z)).sqrt()
    }
}

/// Ellipsoid with semi-axes `r` at the origin of `p`; first-order distance k0 (k0 - 1) / k1.
pub fn ellipsoid(p: &Point, r: Vec3) -> Tree {
    let k0 = p.length_of(r.recip());
    let k1 = p.length_of((r * r).recip());
    // k1 vanishes only at the centre, where any negative value serves.
    k0.clone() * (k0 - 1.0) / (k1 + 1e-6)
}

/// Elliptic cylinder along z with semi-axes `a` (x) and `b` (y).
pub fn elliptic_cylinder(p: &Point, a: f32, b: f32) -> Tree {
    let flat = Point(p.0.clone(), p.1.clone(), Tree::from(0.0));
    ellipsoid(&flat, Vec3::new(a, b, 1.0))
}

/// Half-space: negative on the side of `o` to which `-normal` points.
pub fn half_space(p: &Point, o: Vec3, normal: Vec3) -> Tree {
    p.from(o).dot(normal.normalize())
}

/// Tapered capsule from `a` (radius `ra`) to `b` (radius `rb`).
pub fn cone(p: &Point, a: Vec3, ra: f32, b: Vec3, rb: f32) -> Tree {
    let axis = b - a;
    let rel = p.from(a);
    let h = (rel.dot(axis) * axis.length_squared().recip()).max(0.0).min(1.0);
    let off =
        Point(rel.0 - h.clone() * axis.x, rel.1 - h.clone() * axis.y, rel.2 - h.clone() * axis.z);
    off.length_of(Vec3::ONE) - (h * (rb - ra) + ra)
}

/// Union with a fillet of about `k` mm (quadratic smooth minimum).
pub fn union(a: Tree, b: Tree, k: f32) -> Tree {
    let overlap = (Tree::from(k) - (a.clone() - b.clone()).abs()).max(0.0);
    a.min(b) - overlap.square() * (0.25 / k)
}

/// Intersection with edges rounded over about `k` mm.
pub fn intersection(a: Tree, b: Tree, k: f32) -> Tree {
    -union(-a, -b, k)
}

/// `a` without `b`, edges rounded over about `k` mm.
pub fn difference(a: Tree, b: Tree, k: f32) -> Tree {
    intersection(a, -b, k)
}

/// Union of many fields, paired as in a tournament so that the expression stays shallow and the
/// octree can prune whole halves of it.
pub fn union_all(mut fields: Vec<Tree>, k: f32) -> Tree {
    while fields.len() > 1 {
        let mut next = Vec::with_capacity(fields.len().div_ceil(2));
        let mut rest = fields.into_iter();
        while let Some(a) = rest.next() {
            next.push(match rest.next() {
                Some(b) => union(a, b, k),
                None => a,
            });
        }
        fields = next;
    }
    fields.pop().expect("a union needs at least one field")
}

/// Low-frequency undulation in +-`amplitude` mm: three plane waves of incommensurate direction.
/// Keep 2 pi amplitude / wavelength under 0.3, or the field stops being distance-like.
pub fn undulation(p: &Point, amplitude: f32, wavelength: f32, phase: f32) -> Tree {
    let k = std::f32::consts::TAU / wavelength;
    let wave = |v: Vec3, shift: f32| (p.dot(v.normalize() * k) + shift).sin();
    (wave(Vec3::new(0.93, 0.31, 0.52), phase)
        + wave(Vec3::new(-0.41, 0.87, 0.37), 2.3 * phase + 1.1)
        + wave(Vec3::new(0.23, -0.49, 0.91), 3.7 * phase + 2.9))
        * (amplitude / 3.0)
}

/// A field compiled for evaluation at many points.
pub struct Field {
    /// Machine code, as the mesher takes it.
    pub shape: JitShape,
    /// Interpreted: for the many short-lived simplifications, which are not worth compiling.
    local: VmShape,
}

/// Edge of the blocks in which points are evaluated together, mm. In a block most of a large union
/// is provably far and drops out: a vessel tree evaluates 20 times faster than point by point.
const BLOCK: f32 = 16.0;

impl Field {
    /// Compiles `tree`.
    pub fn new(tree: &Tree) -> Self {
        Self { shape: JitShape::from(tree.clone()), local: VmShape::from(tree.clone()) }
    }

    /// Field values at `points`, mm.
    pub fn values(&self, points: &[Vec3]) -> Vec<f32> {
        self.by_block(points, |shape, at| {
            let tape = shape.ez_float_slice_tape();
            let [x, y, z] = [0, 1, 2].map(|i| at.iter().map(|p| p[i]).collect::<Vec<f32>>());
            let mut eval = VmShape::new_float_slice_eval();
            let values = eval.eval(&tape, &x, &y, &z);
            values.expect("the three slices have one length").to_vec()
        })
    }

    /// Field values, mm, and gradients at `points`.
    pub fn gradients(&self, points: &[Vec3]) -> Vec<(f32, Vec3)> {
        self.by_block(points, |shape, at| {
            let tape = shape.ez_grad_slice_tape();
            let axis = |i: usize| -> Vec<Grad> {
                let unit = |j: usize| if i == j { 1.0 } else { 0.0 };
                let seed = |p: &Vec3| Grad::new(p[i], unit(0), unit(1), unit(2));
                at.iter().map(seed).collect()
            };
            let mut eval = VmShape::new_grad_slice_eval();
            let values = eval.eval(&tape, &axis(0), &axis(1), &axis(2));
            let values = values.expect("the three slices have one length");
            let pair = |g: &Grad| (g.v, Vec3::new(g.dx, g.dy, g.dz));
            values.iter().map(pair).collect()
        })
    }

    /// Evaluates the points of each block with the rest of the field there; results in the
    /// order of `points`.
    fn by_block<T: Copy + Default + Send>(
        &self,
        points: &[Vec3],
        evaluate: impl Fn(&VmShape, &[Vec3]) -> Vec<T> + Sync,
    ) -> Vec<T> {
        let mut blocks: HashMap<IVec3, Vec<usize>> = HashMap::new();
        for (i, p) in points.iter().enumerate() {
            let block = (*p / BLOCK).floor().as_ivec3();
            blocks.entry(block).or_default().push(i);
        }
        let blocks: Vec<Vec<usize>> = blocks.into_values().collect();
        let results: Vec<Vec<T>> = blocks
            .par_iter()
            .map(|block| {
                let at: Vec<Vec3> = block.iter().map(|&i| points[i]).collect();
                evaluate(&self.near(&at), &at)
            })
            .collect();
        let mut out = vec![T::default(); points.len()];
        for (block, values) in blocks.iter().zip(results) {
            for (&i, value) in block.iter().zip(values) {
                out[i] = value;
            }
        }
        out
    }

    /// The field without the branches that have no effect within the box of `points`.
    fn near(&self, points: &[Vec3]) -> VmShape {
        let low = points.iter().copied().reduce(Vec3::min);
        let high = points.iter().copied().reduce(Vec3::max);
        let (Some(low), Some(high)) = (low, high) else {
            return self.local.clone();
        };
        let [x, y, z] = [0, 1, 2].map(|i| Interval::new(low[i], high[i]));
        let mut eval = VmShape::new_interval_eval();
        let tape = self.local.ez_interval_tape();
        let (_, trace) = eval.eval(&tape, x, y, z).expect("no free variables");
        match trace {
            Some(trace) => self.local.ez_simplify(trace).expect("its own trace"),
            None => self.local.clone(),
        }
    }

    /// Box around the zero set within `low..high`, found on a grid of `step` mm and widened by it;
    /// `None` if the field is positive throughout. Relies on the field rising no faster than
    /// distance, so that a branch thinner than the step is still seen from its neighbour points.
    pub fn bounds(&self, low: Vec3, high: Vec3, step: f32) -> Option<(Vec3, Vec3)> {
        let count = ((high - low) / step).ceil().as_uvec3() + 1;
        let mut points = Vec::with_capacity((count.x * count.y * count.z) as usize);
        for k in 0..count.z {
            for j in 0..count.y {
                for i in 0..count.x {
                    points.push(low + step * glam::UVec3::new(i, j, k).as_vec3());
                }
            }
        }
        // Half the diagonal of a grid cell.
        let reach = 0.5 * 3f32.sqrt() * step;
        let mut found = None;
        for (p, v) in points.iter().zip(self.values(&points)) {
            if v < reach {
                let (a, b) = found.unwrap_or((*p, *p));
                found = Some((p.min(a), p.max(b)));
            }
        }
        found.map(|(a, b)| (a - step, b + step))
    }
}
