//! From a mesh file to a [`Mesh`]: read, weld, repair, check, shade.

use std::path::Path;

use super::{Mesh, check, load_gltf, load_obj, load_stl};
use crate::issue::Issue;

mod animated;
mod keyframes;
mod recipe;

pub use animated::{
    Animated, AnimatedMesh, AnimatedNode, Choice, Placement, animations, load_animated,
};
pub(super) use keyframes::bounded;
pub use keyframes::{MAX_SHAPES, load_keyframes};
pub(super) use recipe::weld;

use recipe::Recipe;

/// Largest file that is read, bytes. Four million triangles of text fit; memory stays under 1 GB.
pub const MAX_FILE: u64 = 256 << 20;

/// Most triangles and most vertices of one file.
pub const MAX_ELEMENTS: usize = 4_000_000;

/// Dihedral angle above which shading normals are split, degrees.
const CREASE: f32 = 40.0;

/// Triangles that share vertices by index. Units are those of the file until [`load`] scales.
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
    /// Unit; without it mm, and metres for glTF, which defines its unit.
    pub units: Option<Units>,
    /// Only this glTF node with its children, or this OBJ object or group.
    pub node: Option<String>,
    /// True where boundary loops are closed by fans to their centres.
    pub cap_openings: bool,
    /// Most shapes that are sampled from an animated skin, at least 2; without it 24.
    pub keyframes: Option<usize>,
}

/// Result of reading a file, mm; with a mesh only if no finding is an error.
#[derive(Clone, Debug, Default)]
pub struct Inspected {
    /// The mesh, ready to trace.
    pub mesh: Option<Mesh>,
    /// Measures after repair.
    pub facts: check::Facts,
    /// Names of objects, groups or nodes that hold triangles.
    pub parts: Vec<String>,
    /// All findings.
    pub issues: Vec<Issue>,
}

/// Result of a reader.
#[derive(Debug, Default)]
pub(super) struct Parts {
    pub parts: Vec<Soup>,
    pub issues: Vec<Issue>,
}

/// Reads and checks a mesh file; positions end in mm.
///
/// # Errors
/// Returns every finding when at least one of them stops loading.
pub fn load(path: &Path, options: &Options) -> Result<(Mesh, Vec<Issue>), Vec<Issue>> {
    let inspected = inspect(path, options);
    match inspected.mesh {
        Some(mesh) => Ok((mesh, inspected.issues)),
        None => Err(inspected.issues),
    }
}

/// Reads a mesh file and reports on it, errors included.
pub fn inspect(path: &Path, options: &Options) -> Inspected {
    let mut found = Inspected::default();
    let Some((raw, units)) = read_raw(path, options, &mut found) else {
        return found;
    };
    let (recipe, mut soup, issues) = Recipe::new(path, &raw, &[], options.cap_openings);
    drop(raw);
    let (facts, more) = check::examine(path, &mut soup, units, 1.0);
    found.facts = facts;
    found.issues.extend(issues);
    found.issues.extend(more);
    if !found.issues.iter().any(Issue::is_error) {
        found.mesh = Some(recipe.mesh(&soup.name, &soup.positions));
    }
    found
}

/// All chosen triangles of a file, mm, as stored. None if it could not be read; the reason is then among
/// the issues.
fn read_raw(path: &Path, options: &Options, found: &mut Inspected) -> Option<(Soup, Units)> {
    let kind = Kind::of(path);
    let read = read_bounded(path).and_then(|bytes| match kind {
        Some(Kind::Obj) => load_obj::read(path, &bytes),
        Some(Kind::Stl) => load_stl::read(path, &bytes),
        Some(Kind::Gltf) => load_gltf::read(path, &bytes, options.node.as_deref()),
        None => Err(vec![Issue::error(
            path,
            1,
            "not a mesh format that can be read",
            "convert it to .obj, .gltf, .glb or .stl",
        )]),
    });
    let Parts { parts, issues } = match read {
        Ok(parts) => parts,
        Err(issues) => {
            found.issues = issues;
            return None;
        }
    };
    found.issues = issues;
    found.parts = parts.iter().map(|p| p.name.clone()).collect();

    let parts = match (&options.node, kind) {
        (Some(node), Some(Kind::Obj | Kind::Stl)) => {
            let chosen: Vec<_> = parts.into_iter().filter(|p| p.name == *node).collect();
            if chosen.is_empty() {
                found.issues.push(no_such_node(path, node, &found.parts));
                return None;
            }
            chosen
        }
        _ => parts,
    };
    let default_units = if kind == Some(Kind::Gltf) { 1000.0 } else { 1.0 };
    let units = options.units.unwrap_or(Units(default_units));
    Some((merge(parts, units), units))
}

/// Message for a node that a file does not have.
pub(super) fn no_such_node(path: &Path, node: &str, names: &[String]) -> Issue {
    let remedy = crate::settings::suggest::among(node, names.iter().map(String::as_str));
    Issue::error(path, 1, format!("no node or object `{node}` with triangles"), remedy)
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Obj,
    Gltf,
    Stl,
}

impl Kind {
    fn of(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_str()?.to_ascii_lowercase();
        match extension.as_str() {
            "obj" => Some(Self::Obj),
            "gltf" | "glb" => Some(Self::Gltf),
            "stl" => Some(Self::Stl),
            _ => None,
        }
    }
}

/// Returns whether the extension is that of a readable mesh file.
pub fn is_mesh(path: &Path) -> bool {
    Kind::of(path).is_some()
}

/// Reads a regular file of at most [`MAX_FILE`] bytes.
pub(super) fn read_bounded(path: &Path) -> Result<Vec<u8>, Vec<Issue>> {
    let fail = |message: String, remedy: &str| vec![Issue::error(path, 1, message, remedy)];
    let info = std::fs::metadata(path)
        .map_err(|e| fail(format!("cannot be read: {e}"), "check the path"))?;
    if !info.is_file() {
        return Err(fail("is not a regular file".to_owned(), "name a file"));
    }
    if info.len() > MAX_FILE {
        return Err(fail(
            format!("is {} MB, the limit is {} MB", info.len() >> 20, MAX_FILE >> 20),
            "reduce the mesh or split the file",
        ));
    }
    std::fs::read(path).map_err(|e| fail(format!("cannot be read: {e}"), "check permissions"))
}

fn merge(parts: Vec<Soup>, units: Units) -> Soup {
    let name = match parts.as_slice() {
        [one] => one.name.clone(),
        _ => String::new(),
    };
    let mut all = Soup { name, ..Soup::default() };
    for part in parts {
        // Readers keep the sum of all vertices under MAX_ELEMENTS, hence under 2^32.
        let base = all.positions.len() as u32;
        let scaled = |p: [f32; 3]| p.map(|v| (f64::from(v) * units.0) as f32);
        all.positions.extend(part.positions.into_iter().map(scaled));
        let shifted = part.triangles.iter().map(|t| t.map(|i| i + base));
        all.triangles.extend(shifted);
    }
    all
}
