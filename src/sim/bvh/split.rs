//! Spatial splits: builds a binary tree whose leaves hold parts of triangles (Stich, Friedrich, Dietrich
//! 2009, "Spatial splits in bounding volume hierarchies").
//!
//! If the boxes of two children would overlap, a plane is tried that cuts the triangles across it;
//! both sides then hold the triangle, each with the box around its part. A ray that meets the triangle
//! at a part's place finds it there. Leaves that hold parts cannot be refitted: a moved triangle's part
//! is not known.

mod bins;

use std::collections::VecDeque;

use glam::{BVec3A, Vec3A};
use obvhs::{
    aabb::Aabb,
    bvh2::{Bvh2, node::Bvh2Node},
};

use bins::{BINS, Bins, Division, NOTHING, cheapest};

/// Nodes are not cut where the common box of their children has less than this share of the root's surface
/// (alpha of the paper).
const LEAST_OVERLAP: f32 = 1e-5;
/// Most parts beyond one per triangle, relative to the number of triangles (choice).
const MOST_DUPLICATES: f64 = 0.5;
/// Depth below which nodes are halved by number, so that no geometry makes a deep tree.
const MOST_LEVELS: usize = 40;
/// Nodes with more parts than this are built by several threads.
const PARALLEL_PARTS: usize = 4096;

/// A triangle, or the part of it that lies in a box.
#[derive(Clone, Copy, Debug)]
struct TrianglePart {
    bounds: Aabb,
    triangle: u32,
}

enum Tree {
    Leaf(TrianglePart),
    Node(Aabb, Box<[Tree; 2]>),
}

impl Tree {
    fn bounds(&self) -> Aabb {
        match self {
            Self::Leaf(part) => part.bounds,
            Self::Node(bounds, _) => *bounds,
        }
    }
}

/// A tree over the parts of `triangles`, one part per leaf; `primitive_indices` has the triangle of each part.
pub(super) fn tree(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Bvh2 {
    if triangles.is_empty() {
        return Bvh2::default();
    }
    let whole = |(t, corners): (usize, &[u32; 3])| TrianglePart {
        bounds: Aabb::from_points(&corners.map(|v| Vec3A::from(positions[v as usize]))),
        triangle: t as u32,
    };
    let parts: Vec<TrianglePart> = triangles.iter().enumerate().map(whole).collect();
    let builder =
        Builder { positions, triangles, least_overlap: LEAST_OVERLAP * around(&parts).half_area() };
    let spare = (MOST_DUPLICATES * parts.len() as f64) as usize;
    flat(builder.build(parts, spare, 0))
}

fn around(parts: &[TrianglePart]) -> Aabb {
    (parts.iter()).fold(Aabb::INVALID, |all, part| all.union(&part.bounds))
}

/// The nodes of the tree level by level, as reinsertion expects them.
fn flat(tree: Tree) -> Bvh2 {
    let mut nodes = vec![Bvh2Node::default()];
    let mut primitive_indices = Vec::new();
    let mut waiting = VecDeque::from([(0, tree)]);
    while let Some((place, tree)) = waiting.pop_front() {
        let bounds = tree.bounds();
        nodes[place] = match tree {
            Tree::Leaf(part) => {
                primitive_indices.push(part.triangle);
                Bvh2Node::new(bounds, 1, primitive_indices.len() as u32 - 1)
            }
            Tree::Node(_, children) => {
                let first = nodes.len();
                nodes.extend([Bvh2Node::default(); 2]);
                waiting.extend((first..).zip(*children));
                Bvh2Node::new(bounds, 0, first as u32)
            }
        };
    }
    Bvh2 {
        nodes,
        primitive_indices,
        children_are_ordered_after_parents: true,
        uses_spatial_splits: true,
        ..Bvh2::default()
    }
}

struct Builder<'a> {
    positions: &'a [[f32; 3]],
    triangles: &'a [[u32; 3]],
    /// Half a surface area, mm^2.
    least_overlap: f32,
}

