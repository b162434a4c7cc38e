//! Files of numbers in named columns: row by row as CSV, or column by column as TOML.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

use toml::Spanned;

use super::error::SceneError;
use crate::issue::{self, FileError};
use crate::settings::suggest;
use crate::settings::units::FARTHEST;

/// Largest file, bytes.
const MAX_TEXT: u64 = 16 << 20;
/// Most rows: an hour at 50 a second and some.
const MAX_ROWS: usize = 200_000;

/// A kind of such files.
pub(super) struct ColumnFile {
    /// The kind in messages: `trajectory`.
    pub name: &'static str,
    /// Names of all possible columns. Those that end with `mm` are places and lengths.
    pub columns: &'static [&'static str],
}

/// One column with the places of its values in the text, bytes.
pub(super) struct Column {
    pub values: Vec<f64>,
    pub places: Vec<Range<usize>>,
}

/// The columns of a file, as read.
pub(super) struct Columns<'t> {
    kind: &'t ColumnFile,
    path: &'t Path,
    text: &'t str,
    columns: BTreeMap<&'static str, Column>,
}

/// Text of the file at `path`.
pub(super) fn text(path: &Path) -> Result<String, FileError> {
    issue::read_text(path, MAX_TEXT, "sample it more coarsely")
}

fn fail(
    path: &Path,
    text: &str,
    at: Range<usize>,
    message: impl Into<String>,
    remedy: impl Into<String>,
) -> SceneError {
    SceneError::at(path, text, at, message.into(), Some(remedy.into()))
}

/// The column called `name`, which must be one of the kind, and new.
fn column(
    kind: &ColumnFile,
    name: &str,
    has: impl Fn(&str) -> bool,
) -> Result<&'static str, (String, String)> {
    let known = kind.columns.iter().find(|n| **n == name).ok_or_else(|| {
        let remedy = suggest::among(name, kind.columns.iter().copied());
        (format!("unknown column `{name}`"), remedy)
    })?;
    match has(known) {
        true => Err((format!("there are two columns `{name}`"), "remove one".to_owned())),
        false => Ok(known),
    }
}

fn too_many(kind: &ColumnFile, path: &Path, text: &str, at: Range<usize>) -> SceneError {
    let message = format!("a {} has at most {MAX_ROWS} rows", kind.name);
    fail(path, text, at, message, "sample it more coarsely")
}

fn of_csv<'t>(
    kind: &'t ColumnFile,
    path: &'t Path,
    text: &'t str,
) -> Result<Columns<'t>, SceneError> {
    // Cells with their places; empty lines and lines that begin with # are left out.
    let cells = |line: &'t str| {
        let start = line.as_ptr() as usize - text.as_ptr() as usize;
        let mut at = start;
        line.split(',')
            .map(|cell| {
                let blank = cell.len() - cell.trim_start().len();
                let (begin, cell_text) = (at + blank, cell.trim());
                at += cell.len() + 1;
                (cell_text, begin..begin + cell_text.len())
            })
            .collect::<Vec<_>>()
    };
    let mut lines =
        text.lines().filter(|l| !l.trim().is_empty() && !l.trim_start().starts_with('#'));
    let header = lines.next().map(cells).ok_or_else(|| {
        let remedy = format!("begin with a header line of {}", kind.columns.join(","));
        fail(path, text, 0..0, format!("the {} is empty", kind.name), remedy)
    })?;
    let mut columns = BTreeMap::new();
    let mut order = Vec::new();
    for (name, at) in &header {
        let name = column(kind, name, |n| columns.contains_key(n))
            .map_err(|(message, remedy)| fail(path, text, at.clone(), message, remedy))?;
        order.push(name);
        let empty = Column { values: Vec::new(), places: Vec::new() };
        columns.insert(name, empty);
    }
    for (row, line) in lines.enumerate() {
        let cells = cells(line);
        let whole = cells[0].1.start..cells[cells.len() - 1].1.end;
        if row >= MAX_ROWS {
            return Err(too_many(kind, path, text, whole));
        }
        if cells.len() != order.len() {
            let (found, wanted) = (cells.len(), order.len());
            let message = format!("this row has {found} values, the header {wanted}");
            return Err(fail(path, text, whole, message, "give one for each column"));
        }
        for (name, (cell, at)) in order.iter().zip(cells) {
            let Ok(value) = cell.parse::<f64>() else {
                let message = format!("{name}: `{cell}` is not a number");
                return Err(fail(path, text, at, message, "write it like 1.5"));
            };
            let column = columns.get_mut(name).expect("in the header");
            column.values.push(value);
            column.places.push(at);
        }
    }
    Ok(Columns { kind, path, text, columns })
}

