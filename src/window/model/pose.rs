//! Movements of a probe, named as sonographers name them (AIUM, Transducer manipulation, 1999).

use glam::{DAffine3, DMat3, DQuat, DVec3};

/// A movement of a probe in its own axes; rotations are about the centre of its face.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// Slide along the image's lateral axis, mm.
    Lateral,
    /// Slide (sweep) along the elevation axis, mm.
    Elevation,
    /// Press along the depth axis, mm.
    Depth,
    /// Turn about the depth axis, rad.
    Rotate,
    /// Rock in the image plane: turn about the elevation axis, rad.
    Rock,
    /// Tilt (fan) the image plane: turn about the lateral axis, rad.
    Tilt,
}

impl Axis {
    /// All movements.
    pub const ALL: [Self; 6] =
        [Self::Lateral, Self::Elevation, Self::Depth, Self::Rotate, Self::Rock, Self::Tilt];

    /// Returns true for a shift, in mm, and false for a turn, in rad.
    pub fn shifts(self) -> bool {
        matches!(self, Self::Lateral | Self::Elevation | Self::Depth)
    }
}

/// Movement of one key press: mm, and radians (2 degrees).
pub const STEP: [f64; 2] = [2.0, 2.0 * std::f64::consts::PI / 180.0];

/// A pose moved along or about one of its own axes, and made exactly rigid again.
pub fn moved(pose: &DAffine3, axis: Axis, amount: f64) -> DAffine3 {
    let shift = DAffine3::from_translation;
    let turn = |axis| DAffine3::from_axis_angle(axis, amount);
    let step = match axis {
        Axis::Lateral => shift(DVec3::X * amount),
        Axis::Elevation => shift(DVec3::Y * amount),
        Axis::Depth => shift(DVec3::Z * amount),
        Axis::Rotate => turn(DVec3::Z),
        Axis::Rock => turn(DVec3::Y),
        Axis::Tilt => turn(DVec3::X),
    };
    let out = *pose * step;
    // Otherwise the rounding of thousands of steps would add up to a shear.
    let rotation = DQuat::from_mat3(&out.matrix3).normalize();
    DAffine3::from_mat3_translation(DMat3::from_quat(rotation), out.translation)
}
