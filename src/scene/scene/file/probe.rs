//! The table `probe` with its pose.

use glam::{DAffine3, DMat3, DVec3};

use super::document::Document;
use super::error::SceneError;
use super::table::Stated;
use crate::probe::Probe;
use crate::settings::units::LENGTH;
use crate::settings::{Exam, Form, Group, Value, group, suggest};

/// Lateral and depth axes nearer to parallel than this (sine) define no image plane.
const PARALLEL: f64 = 1e-3;
const INF: f64 = f64::INFINITY;

group! {
    /// The preset of a probe, which other keys change.
    pub struct PresetKey in "probe" {
        /// One of the presets in the table below. Without it, the probe of `imaging.exam` where that names one.
        preset: String = "paper-table1".to_owned(), Facts::of(Form::Text);
    }
}

group! {
    /// Pose of the probe.
    pub struct Pose in "probe.pose" {
        /// Centre of the face in the world.
        position: [f64; 3] = [0.0; 3], Facts::quantities(&LENGTH, 3, -INF, INF).limits("finite");
        /// Depth axis in the world; any length.
        direction: [f64; 3] = [0.0, 0.0, 1.0], Facts::of(Form::Direction);
        /// Lateral axis, towards the last scanline; its part across `direction` is taken.
        lateral: [f64; 3] = [1.0, 0.0, 0.0], Facts::of(Form::Direction).limits("not along `direction`");
    }
}

/// The probe that a file states; what it leaves out is as in the preset that it names, else as in its examination.
pub(super) fn build(
    document: &Document<'_>,
    stated: &Stated,
    exam: Exam,
) -> Result<Probe, SceneError> {
    let mut out = match exam.probe() {
        Some(probe) if !stated.has("preset") => probe,
        _ => named(document, stated)?,
    };
    arrange(document, stated, &mut out)?;
    stated.put("", &mut out);
    Ok(out)
}

/// The preset that a file names, or the default one.
fn named(document: &Document<'_>, stated: &Stated) -> Result<Probe, SceneError> {
    let PresetKey { preset } = stated.get("");
    let presets = &Probe::PRESETS;
    let make = presets.iter().find(|p| p.0 == preset).ok_or_else(|| {
        let remedy = suggest::among(&preset, presets.iter().map(|p| p.0));
        document.fail("probe.preset", format!("unknown preset `{preset}`"), remedy)
    })?;
    Ok(make.1())
}

/// Sets the arrangement that is stated in `out`, which holds the preset. Keys of another arrangement are refused,
/// and so is an arrangement of which neither the file nor the preset states a needed key.
fn arrange(document: &Document<'_>, stated: &Stated, out: &mut Probe) -> Result<(), SceneError> {
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
        let given = stated.value(key);
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
    let (Some(view), Some(row)) = (stated.value("field_of_view"), Probe::row("field_of_view"))
    else {
        return Ok(());
    };
    let mut facts = row.facts;
    facts.range[1] = out.kind.widest();
    document.within("probe.field_of_view", &facts, view)
}

/// World from probe, by the table `pose` of the table at `path`.
pub(super) fn pose(
    document: &Document<'_>,
    path: &str,
    stated: &Stated,
) -> Result<DAffine3, SceneError> {
    let Pose { position, direction, lateral } = stated.get("pose.");
    look(position.into(), direction.into(), lateral.into()).map_err(|fault| {
        let [key, message, remedy] = fault;
        document.fail(&format!("{path}.pose.{key}"), message, remedy)
    })
}

/// World from probe: z along `direction`, x along the part of `lateral` perpendicular to it, of which both have a
/// length; or the key that is at fault, the cause and the remedy.
pub(super) fn look(
    position: DVec3,
    direction: DVec3,
    lateral: DVec3,
) -> Result<DAffine3, [&'static str; 3]> {
    let (z, lateral) = (direction.normalize(), lateral.normalize());
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

/// The pose nearest to `exact` on a grid of 0.1 um, and the entry of a scene file, path and value without blanks, that
/// says it to the last bit.
pub fn stated(exact: DAffine3) -> (DAffine3, (String, String)) {
    // Adding zero turns -0 into 0.
    let rounded = |v: DVec3, unit: f64| (v * unit).round() / unit + DVec3::ZERO;
    let position = rounded(exact.translation, 1e4);
    let direction = rounded(exact.matrix3.z_axis, 1e7);
    let lateral = rounded(exact.matrix3.x_axis, 1e7);
    let pose = look(position, direction, lateral).expect("the axes of a frame");
    let list = |v: DVec3| format!("[{},{},{}]", v.x, v.y, v.z);
    let value = format!(
        "{{position={},direction={},lateral={}}}",
        list(position),
        list(direction),
        list(lateral)
    );
    (pose, ("probe.pose".to_owned(), value))
}
