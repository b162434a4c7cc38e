//! The table `tracker`.

use glam::DAffine3;

use super::document::Document;
use super::error::SceneError;
use super::placing::{affine, placement};
use super::table::Stated;
use crate::scene::tracker::{Axes, Tracker, rigid};
use crate::settings::units::DURATION;
use crate::settings::{Form, group};

/// Bytes that a name may have on the wire.
const NAME: usize = 20;

group! {
    /// A tracked tool that moves the probe.
    pub struct TrackerKeys in "tracker" {
        /// Name of the TRANSFORM message, or of the tool in TDATA messages.
        device: Option<String> = None,
            Facts::of(Form::Text).by_default("every tool").limits("not empty, at most 20 bytes");
        /// Silence after which the tracker counts as lost. The probe stays where it was.
        timeout: f64 = 0.5, Facts::quantity(&DURATION, 0.01, 3600.0);
        /// Directions of x and y of the world: left and back of the patient, as in the volumes of scenes, or right and
        /// front. What is sent is RAS.
        axes: Axes = Axes::Lps, Facts::word::<Axes>();
    }
}

group! {
    /// A rigid transform, instead of rotation and shift.
    pub struct MatrixKey in "" {
        /// The same as a matrix, row by row as PLUS writes it; the shift, in mm, is the fourth column.
        matrix: Option<[f64; 16]> = None,
            Facts::of(Form::Numbers(16)).limits("rigid to 0.002, without the other keys");
    }
}

pub(super) fn build(document: &Document<'_>, stated: &Stated) -> Result<Tracker, SceneError> {
    let TrackerKeys { device, timeout, axes } = stated.get("");
    if let Some(device) = &device
        && (device.is_empty() || device.len() > NAME)
    {
        return Err(document.fail(
            "tracker.device",
            format!("`{device}` has {} bytes", device.len()),
            match device.is_empty() {
                true => "give the name that arrives, or leave `device` out for any".to_owned(),
                false => format!(
                    "names have at most {NAME} bytes in OpenIGTLink, which cuts longer ones: give what arrives, `{}`",
                    &device[..device.floor_char_boundary(NAME)]
                ),
            },
        ));
    }
    let place = |name: &str, default: DAffine3| match stated.has(name) {
        true => transform(document, stated, name),
        false => Ok(default),
    };
    Ok(Tracker {
        device,
        timeout,
        axes,
        // The tracker's frame is taken for RAS unless the file says where it is.
        world_from_reference: place("world_from_reference", axes.to_ras())?,
        tool_from_probe: place("tool_from_probe", DAffine3::IDENTITY)?,
    })
}

/// The transform in the table `name`: either the matrix, or rotation and shift.
fn transform(document: &Document<'_>, stated: &Stated, name: &str) -> Result<DAffine3, SceneError> {
    let below = format!("{name}.");
    let Some(rows) = stated.get::<MatrixKey>(&below).matrix else {
        return Ok(placement(stated, &below));
    };
    let path = format!("tracker.{below}matrix");
    let matrix = affine(document, &path, rows, stated, &below)?;
    rigid(matrix).map_err(|why| {
        let message = format!("this is no rigid transform: {why}");
        let remedy = "write rotation and shift in mm, without scale, row by row";
        document.fail(&path, message, remedy)
    })
}
