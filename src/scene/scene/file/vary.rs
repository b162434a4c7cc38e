//! The table `vary`.

use super::document::Document;
use super::error::SceneError;
use super::schema::File;
use super::settings;
use super::table::{Key, Keys, Stated};
use crate::scene::Scene;
use crate::scene::vary::{Parameter, Variant};
use crate::settings::{Form, Value};

/// The parameters, each with a list of values.
pub enum VaryKeys {}

impl Keys for VaryKeys {
    const TABLE: &'static str = "vary";

    fn keys() -> Vec<Key> {
        let key = |p: Parameter| {
            let form = Form::Several(p.form());
            Key { path: p.key(), facts: p.facts, form, default: String::new(), usual: None }
        };
        Parameter::all().map(key).collect()
    }
}

/// The variants of `scene`: of each suggested parameter those that the table states or else, where `suggested`, those
/// that are suggested; then those of the other parameters that it states.
pub(super) fn variants(
    document: &Document<'_>,
    stated: &Stated,
    scene: &Scene,
    suggested: bool,
) -> Result<Vec<Variant>, SceneError> {
    let values = |parameter: &Parameter| match stated.value(&parameter.key()) {
        Some(Value::List(values)) => Some(values.clone()),
        _ => None,
    };
    let mut all: Vec<(Parameter, Vec<f64>)> = Vec::new();
    for parameter in Parameter::suggested() {
        let around = || {
            let own = parameter.value(scene).filter(|_| suggested);
            own.and_then(|own| parameter.around(own)).map_or_else(Vec::new, Vec::from)
        };
        all.push((parameter, values(&parameter).unwrap_or_else(around)));
    }
    let others = stated.keys().filter_map(Parameter::of);
    let others = others.filter(|p| !Parameter::suggested().any(|s| s == *p));
    all.extend(others.filter_map(|p| Some((p, values(&p)?))));
    let mut out = Vec::new();
    for (parameter, values) in all {
        for (i, value) in values.into_iter().enumerate() {
            let setting = parameter.setting(scene, value);
            let made = settled(document, parameter, value, setting).map_err(|error| {
                let (key, unit) = (parameter.key(), parameter.unit());
                let blank = if unit.is_empty() { "" } else { " " };
                document.fail(
                    &format!("{}.{key}.{i}", document.vary()),
                    format!("{key} cannot be {value}{blank}{unit}"),
                    error.remedy.unwrap_or(error.message),
                )
            })?;
            out.push(made);
        }
    }
    Ok(out)
}

/// The settings of the document with one more override, checked as `render` does.
fn settled(
    document: &Document<'_>,
    parameter: Parameter,
    value: f64,
    setting: (String, String),
) -> Result<Variant, SceneError> {
    let source = document.source.with(std::slice::from_ref(&setting));
    let document = source.document()?;
    let file = File::of(&document)?;
    let settings = settings::settings(&document, &file, None)?;
    Ok(Variant { parameter, value, setting, settings })
}
