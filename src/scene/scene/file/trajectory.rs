//! Trajectory files: time, position, rotation and scale, row by row as CSV or column by column as TOML.

use std::path::Path;

use glam::{DQuat, DVec3};

use super::columns::{Column, ColumnFile, Columns, text};
use super::error::SceneError;
use super::motion::SQUEEZE;
use crate::scene::animation::{Channel, Curve, Track, TrackError};

/// A trajectory's columns.
const TRAJECTORY: ColumnFile = ColumnFile {
    name: "trajectory",
    columns: &["time_s", "x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz", "sx", "sy", "sz"],
};

/// The samples of the probe's trajectory in the file at `path`, linear between them: TOML by its extension, else
/// CSV, of the columns `time_s`, `x_mm`, `y_mm`, `z_mm` (mm) and `qw`, `qx`, `qy`, `qz` (a quaternion).
///
/// # Errors
/// A file that cannot be read, or the first mistake with its place in it.
pub fn load_trajectory(path: &Path) -> Result<Track, SceneError> {
    let text = text(path)?;
    let track = parse(path, &text, Curve::Linear)?;
    match track.scale {
        None => Ok(track),
        Some(_) => Err(SceneError::file(
            path,
            "a probe keeps its size, and there are columns sx, sy, sz".to_owned(),
            "remove them, or give the file to the motion of a transform",
        )),
    }
}

/// The samples of `text`, TOML by the extension of `path`, else CSV.
///
/// # Errors
/// The first mistake with its place in the trajectory file.
pub(super) fn parse(path: &Path, text: &str, curve: Curve) -> Result<Track, SceneError> {
    let table = Columns::parse(&TRAJECTORY, path, text)?;
    track(&table, curve)
}

fn track(table: &Columns<'_>, curve: Curve) -> Result<Track, SceneError> {
    let Some([time]) = table.together(["time_s"])? else {
        let remedy = "add the time of each row, in seconds";
        return Err(table.fail(0..0, "column `time_s` is missing".to_owned(), remedy));
    };
    table.check("time_s")?;
    let positions = table.together(["x_mm", "y_mm", "z_mm"])?;
    let rotations = table.together(["qw", "qx", "qy", "qz"])?;
    let factors = table.together(["sx", "sy", "sz"])?;
    if positions.is_none() && rotations.is_none() && factors.is_none() {
        return Err(table.fail(
            0..0,
            "the trajectory has neither positions nor rotations nor factors".to_owned(),
            "add x_mm, y_mm, z_mm or qw, qx, qy, qz or sx, sy, sz",
        ));
    }
    let rows = time.values.len();
    for column in factors.into_iter().flatten() {
        let (least, most) = SQUEEZE;
        let outside = |v: &f64| !(least..=most).contains(v);
        if let Some(row) = column.values.iter().position(outside) {
            let at = column.places[row].clone();
            let message = format!("the factor is {}", column.values[row]);
            let remedy = format!("tissue can be squeezed to {least} and stretched to {most}");
            return Err(table.fail(at, message, &remedy));
        }
    }
    let refused = |e: TrackError| refused(table, &e, time, rotations);
    let vectors = |of: [&Column; 3]| {
        let values = (0..rows).map(|i| DVec3::from(of.map(|c| c.values[i])));
        Channel::new(time.values.clone(), values.collect(), curve).map_err(refused)
    };
    let quaternions = |of: [&Column; 4]| {
        let values = (0..rows).map(|i| {
            let [w, x, y, z] = of.map(|c| c.values[i]);
            DQuat::from_xyzw(x, y, z, w)
        });
        Channel::rotations(time.values.clone(), values.collect(), curve).map_err(refused)
    };
    Ok(Track {
        translation: positions.map(vectors).transpose()?,
        rotation: rotations.map(quaternions).transpose()?,
        scale: factors.map(vectors).transpose()?,
    })
}

/// The error for samples that a channel refuses, at their row.
fn refused(
    table: &Columns<'_>,
    error: &TrackError,
    time: &Column,
    q: Option<[&Column; 4]>,
) -> SceneError {
    match (error, q) {
        (TrackError::Order(row), _) => table.out_of_order(time, *row),
        (TrackError::ZeroQuaternion(row), Some(q)) => {
            let at = q[0].places[*row].clone();
            let message = "this quaternion is zero, which is no rotation".to_owned();
            table.fail(at, message, "no rotation is qw, qx, qy, qz = 1, 0, 0, 0")
        }
        // Other errors have been excluded by checks; if one occurs, it is reported all the same.
        (error, _) => table.fail(0..0, error.to_string(), ""),
    }
}
