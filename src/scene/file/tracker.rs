//! The table `tracker`.

use glam::{DAffine3, DMat3, DVec3};

use super::document::Document;
use super::error::SceneError;
use super::placing::placement;
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
        /// What x and y of the world are: left and back of the patient, as in the volumes of scenes, or right and
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
            format!(
                "names have 1 to {NAME} bytes in OpenIGTLink, which cuts longer ones: give what \
                 arrives"
            ),
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
    let fail =
        |why: String, remedy| Err(document.fail(&format!("tracker.{below}matrix"), why, remedy));
    if ["translate", "rotate"].iter().any(|key| stated.has(&format!("{below}{key}"))) {
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
