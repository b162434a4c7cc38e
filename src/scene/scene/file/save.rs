//! Writing settings back into a scene file: its comments, its order and all other keys stay as
//! they are.

use std::path::{Component, Path, PathBuf};

use toml_edit::visit_mut::{VisitMut, visit_table_like_kv_mut};
use toml_edit::{ArrayOfTables, DocumentMut, InlineTable, Item, KeyMut, Table, TableLike, Value};

use super::document::{Misfit, Source, element, segments};
use super::error::SceneError;
use super::placing::placed;
use super::schema::File;
use super::setting::above;
use super::table::Entry;
use super::tissues::Tissues;
use super::{poses, probe, settings, tasks};
use crate::output::files;
use crate::scene::shipped;

/// The list of named poses, which alone grows and shrinks.
const POSES: &str = "pose";

/// A comment above the key at a path: the path, and one line of text. It takes the place of comments there
/// that begin with the same word.
pub type Note = (String, String);

/// Writes the scene file `from` to `to` (which may be the same) with `settings` in place. What they
/// replace keeps its comments. In another folder the files that the scene names are named from there.
/// `to` is replaced at once, when all is written: no failure leaves half a file.
///
/// # Errors
/// A file that cannot be read or written, a path that does not fit the file, a value that the key does
/// not take. `to` is then as it was.
pub fn save(from: &Path, to: &Path, settings: &[Entry]) -> Result<(), SceneError> {
    save_with(from, to, settings, &[])
}

/// Like [`save`], with `notes` above their keys.
///
/// # Errors
/// Those of [`save`]; a note whose key is not in the file.
pub fn save_with(
    from: &Path,
    to: &Path,
    settings: &[Entry],
    notes: &[Note],
) -> Result<(), SceneError> {
    write(&Source::read(from, &[])?, to, settings, notes)
}

/// Like [`save`], for a file that was at `from` with this text and is gone.
///
/// # Errors
/// Those of [`save`].
pub fn save_text(text: &str, from: &Path, to: &Path, settings: &[Entry]) -> Result<(), SceneError> {
    write(&Source::of(from, text.to_owned()), to, settings, &[])
}

fn write(source: &Source, to: &Path, settings: &[Entry], notes: &[Note]) -> Result<(), SceneError> {
    let from = &source.path;
    let misfit = |(message, remedy): Misfit| SceneError::file(from, message, &remedy);
    if shipped::is_shipped(to) {
        let cause = "ships with the program and stays as it is".to_owned();
        return Err(SceneError::file(
            to,
            cause,
            "save the scene under another name, in a folder of yours",
        ));
    }
    // The scene file's parser gives an error with a remedy; that of toml_edit has none.
    source.document()?;
    let mut document: DocumentMut = source
        .text()
        .parse()
        .map_err(|e| misfit((format!("{e}"), "check its syntax".to_owned())))?;
    for (path, value) in settings {
        let segments = segments(path);
        let segments: Vec<_> = segments.iter().map(String::as_str).collect();
        let value = value.as_deref().map(parsed);
        match &segments[..] {
            [POSES, path @ ..] => into_pose(document.as_table_mut(), path, value),
            path => into_table(document.as_table_mut(), path, value),
        }
        .map_err(misfit)?;
    }
    for (path, text) in notes {
        let segments = segments(path);
        let segments: Vec<_> = segments.iter().map(String::as_str).collect();
        note(document.as_table_mut(), &segments, text).map_err(misfit)?;
    }
    let folder = |path: &Path| {
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
        let folder = folder.unwrap_or(Path::new("."));
        folder.canonicalize().map_err(|e| {
            let cause = format!("the folder cannot be used: {e}");
            SceneError::file(path, cause, "name a file in a folder that exists")
        })
    };
    // Also where the folder has gone with it.
    let gone = || Some(std::path::absolute(from).ok()?.parent()?.to_owned());
    let (old, new) = (folder(from), folder(to)?);
    let old = old.or_else(|e| gone().ok_or(e))?;
    if old != new {
        Moved { old, new }.visit_document_mut(&mut document);
    }
    let text = document.to_string();
    check(&Source::of(to, text.clone()))?;
    files::replace(to, text.as_bytes()).map_err(|e| {
        let remedy = "check that the folder can be written to and has room";
        SceneError::file(to, format!("cannot be written: {e}"), remedy)
    })
}

