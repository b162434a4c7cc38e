//! Placements: shift, rotation and scale of meshes, transforms and motions.

use glam::{DAffine3, DMat3, DQuat, DVec3};

use super::document::Document;
use super::error::SceneError;
use super::table::Stated;
use crate::settings::units::{ANGLE, FARTHEST, LENGTH};
use crate::settings::{Facts, Form, group};

/// Least and largest factor by which a placement scales.
pub const SCALES: [f64; 2] = [1e-6, 1e6];
/// An axis of rotation.
pub(super) const AXIS: Facts = Facts::of(Form::Direction).key("rotate.axis").required();
/// The angle about it.
pub(super) const TURN: Facts = Facts::quantity(&ANGLE, -1e3, 1e3).key("rotate.angle").required();
/// Three lengths from a place where anatomy may be.
pub(super) const PLACE: Facts = Facts::quantities(&LENGTH, 3, -FARTHEST, FARTHEST);

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

group! {
    /// A placement as a matrix.
    pub struct Affine in "" {
        /// Instead of `scale`, `rotate` and `translate`: 4 x 4, row by row; the shift, in mm, is the fourth column.
        matrix: Option<[f64; 16]> = None,
            Facts::of(Form::Numbers(16)).limits("not flat, not mirroring, without the other keys");
    }
}

/// Volume of the box that the unit vectors become, over the product of their lengths, at and below which a matrix is
/// flat for single precision.
const FLAT: f64 = 1e-6;

/// World from object, as the table at `path` says it: its matrix, or its parts.
///
/// # Errors
/// A matrix beside parts, or one that mirrors, is flat, scales too much or leads too far.
pub(super) fn placed(
    document: &Document<'_>,
    path: &str,
    stated: &Stated,
) -> Result<DAffine3, SceneError> {
    let Some(rows) = stated.get::<Affine>("").matrix else { return Ok(placement(stated, "")) };
    let path = format!("{path}.matrix");
    let placement = affine(document, &path, rows, stated, "")?;
    let (m, shifts) = (placement.matrix3, placement.translation.to_array());
    let lengths = [m.x_axis, m.y_axis, m.z_axis].map(DVec3::length);
    let volume = m.determinant() / lengths.iter().product::<f64>();
    let [least, most] = SCALES;
    let (cause, remedy) = match lengths.iter().find(|size| !(least..=most).contains(*size)) {
        Some(size) => (
            format!("a column of this matrix is {size} long, by which it scales"),
            format!("it must lie between {least} and {most}"),
        ),
        None if volume < 0.0 => (
            "this matrix mirrors, which turns tissues inside out".to_owned(),
            "mirror the mesh in the modeller; from RAS to LPS two axes change sign, not one"
                .to_owned(),
        ),
        None if volume <= FLAT => (
            "this matrix is flat: it has no inverse".to_owned(),
            "write it row by row; the shift is the fourth column, mm".to_owned(),
        ),
        None => match shifts.iter().find(|shift| !(-FARTHEST..=FARTHEST).contains(*shift)) {
            Some(shift) => (
                format!("this matrix shifts by {shift} mm"),
                format!("it must lie between -{FARTHEST} and {FARTHEST} mm"),
            ),
            None => return Ok(placement),
        },
    };
    Err(document.fail(&path, cause, remedy))
}

/// The matrix of four rows at `path`; the other keys that place may not stand in the table `below` with it.
pub(super) fn affine(
    document: &Document<'_>,
    path: &str,
    rows: [f64; 16],
    stated: &Stated,
    below: &str,
) -> Result<DAffine3, SceneError> {
    let fail = |why: &str, remedy| Err(document.fail(path, why, remedy));
    if ["scale", "rotate", "translate"].iter().any(|key| stated.has(&format!("{below}{key}"))) {
        return fail("both a matrix and a shift, rotation or scale are given", "give one of them");
    }
    if rows[12..] != [0.0, 0.0, 0.0, 1.0] {
        return fail(
            "the last row is not 0 0 0 1",
            "write the matrix row by row; the shift is the fourth column, mm",
        );
    }
    let column = |i: usize| DVec3::new(rows[i], rows[4 + i], rows[8 + i]);
    let matrix = DMat3::from_cols(column(0), column(1), column(2));
    Ok(DAffine3::from_mat3_translation(matrix, column(3)))
}

/// World from object, as the table `below` says it: scale, then rotate, then translate.
pub(super) fn placement(stated: &Stated, below: &str) -> DAffine3 {
    let scale = stated.get::<Stretch>(below).scale;
    let Placed { axis, angle, translate } = stated.get(below);
    let rotation = DQuat::from_axis_angle(DVec3::from(axis).normalize(), angle);
    DAffine3::from_scale_rotation_translation(scale.into(), rotation, translate.into())
}
