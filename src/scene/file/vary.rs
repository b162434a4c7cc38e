//! The table `vary`.

use std::fmt;

use serde::Deserialize;
use serde::de::{DeserializeSeed, Deserializer, Error, MapAccess, SeqAccess, Visitor};

use super::document::Document;
use super::error::SceneError;
use super::settings;
use super::table::unknown;
use crate::scene::Scene;
use crate::scene::vary::{Parameter, Variant};
use crate::settings::{Form, Value};

/// Values of parameters, in the order of the file.
#[derive(Debug, Default)]
pub(super) struct VaryTable(Vec<(Parameter, Vec<f64>)>);

impl<'de> Deserialize<'de> for VaryTable {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct AsTable;

        impl<'de> Visitor<'de> for AsTable {
            type Value = VaryTable;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a table of parameters, each with a list of values")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<VaryTable, A::Error> {
                let mut out = Vec::new();
                while let Some(parameter) = map.next_key_seed(Key)? {
                    out.push((parameter, map.next_value_seed(Values(parameter.form()))?));
                }
                Ok(VaryTable(out))
            }
        }

        deserializer.deserialize_map(AsTable)
    }
}

/// Reads the key of a parameter.
struct Key;

impl Visitor<'_> for Key {
    type Value = Parameter;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the key of a number among probe, simulation and imaging")
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<Parameter, E> {
        Parameter::of(text).ok_or_else(|| unknown(text, Parameter::all().map(|p| p.key())))
    }
}

impl<'de> DeserializeSeed<'de> for Key {
    type Value = Parameter;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Parameter, D::Error> {
        deserializer.deserialize_identifier(self)
    }
}

/// Reads a list of values of this form.
struct Values(Form);

impl<'de> Visitor<'de> for Values {
    type Value = Vec<f64>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a sequence")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Vec<f64>, A::Error> {
        let mut out = Vec::new();
        while let Some(value) = list.next_element_seed(&self.0)? {
            if let Value::Number(number) = value {
                out.push(number);
            }
        }
        Ok(out)
    }
}

impl<'de> DeserializeSeed<'de> for Values {
    type Value = Vec<f64>;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Vec<f64>, D::Error> {
        deserializer.deserialize_seq(self)
    }
}

/// The variants of `scene`: of each suggested parameter those that the table states or else, where `suggested`, those
/// that are suggested; then those of the other parameters that it states.
pub(super) fn variants(
    document: &Document<'_>,
    table: &VaryTable,
    scene: &Scene,
    suggested: bool,
) -> Result<Vec<Variant>, SceneError> {
    let stated = |parameter: &Parameter| table.0.iter().find(|(other, _)| other == parameter);
    let mut all: Vec<(Parameter, Vec<f64>)> = Vec::new();
    for parameter in Parameter::suggested() {
        let around = || {
            let own = parameter.value(scene).filter(|_| suggested);
            own.and_then(|own| parameter.around(own)).map_or_else(Vec::new, Vec::from)
        };
        let values = stated(&parameter).map_or_else(around, |(_, values)| values.clone());
        all.push((parameter, values));
    }
    all.extend(table.0.iter().filter(|(p, _)| !Parameter::suggested().any(|s| s == *p)).cloned());
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
    let file = document.parse()?;
    let settings = settings::settings(&document, &file, None)?;
    Ok(Variant { parameter, value, setting, settings })
}