fn of_toml<'t>(
    kind: &'t ColumnFile,
    path: &'t Path,
    text: &'t str,
) -> Result<Columns<'t>, SceneError> {
    type Lists = BTreeMap<Spanned<String>, Vec<Spanned<f64>>>;
    let found: Lists = toml::from_str(text).map_err(|e| {
        let remedy =
            format!("give a list of numbers for each column: {} = [0, 0.5]", kind.columns[0]);
        fail(path, text, e.span().unwrap_or(0..0), e.message(), remedy)
    })?;
    let mut columns = BTreeMap::new();
    for (name, values) in found {
        let at = name.span();
        let name = column(kind, name.get_ref(), |n| columns.contains_key(n))
            .map_err(|(message, remedy)| fail(path, text, at.clone(), message, remedy))?;
        if values.len() > MAX_ROWS {
            return Err(too_many(kind, path, text, at));
        }
        let column = Column {
            places: values.iter().map(Spanned::span).collect(),
            values: values.into_iter().map(Spanned::into_inner).collect(),
        };
        columns.insert(name, column);
    }
    Ok(Columns { kind, path, text, columns })
}

impl<'t> Columns<'t> {
    /// The columns of `text`, TOML by the extension of `path`, else CSV.
    ///
    /// # Errors
    /// The first mistake with its place in the file.
    pub fn parse(kind: &'t ColumnFile, path: &'t Path, text: &'t str) -> Result<Self, SceneError> {
        let extension = path.extension().and_then(|e| e.to_str());
        match extension.unwrap_or_default().to_ascii_lowercase().as_str() {
            "toml" => of_toml(kind, path, text),
            _ => of_csv(kind, path, text),
        }
    }

    /// The error at a place in the file.
    pub fn fail(&self, at: Range<usize>, message: String, remedy: &str) -> SceneError {
        fail(self.path, self.text, at, message, remedy)
    }

    /// The columns of these names: all of them, or none.
    pub fn together<const N: usize>(
        &self,
        names: [&'static str; N],
    ) -> Result<Option<[&Column; N]>, SceneError> {
        let found = names.map(|name| self.columns.get(name));
        match found.iter().position(Option::is_none) {
            None => Ok(Some(found.map(|c| c.expect("none is missing")))),
            Some(_) if found.iter().all(Option::is_none) => Ok(None),
            Some(missing) => Err(self.fail(
                0..0,
                format!("column `{}` is missing", names[missing]),
                &format!("give {} together", names.join(", ")),
            )),
        }
    }

    /// The error of a row whose time is not later than that of the row before it.
    pub fn out_of_order(&self, time: &Column, row: usize) -> SceneError {
        let (now, before) = (time.values[row], time.values[row - 1]);
        let message = match now == before {
            true => format!("time {now} s occurs twice"),
            false => format!("time {now} s follows {before} s"),
        };
        self.fail(time.places[row].clone(), message, "times must increase from row to row")
    }

    /// Fails where the column `first` has no rows, where another one has not as many, and at numbers that are not finite or
    /// too large.
    pub fn check(&self, first: &str) -> Result<(), SceneError> {
        let rows = self.columns.get(first).map_or(0, |column| column.values.len());
        if rows == 0 {
            let message = format!("the {} has no rows", self.kind.name);
            return Err(self.fail(0..0, message, "add a row of numbers"));
        }
        for (name, column) in &self.columns {
            if column.values.len() != rows {
                let at = column.places.last().cloned().unwrap_or(0..0);
                let message =
                    format!("{} values of {name}, and {rows} of {first}", column.values.len());
                return Err(self.fail(at, message, &format!("give as many as of {first}")));
            }
            let wild = |v: &f64| !v.is_finite() || name.ends_with("mm") && v.abs() > FARTHEST;
            if let Some(row) = column.values.iter().position(wild) {
                let (value, at) = (column.values[row], column.places[row].clone());
                let message = match value.is_finite() {
                    true => format!("{name} is {value} mm"),
                    false => format!("{name} is not finite"),
                };
                return Err(self.fail(at, message, "give numbers, positions up to 100000 mm"));
            }
        }
        Ok(())
    }
}
