//! Points inside closed surfaces.

use glam::DVec3;

use crate::scene::{Instance, Scene};

/// Returns whether an instance encloses a point: winding number by the solid angles of all triangles (van Oosterom
/// and Strackee 1983), one inside a closed outward mesh and zero outside, with one half as the limit.
pub(super) fn encloses(scene: &Scene, instance: &Instance, point: DVec3) -> bool {
    let local = instance.world_from_object.inverse().transform_point3(point);
    let mesh = &scene.meshes[instance.mesh];
    let half_angles: f64 = mesh
        .triangles
        .iter()
        .map(|t| {
            let [a, b, c] =
                t.map(|i| DVec3::from(mesh.positions[i as usize].map(f64::from)) - local);
            let (la, lb, lc) = (a.length(), b.length(), c.length());
            let below = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
            a.dot(b.cross(c)).atan2(below)
        })
        .sum();
    half_angles / std::f64::consts::TAU > 0.5
}
