//! Branching vessels grown into an organ.
//!
//! Each branch owns the points of the organ that it supplies; it divides them by their principal
//! axis and sends a child towards the middle of each half. Flow is proportional to the points
//! supplied, radii follow Murray's law r0^3 = r1^3 + r2^3 (Murray, PNAS 1926), so that a child
//! with the share s of the points has s^(1/3) of the parent's radius.

use fidget::context::Tree;
use glam::Vec3;

use crate::field::{Field, Point, cone, union_all};

/// A straight, slightly tapered piece of a vessel.
#[derive(Clone, Copy, Debug)]
pub struct Piece {
    /// Ends, mm.
    pub ends: [Vec3; 2],
    /// Radii of the lumen at the ends, mm.
    pub radii: [f32; 2],
}

/// Values of a field on a grid, for the many look-ups of the growth.
pub struct Region {
    low: Vec3,
    size: glam::UVec3,
    values: Vec<f32>,
}

/// Spacing of [`Region`]'s grid, mm.
const REGION_STEP: f32 = 4.0;

impl Region {
    /// Samples `field` within `low..high`.
    pub fn new(field: &Field, low: Vec3, high: Vec3) -> Self {
        let size = ((high - low) / REGION_STEP).ceil().as_uvec3() + 1;
        let at = |i: u32| {
            let cell = glam::UVec3::new(i % size.x, i / size.x % size.y, i / (size.x * size.y));
            low + REGION_STEP * cell.as_vec3()
        };
        let points: Vec<Vec3> = (0..size.x * size.y * size.z).map(at).collect();
        Self { low, size, values: field.values(&points) }
    }

    /// The value at the grid point nearest to `p`; positive outside the grid.
    fn value(&self, p: Vec3) -> f32 {
        let cell = ((p - self.low) / REGION_STEP).round();
        if cell.min_element() < 0.0 || cell.cmpge(self.size.as_vec3()).any() {
            return f32::INFINITY;
        }
        let c = cell.as_uvec3();
        self.values[(c.x + self.size.x * (c.y + self.size.y * c.z)) as usize]
    }

    /// Points at least `margin` mm inside, on a jittered grid of `spacing` mm.
    pub fn points(&self, margin: f32, spacing: f32, random: &mut Random) -> Vec<Vec3> {
        let count = (self.size.as_vec3() * REGION_STEP / spacing).as_uvec3();
        let mut points = Vec::new();
        for k in 0..count.z {
            for j in 0..count.y {
                for i in 0..count.x {
                    let grid = glam::UVec3::new(i, j, k).as_vec3() + 0.5;
                    let p = self.low + spacing * (grid + 0.4 * random.vector());
                    if self.value(p) < -margin {
                        points.push(p);
                    }
                }
            }
        }
        points
    }
}

/// A small generator with a fixed seed: the same anatomy at every resolution and on every machine.
pub struct Random(pub u64);

impl Random {
    /// Uniform in -1..1 (SplitMix64, Steele et al., OOPSLA 2014).
    fn signed(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 40) as f32 / (1u64 << 23) as f32 - 1.0
    }

    fn vector(&mut self) -> Vec3 {
        Vec3::new(self.signed(), self.signed(), self.signed())
    }
}

/// Limits on growing vessels.
pub struct Growth<'a> {
    /// The organ.
    pub region: &'a Region,
    /// Vessels to keep clear of.
    pub avoid: &'a [Piece],
    /// Branches thinner than this are not grown, mm.
    pub min_radius: f32,
    /// Most divisions along one path.
    pub generations: u32,
}

/// Straight pieces per branch: the branch is a parabola, and five chords of it bend by less than
/// 8 degrees each.
const PIECES: usize = 5;

/// Candidates per branch, of which the clearest of other vessels is kept.
const CANDIDATES: usize = 24;

/// Clearance beyond which more is no better, mm.
const ENOUGH: f32 = 7.0;

