//! Where things are: shift, rotation and scale of meshes, transforms and motions.

use glam::{DAffine3, DMat3, DQuat, DVec3};

use super::document::Document;
use super::error::SceneError;
use super::schema::{Factors, Rotation};
use super::within;
use crate::settings::units::Length;

/// Least and largest factor by which a placement scales.
pub const SCALES: [f64; 2] = [1e-6, 1e6];

/// Shift, rotation and scale of a table.
pub(super) type Place<'t> = (Option<[Length; 3]>, Option<&'t Rotation>, Option<Factors>);

/// Volume of the box that the unit vectors become, over the product of their lengths, at and below which a matrix is
/// flat for single precision.
const FLAT: f64 = 1e-6;

/// World from object: the matrix where there is one, else scale, then rotate, then translate.
pub(super) fn placed(
    document: &Document<'_>,
    path: &str,
    matrix: Option<[f64; 16]>,
    place: Place<'_>,
) -> Result<DAffine3, SceneError> {
    let Some(rows) = matrix else { return placement(document, path, place) };
    let alone = place.0.is_none() && place.1.is_none() && place.2.is_none();
    let placement = affine(document, path, rows, alone)?;
    let path = format!("{path}.matrix");
    for shift in placement.translation.to_array() {
        within(document, &path, shift, -1e5, 1e5, "mm")?;
    }
    let m = placement.matrix3;
    let lengths = [m.x_axis, m.y_axis, m.z_axis].map(DVec3::length);
    let volume = m.determinant() / lengths.iter().product::<f64>();
    let [least, most] = SCALES;
    let wrong = lengths.iter().find(|length| !(least..=most).contains(*length));
    let (cause, remedy) = match wrong {
        Some(length) => (
            format!("a column of this matrix is {length} long, by which it scales"),
            format!("it must lie between {least} and {most}"),
        ),
        None if volume < 0.0 => (
            "this matrix mirrors, which turns tissues inside out".to_owned(),
            "mirror the mesh in the modeller; from RAS to LPS two axes change sign, not one"
                .to_owned(),
        ),
        None if !(volume > FLAT) => (
            "this matrix is flat: it has no inverse".to_owned(),
            "write it row by row; the shift is the fourth column, mm".to_owned(),
        ),
        None => return Ok(placement),
    };
    Err(document.fail(&path, cause, remedy))
}

/// A matrix of four rows; `alone`: without other keys that place.
pub(super) fn affine(
    document: &Document<'_>,
    path: &str,
    rows: [f64; 16],
    alone: bool,
) -> Result<DAffine3, SceneError> {
    let fail = |why: &str, remedy| Err(document.fail(&format!("{path}.matrix"), why, remedy));
    if !alone {
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

/// World from object: scale, then rotate, then translate.
pub(super) fn placement(
    document: &Document<'_>,
    path: &str,
    (translate, rotate, scale): Place<'_>,
) -> Result<DAffine3, SceneError> {
    let scale = factors(document, &format!("{path}.scale"), scale, SCALES.into())?;
    let rotation = match rotate {
        Some(rotation) => {
            let (axis, angle) = turn(document, &format!("{path}.rotate"), rotation)?;
            DQuat::from_axis_angle(axis, angle)
        }
        None => DQuat::IDENTITY,
    };
    let translation = match translate {
        Some(translate) => shift(document, &format!("{path}.translate"), translate)?,
        None => DVec3::ZERO,
    };
    Ok(DAffine3::from_scale_rotation_translation(scale, rotation, translation))
}

/// Unit axis and angle, rad.
pub(super) fn turn(
    document: &Document<'_>,
    path: &str,
    rotation: &Rotation,
) -> Result<(DVec3, f64), SceneError> {
    let axis = DVec3::from(rotation.axis).try_normalize().ok_or_else(|| {
        let remedy = "give a vector such as [0, 0, 1]";
        let path = format!("{path}.axis");
        document.fail(&path, "this axis has no length", remedy)
    })?;
    let angle = rotation.angle.0;
    within(document, &format!("{path}.angle"), angle, -1e3, 1e3, "rad")?;
    Ok((axis, angle))
}

/// Factors along the axes, each within `range`; 1 where none are given.
pub(super) fn factors(
    document: &Document<'_>,
    path: &str,
    given: Option<Factors>,
    range: (f64, f64),
) -> Result<DVec3, SceneError> {
    let Factors(factors) = given.unwrap_or(Factors([1.0; 3]));
    for factor in factors {
        within(document, path, factor, range.0, range.1, "")?;
    }
    Ok(factors.into())
}

/// A vector, mm.
pub(super) fn shift(
    document: &Document<'_>,
    path: &str,
    lengths: [Length; 3],
) -> Result<DVec3, SceneError> {
    for length in lengths {
        within(document, path, length.0, -1e5, 1e5, "mm")?;
    }
    Ok(lengths.map(|length| length.0).into())
}
