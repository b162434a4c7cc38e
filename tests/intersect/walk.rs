//! All surfaces along a ray, one after the other.

use insonify::scene::Scene;
use insonify_tools::reference::intersect::{self, Hit};

use super::compare::{Found, around, displacement};
use super::device::Rig;
use super::rays::Ray;

/// Every surface along the ray, nearest first, as the path tracer finds them: past each hit by a margin of
/// rounding; surfaces of other instances within the margin by skipping.
pub fn walk(rig: &Rig, rays: &[Ray], margin: f64) -> Vec<Vec<(f64, usize, bool)>> {
    let mut found = vec![Vec::new(); rays.len()];
    let mut active: Vec<(usize, Ray)> = rays.iter().copied().enumerate().collect();
    for _ in 0..64 {
        if active.is_empty() {
            break;
        }
        let list: Vec<Ray> = active.iter().map(|a| a.1).collect();
        let hits = rig.trace(&list);
        active = active
            .iter()
            .zip(&hits)
            .filter_map(|(&(i, ray), hit)| {
                let Found { t, instance, .. } = hit.found?;
                found[i].push((t, instance, hit.geometric.dot(ray.direction()) < 0.0));
                Some((i, Ray { t_min: (t + margin) as f32, ..ray }))
            })
            .collect();
    }
    assert!(active.is_empty(), "a ray meets more than 64 surfaces");
    found
}

/// The surfaces along a ray, an edge shared by triangles once, where single precision cannot change them: rays
/// displaced by the rounding meet the same instances, and surfaces of different triangles lie at least `gap`
/// apart unless `twins` lets two instances coincide.
pub fn clear_hits(
    scene: &Scene,
    ray: &Ray,
    gap: f64,
    twins: fn(usize, usize) -> bool,
) -> Option<Vec<Hit>> {
    let (o, d) = (ray.origin(), ray.direction());
    let once = |o| {
        let mut hits = intersect::all_hits(scene, o, d, f64::from(ray.t_min));
        let mut kept: Vec<Hit> = Vec::new();
        hits.retain(|hit| {
            let new = !kept
                .iter()
                .any(|k| k.instance == hit.instance && (hit.t - k.t).abs() < 1e-9 * hit.t);
            kept.extend(new.then_some(*hit));
            new
        });
        hits
    };
    let hits = once(o);
    let apart = hits.windows(2).all(|w| {
        w[1].t - w[0].t > gap
            || (w[1].t - w[0].t < 1e-9 * w[1].t && twins(w[0].instance, w[1].instance))
    });
    let delta = displacement(scene, ray, hits.last().map_or(0.0, |h| h.t));
    let same = apart
        && around(d, 12).all(|aside| {
            let moved = once(o + aside * delta);
            moved.len() == hits.len()
                && moved
                    .iter()
                    .zip(&hits)
                    .all(|(a, b)| a.instance == b.instance && (a.t - b.t).abs() < gap / 2.0)
        });
    same.then_some(hits)
}
