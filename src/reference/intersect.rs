//! Brute-force ray intersection in double precision: every triangle of every instance.

use glam::DVec3;

use crate::scene::Scene;

/// Where a ray meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Ray parameter: mm for a unit direction.
    pub t: f64,
    /// Index into [`Scene::instances`].
    pub instance: usize,
    /// Index into the triangles of the instance's mesh.
    pub triangle: usize,
    /// Barycentric weight of the second vertex.
    pub u: f64,
    /// Barycentric weight of the third vertex.
    pub v: f64,
}

/// Ray parameter and barycentric weights (t, u, v) where a ray meets the triangle of these
/// `corners`; unbounded in t. Edges count as inside.
///
/// The edge functions are scalar triple products (Pluecker coordinates of the ray and the edge), of
/// which two triangles that share an edge compute exactly opposite values: no ray passes between.
pub fn triangle(corners: [DVec3; 3], origin: DVec3, direction: DVec3) -> Option<[f64; 3]> {
    let [a, b, c] = corners.map(|corner| corner - origin);
    let weights = [direction.dot(c.cross(b)), direction.dot(a.cross(c)), direction.dot(b.cross(a))];
    if weights.iter().any(|&w| w < 0.0) && weights.iter().any(|&w| w > 0.0) {
        return None;
    }
    let sum: f64 = weights.iter().sum();
    if sum == 0.0 {
        return None;
    }
    let [wa, wb, wc] = weights.map(|w| w / sum);
    let t = (a * wa + b * wb + c * wc).dot(direction) / direction.length_squared();
    Some([t, wb, wc])
}

/// All surfaces with t > `t_min` along `origin + t * direction` (world space, mm), by increasing t.
/// A ray through an edge meets both its triangles.
pub fn all_hits(scene: &Scene, origin: DVec3, direction: DVec3, t_min: f64) -> Vec<Hit> {
    let mut hits = Vec::new();
    for (instance, placed) in scene.instances.iter().enumerate() {
        let object_from_world = placed.world_from_object.inverse();
        let (o, d) = (
            object_from_world.transform_point3(origin),
            object_from_world.transform_vector3(direction),
        );
        let mesh = &scene.meshes[placed.mesh];
        for index in 0..mesh.triangles.len() {
            let corners = mesh.triangles[index]
                .map(|i| DVec3::from(mesh.positions[i as usize].map(f64::from)));
            if let Some([t, u, v]) = triangle(corners, o, d)
                && t > t_min
            {
                hits.push(Hit { t, instance, triangle: index, u, v });
            }
        }
    }
    hits.sort_by(|a, b| a.t.total_cmp(&b.t));
    hits
}

/// The first surface with `t_min` < t < `t_max`; all of instance `skip` is transparent.
pub fn closest_hit(
    scene: &Scene,
    origin: DVec3,
    direction: DVec3,
    [t_min, t_max]: [f64; 2],
    skip: Option<usize>,
) -> Option<Hit> {
    all_hits(scene, origin, direction, t_min)
        .into_iter()
        .find(|hit| Some(hit.instance) != skip)
        .filter(|hit| hit.t < t_max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangle_in_closed_form() {
        let corners = [DVec3::ZERO, 2.0 * DVec3::X, 4.0 * DVec3::Y];
        let at = |x, y| triangle(corners, DVec3::new(x, y, -3.0), DVec3::new(0.0, 0.0, 0.5));
        // Weights are x/2 and y/4; the plane z = 0 lies six half-unit directions away. Binary fractions: exact.
        assert_eq!(at(0.5, 1.0), Some([6.0, 0.25, 0.25]));
        assert_eq!(at(1.0, 0.0), Some([6.0, 0.5, 0.0]), "edges are inside");
        assert_eq!(at(0.0, 0.0), Some([6.0, 0.0, 0.0]), "vertices are inside");
        assert_eq!(at(-1e-9, 1.0), None);
        assert_eq!(at(1.5, 1.5), None);
        assert_eq!(triangle(corners, DVec3::ZERO, DVec3::X), None, "a ray in the plane misses");
    }
}
