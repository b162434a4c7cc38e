//! Legacy VTK files with polydata, in text and binary, of versions 1 to 5 (VTK User's Guide, "VTK File Formats"; from
//! 5.1 on polygons are offsets and connectivity): points, polygons and strips of triangles. Vertices, lines and the
//! data of points and cells are not read.

use std::path::Path;

use super::words::shown;
use super::{
    COPY_AGAIN, EXPORT_AGAIN, Faces, Fault, MAX_VALUES, Scalar, Words, index, surface, whole,
};
use crate::issue::Issue;
use crate::scene::mesh::{MAX_ELEMENTS, Parts, Soup};

/// Remedy for data of VTK, of this kind, that are no surface.
pub(super) fn not_polydata(kind: &[u8]) -> &'static str {
    let volumes = [&b"STRUCTURED_POINTS"[..], b"ImageData"];
    match volumes.iter().any(|volume| volume.eq_ignore_ascii_case(kind)) {
        true => {
            "it is a volume: save it as .nrrd or .mha (in ParaView and 3D Slicer: Save Data), and `import` that as a label \
             map, or fuse it"
        }
        false => "extract its surface (in ParaView: Extract Surface), and save that as polydata",
    }
}

pub(in crate::scene) fn read(path: &Path, bytes: &[u8]) -> Result<Parts, Vec<Issue>> {
    surface(path, parse(bytes))
}

struct File<'b> {
    words: Words<'b>,
    binary: bool,
}

/// The list to which cells belong.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Cells {
    Polygons,
    Strips,
}

fn parse(bytes: &[u8]) -> Result<(Soup, Faces), Fault> {
    let mut words = Words::new(bytes, 1);
    if !words.line_left().to_ascii_lowercase().starts_with(b"# vtk datafile version") {
        let cause = "is no VTK file: its first line is not `# vtk DataFile Version`";
        return Err(Fault::new(cause, EXPORT_AGAIN));
    }
    // The title.
    words.line_left();
    let binary = match words.line_left().to_ascii_uppercase().as_slice() {
        b"ASCII" => false,
        b"BINARY" => true,
        _ => return Err(Fault::new("is neither ASCII nor BINARY", EXPORT_AGAIN).at(3)),
    };
    let mut file = File { words, binary };
    let (mut soup, mut faces) = (Soup::default(), Faces::default());
    while let Some(word) = file.words.next() {
        let line = file.words.line();
        match word.to_ascii_uppercase().as_slice() {
            b"DATASET" => {
                let kind = file.words.line_left();
                if !kind.eq_ignore_ascii_case(b"POLYDATA") {
                    let cause =
                        format!("holds a dataset `{}`, and only POLYDATA is read", shown(kind));
                    return Err(Fault::new(cause, not_polydata(kind)).at(line));
                }
            }
            b"POINTS" => {
                let count = file.count("POINTS")?;
                if count > MAX_ELEMENTS {
                    return Err(Fault::too_many(count, "points").at(line));
                }
                let kind = file.kind()?;
                let values = file.values(kind, 3 * count, "the points")?;
                let points = values.as_chunks().0.iter();
                soup.positions = points.map(|p: &[f64; 3]| p.map(|v| v as f32)).collect();
            }
            b"POLYGONS" => file.cells(Some(Cells::Polygons), &mut faces)?,
            b"TRIANGLE_STRIPS" => file.cells(Some(Cells::Strips), &mut faces)?,
            b"VERTICES" | b"LINES" => file.cells(None, &mut faces)?,
            b"FIELD" => file.field()?,
            b"METADATA" => file.metadata(),
            // The rest are attributes of points and cells that have been read.
            b"POINT_DATA" | b"CELL_DATA" => break,
            other => {
                let cause = format!("`{}` is no part of polydata", shown(other));
                return Err(Fault::new(cause, COPY_AGAIN).at(line));
            }
        }
    }
    Ok((soup, faces))
}

