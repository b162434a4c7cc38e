//! Paths to values of scene files, and the tables and lists along them.

use std::borrow::Cow;
use std::ops::Range;

use toml::Spanned;
use toml::de::{DeTable, DeValue};
use toml_edit::Key;

use crate::settings::suggest;

/// Tables of which a file may have several.
pub const LISTS: [&str; 8] =
    ["pose", "task", "group", "transform", "selector", "mesh", "flow", "wire"];

/// The value at a path of keys and indices.
pub fn find<'a, 's>(root: &'a DeTable<'s>, path: &[&str]) -> Option<&'a Spanned<DeValue<'s>>> {
    let (first, rest) = path.split_first()?;
    let mut value = root.get(*first)?;
    for part in rest {
        value = match value.get_ref() {
            DeValue::Table(table) => table.get(*part)?,
            DeValue::Array(array) => {
                let called = || array.iter().position(|v| name_of(v).as_deref() == Some(*part));
                array.get(part.parse::<usize>().ok().or_else(called)?)?
            }
            _ => return None,
        };
    }
    Some(value)
}

/// The fault of a setting, and the remedy.
pub type Misfit = (String, String);

/// The parts of a path as the command line and the program itself write it. Names with dots stand in quotes, as in
/// TOML; others need none, and may hold what a bare key of TOML may not.
pub fn segments(path: &str) -> Vec<String> {
    match Key::parse(path) {
        Ok(keys) => keys.iter().map(|key| key.get().to_owned()).collect(),
        Err(_) => path.split('.').map(str::to_owned).collect(),
    }
}

/// A name as a part of a path: in quotes where it needs them.
pub fn quoted(name: &str) -> String {
    Key::new(name).display_repr().into_owned()
}

/// Puts `value` at a path; elements of arrays of tables are addressed by index or by name.
pub fn insert<'s>(
    table: &mut DeTable<'s>,
    path: &[&'s str],
    value: Spanned<DeValue<'s>>,
    key_span: &Range<usize>,
) -> Result<(), Misfit> {
    if let [first, name, ..] = path
        && LISTS.contains(first)
        && !table.contains_key(*first)
    {
        let message = format!("there is no {first} `{name}`: the file has no [[{first}]]");
        return Err((message, format!("add a [[{first}]] to the file")));
    }
    into_table(table, path, value, key_span)
}

fn into_table<'s>(
    table: &mut DeTable<'s>,
    path: &[&'s str],
    value: Spanned<DeValue<'s>>,
    key_span: &Range<usize>,
) -> Result<(), Misfit> {
    let (first, rest) = path.split_first().expect("a path has a part");
    if rest.is_empty() {
        table.insert(Spanned::new(key_span.clone(), Cow::Borrowed(*first)), value);
        return Ok(());
    }
    if !table.contains_key(*first) {
        let empty = DeValue::Table(DeTable::new());
        let key = Spanned::new(key_span.clone(), Cow::Borrowed(*first));
        table.insert(key, Spanned::new(key_span.clone(), empty));
    }
    let inner = table.get_mut(*first).expect("just put in").get_mut();
    into_value(inner, first, rest, value, key_span)
}

fn into_value<'s>(
    target: &mut DeValue<'s>,
    name: &str,
    rest: &[&'s str],
    value: Spanned<DeValue<'s>>,
    key_span: &Range<usize>,
) -> Result<(), Misfit> {
    let array = match target {
        DeValue::Table(table) => return into_table(table, rest, value, key_span),
        DeValue::Array(array) => array,
        _ => {
            return Err((format!("`{name}` has no parts"), "set it as a whole".to_owned()));
        }
    };
    let index = element(name, rest[0], &array.iter().map(name_of).collect::<Vec<_>>())?;
    let element = &mut array.as_mut()[index];
    match rest {
        [_] => {
            *element = value;
            Ok(())
        }
        _ => into_value(element.get_mut(), rest[0], &rest[1..], value, key_span),
    }
}

/// The index of the element that a part of a path means: by name, or counted from 0.
pub fn element(list: &str, wanted: &str, names: &[Option<String>]) -> Result<usize, Misfit> {
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

fn name_of(value: &Spanned<DeValue<'_>>) -> Option<String> {
    value.get_ref().as_table()?.get("name")?.get_ref().as_str().map(str::to_owned)
}
