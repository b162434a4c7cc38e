//! Settings written back into a scene file: its comments, its order and all that is not set stay as
//! they are.

use std::io::Write as _;
use std::path::{Component, Path, PathBuf};

use toml_edit::visit_mut::{VisitMut, visit_table_like_kv_mut};
use toml_edit::{DocumentMut, Item, Key, KeyMut, Table, TableLike, Value};

use super::document::Source;
use super::error::SceneError;
use super::tissues::Tissues;
use super::{parameters, probe};
use crate::scene::suggest;

/// What is wrong with a setting, and what to do about it.
type Misfit = (String, String);

/// What is to be written: a path as [`crate::scene::Scene::load`] takes it and its value, or none where
/// the key is to go. Names with dots stand in quotes, as in TOML: `mesh."a.b".roughness`.
pub type Entry = (String, Option<String>);

/// Writes the scene file `from` to `to` (which may be the same) with `settings` in place. What they
/// replace keeps its comments. In another folder the files that the scene names are named from there.
/// `to` is replaced at once, when all is written: no failure leaves half a file.
///
/// # Errors
/// A file that cannot be read or written, a path that does not fit the file, a value that the key does
/// not take. `to` is then as it was.
pub fn save(from: &Path, to: &Path, settings: &[Entry]) -> Result<(), SceneError> {
    let misfit = |(message, remedy): Misfit| SceneError::file(from, message, &remedy);
    let source = Source::read(from, &[])?;
    // Its own error would have no remedy.
    source.document()?;
    let mut document: DocumentMut = source
        .text()
        .parse()
        .map_err(|e| misfit((format!("{e}"), "check its syntax".to_owned())))?;
    for (path, value) in settings {
        let segments = segments(path);
        let segments: Vec<_> = segments.iter().map(String::as_str).collect();
        let value = value.as_deref().map(parsed);
        into_table(document.as_table_mut(), &segments, value).map_err(misfit)?;
    }
    let folder = |path: &Path| {
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
        let folder = folder.unwrap_or(Path::new("."));
        folder.canonicalize().map_err(|e| {
            let cause = format!("the folder cannot be used: {e}");
            SceneError::file(path, cause, "name a file in a folder that exists")
        })
    };
    let (old, new) = (folder(from)?, folder(to)?);
    if old != new {
        Moved { old, new }.visit_document_mut(&mut document);
    }
    let text = document.to_string();
    check(&Source::of(to, text.clone()))?;
    replace_file(to, &text).map_err(|e| {
        let remedy = "check that the folder can be written to and has room";
        SceneError::file(to, format!("cannot be written: {e}"), remedy)
    })
}

/// Fails on what could not be read again: nothing of that is written.
fn check(source: &Source) -> Result<(), SceneError> {
    let document = source.document()?;
    let file = document.parse()?;
    let (probe, _) = probe::build(&document, &file.probe)?;
    parameters::simulation(&document, file.simulation, probe.frequency)?;
    parameters::imaging(&document, file.imaging)?;
    parameters::live(&document, &file.live)?;
    Tissues::new(&document, &file.tissues)?;
    Ok(())
}

/// A value as the command line takes it: what is not TOML is a text.
fn parsed(value: &str) -> Value {
    value.parse().unwrap_or_else(|_| Value::from(value))
}

/// The parts of a path. Names on the command line are not quoted, and may hold what a bare key may not.
fn segments(path: &str) -> Vec<String> {
    match Key::parse(path) {
        Ok(keys) => keys.iter().map(|key| key.get().to_owned()).collect(),
        Err(_) => path.split('.').map(str::to_owned).collect(),
    }
}

fn into_table(
    table: &mut dyn TableLike,
    path: &[&str],
    value: Option<Value>,
) -> Result<(), Misfit> {
    let (first, rest) = path.split_first().expect("a path has a part");
    if rest.is_empty() {
        let old = table.get_mut(first).and_then(Item::as_value_mut);
        match (old, value) {
            (Some(old), Some(value)) => replace_value(old, value),
            (None, Some(value)) => drop(table.insert(first, Item::Value(value))),
            (_, None) => drop(table.remove(first)),
        }
        return Ok(());
    }
    if !table.contains_key(first) {
        if value.is_none() {
            return Ok(());
        }
        let mut new = Table::new();
        new.decor_mut().set_prefix("\n");
        // A table of tables alone needs no heading.
        new.set_implicit(true);
        table.insert(first, Item::Table(new));
    }
    let item = table.get_mut(first).expect("just put in");
    if let Some(tables) = item.as_array_of_tables_mut() {
        let names: Vec<_> = tables.iter().map(|t| name_of(t)).collect();
        let index = element(first, rest[0], &names)?;
        let table = tables.get_mut(index).expect("one of them");
        return match rest {
            [_] => Err(whole(first)),
            _ => into_table(table, &rest[1..], value),
        };
    }
    if let Some(table) = item.as_table_like_mut() {
        return into_table(table, rest, value);
    }
    match item.as_value_mut() {
        Some(inner) => into_value(inner, first, rest, value),
        None => Err(whole(first)),
    }
}