/// Fails if the result could not be read again; nothing is written then.
fn check(source: &Source) -> Result<(), SceneError> {
    let document = source.document()?;
    let file = File::of(&document)?;
    settings::settings(&document, &file, None)?;
    probe::pose(&document, "probe", &file.probe.stated)?;
    let poses = poses::build(&document, &file.pose)?;
    tasks::poses_exist(&document, &file.task, &poses)?;
    for (i, table) in file.transform.iter().enumerate() {
        placed(&document, &format!("transform.{i}"), &table.stated)?;
    }
    for (i, table) in file.mesh.iter().enumerate() {
        placed(&document, &format!("mesh.{i}"), &table.stated)?;
    }
    Tissues::new(&document, &file.tissues).map(|_| ())
}

/// A value as the command line takes it: text that is not TOML is a string.
fn parsed(value: &str) -> Value {
    value.parse().unwrap_or_else(|_| Value::from(value))
}

fn into_table(
    table: &mut dyn TableLike,
    path: &[&str],
    value: Option<Value>,
) -> Result<(), Misfit> {
    let (first, rest) = path.split_first().expect("a path has a part");
    if rest.is_empty() {
        let old = table.get_mut(first);
        if let (Some(old), Some(Value::InlineTable(new))) = (old, &value)
            && let Some(old) = old.as_table_like_mut()
        {
            return replace_table(old, new);
        }
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

/// Sets a key of the pose that the path's first part names, which is added where it is not there; without keys
/// behind its name it is removed.
fn into_pose(root: &mut Table, path: &[&str], value: Option<Value>) -> Result<(), Misfit> {
    let (name, rest) = path.split_first().ok_or_else(|| whole(POSES))?;
    let item = root.entry(POSES).or_insert(Item::ArrayOfTables(ArrayOfTables::new()));
    // A list of inline tables becomes one of tables.
    let tables = std::mem::take(item).into_array_of_tables().map_err(|_| whole(POSES))?;
    *item = Item::ArrayOfTables(tables);
    let poses = item.as_array_of_tables_mut().expect("just made");
    let index = poses.iter().position(|pose| name_of(pose).as_deref() == Some(name));
    match (index, rest, value) {
        (Some(index), [], None) => drop(poses.remove(index)),
        (None, _, None) => {}
        (_, [], Some(_)) => return Err(whole(POSES)),
        (Some(index), rest, value) => {
            let pose = poses.get_mut(index).expect("one of them");
            return into_table(pose, rest, value);
        }
        (None, rest, value) => {
            let mut pose = Table::new();
            pose.decor_mut().set_prefix("\n");
            pose.insert("name", Item::Value(Value::from(*name)));
            into_table(&mut pose, rest, value)?;
            poses.push(pose);
        }
    }
    Ok(())
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
    let names = array.iter().map(|v| v.as_inline_table().and_then(|t| name_of(t)));
    let index = element(name, rest[0], &names.collect::<Vec<_>>())?;
    let inner = array.get_mut(index).expect("one of them");
    match (rest, value) {
        ([_], Some(value)) => {
            replace_value(inner, value);
            Ok(())
        }
        // Removing an element would renumber the others.
        ([_], None) => Err(whole(name)),
        (_, value) => into_value(inner, rest[0], &rest[1..], value),
    }
}

fn whole(name: &str) -> Misfit {
    let cause = format!("`{name}` has no such part");
    (cause, "set it as a whole".to_owned())
}

fn name_of(table: &dyn TableLike) -> Option<String> {
    Some(table.get("name")?.as_str()?.to_owned())
}

/// Replaces `old` by `new` and keeps its blanks and comments; in lists of equal length element by element.
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

/// Puts the entries of `new` in the place of those of `old`, key by key.
fn replace_table(old: &mut dyn TableLike, new: &InlineTable) -> Result<(), Misfit> {
    let gone = old.iter().map(|(key, _)| key.to_owned());
    let gone: Vec<_> = gone.filter(|key| !new.contains_key(key)).collect();
    for key in gone {
        old.remove(&key);
    }
    for (key, value) in new {
        into_table(old, &[key], Some(value.clone()))?;
    }
    Ok(())
}

/// Writes a comment above the key at `path`, or above the inline table that holds it, where no comment
/// fits.
fn note(table: &mut dyn TableLike, path: &[&str], text: &str) -> Result<(), Misfit> {
    let (first, rest) = path.split_first().expect("a path has a part");
    match (table.get_mut(first), rest) {
        (None, _) => return Err(whole(first)),
        (Some(Item::Table(inner)), [_, ..]) => return note(inner, rest, text),
        (Some(Item::ArrayOfTables(tables)), [name, _, ..]) => {
            let names: Vec<_> = tables.iter().map(|t| name_of(t)).collect();
            let index = element(first, name, &names)?;
            let table = tables.get_mut(index).expect("one of them");
            return note(table, &rest[1..], text);
        }
        _ => {}
    }
    let mut key = table.key_mut(first).expect("it has a value");
    let decor = key.leaf_decor_mut();
    let before = decor.prefix().and_then(|p| p.as_str()).unwrap_or_default();
    let (lines, indent) = match before.rsplit_once('\n') {
        Some((lines, indent)) => (lines.split('\n').collect(), indent),
        None => (Vec::new(), before),
    };
    let word = text.split_whitespace().next().unwrap_or_default();
    let same = |line: &str| {
        let comment = line.trim_start().strip_prefix('#');
        comment.is_some_and(|c| c.split_whitespace().next() == Some(word))
    };
    let kept = lines.iter().filter(|l| !same(l));
    let kept: String = kept.map(|l| format!("{l}\n")).collect();
    decor.set_prefix(format!("{kept}{indent}# {text}\n{indent}"));
    Ok(())
}

/// The files that the scene file at `path` names; none if it cannot be read.
pub fn named_files(path: &Path) -> Option<Vec<PathBuf>> {
    let mut document: DocumentMut = std::fs::read_to_string(path).ok()?.parse().ok()?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut named = Named(Vec::new());
    named.visit_document_mut(&mut document);
    Some(named.0.into_iter().map(|file| folder.join(file)).collect())
}

/// True if a setting, as `--set` takes it, names a file: by its key, or somewhere in its value.
pub fn names_files(path: &str, value: &str) -> bool {
    let parts = segments(path);
    let table = parts.first().map_or("", String::as_str);
    if parts.iter().skip(above(table)).any(|key| NAMING.contains(&key.as_str())) {
        return true;
    }
    let mut named = Named(Vec::new());
    if let Ok(mut document) = format!("value = {value}").parse::<DocumentMut>() {
        named.visit_document_mut(&mut document);
    }
    !named.0.is_empty()
}

/// Keys whose values are names of files.
const NAMING: [&str; 2] = ["file", "keyframes"];

/// Collects the names of files.
struct Named(Vec<String>);

impl VisitMut for Named {
    fn visit_table_like_kv_mut(&mut self, key: KeyMut<'_>, item: &mut Item) {
        match item.as_value() {
            Some(value) if NAMING.contains(&key.get()) => {
                let several = value.as_array().into_iter().flatten();
                let all = several.chain([value]).filter_map(Value::as_str);
                self.0.extend(all.map(str::to_owned));
            }
            _ => visit_table_like_kv_mut(self, key, item),
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
        let named = NAMING.contains(&key.get());
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
        // A symbolic link on the way would make `..` mean another folder.
        let folder = full.parent().and_then(|p| p.canonicalize().ok());
        let full = match (folder, full.file_name()) {
            (Some(folder), Some(name)) => folder.join(name),
            _ => full,
        };
        let (mut theirs, mut ours) =
            (full.components().peekable(), self.new.components().peekable());
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

#[cfg(test)]
mod tests;