impl Growth<'_> {
    /// Grows a tree that starts at `from` along `towards` with radius `radius` into `points`.
    pub fn grow(
        &self,
        from: Vec3,
        towards: Vec3,
        radius: f32,
        points: Vec<Vec3>,
        random: &mut Random,
    ) -> Vec<Piece> {
        let mut pieces = Vec::new();
        self.branch(from, towards.normalize(), radius, points, 0, random, &mut pieces);
        pieces
    }

    #[allow(clippy::too_many_arguments)] // One recursion's state; a struct would only rename it.
    fn branch(
        &self,
        from: Vec3,
        heading: Vec3,
        radius: f32,
        points: Vec<Vec3>,
        generation: u32,
        random: &mut Random,
        pieces: &mut Vec<Piece>,
    ) {
        if radius < self.min_radius || generation > self.generations || points.is_empty() {
            return;
        }
        let centre = points.iter().sum::<Vec3>() / points.len() as f32;
        // A bit over half-way: the children still have room to diverge.
        let end = from + (centre - from) * if generation == 0 { 0.5 } else { 0.62 };
        // Where the points lie all around, the vessel divides at once.
        let (tip, heading, end_radius) = if end.distance(from) < 2.0 * radius {
            (from, heading, radius)
        } else {
            let path = self.clearest(from, heading, end, radius, random, pieces);
            // Vessels narrow little between divisions.
            let end_radius = 0.94 * radius;
            for (i, pair) in path.windows(2).enumerate() {
                let at = |i: usize| radius + (end_radius - radius) * i as f32 / PIECES as f32;
                pieces.push(Piece { ends: [pair[0], pair[1]], radii: [at(i), at(i + 1)] });
            }
            let tip = path[PIECES];
            (tip, (tip - path[PIECES - 1]).normalize(), end_radius)
        };
        let total = points.len() as f32;
        let halves = split(points, tip);
        for half in halves {
            let share = half.len() as f32 / total;
            let child = end_radius * share.cbrt();
            self.branch(tip, heading, child, half, generation + 1, random, pieces);
        }
    }

    /// Returns the clearest of some random paths from `from`, leaving along `heading`, to about `end`.
    fn clearest(
        &self,
        from: Vec3,
        heading: Vec3,
        end: Vec3,
        radius: f32,
        random: &mut Random,
        own: &[Piece],
    ) -> Vec<Vec3> {
        let length = end.distance(from);
        let mut best = (f32::NEG_INFINITY, Vec::new());
        for candidate in 0..CANDIDATES {
            let wander = if candidate == 0 { 0.0 } else { 0.28 };
            let tip = end + random.vector() * (wander * length);
            let bend = from + (heading * 0.45 + random.vector() * 0.12) * length;
            let path = parabola(from, bend, tip);
            let score = self.score(&path, radius, own) - 0.1 * tip.distance(end);
            if candidate == 0 || score > best.0 {
                best = (score, path);
            }
        }
        best.1
    }

    /// Room around a path, mm: from other vessels, from this tree, from the organ's surface.
    fn score(&self, path: &[Vec3], radius: f32, own: &[Piece]) -> f32 {
        let gap = |p: Vec3, pieces: &[Piece]| {
            let each = pieces.iter().map(|q| distance(p, q) - radius);
            each.fold(ENOUGH, f32::min)
        };
        let mut score = ENOUGH;
        for (i, &p) in path.iter().enumerate().skip(1) {
            score = score.min(gap(p, self.avoid));
            // The first third leaves the parent, which is no crowding.
            if i * 3 > PIECES {
                score = score.min(gap(p, own) + 2.0);
                score = score.min(2.0 * (-self.region.value(p) - radius - 3.0));
            }
        }
        score
    }
}

/// Distance from `p` to the wall of a piece, mm.
fn distance(p: Vec3, piece: &Piece) -> f32 {
    let [a, b] = piece.ends;
    let axis = b - a;
    let h = ((p - a).dot(axis) / axis.length_squared()).clamp(0.0, 1.0);
    p.distance(a + axis * h) - piece.radii[0].max(piece.radii[1])
}

/// Quadratic Bezier curve from `a` over `b` to `c` in `PIECES` chords.
fn parabola(a: Vec3, b: Vec3, c: Vec3) -> Vec<Vec3> {
    (0..=PIECES)
        .map(|i| {
            let t = i as f32 / PIECES as f32;
            a.lerp(b, t).lerp(b.lerp(c, t), t)
        })
        .collect()
}

/// Halves `points` across their principal axis as seen from `tip`.
fn split(points: Vec<Vec3>, tip: Vec3) -> [Vec<Vec3>; 2] {
    let centre = points.iter().sum::<Vec3>() / points.len() as f32;
    let away = (centre - tip).normalize_or(Vec3::X);
    // Spread across the line of sight: children diverge instead of following one another.
    let across = |p: &Vec3| {
        let d = *p - centre;
        d - away * (0.7 * d.dot(away))
    };
    // Power iteration on the covariance; twenty rounds separate axes that differ by 20 %.
    let mut axis = Vec3::new(0.6, 0.5, 0.62);
    for _ in 0..20 {
        let next: Vec3 = points.iter().map(|p| across(p) * across(p).dot(axis)).sum();
        axis = next.normalize_or(axis);
    }
    points.into_iter().partition::<Vec<_>, _>(|p| across(p).dot(axis) < 0.0).into()
}

/// The lumen of all pieces, widened by `wall` mm.
pub fn lumen(p: &Point, pieces: &[Piece], wall: f32) -> Tree {
    let tubes =
        pieces.iter().map(|q| cone(p, q.ends[0], q.radii[0] + wall, q.ends[1], q.radii[1] + wall));
    // The fillet rounds the forks and stays below the finest radius.
    union_all(tubes.collect(), 1.2)
}

/// A vessel along given points with given radii.
pub fn along(points: &[(Vec3, f32)]) -> Vec<Piece> {
    points.windows(2).map(|w| Piece { ends: [w[0].0, w[1].0], radii: [w[0].1, w[1].1] }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::ellipsoid;

    #[test]
    fn trees_keep_murrays_law_and_stay_inside() {
        let field = Field::new(&ellipsoid(&Point::world(), Vec3::splat(50.0)));
        let region = Region::new(&field, Vec3::splat(-52.0), Vec3::splat(52.0));
        let random = &mut Random(1);
        let growth = Growth { region: &region, avoid: &[], min_radius: 1.5, generations: 5 };
        let points = region.points(8.0, 12.0, random);
        let pieces = growth.grow(Vec3::new(0.0, 0.0, -40.0), Vec3::Z, 6.0, points, random);
        assert!(pieces.len() > 20 * PIECES);
        for q in &pieces {
            assert!(q.ends[1].length() + q.radii[1] < 50.0);
        }
        // Children of each fork: the pieces that start where a branch ends. Their cubes add up
        // to the parent's, except where one was too thin to grow.
        let mut forks = 0;
        for parent in &pieces {
            let starts = |q: &&Piece| q.ends[0] == parent.ends[1] && q.radii[0] != parent.radii[1];
            let children: Vec<_> = pieces.iter().filter(starts).collect();
            if let [a, b] = children[..] {
                let cubes = a.radii[0].powi(3) + b.radii[0].powi(3);
                // Rounding of three cubes in f32.
                assert!((cubes / parent.radii[1].powi(3) - 1.0).abs() < 1e-4);
                forks += 1;
            }
        }
        assert!(forks > 8);
    }
}
