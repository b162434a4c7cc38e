//! Keys of scene files by their paths, and their values in a scene.

use super::document::{LISTS, segments};
use super::schema::reference;
use super::setting::{Setting, setting};
use super::table::Key;
use crate::scene::Scene;
use crate::settings::{Facts, Group, Settings, Value};

/// The facts about the key at a path: `imaging.gain`, `tissues.liver.speed`.
///
/// # Errors
/// Cause and remedy, where scene files have no such key.
pub fn facts(path: &str) -> Result<&'static Facts, String> {
    Ok(found(path)?.facts)
}

/// The value of a key where a file does not state it; none where there is none, or not always the same one.
pub fn default(path: &str) -> Option<Value> {
    found(path).ok()?.default
}

fn found(path: &str) -> Result<Setting, String> {
    let parts = segments(path);
    if let [key] = &parts[..] {
        let tables = reference();
        let title = tables.into_iter().find(|(table, _)| table.is_empty());
        let found = title.and_then(|(_, keys)| keys.into_iter().find(|known| known.path == *key));
        if let Some(Key { facts, form, usual, .. }) = found {
            return Ok(Setting { facts, form, default: usual });
        }
    }
    match setting(&parts) {
        Ok(Some(found)) => Ok(found),
        Ok(None) => Err(format!("`{path}` is a table; name a key in it")),
        Err((message, remedy)) => Err(format!("{message}; {remedy}")),
    }
}

/// Paths of the keys of the table at a path, and of the tables in it: of `tissues.liver` its speed and all others; none where
/// there is no such table.
pub fn keys_below(path: &str) -> Vec<String> {
    let given = segments(path);
    let below = |known: String| {
        let all = segments(&known);
        let rest = all.get(given.len()..).filter(|rest| !rest.is_empty())?;
        let fits = |(known, given): (&String, &String)| known == given || known == "NAME";
        let is_below = all.iter().zip(&given).all(fits) && !rest.contains(&"NAME".to_owned());
        is_below.then(|| format!("{path}.{}", rest.join(".")))
    };
    paths().filter_map(below).collect()
}

/// The value of a key in `scene`; none of keys that a scene holds in another form, as those of geometry.
pub fn value(scene: &Scene, path: &str) -> Option<Value> {
    let parts = segments(path);
    let key = |at: usize| parts.get(at..).map(|parts| parts.join("."));
    match parts[0].as_str() {
        "live" => of(&scene.live, &key(1)?),
        "tissues" => of(scene.tissues.iter().find(|t| Some(&t.name) == parts.get(1))?, &key(2)?),
        _ => value_of_settings(&scene.settings, path),
    }
}

/// The value of a key in `settings`; none of keys of other tables than theirs.
pub fn value_of_settings(settings: &Settings, path: &str) -> Option<Value> {
    let (table, key) = path.split_once('.')?;
    settings.value(table, key)
}

fn of<T: Group>(settings: &T, key: &str) -> Option<Value> {
    T::row(key).map(|row| (row.get)(settings))
}

/// Paths of all keys of scene files; `NAME` stands for the name of a tissue, a mesh or another element of a list.
pub fn paths() -> impl Iterator<Item = String> {
    reference().into_iter().flat_map(|(table, keys)| {
        let before = match table {
            "" => String::new(),
            _ if LISTS.contains(&table) => format!("{table}.NAME."),
            _ => format!("{table}."),
        };
        keys.into_iter().map(move |key| format!("{before}{}", key.path))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_key_of_the_reference_is_found_by_its_path() {
        assert!(paths().count() > 150);
        for path in paths() {
            assert!(facts(&path).is_ok(), "{path}: {:?}", facts(&path).err());
        }
        for (path, value) in [
            ("imaging.gain", Some(Value::Number(16.0))),
            ("imaging.exam", Some(Value::Word("general"))),
            ("probe.depth", None),
            ("tissues.liver.speed", None),
            ("nothing.at_all", None),
        ] {
            assert_eq!(default(path), value, "{path}");
        }
        assert!(facts("imaging.gian").unwrap_err().contains("did you mean `gain`?"));
        assert!(facts("imaging").unwrap_err().contains("is a table"));
        let keys = keys_below("imaging");
        assert!(keys.contains(&"imaging.gain".to_owned()), "{keys:?}");
        assert!(keys.iter().all(|key| facts(key).is_ok()), "{keys:?}");
        assert!(keys_below("tissues.liver").contains(&"tissues.liver.speed".to_owned()));
        assert_eq!((keys_below("imaging.gain"), keys_below("nothing")), (vec![], vec![]));
    }
}
