//! Readers of mesh files other than OBJ and glTF, and their common parts. None takes more memory than a small
//! multiple of the file, whatever the file declares.

use std::fmt;
use std::path::Path;

use super::mesh::{MAX_ELEMENTS, Parts, Soup};
use crate::issue::Issue;
use crate::volume::Scalar;

pub(super) mod off;
pub(super) mod ply;
pub(super) mod stl;
pub(super) mod threemf;
pub(super) mod vtk;
pub(super) mod vtp;
mod words;
mod xml;

use words::Words;

/// Most values of a list, such as the corners of all polygons: each is in memory as eight bytes.
const MAX_VALUES: usize = 6 * MAX_ELEMENTS;

const EXPORT_AGAIN: &str = "export it again";
const COPY_AGAIN: &str = "export or copy it again";
const REDUCE: &str = "reduce the mesh";

/// The reason why a file cannot be read.
#[derive(Debug)]
struct Fault {
    /// Line of text, from 1; 0 where it does not apply.
    line: usize,
    cause: String,
    remedy: &'static str,
}

impl Fault {
    fn new(cause: impl Into<String>, remedy: &'static str) -> Self {
        Self { line: 0, cause: cause.into(), remedy }
    }

    /// The file ends within `what`.
    fn cut(what: impl fmt::Display) -> Self {
        Self::new(format!("is cut off: it ends within {what}"), COPY_AGAIN)
    }

    /// The same with its place among those that the header counts, where the file ends there.
    fn counted(self, n: usize, count: usize) -> Self {
        match self.remedy == COPY_AGAIN {
            true => Self {
                cause: format!("{}, at number {} of {count} by its header", self.cause, n + 1),
                ..self
            },
            false => self,
        }
    }

    fn too_many(count: impl fmt::Display, what: &str) -> Self {
        let cause = format!("{count} {what} are too many: the limit is {MAX_ELEMENTS}");
        Self::new(cause, REDUCE)
    }

    /// The same in a line of text.
    fn at(self, line: usize) -> Self {
        Self { line, ..self }
    }

    /// The finding about the file at `path`.
    fn issues(self, path: &Path) -> Vec<Issue> {
        let issue = Issue::error(path, 1, self.cause, self.remedy);
        vec![match self.line {
            0 => issue,
            line => issue.of(&format!("line {line}")),
        }]
    }
}

/// The reason why a text in UTF-16 is not read; none where it is no such text, by its mark.
pub(super) fn utf16(path: &Path, bytes: &[u8]) -> Option<Issue> {
    let cause = "is text in UTF-16, which no mesh format allows";
    let marked = matches!(bytes, [0xff, 0xfe, ..] | [0xfe, 0xff, ..]);
    marked.then(|| Issue::error(path, 1, cause, "save it as UTF-8 in a text editor"))
}

/// Bytes of a header in which a file may state its frame.
const STATED_WITHIN: usize = 1024;

/// Returns whether a file says that its coordinates are RAS, as 3D Slicer writes it into comments and titles:
/// `3D Slicer output. SPACE=RAS`.
pub(super) fn states_ras(bytes: &[u8]) -> bool {
    let head = &bytes[..bytes.len().min(STATED_WITHIN)];
    head.windows(9).any(|word| word == b"SPACE=RAS")
}

/// The one surface of a file, or the findings that keep it from being read.
fn surface(path: &Path, parsed: Result<(Soup, Faces), Fault>) -> Result<Parts, Vec<Issue>> {
    let (soup, faces) = parsed.map_err(|fault| fault.issues(path))?;
    let issues = faces.warning(path).into_iter().collect();
    let vertices = soup.positions.len();
    let triangles = faces.over(vertices).map_err(|fault| fault.issues(path))?;
    Ok(Parts { parts: vec![Soup { triangles, ..soup }], issues, ..Parts::default() })
}

/// Triangles from polygons and strips, within the limits.
#[derive(Default)]
struct Faces {
    triangles: Vec<[u32; 3]>,
    /// Faces with fewer than three corners.
    short: usize,
}

impl Faces {
    /// Adds a polygon as a fan about its first corner.
    fn polygon(&mut self, corners: &[u32]) -> Result<(), Fault> {
        self.note(corners)?;
        for pair in corners.get(1..).unwrap_or_default().windows(2) {
            self.triangles.push([corners[0], pair[0], pair[1]]);
        }
        Ok(())
    }

    /// Adds a strip of triangles; every other one is turned.
    fn strip(&mut self, corners: &[u32]) -> Result<(), Fault> {
        self.note(corners)?;
        for (k, c) in corners.windows(3).enumerate() {
            self.triangles.push(if k % 2 == 0 { [c[0], c[1], c[2]] } else { [c[1], c[0], c[2]] });
        }
        Ok(())
    }

    /// Notes a face of too few corners, or fails where there are too many faces.
    fn note(&mut self, corners: &[u32]) -> Result<(), Fault> {
        self.short += usize::from(corners.len() < 3);
        match self.triangles.len() + corners.len().saturating_sub(2) > MAX_ELEMENTS {
            true => Err(Fault::too_many("these", "triangles")),
            false => Ok(()),
        }
    }

    /// The triangles over `vertices` vertices, each of which exists.
    fn over(self, vertices: usize) -> Result<Vec<[u32; 3]>, Fault> {
        match self.triangles.iter().flatten().find(|&&v| v as usize >= vertices) {
            Some(v) => Err(no_vertex(v, vertices)),
            None => Ok(self.triangles),
        }
    }

    /// The warning about faces with fewer than three corners.
    fn warning(&self, path: &Path) -> Option<Issue> {
        let message = format!("faces with fewer than three corners are ignored ({})", self.short);
        (self.short > 0).then(|| Issue::warning(path, self.short, message, ""))
    }
}

fn no_vertex(index: impl fmt::Display, vertices: usize) -> Fault {
    let cause = format!("a face names vertex {index}, counted from 0, and there are {vertices}");
    Fault::new(cause, EXPORT_AGAIN)
}

/// A vertex index; a number that does not fit into 32 bits names no vertex.
fn index(value: i64) -> Result<u32, Fault> {
    u32::try_from(value).map_err(|_| {
        Fault::new(format!("a face names vertex {value}, which cannot be"), EXPORT_AGAIN)
    })
}

/// A number as an index or a count; none where it is no whole number, or one that f64 does not tell from others.
fn whole(value: f64) -> Option<i64> {
    (value.fract() == 0.0 && value.abs() < 9e15).then_some(value as i64)
}
