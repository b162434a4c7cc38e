//! Placements: shift, rotation and scale of meshes, transforms and motions.

use glam::{DAffine3, DQuat, DVec3};

use super::table::Stated;
use crate::settings::units::{ANGLE, LENGTH};
use crate::settings::{Facts, Form, group};

/// Least and largest factor by which a placement scales.
pub const SCALES: [f64; 2] = [1e-6, 1e6];
/// An axis of rotation.
pub(super) const AXIS: Facts = Facts::of(Form::Direction).key("rotate.axis").required();
/// The angle about it.
pub(super) const TURN: Facts = Facts::quantity(&ANGLE, -1e3, 1e3).key("rotate.angle").required();
/// Three lengths from a place where anatomy may be.
pub(super) const PLACE: Facts = Facts::quantities(&LENGTH, 3, -1e5, 1e5);

group! {
    /// Size of something that keeps its proportions.
    pub struct Size in "" {
        /// Size factor. Applied first, about the origin.
        scale: f64 = 1.0, Facts::number(SCALES[0], SCALES[1]);
    }
}

group! {
    /// Size of something that may be stretched.
    pub struct Stretch in "" {
        /// Factor, or factors along x, y, z. Applied first, about the origin.
        scale: [f64; 3] = [1.0; 3], Facts::factors(SCALES[0], SCALES[1]);
    }
}

group! {
    /// Direction and place.
    pub struct Placed in "" {
        /// Axis of the rotation, through the origin.
        axis: [f64; 3] = [0.0, 0.0, 1.0], AXIS;
        /// Angle, by the right-hand rule.
        angle: f64 = 0.0, TURN;
        /// Shift. Applied last.
        translate: [f64; 3] = [0.0; 3], PLACE;
    }
}

/// World from object, as the table `below` says it: scale, then rotate, then translate.
pub(super) fn placement(stated: &Stated, below: &str) -> DAffine3 {
    let scale = stated.get::<Stretch>(below).scale;
    let Placed { axis, angle, translate } = stated.get(below);
    let rotation = DQuat::from_axis_angle(DVec3::from(axis).normalize(), angle);
    DAffine3::from_scale_rotation_translation(scale.into(), rotation, translate.into())
}
