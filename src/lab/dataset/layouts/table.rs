//! The table of all samples: what was drawn for each, where the probe was, and the pixels of its classes.

use std::collections::BTreeSet;
use std::path::Path;

use serde_json::Value;

use super::super::DatasetError;
use super::{Labelled, Set};
use crate::output::files;

/// Columns of every sample: name, and place in its facts.
const COLUMNS: [(&str, &str); 20] = [
    ("sample", "/sample"),
    ("split", "/split"),
    ("scene", "/scene"),
    ("anatomy", "/anatomy"),
    ("time_s", "/time_s"),
    ("seed", "/seed"),
    ("width", "/image/width"),
    ("height", "/image/height"),
    ("pixel_mm", "/image/pixel_mm"),
    ("depth_samples", "/lines/samples"),
    ("scanlines", "/lines/scanlines"),
    ("frequency_mhz", "/lines/frequency_mhz"),
    ("contact", "/contact/share"),
    ("x_mm", "/position_mm/0"),
    ("y_mm", "/position_mm/1"),
    ("z_mm", "/position_mm/2"),
    ("qw", "/rotation_wxyz/0"),
    ("qx", "/rotation_wxyz/1"),
    ("qy", "/rotation_wxyz/2"),
    ("qz", "/rotation_wxyz/3"),
];

pub(super) fn write(
    set: &Set,
    to: &Path,
    counted: &mut dyn FnMut(&Labelled),
) -> Result<(), DatasetError> {
    let (mut rows, mut drawn) = (Vec::new(), BTreeSet::new());
    set.each(&mut |sample| {
        for table in ["drawn", "variables"] {
            let keys = sample.facts[table].as_object().into_iter().flat_map(|all| all.keys());
            drawn.extend(keys.map(|key| (table, key.clone())));
        }
        counted(&sample);
        rows.push(sample.facts);
        Ok(())
    })?;
    let head = COLUMNS.iter().map(|(name, _)| (*name).to_owned());
    let draws = drawn.iter().map(|(_, key)| key.clone());
    let classes = set.classes.iter().map(|class| format!("pixels {class}"));
    let mut writer = csv::Writer::from_writer(Vec::new());
    let written = "into memory";
    writer.write_record(head.chain(draws).chain(classes)).expect(written);
    for facts in &rows {
        let fixed = COLUMNS.iter().map(|(_, place)| cell(facts.pointer(place)));
        let draws = drawn.iter().map(|(table, key)| cell(facts[table].get(key)));
        let pixels = set.classes.iter().map(|class| match &facts["classes"][class]["pixels"] {
            Value::Null => "0".to_owned(),
            count => count.to_string(),
        });
        writer.write_record(fixed.chain(draws).chain(pixels)).expect(written);
    }
    let bytes = writer.into_inner().expect(written);
    files::replace(to, &bytes).map_err(|e| DatasetError::writing(to, e))
}

/// A value as a cell; empty where there is none.
fn cell(value: Option<&Value>) -> String {
    match value {
        None | Some(Value::Null) => String::new(),
        Some(Value::String(text)) => text.clone(),
        Some(value) => value.to_string(),
    }
}
