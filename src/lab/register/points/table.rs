//! Tables of points: .csv, and the .fcsv of 3D Slicer, whose header is comments.

use std::path::Path;

use csv::{ReaderBuilder, StringRecord, Trim};
use glam::DVec3;

use super::{FARTHEST, MAX_POINTS, far, frame_named, too_many, unknown_frame};
use crate::issue::FileError;
use crate::settings::suggest;
use crate::volume::Frame;

/// A row that is not empty.
pub(super) struct Row {
    pub line: usize,
    pub cells: StringRecord,
}

/// A table with known columns.
pub(super) struct Table<'p> {
    path: &'p Path,
    /// Lower case, without the unit.
    columns: Vec<String>,
    pub rows: Vec<Row>,
    /// Frame stated in its comments.
    pub frame: Frame,
}

impl<'p> Table<'p> {
    pub fn read(path: &'p Path, text: &str) -> Result<Self, FileError> {
        let (mut frame, mut columns) = (Frame::Unstated, None);
        // The header of a .fcsv is comments.
        let comments = (1..).zip(text.lines()).filter(|(_, l)| l.starts_with('#'));
        for (line, (key, value)) in comments.filter_map(|(n, l)| Some((n, l[1..].split_once('=')?)))
        {
            match key.trim().to_ascii_lowercase().as_str() {
                "coordinatesystem" => {
                    let named = frame_named(value.trim());
                    frame = named.map_err(|cause| unknown_frame(path, line, &cause))?;
                }
                "columns" => columns = Some(value.split(',').map(column_name).collect()),
                _ => {}
            }
        }
        let mut reader = ReaderBuilder::new();
        reader.has_headers(false).flexible(true).comment(Some(b'#')).trim(Trim::All);
        let mut rows = Vec::new();
        for record in reader.from_reader(text.as_bytes()).into_records() {
            let cells = record.map_err(|e| {
                FileError::file(path, format!("is no table: {e}"), "save it as CSV")
            })?;
            let line = cells.position().map_or(0, |p| p.line() as usize);
            if rows.len() > MAX_POINTS {
                return Err(too_many(path, line));
            }
            if cells.iter().any(|c| !c.is_empty()) {
                rows.push(Row { line, cells });
            }
        }
        let numeric = |row: &Row| {
            let numbers = row.cells.iter().take(3).filter(|c| c.parse::<f64>().is_ok());
            numbers.count() == 3
        };
        let columns = match (columns, rows.first()) {
            (Some(columns), _) => columns,
            (None, Some(first)) if numeric(first) => ["x", "y", "z"].map(str::to_owned).to_vec(),
            (None, Some(_)) => rows.remove(0).cells.iter().map(column_name).collect(),
            (None, None) => Vec::new(),
        };
        if rows.is_empty() {
            return Err(FileError::file(
                path,
                "holds no points",
                "give a line x,y,z for each, in mm",
            ));
        }
        Ok(Self { path, columns, rows, frame })
    }

    pub fn column(&self, name: &str) -> Option<usize> {
        self.columns.iter().position(|c| c == name)
    }

    pub fn has(&self, names: &[String; 3]) -> bool {
        names.iter().all(|n| self.column(n).is_some())
    }

    /// An error: one of these columns is missing.
    pub fn lacks(&self, wanted: &[&str]) -> FileError {
        let missing = wanted.iter().find(|n| self.column(n).is_none());
        let missing = missing.expect("one is missing");
        let near = suggest::nearest(missing, self.columns.iter().map(String::as_str));
        let near = near.map_or_else(String::new, |n| format!("; `{n}` is not it"));
        FileError::line(
            self.path,
            1,
            format!("has no column `{missing}`{near}"),
            format!("begin with a header line that has {}", wanted.join(",")),
        )
    }

    /// The vector in these columns, which must exist.
    pub fn vector(&self, row: &Row, names: &[String; 3]) -> Result<DVec3, FileError> {
        let mut out = DVec3::ZERO;
        for (axis, name) in names.iter().enumerate() {
            let column = self.column(name).expect("the table has it");
            let fail = |cause: String| {
                let remedy = format!("write `{name}` as a number of mm, like 1.5");
                FileError::line(self.path, row.line, cause, remedy)
            };
            let cell = row.cells.get(column);
            let cell = cell.ok_or_else(|| fail(format!("the row ends before column `{name}`")))?;
            let value = cell.parse::<f64>();
            out[axis] = value.map_err(|_| fail(format!("{name}: `{cell}` is not a number")))?;
            if out[axis].is_nan() || out[axis].abs() > FARTHEST {
                return Err(far(self.path, row.line, out[axis]));
            }
        }
        Ok(out)
    }
}

fn column_name(cell: &str) -> String {
    let name = cell.trim().to_ascii_lowercase();
    name.strip_suffix("_mm").map_or(name.clone(), str::to_owned)
}