fn into_value(
    inner: &mut Value,
    name: &str,
    rest: &[&str],
    value: Option<Value>,
) -> Result<(), Misfit> {
    let array = match inner {
        Value::InlineTable(table) => return into_table(table, rest, value),
        Value::Array(array) => array,
        _ => return Err(whole(name)),
    };
    let names = array
        .iter()
        .map(|v| v.as_inline_table().and_then(|t| name_of(t)));
    let index = element(name, rest[0], &names.collect::<Vec<_>>())?;
    let inner = array.get_mut(index).expect("one of them");
    match (rest, value) {
        ([_], Some(value)) => {
            replace_value(inner, value);
            Ok(())
        }
        // The others would be counted anew.
        ([_], None) => Err(whole(name)),
        (_, value) => into_value(inner, rest[0], &rest[1..], value),
    }
}

fn whole(name: &str) -> Misfit {
    let cause = format!("`{name}` has no such part");
    (cause, "set it as a whole".to_owned())
}

/// Which of a list's elements is meant: by name, or counted from 0.
fn element(list: &str, wanted: &str, names: &[Option<String>]) -> Result<usize, Misfit> {
    let by_name = names.iter().position(|n| n.as_deref() == Some(wanted));
    let counted = || wanted.parse().ok().filter(|&i: &usize| i < names.len());
    by_name.or_else(counted).ok_or_else(|| {
        let remedy = match names.iter().any(Option::is_some) {
            true => suggest::among(wanted, names.iter().flatten().map(String::as_str)),
            false => format!("`{list}` has {} elements, counted from 0", names.len()),
        };
        (format!("there is no {list} `{wanted}`"), remedy)
    })
}

fn name_of(table: &dyn TableLike) -> Option<String> {
    Some(table.get("name")?.as_str()?.to_owned())
}

/// Puts `new` in the place of `old` with its blanks and comments; lists of one length one by one.
fn replace_value(old: &mut Value, new: Value) {
    match (&mut *old, new) {
        (Value::Array(old), Value::Array(new)) if old.len() == new.len() => {
            for (old, new) in old.iter_mut().zip(new) {
                replace_value(old, new);
            }
        }
        (_, mut new) => {
            *new.decor_mut() = old.decor().clone();
            *old = new;
        }
    }
}

/// Names the files of a scene from another folder.
struct Moved {
    old: PathBuf,
    new: PathBuf,
}

impl VisitMut for Moved {
    fn visit_table_like_kv_mut(&mut self, key: KeyMut<'_>, item: &mut Item) {
        let named = ["file", "keyframes"].contains(&key.get());
        match item.as_value_mut() {
            Some(value) if named => self.rename(value),
            _ => visit_table_like_kv_mut(self, key, item),
        }
    }
}

impl Moved {
    fn rename(&self, value: &mut Value) {
        if let Some(files) = value.as_array_mut() {
            files.iter_mut().for_each(|file| self.rename(file));
        } else if let Some(file) = value.as_str().map(PathBuf::from)
            && file.is_relative()
        {
            replace_value(value, Value::from(self.seen(&file)));
        }
    }

    /// The relative path of `file`, which is named from the old folder, as seen from the new one.
    fn seen(&self, file: &Path) -> String {
        let full = self.old.join(file);
        // A link in between would make `..` mean another folder.
        let folder = full.parent().and_then(|p| p.canonicalize().ok());
        let full = match (folder, full.file_name()) {
            (Some(folder), Some(name)) => folder.join(name),
            _ => full,
        };
        let (mut theirs, mut ours) = (
            full.components().peekable(),
            self.new.components().peekable(),
        );
        while theirs.peek().is_some() && theirs.peek() == ours.peek() {
            theirs.next();
            ours.next();
        }
        if ours.clone().any(|c| matches!(c, Component::Prefix(_))) {
            return full.to_string_lossy().into_owned();
        }
        let up = ours.map(|_| "..".to_owned());
        let down = theirs.map(|c| c.as_os_str().to_string_lossy().into_owned());
        up.chain(down).collect::<Vec<_>>().join("/")
    }
}

/// Writes beside `path`, then takes its place.
fn replace_file(path: &Path, text: &str) -> std::io::Result<()> {
    // A link stays one.
    let path = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let beside = path.with_file_name(format!(".{name}.{}", std::process::id()));
    let written = || {
        let mut file = std::fs::File::create_new(&beside)?;
        file.write_all(text.as_bytes())?;
        if let Ok(before) = std::fs::metadata(&path) {
            file.set_permissions(before.permissions())?;
        }
        file.sync_all()?;
        std::fs::rename(&beside, &path)
    };
    written().inspect_err(|_| {
        // What is left of it helps nobody; the first error is the one to tell.
        let _ = std::fs::remove_file(&beside);
    })
}

#[cfg(test)]
#[path = "save_tests.rs"]
mod tests;
