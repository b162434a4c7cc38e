//! The table `probe` with its pose.

use std::f64::consts::{PI, TAU};

use glam::{DAffine3, DMat3, DVec3};

use super::document::Document;
use super::error::SceneError;
use super::parameters::overlay;
use super::schema::{KindName, PoseTable, ProbeTable};
use super::within;
use crate::probe::{Kind, MAX_ELEVATION_LAYERS, Probe};
use crate::scene::suggest;

/// Lateral and depth axes nearer to parallel than this (sine) define no image plane.
const PARALLEL: f64 = 1e-3;

pub(super) fn build(
    document: &Document<'_>,
    table: &ProbeTable,
) -> Result<(Probe, DAffine3), SceneError> {
    let preset = table.preset.as_deref().unwrap_or("paper-table1");
    let presets = &Probe::PRESETS;
    let make = presets.iter().find(|p| p.0 == preset).ok_or_else(|| {
        let remedy = suggest::among(preset, presets.iter().map(|p| p.0));
        document.fail("probe.preset", format!("unknown preset `{preset}`"), remedy)
    })?;
    let mut out = make.1();
    out.kind = kind(document, table, out.kind)?;
    overlay!(table => out:
        scanlines, elevation_layers, samples, bandwidth, f_number_transmit, f_number_receive;
        depth, frequency, speed, focus, aperture, elevation_focus, elevation_height,
        slice_thickness);
    let far = f64::INFINITY;
    for (key, value, (least, most), unit) in [
        ("scanlines", f64::from(out.scanlines), (1.0, 4096.0), ""),
        (
            "elevation_layers",
            f64::from(out.elevation_layers),
            (1.0, f64::from(MAX_ELEVATION_LAYERS)),
            "",
        ),
        ("samples", f64::from(out.samples), (16.0, 65_536.0), ""),
        ("depth", out.depth, (1.0, 1000.0), "mm"),
        ("frequency", out.frequency, (0.1, 100.0), "MHz"),
        ("bandwidth", out.bandwidth, (0.01, 2.0), ""),
        ("speed", out.speed, (0.3, 5.0), "mm/us"),
        ("focus", out.focus, (0.1, 1e4), "mm"),
        ("f_number_transmit", out.f_number_transmit, (0.1, 100.0), ""),
        ("f_number_receive", out.f_number_receive, (0.1, 100.0), ""),
        ("aperture", out.aperture, (0.1, far), "mm"),
        ("elevation_focus", out.elevation_focus, (0.1, 1e4), "mm"),
        ("elevation_height", out.elevation_height, (0.1, 1000.0), "mm"),
        ("slice_thickness", out.slice_thickness, (0.0, 1000.0), "mm"),
    ] {
        within(document, &format!("probe.{key}"), value, least, most, unit)?;
    }
    let pose = match &table.pose {
        Some(pose) => place(document, "probe.pose", pose)?,
        None => DAffine3::IDENTITY,
    };
    Ok((out, pose))
}

/// The preset's arrangement with the keys of the file; keys of another arrangement are refused.
fn kind(document: &Document<'_>, table: &ProbeTable, preset: Kind) -> Result<Kind, SceneError> {
    let of_preset = match preset {
        Kind::Convex { .. } => KindName::Convex,
        Kind::Linear { .. } => KindName::Linear,
        Kind::Phased { .. } => KindName::Phased,
    };
    let name = table.kind.unwrap_or(of_preset);
    let (radius, field_of_view, width) = match preset {
        Kind::Convex { radius, field_of_view } => (Some(radius), Some(field_of_view), None),
        Kind::Linear { width } => (None, None, Some(width)),
        Kind::Phased { field_of_view } => (None, Some(field_of_view), None),
    };
    let key = |name: &str, given: Option<f64>, preset: Option<f64>, most: f64, unit: &str| {
        let value = given.or(preset).ok_or_else(|| {
            document.fail(
                "probe.kind",
                format!("this kind of probe needs `{name}`"),
                format!("add `{name}` to [probe]"),
            )
        })?;
        within(document, &format!("probe.{name}"), value, 1e-3, most, unit)?;
        Ok(value)
    };
    let unfit = |name: &str, given: bool| match given {
        true => Err(document.fail(
            &format!("probe.{name}"),
            format!("`{name}` does not belong to this kind of probe"),
            "convex takes radius and field_of_view, linear width, phased field_of_view",
        )),
        false => Ok(()),
    };
    let (given_radius, given_view, given_width) =
        (table.radius.map(|q| q.0), table.field_of_view.map(|q| q.0), table.width.map(|q| q.0));
    Ok(match name {
        KindName::Convex => {
            unfit("width", given_width.is_some())?;
            Kind::Convex {
                radius: key("radius", given_radius, radius, 1000.0, "mm")?,
                field_of_view: key("field_of_view", given_view, field_of_view, TAU, "rad")?,
            }
        }
        KindName::Linear => {
            unfit("radius", given_radius.is_some())?;
            unfit("field_of_view", given_view.is_some())?;
            Kind::Linear { width: key("width", given_width, width, 1000.0, "mm")? }
        }
        KindName::Phased => {
            unfit("radius", given_radius.is_some())?;
            unfit("width", given_width.is_some())?;
            Kind::Phased {
                field_of_view: key("field_of_view", given_view, field_of_view, PI, "rad")?,
            }
        }
    })
}

/// The pose that the table at `path` describes.
pub(super) fn place(
    document: &Document<'_>,
    path: &str,
    pose: &PoseTable,
) -> Result<DAffine3, SceneError> {
    let position = DVec3::from(pose.position.map(|q| q.0));
    look(position, pose.direction.into(), pose.lateral.into()).map_err(|fault| {
        let [key, message, remedy] = fault;
        document.fail(&format!("{path}.{key}"), message, remedy)
    })
}

/// World from probe: z along `direction`, x along the part of `lateral` perpendicular to it; or which
/// of them is at fault, why, and what to do.
pub(super) fn look(
    position: DVec3,
    direction: DVec3,
    lateral: DVec3,
) -> Result<DAffine3, [&'static str; 3]> {
    let unit = |key, v: DVec3| {
        let remedy = "give a vector such as [0, 0, 1]";
        v.try_normalize().ok_or([key, "this direction has no length", remedy])
    };
    let z = unit("direction", direction)?;
    let lateral = unit("lateral", lateral)?;
    let across = lateral - z * lateral.dot(z);
    if across.length() < PARALLEL {
        return Err([
            "lateral",
            "lateral is parallel to direction: they span no image plane",
            "choose a lateral axis across the direction",
        ]);
    }
    let x = across.normalize();
    if !position.is_finite() {
        return Err(["position", "the position is not finite", "give lengths"]);
    }
    Ok(DAffine3::from_mat3_translation(DMat3::from_cols(x, z.cross(x), z), position))
}
