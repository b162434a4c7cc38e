//! Trajectory files: time, position, rotation and scale, row by row as CSV or column by column as TOML.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

use glam::{DQuat, DVec3};
use toml::Spanned;

use super::error::SceneError;
use super::motion::SQUEEZE;
use crate::issue::{self, FileError};
use crate::scene::animation::{Channel, Curve, Track, TrackError};
use crate::settings::suggest;

/// Largest file, bytes.
const MAX_TEXT: u64 = 16 << 20;
/// Most rows: an hour at 50 a second and some.
const MAX_ROWS: usize = 200_000;
/// Farthest position, mm, as for everything that is placed.
const FAR: f64 = 1e5;

/// Names of all possible columns.
const NAMES: [&str; 11] =
    ["time_s", "x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz", "sx", "sy", "sz"];

/// One column with the places of its values in the text, bytes.
struct Column {
    values: Vec<f64>,
    places: Vec<Range<usize>>,
}

/// The columns of a file, as read.
struct Table<'t> {
    path: &'t Path,
    text: &'t str,
    columns: BTreeMap<&'static str, Column>,
}

/// Text of the file at `path`.
pub(super) fn text(path: &Path) -> Result<String, FileError> {
    issue::read_text(path, MAX_TEXT, "sample it more coarsely")
}

/// The samples of the probe's trajectory in the file at `path`, linear between them: TOML by its extension, else
/// CSV, of the columns `time_s`, `x_mm`, `y_mm`, `z_mm` (mm) and `qw`, `qx`, `qy`, `qz` (a quaternion).
///
/// # Errors
/// A file that cannot be read, or the first mistake with its place in it.
pub fn load_trajectory(path: &Path) -> Result<Track, SceneError> {
    let text = text(path)?;
    let track = parse(path, &text, Curve::Linear)?;
    match track.scale {
        None => Ok(track),
        Some(_) => Err(SceneError::file(
            path,
            "a probe keeps its size, and there are columns sx, sy, sz".to_owned(),
            "remove them, or give the file to the motion of a transform",
        )),
    }
}

/// The samples of `text`, TOML by the extension of `path`, else CSV.
///
/// # Errors
/// The first mistake with its place in the trajectory file.
pub(super) fn parse(path: &Path, text: &str, curve: Curve) -> Result<Track, SceneError> {
    let extension = path.extension().and_then(|e| e.to_str());
    let table = match extension.unwrap_or_default().to_ascii_lowercase().as_str() {
        "toml" => of_toml(path, text)?,
        _ => of_csv(path, text)?,
    };
    table.track(curve)
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

/// The column called `name`, which must be new.
fn column(name: &str, has: impl Fn(&str) -> bool) -> Result<&'static str, (String, String)> {
    let known = NAMES.iter().find(|n| **n == name).ok_or_else(|| {
        let remedy = suggest::among(name, NAMES.iter().copied());
        (format!("unknown column `{name}`"), remedy)
    })?;
    match has(known) {
        true => Err((format!("there are two columns `{name}`"), "remove one".to_owned())),
        false => Ok(known),
    }
}

fn too_many(path: &Path, text: &str, at: Range<usize>) -> SceneError {
    let message = format!("a trajectory has at most {MAX_ROWS} rows");
    fail(path, text, at, message, "sample it more coarsely")
}

