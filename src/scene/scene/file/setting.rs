//! The row of a setting, by its path.

use super::document::{LISTS, Misfit, quoted};
use super::schema::reference;
use super::table::Key;
use crate::settings::{Facts, Form, Value, suggest};

/// A key of a scene file, found by its path.
pub struct Setting {
    /// All facts about it.
    pub facts: &'static Facts,
    /// The form of its values.
    pub form: Form,
    /// Its value where a file does not state it; none where there is none, or not always the same one.
    pub default: Option<Value>,
}

/// Number of a path's parts before its key: `imaging`, or `tissues` and a name.
pub(super) fn above(table: &str) -> usize {
    if table == "tissues" || LISTS.contains(&table) { 2 } else { 1 }
}

/// The setting at a path, as [`crate::scene::Scene::load`] takes it; none where more parts follow: `tissues.liver`.
///
/// # Errors
/// A table or key that no scene file has, with the nearest that it may have.
pub fn setting(path: &[String]) -> Result<Option<Setting>, Misfit> {
    let table = path.first().map_or("", String::as_str);
    let name = |full: &'static str| full.split('.').next().unwrap_or(full);
    let tables = reference();
    let Some((_, keys)) = tables.iter().find(|(full, _)| name(full) == table && !table.is_empty())
    else {
        let known = tables.iter().map(|(full, _)| name(full)).filter(|name| !name.is_empty());
        let message = format!("scene files have no table `{table}`");
        return Err((message, suggest::among(table, known)));
    };
    let Some(rest) = path.get(above(table)..).filter(|rest| !rest.is_empty()) else {
        return Ok(None);
    };
    let key = rest.join(".");
    if let Some(Key { facts, form, usual, .. }) = keys.iter().find(|k| k.path == key) {
        return Ok(Some(Setting { facts, form: *form, default: usual.clone() }));
    }
    let below = format!("{key}.");
    if keys.iter().any(|k| k.path.starts_with(&below)) {
        return Ok(None);
    }
    let full: Vec<_> = path.iter().map(|part| quoted(part)).collect();
    let message = format!("scene files have no key `{}`", full.join("."));
    Err((message, suggest::among(&key, keys.iter().map(|k| k.path.as_str()))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::file::document::segments;

    #[test]
    fn settings_are_found_by_their_paths_and_mistakes_have_a_remedy() {
        let found = |path: &str| setting(&segments(path));
        for (path, unit) in [
            ("imaging.gain", "dB"),
            ("probe.frequency", "MHz"),
            ("probe.pose.position", "mm"),
            ("tissues.liver.attenuation", "dB/cm/MHz"),
            ("mesh.\"left.lobe\".inside.roughness", ""),
        ] {
            let facts = found(path).unwrap_or_else(|e| panic!("{path}: {e:?}")).expect(path).facts;
            assert_eq!(facts.unit(), unit, "{path}");
        }
        for path in ["imaging", "tissues.liver", "probe.pose", "mesh.liver.inside"] {
            assert!(found(path).expect(path).is_none(), "{path}");
        }
        for (path, cause, remedy) in [
            ("imagin.gain", "no table `imagin`", "`imaging`"),
            ("imaging.gian", "no key `imaging.gian`", "`gain`"),
            ("tissues.liver.atenuation", "no key", "`attenuation`"),
        ] {
            let Err((message, advice)) = found(path) else { panic!("{path}") };
            assert!(message.contains(cause) && advice.contains(remedy), "{message}: {advice}");
        }
    }
}