impl File<'_> {
    fn count(&mut self, what: &str) -> Result<usize, Fault> {
        let count: usize = self.words.number(what)?;
        match count > MAX_VALUES {
            true => Err(Fault::too_many(count, &format!("values of {what}")).at(self.words.line())),
            false => Ok(count),
        }
    }

    /// A type, after which binary data begin.
    fn kind(&mut self) -> Result<Scalar, Fault> {
        let word = self.words.next().ok_or_else(|| Fault::cut("the type of values"))?;
        let line = self.words.line();
        let kind = scalar(word).ok_or_else(|| {
            let cause = format!("`{}` is no type of VTK that can be read", shown(word));
            Fault::new(cause, EXPORT_AGAIN)
        });
        self.data_begin();
        kind.map_err(|fault| fault.at(line))
    }

    /// Binary data begin after the end of the line.
    fn data_begin(&mut self) {
        if self.binary {
            self.words.line_left();
        }
    }

    fn values(&mut self, kind: Scalar, count: usize, what: &str) -> Result<Vec<f64>, Fault> {
        if !self.binary {
            return (0..count).map(|_| self.words.number(what)).collect();
        }
        let size = kind.bytes();
        let bytes = self.words.bytes(count.saturating_mul(size), what)?;
        Ok(bytes.chunks_exact(size).map(|bytes| kind.value(bytes, true)).collect())
    }

    /// Reads cells, and keeps those of a surface.
    fn cells(&mut self, cells: Option<Cells>, faces: &mut Faces) -> Result<(), Fault> {
        let what = "the cells";
        let (count, size) = (self.count(what)?, self.count(what)?);
        self.data_begin();
        let offsets = self.words.peek().is_some_and(|w| w.eq_ignore_ascii_case(b"OFFSETS"));
        if !offsets {
            let values = self.values(Scalar::I32, size, what)?;
            let mut rest = values.as_slice();
            for k in 0..count {
                let wrong = || {
                    let cause = format!("cell {k} of {count} has more corners than are there");
                    Fault::new(cause, COPY_AGAIN)
                };
                let (&corners, after) = rest.split_first().ok_or_else(wrong)?;
                let corners = whole(corners).and_then(|n| usize::try_from(n).ok());
                let cell = corners.and_then(|n| after.split_at_checked(n)).ok_or_else(wrong)?;
                rest = cell.1;
                add(cells, cell.0, faces)?;
            }
            return Ok(());
        }
        let mut list = |name: &[u8], count: usize| {
            let word = self.words.next().unwrap_or_default();
            if !word.eq_ignore_ascii_case(name) {
                let cause = format!("lacks `{}`", String::from_utf8_lossy(name));
                return Err(Fault::new(cause, COPY_AGAIN).at(self.words.line()));
            }
            let kind = self.kind()?;
            self.values(kind, count, what)
        };
        let (offsets, corners) = (list(b"OFFSETS", count)?, list(b"CONNECTIVITY", size)?);
        offset_cells(cells, &offsets, &corners, faces)
    }

    /// Skips the rest of a line, then lines up to an empty one.
    fn metadata(&mut self) {
        self.words.line_left();
        while !self.words.line_left().is_empty() {}
    }

    /// Skips arrays that belong to the whole file.
    fn field(&mut self) -> Result<(), Fault> {
        let what = "the field data";
        self.words.next();
        let arrays: usize = self.words.number(what)?;
        for _ in 0..arrays {
            let name = self.words.next().ok_or_else(|| Fault::cut(what))?;
            // An array may be missing, and have a blank of its own then.
            if name.eq_ignore_ascii_case(b"NULL_ARRAY") {
                continue;
            }
            let (parts, rows) = (self.count(what)?, self.count(what)?);
            let count = parts.saturating_mul(rows);
            let kind = self.words.peek().unwrap_or_default().to_ascii_lowercase();
            match kind.as_slice() {
                b"string" | b"utf8_string" => {
                    self.words.line_left();
                    (0..count).try_for_each(|_| self.skip_text())?;
                }
                b"bit" => {
                    self.words.line_left();
                    match self.binary {
                        true => {
                            self.words.bytes(count.div_ceil(8), what)?;
                        }
                        false => (0..count).try_for_each(|_| {
                            self.words.next().map(drop).ok_or_else(|| Fault::cut(what))
                        })?,
                    }
                }
                _ => {
                    let kind = self.kind()?;
                    self.values(kind, count.min(MAX_VALUES + 1), what)?;
                }
            }
            if self.words.peek() == Some(b"METADATA") {
                self.metadata();
            }
        }
        Ok(())
    }

    /// Skips a text: a line, or in binary files its bytes behind their number, whose own length the two highest
    /// bits say.
    fn skip_text(&mut self) -> Result<(), Fault> {
        let what = "a text of the field data";
        if !self.binary {
            let end = self.words.rest().is_empty();
            self.words.line_left();
            return if end { Err(Fault::cut(what)) } else { Ok(()) };
        }
        let first = *self.words.rest().first().ok_or_else(|| Fault::cut(what))?;
        let width = 8 >> (first >> 6);
        let bytes = self.words.bytes(width, what)?;
        let value = bytes.iter().fold(0u64, |value, &byte| value << 8 | u64::from(byte));
        let most = (1u64 << (8 * width - 2)) - 1;
        let count = usize::try_from(value & most).map_err(|_| Fault::cut(what))?;
        self.words.bytes(count, what)?;
        Ok(())
    }
}

/// Cells between offsets into a list of corners: the first at 0, and one more offset than cells.
pub(super) fn offset_cells(
    cells: Option<Cells>,
    offsets: &[f64],
    corners: &[f64],
    faces: &mut Faces,
) -> Result<(), Fault> {
    for pair in offsets.windows(2) {
        let range = whole(pair[0]).zip(whole(pair[1]));
        let range =
            range.and_then(|(a, b)| Some(usize::try_from(a).ok()?..usize::try_from(b).ok()?));
        let cell = range.and_then(|range| corners.get(range)).ok_or_else(|| {
            let cause = format!(
                "cells lie between the offsets {} and {} of {} corners",
                pair[0],
                pair[1],
                corners.len()
            );
            Fault::new(cause, COPY_AGAIN)
        })?;
        add(cells, cell, faces)?;
    }
    Ok(())
}

fn add(cells: Option<Cells>, corners: &[f64], faces: &mut Faces) -> Result<(), Fault> {
    let Some(cells) = cells else { return Ok(()) };
    let corners = corners.iter().map(|&corner| index(whole(corner).unwrap_or(-1)));
    let corners = corners.collect::<Result<Vec<_>, _>>()?;
    match cells {
        Cells::Polygons => faces.polygon(&corners),
        Cells::Strips => faces.strip(&corners),
    }
}

fn scalar(name: &[u8]) -> Option<Scalar> {
    Some(match name.to_ascii_lowercase().as_slice() {
        b"char" | b"signed_char" => Scalar::I8,
        b"unsigned_char" => Scalar::U8,
        b"short" => Scalar::I16,
        b"unsigned_short" => Scalar::U16,
        // Identifiers are written with 32 bits.
        b"int" | b"vtkidtype" => Scalar::I32,
        b"unsigned_int" => Scalar::U32,
        b"long" | b"vtktypeint64" => Scalar::I64,
        b"unsigned_long" | b"vtktypeuint64" => Scalar::U64,
        b"float" => Scalar::F32,
        b"double" => Scalar::F64,
        _ => return None,
    })
}

#[cfg(test)]
mod tests;
