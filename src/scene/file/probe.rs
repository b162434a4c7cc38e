//! The table `probe` with its pose.

use glam::{DAffine3, DMat3, DVec3};

use super::document::Document;
use super::error::SceneError;
use super::schema::{PoseTable, ProbeTable};
use super::table::{Stated, Table};
use super::within;
use crate::probe::Probe;
use crate::settings::{Group, Value, suggest};

/// Lateral and depth axes nearer to parallel than this (sine) define no image plane.
const PARALLEL: f64 = 1e-3;

pub(super) fn build(
    document: &Document<'_>,
    table: &Table<Probe, ProbeTable>,
) -> Result<(Probe, DAffine3), SceneError> {
    let preset = table.other.preset.as_deref().unwrap_or("paper-table1");
    let presets = &Probe::PRESETS;
    let make = presets.iter().find(|p| p.0 == preset).ok_or_else(|| {
        let remedy = suggest::among(preset, presets.iter().map(|p| p.0));
        document.fail("probe.preset", format!("unknown preset `{preset}`"), remedy)
    })?;
    let mut out = make.1();
    arrange(document, &table.stated, &mut out)?;
    table.stated.put(document, Probe::TABLE, &mut out)?;
    let pose = match &table.other.pose {
        Some(pose) => place(document, "probe.pose", pose)?,
        None => DAffine3::IDENTITY,
    };
    Ok((out, pose))
}

/// Sets the arrangement that is stated in `out`, which holds the preset. Keys of another arrangement are refused,
/// and so is an arrangement of which neither the file nor the preset states a needed key.
fn arrange(
    document: &Document<'_>,
    stated: &Stated<Probe>,
    out: &mut Probe,
) -> Result<(), SceneError> {
    const KEYS: [&str; 3] = ["radius", "field_of_view", "width"];
    let preset = out.clone();
    let absent = |probe: &Probe, key: &str| {
        Probe::row(key).is_some_and(|row| (row.get)(probe) == Value::Absent)
    };
    if let Some(Value::Word(word)) = stated.value("kind") {
        out.kind = out.kind.turned(word);
    }
    for key in KEYS {
        let path = format!("probe.{key}");
        let given = stated.number(key);
        match (absent(out, key), given) {
            (true, Some(_)) => {
                return Err(document.fail(
                    &path,
                    format!("`{key}` does not belong to this kind of probe"),
                    "convex takes radius and field_of_view, linear width, phased field_of_view",
                ));
            }
            (false, None) if absent(&preset, key) => {
                return Err(document.fail(
                    "probe.kind",
                    format!("this kind of probe needs `{key}`"),
                    format!("add `{key}` to [probe]"),
                ));
            }
            _ => {}
        }
    }
    match stated.number("field_of_view") {
        Some(view) => {
            let [least, _] = Probe::range("field_of_view");
            within(document, "probe.field_of_view", view, least, out.kind.widest(), "rad")
        }
        None => Ok(()),
    }
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

/// World from probe: z along `direction`, x along the part of `lateral` perpendicular to it; or the key
/// that is at fault, the cause and the remedy.
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
