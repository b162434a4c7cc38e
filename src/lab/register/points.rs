//! Points in files: tables (.csv) and the markups of 3D Slicer (.fcsv, .mrk.json).

use std::collections::BTreeMap;
use std::io::Read as _;
use std::path::Path;

use glam::DVec3;

use super::landmarks::Landmark;
use crate::issue::{self, FileError};
use crate::volume::Frame;

mod markups;
mod table;

use table::{Row, Table};

/// Largest file, bytes, and most points of one.
const MAX_TEXT: u64 = 128 << 20;
const MAX_POINTS: usize = 1_000_000;
/// Farthest coordinate, mm.
const FARTHEST: f64 = 1e6;

/// Names of coordinates, and the frame that they imply.
const COORDINATES: [([&str; 3], Frame); 3] = [
    (["x", "y", "z"], Frame::Unstated),
    (["l", "p", "s"], Frame::Lps),
    (["r", "a", "s"], Frame::Ras),
];

/// A point with its name, which may be empty; mm.
#[derive(Clone, Debug, PartialEq)]
pub struct Point {
    /// Name.
    pub name: String,
    /// Position in LPS, mm.
    pub position: DVec3,
}

/// Reads the points of a file by its extension; .csv has the columns x, y, z (or l, p, s, or r, a, s; with
/// _mm behind them or not), name or label, and others, which are not read, or three columns without a
/// header. `stated`: the frame of a file that states none; without it LPS.
///
/// # Errors
/// The first mistake, with its line; a file that states another frame than `stated`.
pub fn load(path: &Path, stated: Option<Frame>) -> Result<Vec<Point>, FileError> {
    let text = issue::read_text(path, MAX_TEXT, "give fewer points: thousands are enough")?;
    let name = path.to_string_lossy().to_ascii_lowercase();
    if name.ends_with(".json") {
        return markups::read(path, &text, stated);
    }
    if !name.ends_with(".csv") && !name.ends_with(".fcsv") {
        return Err(FileError::file(
            path,
            "is no file of points by its extension",
            "give a .csv, or the .fcsv or .mrk.json of 3D Slicer; a mesh goes to --volume-surface",
        ));
    }
    let table = Table::read(path, &text)?;
    let sets = COORDINATES.map(|(letters, frame)| (letters.map(str::to_owned), frame));
    let Some((columns, frame)) = sets.iter().find(|(names, _)| table.has(names)) else {
        return Err(table.lacks(&["x", "y", "z"]));
    };
    let frame = match frame {
        Frame::Unstated => table.frame,
        frame => *frame,
    };
    let signs = agreed(path, frame, stated)?.lps_signs();
    let name = ["label", "name"].iter().find_map(|n| table.column(n));
    let point = |row: &Row| {
        Ok(Point {
            name: name.and_then(|i| row.cells.get(i)).unwrap_or_default().to_owned(),
            position: signs * table.vector(row, columns)?,
        })
    };
    table.rows.iter().map(point).collect()
}

/// Reads landmarks from a table with the columns name, model_x, model_y, model_z and volume_x, volume_y,
/// volume_z. `stated`: the frame of the volume's points where the file states none.
///
/// # Errors
/// The first mistake, with its line.
pub fn load_landmarks(path: &Path, stated: Option<Frame>) -> Result<Vec<Landmark>, FileError> {
    let text = issue::read_text(path, MAX_TEXT, "give fewer points: thousands are enough")?;
    let table = Table::read(path, &text)?;
    let side = |side: &str| ["x", "y", "z"].map(|axis| format!("{side}_{axis}"));
    let (model, volume) = (side("model"), side("volume"));
    if !table.has(&model) || !table.has(&volume) {
        let all = model.iter().chain(&volume).map(String::as_str);
        return Err(table.lacks(&all.collect::<Vec<_>>()));
    }
    let signs = agreed(path, table.frame, stated)?.lps_signs();
    let name = ["name", "label"].iter().find_map(|n| table.column(n));
    let landmark = |row: &Row| {
        let name = name.and_then(|i| row.cells.get(i)).filter(|n| !n.is_empty());
        Ok(Landmark {
            name: name.map_or_else(|| format!("line {}", row.line), str::to_owned),
            from: signs * table.vector(row, &volume)?,
            to: table.vector(row, &model)?,
        })
    };
    table.rows.iter().map(landmark).collect()
}

