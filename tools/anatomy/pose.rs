//! The scene's frame and the probe poses for which the anatomy is arranged.
//!
//! World frame, mm: x to the patient's left, y posterior, z superior (LPS, as in DICOM). The
//! origin lies in the midline, midway between front and back, at the level of the disc L1/L2.

use glam::Vec3;

/// A probe on the skin. The face's centre is at `position`.
#[derive(Clone, Copy, Debug)]
pub struct Pose {
    /// Content of the view, for the scene file.
    pub title: &'static str,
    /// Centre of the probe's face, mm.
    pub position: Vec3,
    /// Unit vector into the body.
    pub direction: Vec3,
    /// Unit vector along the array, perpendicular to `direction`.
    pub lateral: Vec3,
}

impl Pose {
    /// Pose from a point on the undeformed skin at (`x`, front or right side, `z`), a target and the
    /// wanted lateral axis; `press` mm deep.
    fn aimed(title: &'static str, skin: Vec3, target: Vec3, lateral: Vec3, press: f32) -> Self {
        let direction = (target - skin).normalize();
        let lateral = (lateral - direction * lateral.dot(direction)).normalize();
        Self { title, position: skin + direction * press, direction, lateral }
    }

    /// The point `lateral` mm along the array, `depth` mm into the body and `elevation` mm off
    /// the slice.
    pub fn at(&self, lateral: f32, depth: f32, elevation: f32) -> Vec3 {
        self.position
            + self.lateral * lateral
            + self.direction * depth
            + self.direction.cross(self.lateral) * elevation
    }
}

/// Point of the undeformed skin's front at `x`, `z`.
fn front(x: f32, z: f32) -> Vec3 {
    let (a, b) = crate::body::TORSO;
    Vec3::new(x, -b * (1.0 - (x / a).powi(2)).sqrt(), z)
}

/// Depth to which the default probe is pressed in, mm: as deep as the 57 mm long, 50 mm curved face
/// needs to touch the skin nearly everywhere.
pub const PRESS: f32 = 9.0;

/// The scene's pose: right anterior axillary line, long axis of the body, turned along the ribs.
pub fn default() -> Pose {
    Pose::aimed(
        "right intercostal, longitudinal: liver, gallbladder, right kidney, two ribs",
        front(-95.0, -10.0),
        Vec3::new(-66.0, 38.0, -6.0),
        Vec3::new(0.2, -0.1, -0.97),
        PRESS,
    )
}

/// Further views of the same anatomy; the face just touches the undeformed skin.
pub fn alternatives() -> [Pose; 3] {
    [
        Pose::aimed(
            "right subcostal, oblique: hepatic veins joining the vena cava under the diaphragm",
            front(-62.0, -48.0),
            Vec3::new(-40.0, 10.0, 50.0),
            Vec3::new(0.9, 0.1, 0.3),
            1.5,
        ),
        Pose::aimed(
            "epigastric, transverse: left lobe, portal vein, vena cava, aorta, vertebra",
            front(-15.0, -5.0),
            Vec3::new(-10.0, 40.0, -5.0),
            Vec3::X,
            1.5,
        ),
        Pose::aimed(
            "right flank, longitudinal: kidney behind the liver's tip, diaphragm, lung",
            front(-140.0, -8.0),
            Vec3::new(-66.0, 40.0, -8.0),
            Vec3::new(0.0, 0.0, -1.0),
            1.5,
        ),
    ]
}
