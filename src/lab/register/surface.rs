//! A surface as triangles: the nearest point on it, and points spread evenly over it.

use std::time::Duration;

use glam::{DVec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;

use crate::issue::FileError;

/// A triangle, mm.
pub type Triangle = [DVec3; 3];

/// Share of the largest coordinate by which boxes are widened, so that single precision cuts nothing off.
const BOX_MARGIN: f32 = 1e-6;

/// A surface with a search for the nearest point.
pub struct TriangleSurface {
    /// The triangles with area.
    triangles: Vec<Triangle>,
    boxes: Bvh2,
    centre: DVec3,
    size: f64,
}

/// A point on a surface.
#[derive(Clone, Copy, Debug)]
pub struct NearestPoint {
    /// Position, mm.
    pub point: DVec3,
    /// Unit normal of a triangle at the point.
    pub normal: DVec3,
}

impl TriangleSurface {
    /// The surface of these triangles, of any order and orientation; triangles without area do not count.
    ///
    /// # Errors
    /// Coordinates that are no numbers; no triangle that has area.
    pub fn new(triangles: &[Triangle]) -> Result<Self, FileError> {
        if !triangles.iter().flatten().all(|p| p.is_finite()) {
            return Err(FileError::data(
                "the surface has coordinates that are no numbers",
                "export its mesh again",
            ));
        }
        let solid: Vec<Triangle> = triangles.iter().filter(|t| area(t) > 0.0).copied().collect();
        if solid.is_empty() {
            return Err(FileError::data(
                "the surface has no triangle",
                "name a mesh with faces, or several",
            ));
        }
        let corners = || solid.iter().flatten();
        let low = corners().fold(DVec3::INFINITY, |low, p| low.min(*p));
        let high = corners().fold(DVec3::NEG_INFINITY, |high, p| high.max(*p));
        let weighted = solid.iter().map(|t| (area(t), (t[0] + t[1] + t[2]) / 3.0));
        let (sum, centre) = weighted.fold((0.0, DVec3::ZERO), |(sum, centre), (area, middle)| {
            (sum + area, centre + area * middle)
        });
        let margin = Vec3A::splat(BOX_MARGIN * low.abs().max(high.abs()).max_element() as f32);
        let around = |t: &Triangle| {
            let tight = Aabb::from_points(&t.map(|p| p.as_vec3a()));
            Aabb::new(tight.min - margin, tight.max + margin)
        };
        let around: Vec<Aabb> = solid.iter().map(around).collect();
        let boxes = build_bvh2(&around, BvhBuildParams::medium_build(), &mut Duration::default());
        Ok(Self { triangles: solid, boxes, centre: centre / sum, size: low.distance(high) })
    }

    /// The point on the surface that is nearest to `p`.
    pub fn nearest(&self, p: DVec3) -> NearestPoint {
        let (mut best, mut nearest) =
            (f64::INFINITY, NearestPoint { point: p, normal: DVec3::ZERO });
        let reach = |node: u32| from_box(self.boxes.nodes[node as usize].aabb(), p);
        // Nodes still to be visited, with the least squared distance of their content.
        let mut open = vec![(reach(0), 0)];
        while let Some((least, index)) = open.pop() {
            let node = &self.boxes.nodes[index as usize];
            if least >= best {
                continue;
            }
            let first = node.first_index;
            if !node.is_leaf() {
                let mut children = [first, first + 1].map(|child| (reach(child), child));
                // The nearer one comes off the stack first.
                children.sort_by(|a, b| b.0.total_cmp(&a.0));
                open.extend(children);
                continue;
            }
            for slot in first..first + node.prim_count {
                let triangle =
                    &self.triangles[self.boxes.primitive_indices[slot as usize] as usize];
                let point = closest(triangle, p);
                let off = point.distance_squared(p);
                if off < best {
                    (best, nearest) =
                        (off, NearestPoint { point, normal: cross(triangle).normalize() });
                }
            }
        }
        nearest
    }

    /// Centroid of its area, mm.
    pub fn centre(&self) -> DVec3 {
        self.centre
    }

    /// Diagonal of the box around it, mm.
    pub fn size(&self) -> f64 {
        self.size
    }
}

/// `count` points spread evenly over the area of the triangles; the same each time. None for no area.
pub fn samples(triangles: &[Triangle], count: usize) -> Vec<DVec3> {
    let mut total = 0.0;
    let sums: Vec<f64> = triangles
        .iter()
        .map(|t| {
            total += area(t);
            total
        })
        .collect();
    if total.is_nan() || total <= 0.0 {
        return Vec::new();
    }
    let point = |i: usize| {
        let wanted = (i as f64 + 0.5) / count as f64 * total;
        let [a, b, c] = triangles[sums.partition_point(|&s| s < wanted).min(sums.len() - 1)];
        // Additive recurrence of the plastic number: pairs that fill the unit square evenly.
        let [u, v] = [0.754_877_666_246_692_7, 0.569_840_290_998_053_2]
            .map(|step: f64| ((i + 1) as f64 * step).fract());
        let (root, v) = (u.sqrt(), v);
        a * (1.0 - root) + b * (root * (1.0 - v)) + c * (root * v)
    };
    (0..count).map(point).collect()
}

fn cross([a, b, c]: &Triangle) -> DVec3 {
    (*b - *a).cross(*c - *a)
}

fn area(triangle: &Triangle) -> f64 {
    cross(triangle).length() / 2.0
}

/// Squared distance of a box.
fn from_box(around: &Aabb, p: DVec3) -> f64 {
    p.distance_squared(p.clamp(around.min.as_dvec3(), around.max.as_dvec3()))
}

/// The point of a triangle that is nearest to `p`, by the corner, edge or face in whose region `p` lies
/// (Ericson, Real-Time Collision Detection, section 5.1.5).
fn closest([a, b, c]: &Triangle, p: DVec3) -> DVec3 {
    let (ab, ac) = (*b - *a, *c - *a);
    let [a1, a2] = [ab, ac].map(|edge| edge.dot(p - *a));
    if a1 <= 0.0 && a2 <= 0.0 {
        return *a;
    }
    let [b1, b2] = [ab, ac].map(|edge| edge.dot(p - *b));
    if b1 >= 0.0 && b2 <= b1 {
        return *b;
    }
    let [c1, c2] = [ab, ac].map(|edge| edge.dot(p - *c));
    if c2 >= 0.0 && c1 <= c2 {
        return *c;
    }
    let across_ab = a1 * b2 - b1 * a2;
    if across_ab <= 0.0 && a1 >= 0.0 && b1 <= 0.0 {
        return *a + ab * (a1 / (a1 - b1));
    }
    let across_ac = c1 * a2 - a1 * c2;
    if across_ac <= 0.0 && a2 >= 0.0 && c2 <= 0.0 {
        return *a + ac * (a2 / (a2 - c2));
    }
    let across_bc = b1 * c2 - c1 * b2;
    if across_bc <= 0.0 && b2 >= b1 && c1 >= c2 {
        return *b + (*c - *b) * ((b2 - b1) / ((b2 - b1) + (c1 - c2)));
    }
    *a + (ab * across_ac + ac * across_ab) / (across_ab + across_ac + across_bc)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::shapes;

    fn triangles(mesh: &crate::scene::Mesh) -> Vec<Triangle> {
        let at = |i: u32| DVec3::from(mesh.positions[i as usize].map(f64::from));
        mesh.triangles.iter().map(|t| t.map(at)).collect()
    }

    #[test]
    fn the_nearest_point_of_a_box_is_its_closed_form() {
        let surface =
            TriangleSurface::new(&triangles(&shapes::cuboid([20.0, 10.0, 6.0]))).expect("a box");
        assert!((surface.size() - 536f64.sqrt()).abs() < 1e-9);
        assert!(surface.centre().length() < 1e-9);
        for (p, expected) in [
            ([30.0, 1.0, 2.0], [10.0, 1.0, 2.0]),
            ([30.0, 9.0, -8.0], [10.0, 5.0, -3.0]),
            // Inside: the nearest wall.
            ([1.0, 4.5, 0.0], [1.0, 5.0, 0.0]),
            ([3.0, 2.0, 3.0], [3.0, 2.0, 3.0]),
        ] {
            let found = surface.nearest(p.into());
            assert!(found.point.distance(expected.into()) < 1e-12, "{p:?} {found:?}");
        }
        assert!(surface.nearest([0.0, 0.0, 9.0].into()).normal.z > 0.999);
    }

    #[test]
    fn the_nearest_point_is_that_of_brute_force() {
        let all: Vec<Triangle> = triangles(&shapes::sphere(30.0, 3))
            .into_iter()
            .map(|t| t.map(|p| p * DVec3::new(1.0, 0.4, 2.0) + DVec3::new(900.0, 0.0, -80.0)))
            .collect();
        let surface = TriangleSurface::new(&all).expect("a surface");
        // Points of each triangle, its edges and corners among them.
        let steps = || {
            (0..=20).flat_map(|i| (0..=20 - i).map(move |j| [i, j].map(|n| f64::from(n) / 20.0)))
        };
        let scattered = samples(&triangles(&shapes::cuboid([90.0, 50.0, 150.0])), 40);
        for p in scattered.into_iter().map(|p| p + DVec3::new(890.0, 5.0, -70.0)) {
            let found = surface.nearest(p).point.distance(p);
            let each = all.iter().map(|t| closest(t, p).distance(p)).fold(f64::INFINITY, f64::min);
            assert!((found - each).abs() < 1e-12, "{p}: {found} {each}");
            for t in &all {
                let closest = closest(t, p).distance(p);
                let tried = steps().map(|[u, v]| t[0] + u * (t[1] - t[0]) + v * (t[2] - t[0]));
                let best = tried.map(|q| q.distance(p)).fold(f64::INFINITY, f64::min);
                let edge = (t[1] - t[0]).length().max((t[2] - t[0]).length());
                assert!(closest <= best + 1e-12 && closest > best - edge / 20.0, "{p} {t:?}");
            }
        }
    }

    #[test]
    fn samples_lie_on_the_surface_as_many_as_its_area_says() {
        let all = triangles(&shapes::cuboid([20.0, 10.0, 6.0]));
        let made = samples(&all, 4000);
        let surface = TriangleSurface::new(&all).expect("a box");
        assert!(made.iter().all(|&p| surface.nearest(p).point.distance(p) < 1e-12));
        let top = made.iter().filter(|p| p.z > 2.999).count() as f64;
        let share = 200.0 / (2.0 * (200.0 + 120.0 + 60.0));
        assert!((top / 4000.0 - share).abs() < 0.002, "{top} on the top");
        let mean = made.iter().sum::<DVec3>() / 4000.0;
        assert!(mean.length() < 0.05, "{mean}");
    }

    #[test]
    fn triangles_without_area_or_numbers_are_refused() {
        let line = [DVec3::ZERO, DVec3::X, 2.0 * DVec3::X];
        for (triangles, cause) in [
            (vec![], "no triangle"),
            (vec![line], "no triangle"),
            (vec![[DVec3::NAN, DVec3::X, DVec3::Y]], "no numbers"),
        ] {
            let error = TriangleSurface::new(&triangles).map(|_| ()).expect_err(cause);
            assert!(error.to_string().contains(cause), "{error}");
            assert!(samples(&triangles, 10).is_empty());
        }
    }
}