fn of_csv<'t>(path: &'t Path, text: &'t str) -> Result<Table<'t>, SceneError> {
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
        let remedy = format!("begin with a header line of {}", NAMES.join(","));
        fail(path, text, 0..0, "the trajectory is empty", remedy)
    })?;
    let mut columns = BTreeMap::new();
    let mut order = Vec::new();
    for (name, at) in &header {
        let name = column(name, |n| columns.contains_key(n))
            .map_err(|(message, remedy)| fail(path, text, at.clone(), message, remedy))?;
        order.push(name);
        let empty = Column { values: Vec::new(), places: Vec::new() };
        columns.insert(name, empty);
    }
    for (row, line) in lines.enumerate() {
        let cells = cells(line);
        let whole = cells[0].1.start..cells[cells.len() - 1].1.end;
        if row >= MAX_ROWS {
            return Err(too_many(path, text, whole));
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
    Ok(Table { path, text, columns })
}

fn of_toml<'t>(path: &'t Path, text: &'t str) -> Result<Table<'t>, SceneError> {
    type Columns = BTreeMap<Spanned<String>, Vec<Spanned<f64>>>;
    let found: Columns = toml::from_str(text).map_err(|e| {
        let remedy = "give a list of numbers for each column: time_s = [0, 0.5]";
        fail(path, text, e.span().unwrap_or(0..0), e.message(), remedy)
    })?;
    let mut columns = BTreeMap::new();
    for (name, values) in found {
        let at = name.span();
        let name = column(name.get_ref(), |n| columns.contains_key(n))
            .map_err(|(message, remedy)| fail(path, text, at.clone(), message, remedy))?;
        if values.len() > MAX_ROWS {
            return Err(too_many(path, text, at));
        }
        let column = Column {
            places: values.iter().map(Spanned::span).collect(),
            values: values.into_iter().map(Spanned::into_inner).collect(),
        };
        columns.insert(name, column);
    }
    Ok(Table { path, text, columns })
}

impl Table<'_> {
    fn fail(&self, at: Range<usize>, message: String, remedy: &str) -> SceneError {
        fail(self.path, self.text, at, message, remedy)
    }

    /// The columns of these names: all of them, or none.
    fn together<const N: usize>(
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

    fn track(&self, curve: Curve) -> Result<Track, SceneError> {
        let Some([time]) = self.together(["time_s"])? else {
            let remedy = "add the time of each row, in seconds";
            return Err(self.fail(0..0, "column `time_s` is missing".to_owned(), remedy));
        };
        let positions = self.together(["x_mm", "y_mm", "z_mm"])?;
        let rotations = self.together(["qw", "qx", "qy", "qz"])?;
        if time.values.is_empty() {
            let remedy = "add a row of numbers";
            return Err(self.fail(0..0, "the trajectory has no rows".to_owned(), remedy));
        }
        let factors = self.together(["sx", "sy", "sz"])?;
        if positions.is_none() && rotations.is_none() && factors.is_none() {
            return Err(self.fail(
                0..0,
                "the trajectory has neither positions nor rotations nor factors".to_owned(),
                "add x_mm, y_mm, z_mm or qw, qx, qy, qz or sx, sy, sz",
            ));
        }
        let rows = time.values.len();
        for (name, column) in &self.columns {
            if column.values.len() != rows {
                let at = column.places.last().cloned().unwrap_or(0..0);
                let message = format!("{} values of {name} for {rows} times", column.values.len());
                return Err(self.fail(at, message, "give as many as times"));
            }
            let wild = |v: &f64| !v.is_finite() || name.ends_with("mm") && v.abs() > FAR;
            if let Some(row) = column.values.iter().position(wild) {
                let (value, at) = (column.values[row], column.places[row].clone());
                let message = match value.is_finite() {
                    true => format!("{name} is {value} mm"),
                    false => format!("{name} is not finite"),
                };
                return Err(self.fail(at, message, "give numbers, positions up to 100000 mm"));
            }
        }
        for column in factors.into_iter().flatten() {
            let (least, most) = SQUEEZE;
            let outside = |v: &f64| !(least..=most).contains(v);
            if let Some(row) = column.values.iter().position(outside) {
                let at = column.places[row].clone();
                let message = format!("the factor is {}", column.values[row]);
                let remedy = format!("tissue can be squeezed to {least} and stretched to {most}");
                return Err(self.fail(at, message, &remedy));
            }
        }
        let refused = |e: TrackError| self.refused(&e, time, rotations);
        let vectors = |of: [&Column; 3]| {
            let values = (0..rows).map(|i| DVec3::from(of.map(|c| c.values[i])));
            Channel::new(time.values.clone(), values.collect(), curve).map_err(refused)
        };
        let quaternions = |of: [&Column; 4]| {
            let values = (0..rows).map(|i| {
                let [w, x, y, z] = of.map(|c| c.values[i]);
                DQuat::from_xyzw(x, y, z, w)
            });
            Channel::rotations(time.values.clone(), values.collect(), curve).map_err(refused)
        };
        Ok(Track {
            translation: positions.map(vectors).transpose()?,
            rotation: rotations.map(quaternions).transpose()?,
            scale: factors.map(vectors).transpose()?,
        })
    }

    /// The error for samples that a channel refuses, at their row.
    fn refused(&self, error: &TrackError, time: &Column, q: Option<[&Column; 4]>) -> SceneError {
        match (error, q) {
            (TrackError::Order(row), _) => {
                let (now, before) = (time.values[*row], time.values[row - 1]);
                let message = match now == before {
                    true => format!("time {now} s occurs twice"),
                    false => format!("time {now} s follows {before} s"),
                };
                let at = time.places[*row].clone();
                self.fail(at, message, "times must increase from row to row")
            }
            (TrackError::ZeroQuaternion(row), Some(q)) => {
                let at = q[0].places[*row].clone();
                let message = "this quaternion is zero, which is no rotation".to_owned();
                self.fail(at, message, "no rotation is qw, qx, qy, qz = 1, 0, 0, 0")
            }
            // Other errors have been excluded by checks; if one occurs, it is reported all the same.
            (error, _) => self.fail(0..0, error.to_string(), ""),
        }
    }
}
