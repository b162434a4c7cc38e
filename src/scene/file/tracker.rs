//! The table `tracker`.

use glam::{DAffine3, DMat3, DVec3};

use super::document::Document;
use super::error::SceneError;
use super::placing::placement;
use super::schema::{RigidTable, TrackerTable};
use super::within;
use crate::scene::tracker::{Axes, Tracker, rigid};

/// Bytes that a name may have on the wire.
const NAME: usize = 20;

pub(super) fn build(
    document: &Document<'_>,
    table: Option<&TrackerTable>,
) -> Result<Tracker, SceneError> {
    let mut out = Tracker::default();
    let Some(table) = table else {
        return Ok(out);
    };
    if let Some(device) = &table.device {
        if device.is_empty() || device.len() > NAME {
            return Err(document.fail(
                "tracker.device",
                format!("`{device}` has {} bytes", device.len()),
                format!(
                    "names have 1 to {NAME} bytes in OpenIGTLink, which cuts longer ones: give what \
                     arrives"
                ),
            ));
        }
        out.device = Some(device.clone());
    }
    if let Some(timeout) = table.timeout {
        within(document, "tracker.timeout", timeout.0, 0.01, 3600.0, "s")?;
        out.timeout = timeout.0;
    }
    out.axes = table.axes.unwrap_or(Axes::Lps);
    // The tracker's frame is taken for RAS unless the file says where it is.
    out.world_from_reference = out.axes.to_ras();
    if let Some(given) = &table.world_from_reference {
        out.world_from_reference = transform(document, "tracker.world_from_reference", given)?;
    }
    if let Some(given) = &table.tool_from_probe {
        out.tool_from_probe = transform(document, "tracker.tool_from_probe", given)?;
    }
    Ok(out)
}

/// Either the matrix, or rotation and shift.
fn transform(
    document: &Document<'_>,
    path: &str,
    table: &RigidTable,
) -> Result<DAffine3, SceneError> {
    let Some(rows) = table.matrix else {
        return placement(document, path, (table.translate, table.rotate.as_ref(), None));
    };
    let path = format!("{path}.matrix");
    let fail = |why: String, remedy| Err(document.fail(&path, why, remedy));
    if table.translate.is_some() || table.rotate.is_some() {
        return fail(
            "both a matrix and a rotation or shift are given".to_owned(),
            "give one of them",
        );
    }
    if rows[12..] != [0.0, 0.0, 0.0, 1.0] {
        return fail(
            "the last row is not 0 0 0 1".to_owned(),
            "write the matrix row by row; the shift is the fourth column, mm",
        );
    }
    let column = |i: usize| DVec3::new(rows[i], rows[4 + i], rows[8 + i]);
    let matrix = DAffine3::from_mat3_translation(
        DMat3::from_cols(column(0), column(1), column(2)),
        column(3),
    );
    rigid(matrix).or_else(|why| {
        fail(
            format!("this is no rigid transform: {why}"),
            "write rotation and shift in mm, without scale, row by row",
        )
    })
}
