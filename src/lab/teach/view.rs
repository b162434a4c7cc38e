//! How far one view is from another, in terms of the images.

use glam::{DAffine3, DQuat, DVec3};

use crate::scene::task::Target;

/// The distance between two views.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Apart {
    /// Distance between the middles of the images (on the central scanline, at half the depth), mm.
    pub distance: f64,
    /// Angle between the image planes, rad, 0 to pi: that between their elevation axes.
    pub plane_angle: f64,
    /// Rotation within the plane, rad, 0 to pi: what remains once the planes have been laid onto each other the
    /// shortest way.
    pub turn: f64,
}

impl Apart {
    /// The distance between the views of two poses (world from probe) of a probe that images to `depth` mm.
    pub fn of(target: &DAffine3, pose: &DAffine3, depth: f64) -> Self {
        let middle = DVec3::Z * (depth / 2.0);
        let between = target.inverse() * *pose;
        let rotation = DQuat::from_mat3(&between.matrix3).normalize();
        let normal = rotation * DVec3::Y;
        // The twist of the rotation about the elevation axis (swing-twist decomposition); where the planes are turned
        // over there is none to tell.
        let twist = rotation.w.hypot(rotation.y);
        let turn = if twist > 1e-9 { 2.0 * rotation.y.abs().atan2(rotation.w.abs()) } else { 0.0 };
        Self {
            distance: target.transform_point3(middle).distance(pose.transform_point3(middle)),
            plane_angle: normal.cross(DVec3::Y).length().atan2(normal.y),
            turn,
        }
    }

    /// Returns whether this is within the tolerances.
    pub fn within(&self, target: &Target) -> bool {
        self.distance <= target.distance
            && self.plane_angle <= target.plane_angle
            && self.turn <= target.turn
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    #[test]
    fn each_movement_is_told_by_its_number() {
        let target = DAffine3::from_rotation_y(0.4)
            * DAffine3::from_translation(DVec3::new(3.0, -70.0, 9.0));
        let apart = |by: DAffine3| Apart::of(&target, &(target * by), 100.0);
        let near = |a: Apart, b: [f64; 3]| {
            let found = [a.distance, a.plane_angle, a.turn];
            assert!(found.iter().zip(b).all(|(x, y)| (x - y).abs() < 1e-9), "{found:?} {b:?}");
        };
        near(apart(DAffine3::from_translation(DVec3::new(3.0, 4.0, 12.0))), [13.0, 0.0, 0.0]);
        // A fan about the face's lateral axis moves the middle along an arc of half the depth.
        let arc = |angle: f64| 2.0 * 50.0 * (angle / 2.0).sin();
        near(apart(DAffine3::from_rotation_x(0.3)), [arc(0.3), 0.3, 0.0]);
        near(apart(DAffine3::from_rotation_y(-0.2)), [arc(0.2), 0.0, 0.2]);
        near(apart(DAffine3::from_rotation_z(0.5)), [0.0, 0.5, 0.0]);
        // Left to right: the same plane, seen from behind.
        near(apart(DAffine3::from_rotation_z(PI)), [0.0, PI, 0.0]);
    }
}