impl Builder<'_> {
    /// Builds the tree over `parts`, of which there is at least one; cuts may add up to `spare` more.
    fn build(&self, parts: Vec<TrianglePart>, spare: usize, depth: usize) -> Tree {
        if let [part] = parts[..] {
            return Tree::Leaf(part);
        }
        let (bounds, count) = (around(&parts), parts.len());
        let [left, right] = self.divide(parts, &bounds, spare, depth);
        // `spare` is divided by the number of parts. Measured: divided by surface, rays in the heart
        // visit 3 % more nodes, as large nodes use it for cuts of little benefit.
        let all = left.len() + right.len();
        let spare = spare - (all - count);
        let share =
            |parts: &Vec<TrianglePart>| (spare as u64 * parts.len() as u64 / all as u64) as usize;
        let shares = [share(&left), share(&right)];
        let build = |parts, spare| self.build(parts, spare, depth + 1);
        let children = match count > PARALLEL_PARTS {
            true => {
                let (left, right) =
                    rayon::join(|| build(left, shares[0]), || build(right, shares[1]));
                [left, right]
            }
            false => [build(left, shares[0]), build(right, shares[1])],
        };
        Tree::Node(bounds, Box::new(children))
    }

    /// Divides the parts between two children, neither of them empty.
    fn divide(
        &self,
        mut parts: Vec<TrianglePart>,
        bounds: &Aabb,
        spare: usize,
        depth: usize,
    ) -> [Vec<TrianglePart>; 2] {
        let count = parts.len();
        if depth < MOST_LEVELS {
            let centres = centres(&parts);
            let whole = by_objects(&parts, &centres);
            let overlap = whole.map_or(*bounds, |whole| {
                let [low, high] = whole.children;
                low.bounds.intersection(&high.bounds)
            });
            if spare > 0 && overlap.valid() && overlap.half_area() >= self.least_overlap {
                let cut = self.by_space(&parts, bounds, spare);
                let cheaper = |cut: &Division| whole.is_none_or(|whole| cut.cost < whole.cost);
                if let Some(cut) = cut.filter(cheaper) {
                    let sides = self.cut(&parts, bounds, cut);
                    let all = sides[0].len() + sides[1].len();
                    if all <= count + spare && sides.iter().all(|side| !side.is_empty()) {
                        return sides;
                    }
                }
            }
            if let Some(whole) = whole {
                let bins = Bins::new(&centres, whole.axis, count);
                let (left, right) =
                    (parts.into_iter()).partition(|part| bins.of(part.bounds.center()) < whole.bin);
                return [left, right];
            }
        }
        let right = parts.split_off(count / 2);
        [parts, right]
    }

    /// The best plane that cuts the parts lying across it.
    fn by_space(&self, parts: &[TrianglePart], bounds: &Aabb, spare: usize) -> Option<Division> {
        let along = |axis| {
            let bins = Bins::new(bounds, axis, parts.len());
            let mut entering = [NOTHING; BINS];
            let mut leaving = [0; BINS];
            for part in parts {
                let first = bins.of(part.bounds.min);
                let last = bins.of(part.bounds.max);
                let mut rest = *part;
                for (bin, slice) in entering.iter_mut().enumerate().take(last).skip(first) {
                    let [left, right] = self.clip(&rest, axis, bins.plane(bin + 1));
                    *slice = slice.grown(&left);
                    rest.bounds = right;
                }
                entering[last] = entering[last].grown(&rest.bounds);
                entering[first].parts += 1;
                leaving[last] += 1;
            }
            bins.best(&entering, &leaving, parts.len() + spare)
        };
        cheapest((0..3).filter_map(along))
    }

    /// The parts on both sides of a plane. Parts across it are cut, unless one side grows less by taking them whole.
    fn cut(&self, parts: &[TrianglePart], bounds: &Aabb, at: Division) -> [Vec<TrianglePart>; 2] {
        let axis = at.axis;
        let plane = Bins::new(bounds, axis, parts.len()).plane(at.bin);
        let (mut left, mut right) = (Vec::new(), Vec::new());
        let [mut low, mut high] = at.children;
        for &part in parts {
            let [in_left, in_right] = self.clip(&part, axis, plane);
            if !in_right.valid() {
                let bounds = if in_left.valid() { in_left } else { part.bounds };
                left.push(TrianglePart { bounds, ..part });
                continue;
            }
            if !in_left.valid() {
                right.push(TrianglePart { bounds: in_right, ..part });
                continue;
            }
            let cut = low.cost() + high.cost();
            let all_left = low.grown(&part.bounds).cost() + high.without_one().cost();
            let all_right = low.without_one().cost() + high.grown(&part.bounds).cost();
            if cut <= all_left && cut <= all_right {
                left.push(TrianglePart { bounds: in_left, ..part });
                right.push(TrianglePart { bounds: in_right, ..part });
            } else if all_left <= all_right {
                (low, high) = (low.grown(&part.bounds), high.without_one());
                left.push(part);
            } else {
                (low, high) = (low.without_one(), high.grown(&part.bounds));
                right.push(part);
            }
        }
        [left, right]
    }

    /// Boxes around the portions of a part on both sides of a plane; [`Aabb::INVALID`] for an empty side. A part
    /// that only touches the plane belongs to the side on which it lies.
    fn clip(&self, part: &TrianglePart, axis: usize, plane: f32) -> [Aabb; 2] {
        let bounds = &part.bounds;
        if bounds.max.to_array()[axis] <= plane {
            return [*bounds, Aabb::INVALID];
        }
        if bounds.min.to_array()[axis] >= plane {
            return [Aabb::INVALID, *bounds];
        }
        let corners = self.triangles[part.triangle as usize].map(|v| self.positions[v as usize]);
        let along = corners.map(|corner| corner[axis]);
        let corners = corners.map(Vec3A::from);
        let [mut left, mut right] = [Aabb::INVALID; 2];
        for (i, j) in [(0, 1), (1, 2), (2, 0)] {
            if along[i] <= plane {
                left.extend(corners[i]);
            }
            if along[i] >= plane {
                right.extend(corners[i]);
            }
            if (along[i] < plane && along[j] > plane) || (along[i] > plane && along[j] < plane) {
                let share = (plane - along[i]) / (along[j] - along[i]);
                let met = crossing(corners[i], corners[j], share);
                (left, right) = (left.union(&met), right.union(&met));
            }
        }
        let at_plane = Vec3A::splat(plane);
        left.max = Vec3A::select(AXES[axis], at_plane, left.max);
        right.min = Vec3A::select(AXES[axis], at_plane, right.min);
        [left, right].map(|side| {
            let inside = side.intersection(bounds);
            match inside.min.cmple(inside.max).all() {
                true => inside,
                false => Aabb::INVALID,
            }
        })
    }
}

