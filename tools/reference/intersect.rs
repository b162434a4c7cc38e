//! Brute-force ray intersection in double precision: every triangle of every instance.

use glam::DVec3;

use insonify::scene::{Scene, triangle};

/// A hit of a ray on a triangle.
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
            if let Some([t, u, v]) = triangle::crossing(corners, o, d)
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