/// Landmarks of the points with the same name in both files, and the names that only one has.
///
/// # Errors
/// A name that occurs twice in a file; no common name.
pub fn pair(
    (model_file, model): (&Path, &[Point]),
    (volume_file, volume): (&Path, &[Point]),
) -> Result<(Vec<Landmark>, Vec<String>), FileError> {
    let (of_model, of_volume) = (named(model_file, model)?, named(volume_file, volume)?);
    let landmark = |to: &Point| {
        of_volume.get(to.name.as_str()).map(|from| Landmark {
            name: to.name.clone(),
            from: from.position,
            to: to.position,
        })
    };
    let pairs: Vec<Landmark> = model.iter().filter_map(landmark).collect();
    if pairs.is_empty() {
        let names = |points: &[Point]| {
            let names = points.iter().take(5).map(|p| format!("`{}`", p.name));
            names.collect::<Vec<_>>().join(", ")
        };
        return Err(FileError::file(
            volume_file,
            format!("shares no label with {}", model_file.display()),
            format!(
                "landmarks are paired by label: here {}, there {}",
                names(volume),
                names(model)
            ),
        ));
    }
    let here = |points: &BTreeMap<&str, &Point>, p: &&Point| points.contains_key(p.name.as_str());
    let single = model.iter().filter(|p| !here(&of_volume, p));
    let single = single.chain(volume.iter().filter(|p| !here(&of_model, p)));
    Ok((pairs, single.map(|p| p.name.clone()).collect()))
}

/// The points of a file by their names, which must differ.
fn named<'p>(file: &Path, points: &'p [Point]) -> Result<BTreeMap<&'p str, &'p Point>, FileError> {
    let mut out = BTreeMap::new();
    for point in points {
        if out.insert(point.name.as_str(), point).is_some() {
            return Err(FileError::file(
                file,
                format!("has several points called `{}`", point.name),
                "give each landmark a label of its own, the same in both files",
            ));
        }
    }
    Ok(out)
}

/// The frame that a mesh file of 3D Slicer states in the comment `SPACE=` near its beginning.
///
/// # Errors
/// A file that cannot be read; a frame other than LPS and RAS.
pub fn frame_of_mesh(path: &Path) -> Result<Frame, FileError> {
    let fail =
        |e: std::io::Error| FileError::file(path, format!("cannot be read: {e}"), "check the path");
    let mut head = Vec::new();
    let file = std::fs::File::open(path).map_err(fail)?;
    file.take(1024).read_to_end(&mut head).map_err(fail)?;
    let head = String::from_utf8_lossy(&head);
    let Some((_, own)) = head.split_once("SPACE=") else {
        return Ok(Frame::Unstated);
    };
    let own = own.chars().take_while(char::is_ascii_alphanumeric);
    frame_named(&own.collect::<String>()).map_err(|cause| unknown_frame(path, 0, &cause))
}

/// The common frame of a file and of the user.
///
/// # Errors
/// The two differ.
pub fn agreed(path: &Path, own: Frame, stated: Option<Frame>) -> Result<Frame, FileError> {
    match (own, stated) {
        (Frame::Unstated, stated) => Ok(stated.unwrap_or(Frame::Lps)),
        (own, Some(stated)) if own != stated => Err(FileError::file(
            path,
            format!("says that it is in {}, and --frame {}", own.name(), stated.name()),
            "leave --frame out; or correct the file",
        )),
        (own, _) => Ok(own),
    }
}

/// LPS or RAS, also by the numbers of old files.
fn frame_named(name: &str) -> Result<Frame, String> {
    match name.to_ascii_uppercase().as_str() {
        "LPS" | "1" => Ok(Frame::Lps),
        "RAS" | "0" => Ok(Frame::Ras),
        _ => Err(format!("is in the frame `{name}`")),
    }
}

fn unknown_frame(path: &Path, line: usize, cause: &str) -> FileError {
    FileError::line(path, line, cause, "save it in LPS or RAS, in mm")
}

fn too_many(path: &Path, line: usize) -> FileError {
    let cause = format!("more than {MAX_POINTS} points");
    FileError::line(path, line, cause, "give fewer: thousands are enough")
}

fn far(path: &Path, line: usize, value: f64) -> FileError {
    FileError::line(
        path,
        line,
        format!("a coordinate is {value}"),
        format!("it must be a number of at most {FARTHEST} mm"),
    )
}

#[cfg(test)]
mod tests;
