//! The table `tracker`.

use glam::DAffine3;

use super::document::Document;
use super::error::SceneError;
use super::placing::{affine, placement};
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
    let alone = table.translate.is_none() && table.rotate.is_none();
    let matrix = affine(document, path, rows, alone)?;
    rigid(matrix).or_else(|why| {
        let message = format!("this is no rigid transform: {why}");
        let remedy = "write rotation and shift in mm, without scale, row by row";
        Err(document.fail(&format!("{path}.matrix"), message, remedy))
    })
}
