//! The camera of the 3D view: a perspective camera that goes around a point of the anatomy.
//!
//! A panel is its width and height in any unit of length (points, pixels), and places in it are
//! counted from its upper left corner in that unit.

use glam::{DAffine3, DMat3, DQuat, DVec2, DVec3};

/// Angle over the smaller side of the panel, rad: small enough that organs keep their
/// proportions.
const FIELD_OF_VIEW: f64 = 30.0 * std::f64::consts::PI / 180.0;
/// Least and greatest distance of the camera, as multiples of the radius of what it looks at.
const REACH: [f64; 2] = [0.02, 20.0];

/// A ray of the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Start, mm.
    pub origin: DVec3,
    /// Unit direction.
    pub direction: DVec3,
}

/// Position and direction of the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Point that it looks at and goes around, world, mm.
    pub target: DVec3,
    /// Distance from the target to the camera, mm.
    pub distance: f64,
    /// World from camera: x to the right, y up, z from the target to the camera.
    pub turn: DQuat,
    /// Unit vector of the axis for sideways turns.
    up: DVec3,
    /// Radius of the ball around the target, mm.
    size: f64,
}

impl Camera {
    /// A camera for which a ball of `radius` (mm) around `target` fills the panel, facing the image
    /// plane of `pose` (world from probe): the image's left on the left, the probe above.
    pub fn front(pose: &DAffine3, target: DVec3, radius: f64) -> Self {
        let up = -pose.transform_vector3(DVec3::Z).normalize();
        let mut made = Self {
            target,
            distance: radius / (FIELD_OF_VIEW / 2.0).sin(),
            turn: DQuat::IDENTITY,
            up,
            size: radius,
        };
        made.face(pose);
        made
    }

    /// Turns to the image plane of `pose` as [`Self::front`] does, about the same target.
    pub fn face(&mut self, pose: &DAffine3) {
        let axis = |v| pose.transform_vector3(v).normalize();
        let (x, y, z) = (axis(DVec3::X), axis(DVec3::Y), axis(DVec3::Z));
        self.turn = DQuat::from_mat3(&DMat3::from_cols(x, -z, y)).normalize();
    }

    /// Looks along the depth axis of `pose`, as the probe does: lateral to the right.
    pub fn along(&mut self, pose: &DAffine3) {
        let axis = |v| pose.transform_vector3(v).normalize();
        let (x, y, z) = (axis(DVec3::X), axis(DVec3::Y), axis(DVec3::Z));
        self.turn = DQuat::from_mat3(&DMat3::from_cols(x, -y, -z)).normalize();
    }

    /// Looks at the target from the side `from`, with `above` upward: directions in the world at right angles.
    pub fn look_from(&mut self, from: DVec3, above: DVec3) {
        self.turn = DQuat::from_mat3(&DMat3::from_cols(above.cross(from), above, from)).normalize();
    }

    /// Goes around the target by `by` (to the right and down), a drag over the panel's smaller side
    /// being half a turn.
    pub fn orbit(&mut self, panel: DVec2, by: DVec2) {
        let angle = -by / panel.min_element().max(1.0) * std::f64::consts::PI;
        // Upside down, the picture still follows the pointer.
        let upright = if self.above().dot(self.up) < 0.0 { -1.0 } else { 1.0 };
        let around = DQuat::from_axis_angle(self.up, angle.x * upright);
        let over = DQuat::from_axis_angle(DVec3::X, angle.y);
        self.turn = (around * self.turn * over).normalize();
    }

    /// Shifts the target by `by`, so that the target's plane follows the pointer.
    pub fn pan(&mut self, panel: DVec2, by: DVec2) {
        let step = by * self.pitch(panel) * self.distance;
        self.target -= self.right() * step.x - self.above() * step.y;
    }

    /// Goes nearer by `steps` of a wheel, a tenth of the distance each; away where they are negative.
    pub fn zoom(&mut self, steps: f64) {
        let [least, most] = REACH.map(|reach| reach * self.size);
        self.distance = (self.distance * 0.9f64.powf(steps)).clamp(least, most);
    }

    /// Position of the camera, mm.
    pub fn eye(&self) -> DVec3 {
        self.target + self.turn * DVec3::Z * self.distance
    }

    /// Unit vector to the right of the panel.
    pub fn right(&self) -> DVec3 {
        self.turn * DVec3::X
    }

    /// Unit vector to the panel's upper edge.
    pub fn above(&self) -> DVec3 {
        self.turn * DVec3::Y
    }

    /// Unit vector from the camera to the target.
    pub fn forward(&self) -> DVec3 {
        self.turn * DVec3::NEG_Z
    }

    /// Length in the plane at distance 1 that one unit of the panel shows.
    pub fn pitch(&self, panel: DVec2) -> f64 {
        2.0 * (FIELD_OF_VIEW / 2.0).tan() / panel.min_element().max(1.0)
    }

