//! Comparison of the device's hit with that of the brute-force reference.

use glam::DVec3;
use insonify::scene::Scene;
use insonify::sim::tracer::Tracer;
use insonify_tools::reference::intersect::{self, Hit};
use rayon::prelude::*;

use super::rays::{Ray, aimed_at_seams, corners};

/// The device's answer in the reference's terms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found {
    pub t: f64,
    pub instance: usize,
    pub triangle: usize,
}

/// Largest distance between the device's ray and the exact one, mm: the transform into object space rounds
/// three products and sums, the shear as many, each by 6e-8 of the largest coordinate involved;
/// single-precision matrices add as much.
pub fn displacement(scene: &Scene, ray: &Ray, reach: f64) -> f64 {
    let shifts =
        scene.instances.iter().map(|i| i.world_from_object.translation.abs().max_element());
    6e-7 * shifts.fold(ray.origin().abs().max_element() + reach, f64::max)
}

/// Distance of a point from a triangle (Ericson 2005, section 5.1.5, by edges and plane).
fn distance(p: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
    let n = (b - a).cross(c - a);
    let inside = [(a, b), (b, c), (c, a)].iter().all(|&(s, e)| (e - s).cross(p - s).dot(n) >= 0.0);
    if inside {
        return ((p - a).dot(n) / n.length()).abs();
    }
    let to_edge = |s: DVec3, e: DVec3| {
        let along = ((p - s).dot(e - s) / (e - s).length_squared()).clamp(0.0, 1.0);
        p.distance(s + (e - s) * along)
    };
    to_edge(a, b).min(to_edge(b, c)).min(to_edge(c, a))
}

/// Largest distance of a hit on a triangle from its place, mm: the displacement seen along the ray, which
/// grows as the ray grazes.
fn blur(scene: &Scene, ray: &Ray, delta: f64, instance: usize, triangle: usize) -> f64 {
    let [a, b, c] = corners(scene, instance, triangle);
    let cosine = (b - a).cross(c - a).normalize().dot(ray.direction()) / ray.direction().length();
    delta / cosine.abs().max(1e-9)
}

/// Returns whether both hits are on the same surface at the same place: t to 1e-5 relative, or to the blur; the same
/// triangle, or one that touches the point within the blur.
fn agrees(
    scene: &Scene,
    ray: &Ray,
    delta: f64,
    expected: Option<Hit>,
    found: Option<Found>,
) -> bool {
    let (expected, found) = match (expected, found) {
        (None, None) => return true,
        (Some(e), Some(f)) => (e, f),
        _ => return false,
    };
    let slack = 1e-5 * expected.t
        + blur(scene, ray, delta, expected.instance, expected.triangle).max(blur(
            scene,
            ray,
            delta,
            found.instance,
            found.triangle,
        ));
    if found.instance != expected.instance || (found.t - expected.t).abs() > slack {
        return false;
    }
    found.triangle == expected.triangle
        || distance(
            ray.origin() + ray.direction() * expected.t,
            corners(scene, found.instance, found.triangle),
        ) <= slack
}

/// Returns whether the found triangle touches the ray at the found distance, with nothing before it.
fn first_touched(
    scene: &Scene,
    ray: &Ray,
    delta: f64,
    expected: Option<Hit>,
    found: Found,
) -> bool {
    let slack = 1e-5 * found.t + blur(scene, ray, delta, found.instance, found.triangle);
    let point = ray.origin() + ray.direction() * found.t;
    expected.is_none_or(|e| e.t > found.t - slack)
        && distance(point, corners(scene, found.instance, found.triangle)) <= slack
}

/// Unit vectors across a direction, evenly turned about it.
pub fn around(direction: DVec3, count: u32) -> impl Iterator<Item = DVec3> {
    let (x, y) = direction.normalize().any_orthonormal_pair();
    (0..count).map(move |i| {
        let (sin, cos) = (std::f64::consts::TAU * f64::from(i) / f64::from(count)).sin_cos();
        x * cos + y * sin
    })
}

/// Verdict on one ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    Same,
    /// Equal to the reference's answer to a ray displaced by no more than the rounding: the ray passes an outline,
    /// where the device may also meet just the corner of a triangle.
    Displaced,
    Wrong,
}

/// The reference's answer to a ray.
pub fn expected(scene: &Scene, ray: &Ray) -> Option<Hit> {
    closest(scene, ray, ray.origin())
}

fn closest(scene: &Scene, ray: &Ray, origin: DVec3) -> Option<Hit> {
    let bounds = [f64::from(ray.t_min), f64::from(ray.t_max)];
    intersect::closest_hit(scene, origin, ray.direction(), bounds, ray.skip.map(|i| i as usize))
}

/// Compares the device's answer with the reference's.
pub fn judge(scene: &Scene, ray: &Ray, expected: Option<Hit>, found: Option<Found>) -> Verdict {
    let reach = expected.map(|e| e.t).into_iter().chain(found.map(|f| f.t)).fold(0.0, f64::max);
    let delta = displacement(scene, ray, reach);
    if agrees(scene, ray, delta, expected, found) {
        return Verdict::Same;
    }
    // An outline's corner may be narrow: many directions, and near as well as far.
    let moved = [1.0, 0.3, 0.1].iter().any(|step| {
        around(ray.direction(), 24).any(|aside| {
            let hit = closest(scene, ray, ray.origin() + aside * delta * *step);
            agrees(scene, ray, 2.0 * delta, hit, found)
                || found.is_some_and(|found| first_touched(scene, ray, delta, hit, found))
        })
    });
    if moved { Verdict::Displaced } else { Verdict::Wrong }
}

/// Rays that the device answers wrongly.
pub fn wrong(
    scene: &Scene,
    rays: &[Ray],
    expected: &[Option<Hit>],
    found: &[Option<Found>],
) -> Vec<usize> {
    let wrong = |&i: &usize| judge(scene, &rays[i], expected[i], found[i]) == Verdict::Wrong;
    (0..rays.len()).into_par_iter().filter(wrong).collect()
}

/// Numbers of these rays that are aimed at vertices and edges, and of the others.
pub fn by_aim(rays: &[usize]) -> [usize; 2] {
    let aimed = rays.iter().filter(|&&i| aimed_at_seams(i)).count();
    [aimed, rays.len() - aimed]
}

/// Most of the rays aimed exactly at vertices and edges that may slip through. Ours: none. Vulkan wishes that a device's
/// own triangle test lose none there and does not demand it: Mesa 25's software driver loses 2 in 100 at a box, and twice
/// that is allowed. What we make of a device's answers shows in all other rays, of which none may be wrong.
pub fn slips(tracer: Tracer, aimed: usize) -> usize {
    match tracer {
        Tracer::Bvh => 0,
        Tracer::RayQuery => aimed * 400 / 10_000,
    }
}