/// Masks of the axes.
const AXES: [BVec3A; 3] = [
    BVec3A::new(true, false, false),
    BVec3A::new(false, true, false),
    BVec3A::new(false, false, true),
];

fn centres(parts: &[TrianglePart]) -> Aabb {
    let centres = parts.iter().map(|part| part.bounds.center());
    centres.fold(Aabb::INVALID, |all, centre| all.union(&Aabb::from_point(centre)))
}

/// The best division of parts by the centres of their boxes; none where all centres are equal.
fn by_objects(parts: &[TrianglePart], centres: &Aabb) -> Option<Division> {
    let along = |axis| {
        let bins = Bins::new(centres, axis, parts.len());
        let mut entering = [NOTHING; BINS];
        for part in parts {
            let bin = &mut entering[bins.of(part.bounds.center())];
            *bin = bin.grown(&part.bounds);
            bin.parts += 1;
        }
        let leaving = entering.map(|bin| bin.parts);
        bins.best(&entering, &leaving, usize::MAX)
    };
    cheapest((0..3).filter_map(along))
}

/// A box that contains the place at a share of the way from `a` to `b`, whatever the rounding of single precision.
fn crossing(a: Vec3A, b: Vec3A, share: f32) -> Aabb {
    let met = a + share * (b - a);
    // The share is off by 1.5 of its last places, the difference by half of one and up to twice the larger coordinate, the
    // product and the sum by half of one each: 5.5 epsilon of the larger coordinate in all.
    let error = 8.0 * f32::EPSILON * a.abs().max(b.abs());
    Aabb::new(met - error, met + error)
}

#[cfg(test)]
mod tests;
