//! Placements: shift, rotation and scale of meshes, transforms and motions.

use glam::{DAffine3, DQuat, DVec3};

use super::document::Document;
use super::error::SceneError;
use super::schema::{Factors, Rotation};
use super::within;
use crate::settings::units::Length;

/// Least and largest factor by which a placement scales.
pub const SCALES: [f64; 2] = [1e-6, 1e6];

/// World from object: scale, then rotate, then translate.
pub(super) fn placement(
    document: &Document<'_>,
    path: &str,
    (translate, rotate, scale): (Option<[Length; 3]>, Option<&Rotation>, Option<Factors>),
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
