//! The markups of 3D Slicer (.mrk.json).

use std::path::Path;

use glam::DVec3;
use serde::Deserialize;
use serde_json::Value;

use super::{FARTHEST, MAX_POINTS, Point, agreed, far, frame_named, too_many, unknown_frame};
use crate::issue::FileError;
use crate::volume::Frame;

/// The part of a markups file with the points (schema 1.0 of 3D Slicer).
#[derive(Deserialize)]
struct Markups {
    markups: Vec<Markup>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Markup {
    coordinate_system: Option<String>,
    coordinate_units: Option<Value>,
    #[serde(default)]
    control_points: Vec<ControlPoint>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct ControlPoint {
    #[serde(default)]
    label: String,
    #[serde(default)]
    position: Vec<f64>,
    position_status: Option<String>,
}

/// The points of all markups that have been placed.
pub(super) fn read(
    path: &Path,
    text: &str,
    stated: Option<Frame>,
) -> Result<Vec<Point>, FileError> {
    let file: Markups = serde_json::from_str(text).map_err(|e| {
        let remedy = "save the markups of 3D Slicer as .mrk.json or .fcsv";
        FileError::line(path, e.line(), format!("is no markups file: {e}"), remedy)
    })?;
    let mut out = Vec::new();
    for markup in file.markups {
        let own = markup.coordinate_system.as_deref().map_or(Ok(Frame::Lps), frame_named);
        let own = own.map_err(|cause| unknown_frame(path, 0, &cause))?;
        let signs = agreed(path, own, stated)?.lps_signs();
        let units = markup.coordinate_units.unwrap_or_else(|| "mm".into());
        let all = units.as_array().map_or(std::slice::from_ref(&units), Vec::as_slice);
        if let Some(other) = all.iter().find(|u| *u != "mm") {
            return Err(FileError::file(
                path,
                format!("has positions in {other}"),
                "save them in mm",
            ));
        }
        for point in markup.control_points {
            // The others have been announced but not placed.
            if point.position_status.as_deref().unwrap_or("defined") != "defined" {
                continue;
            }
            let Ok(position) = <[f64; 3]>::try_from(point.position) else {
                return Err(FileError::file(
                    path,
                    format!("the position of `{}` is not three numbers", point.label),
                    "place it again, or take it out",
                ));
            };
            if let Some(value) = position.iter().find(|x| x.abs() > FARTHEST) {
                return Err(far(path, 0, *value));
            }
            if out.len() >= MAX_POINTS {
                return Err(too_many(path, 0));
            }
            out.push(Point { name: point.label, position: signs * DVec3::from(position) });
        }
    }
    Ok(out)
}
