//! Triangles as mesh files have them and as rays meet them, and the limits of what is read.

use std::path::Path;

use crate::issue::{self, Issue};

/// Largest file that is read, bytes. Four million triangles of text fit; memory stays under 1 GB.
pub const MAX_FILE: u64 = 256 << 20;

/// Most triangles and most vertices of one file.
pub const MAX_ELEMENTS: usize = 4_000_000;

/// Triangles that share vertices by index. Units are those of the file until [`load`](super::load) scales.
#[derive(Clone, Debug, Default)]
pub struct Soup {
    /// Object, group or node name; may be empty.
    pub name: String,
    /// Vertex positions.
    pub positions: Vec<[f32; 3]>,
    /// Vertex indices, counter-clockwise seen from outside. A reader guarantees that they are
    /// in range.
    pub triangles: Vec<[u32; 3]>,
}

/// Length of the file's unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Units(
    /// Millimetres per unit of the file.
    pub f64,
);

impl Units {
    /// Names as scene files write them, with the length of each in mm.
    pub const NAMES: [(&str, f64); 5] =
        [("um", 1e-3), ("mm", 1.0), ("cm", 10.0), ("m", 1000.0), ("in", 25.4)];

    /// The names alone.
    pub const WORDS: [&str; 5] = {
        let [um, mm, cm, m, inch] = Self::NAMES;
        [um.0, mm.0, cm.0, m.0, inch.0]
    };

    /// The unit called `name`.
    pub fn named(name: &str) -> Option<Self> {
        let found = Self::NAMES.iter().find(|(n, _)| *n == name)?;
        Some(Self(found.1))
    }
}

/// Options for reading a mesh file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Options {
    /// Unit; without it the one that the format defines (glTF: metres) or the file states (3MF), else mm.
    pub units: Option<Units>,
    /// Only this glTF node with its children, this OBJ object or group, this STL solid or 3MF object.
    pub node: Option<String>,
    /// True where boundary loops are closed by fans to their centres.
    pub cap_openings: bool,
    /// True where positions are taken as they are written, whatever frame the file states: who asks knows the frame.
    pub as_written: bool,
    /// Most shapes that are sampled from an animated skin, at least 2; without it 24.
    pub keyframes: Option<usize>,
}

/// A triangle mesh in its own object space, mm.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Name as it appears in messages: the scene's mesh name, or the node's name in the file.
    pub name: String,
    /// Vertex positions, mm.
    pub positions: Vec<[f32; 3]>,
    /// Unit shading normals, one per vertex, outward; vertices are split at creases.
    pub normals: Vec<[f32; 3]>,
    /// Vertex indices, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// Smallest and largest corner of the triangles, mm; zero without any.
    pub fn bounds(&self) -> [[f32; 3]; 2] {
        let corners = self.triangles.iter().flatten();
        let mut positions = corners.map(|&v| self.positions[v as usize]);
        let Some(first) = positions.next() else {
            return [[0.0; 3]; 2];
        };
        positions.fold([first; 2], |[low, high], p| {
            let pick = |f: fn(f32, f32) -> f32, a: [f32; 3]| std::array::from_fn(|i| f(a[i], p[i]));
            [pick(f32::min, low), pick(f32::max, high)]
        })
    }

    /// Returns whether `self` and `other` can be shapes of one surface: equal triangles and equally many vertices,
    /// so that the same vertex is the same point of the tissue.
    pub fn shares_topology(&self, other: &Self) -> bool {
        self.positions.len() == other.positions.len() && self.triangles == other.triangles
    }
}

/// Result of a reader.
#[derive(Debug, Default)]
pub(in crate::scene) struct Parts {
    pub parts: Vec<Soup>,
    pub issues: Vec<Issue>,
    /// The unit, where format or file say it.
    pub units: Option<Units>,
    /// True where the file states that its frame is RAS.
    pub ras: bool,
}

/// Reads a regular file of at most [`MAX_FILE`] bytes.
pub(in crate::scene) fn read_bounded(path: &Path) -> Result<Vec<u8>, Vec<Issue>> {
    let smaller = "reduce the mesh or split the file";
    issue::read(path, MAX_FILE, smaller).map_err(|error| vec![error.into()])
}