    /// The ray through a place of the panel.
    pub fn ray(&self, panel: DVec2, place: DVec2) -> Ray {
        let off = (place - panel / 2.0) * self.pitch(panel);
        let direction = self.forward() + off.x * self.right() - off.y * self.above();
        Ray { origin: self.eye(), direction: direction.normalize() }
    }

    /// The place of the panel, or beside it, where a point of the world (mm) appears; none where the point is not
    /// in front of the camera.
    pub fn project(&self, panel: DVec2, point: DVec3) -> Option<DVec2> {
        let v = point - self.eye();
        let depth = v.dot(self.forward());
        let off = DVec2::new(v.dot(self.right()), -v.dot(self.above())) / depth;
        (depth > 1e-6 * self.size).then(|| panel / 2.0 + off / self.pitch(panel))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PANEL: DVec2 = DVec2::new(600.0, 480.0);

    fn pose() -> DAffine3 {
        let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.4, -1.1, 2.3);
        DAffine3::from_rotation_translation(turn, DVec3::new(10.0, -30.0, 55.0))
    }

    fn camera() -> Camera {
        let target = pose().transform_point3(DVec3::new(0.0, 0.0, 60.0));
        Camera::front(&pose(), target, 90.0)
    }

    fn seen(camera: &Camera, in_probe: [f64; 3]) -> DVec2 {
        let point = pose().transform_point3(DVec3::from(in_probe));
        camera.project(PANEL, point).expect("in front of the eye")
    }

    #[test]
    fn from_the_front_the_plane_lies_as_the_image_does() {
        let camera = camera();
        let [middle, right, deeper, nearer] =
            [[0.0, 0.0, 60.0], [20.0, 0.0, 60.0], [0.0, 0.0, 80.0], [20.0, 15.0, 60.0]]
                .map(|p| seen(&camera, p));
        assert!((middle - PANEL / 2.0).length() < 1e-9);
        // 20 mm at the target's distance, in perspective.
        let length = 20.0 / (camera.distance * camera.pitch(PANEL));
        assert!((right - middle - DVec2::new(length, 0.0)).length() < 1e-9);
        assert!((deeper - middle - DVec2::new(0.0, length)).length() < 1e-9);
        assert!(nearer.x > right.x, "elevation comes towards the eye");
    }

    #[test]
    fn along_the_probe_the_image_is_a_line() {
        let mut camera = camera();
        camera.along(&pose());
        let [middle, left, out] =
            [[0.0, 0.0, 60.0], [-9.0, 0.0, 60.0], [0.0, 5.0, 60.0]].map(|p| seen(&camera, p));
        assert!((left.y - middle.y).abs() < 1e-9 && left.x < middle.x);
        assert!((out.x - middle.x).abs() < 1e-9 && out.y > middle.y);
    }

    #[test]
    fn a_ray_ends_where_it_is_seen() {
        let mut camera = camera();
        camera.orbit(PANEL, DVec2::new(120.0, -75.0));
        camera.pan(PANEL, DVec2::new(-31.0, 12.0));
        camera.zoom(2.5);
        for place in [[0.0, 0.0], [311.0, 77.5], [599.0, 479.0]] {
            let place = DVec2::from(place);
            let ray = camera.ray(PANEL, place);
            assert!((ray.direction.length() - 1.0).abs() < 1e-12);
            let back = camera.project(PANEL, ray.origin + 133.0 * ray.direction);
            assert!((back.expect("in front") - place).length() < 1e-9);
        }
        let behind = camera.eye() - 5.0 * camera.forward();
        assert_eq!(camera.project(PANEL, behind), None);
    }

    #[test]
    fn the_hand_drags_what_it_holds() {
        let before = camera();
        let point = before.target + 9.0 * before.right() + 4.0 * before.above();
        let at = before.project(PANEL, point).expect("seen");
        let mut panned = before;
        panned.pan(PANEL, DVec2::new(40.0, 25.0));
        let now = panned.project(PANEL, point).expect("seen");
        assert!((now - at - DVec2::new(40.0, 25.0)).length() < 1e-9);
        // The side towards the camera follows a drag; the distance stays.
        let near = before.target - 30.0 * before.forward();
        for by in [DVec2::new(20.0, 0.0), DVec2::new(0.0, 20.0)] {
            let mut turned = before;
            turned.orbit(PANEL, by);
            let moved = turned.project(PANEL, near).expect("seen") - PANEL / 2.0;
            assert!(moved.dot(by) > 0.0, "{by}: {moved}");
            assert!((turned.eye().distance(turned.target) - before.distance).abs() < 1e-9);
        }
    }

    #[test]
    fn a_turn_comes_back_and_zoom_has_ends() {
        let before = camera();
        let mut camera = before;
        for _ in 0..8 {
            // A drag over the smaller side is half a turn: sixteen eighths are two.
            camera.orbit(PANEL, DVec2::new(PANEL.y / 4.0, 0.0));
        }
        assert!(camera.turn.angle_between(before.turn) < 1e-6);
        camera.zoom(1e3);
        assert!(camera.distance > 0.0);
        camera.zoom(-1e3);
        assert!(camera.distance <= 20.0 * 90.0);
    }
}
