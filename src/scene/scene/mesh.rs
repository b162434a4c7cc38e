//! From a mesh file to a [`Mesh`]: read, weld, repair, check, shade.

use std::path::Path;

use super::formats::{self, off, ply, stl, threemf, vtk, vtp};
use super::{check, load_gltf, load_obj};
use crate::issue::Issue;

mod animated;
mod keyframes;
mod recipe;
mod section;
mod soup;
mod surface;

pub use animated::{
    Animated, AnimatedMesh, AnimatedNode, Choice, Placement, animations, load_animated,
};
pub(super) use keyframes::bounded;
pub use keyframes::{MAX_SHAPES, load_keyframes};
pub use recipe::weld;
pub use soup::{MAX_ELEMENTS, MAX_FILE, Mesh, Options, Soup, Units};
pub(super) use soup::{Parts, read_bounded};
pub use surface::Surface;

use recipe::Recipe;

/// Result of reading a file, mm; with a mesh only if no finding is an error.
#[derive(Clone, Debug, Default)]
pub struct Inspected {
    /// The mesh, ready to trace.
    pub mesh: Option<Mesh>,
    /// Measures after repair.
    pub facts: check::Facts,
    /// True if the file states that its frame is RAS; then the mesh has been turned into LPS.
    pub ras: bool,
    /// Names of objects, groups or nodes that hold triangles.
    pub parts: Vec<String>,
    /// All findings.
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

/// All chosen triangles of a file, mm. None if it could not be read; the reason is then among the issues.
fn read_raw(path: &Path, options: &Options, found: &mut Inspected) -> Option<(Soup, Units)> {
    let Parts { parts, issues, units, ras } = match read_parts(path, options) {
        Ok(parts) => parts,
        Err(issues) => {
            found.issues = issues;
            return None;
        }
    };
    found.issues = issues;
    found.ras = ras;
    found.parts = parts.iter().map(|p| p.name.clone()).collect();

    let parts = match &options.node {
        // A node of a tree was chosen while that was read.
        Some(node) if MeshFormat::of(path) != Some(MeshFormat::Gltf) => {
            let chosen: Vec<_> = parts.into_iter().filter(|p| p.name == *node).collect();
            if chosen.is_empty() {
                found.issues.push(no_such_node(path, node, &found.parts));
                return None;
            }
            chosen
        }
        _ => parts,
    };
    let units = options.units.or(units).unwrap_or(Units(1.0));
    Some((merge(parts, units), units))
}

/// The parts of a mesh file, in its unit and in LPS where it states its frame. The extension says its format, unless
/// the file begins as one of another does.
fn read_parts(path: &Path, options: &Options) -> Result<Parts, Vec<Issue>> {
    let bytes = read_bounded(path)?;
    let (named, found) = (MeshFormat::of(path), MeshFormat::by_content(&bytes));
    let kind = found.or(named);
    if let Some(issue) =
        formats::utf16(path, &bytes).filter(|_| kind.is_some_and(MeshFormat::is_text))
    {
        return Err(vec![issue]);
    }
    let mut out = match kind {
        Some(MeshFormat::Obj) => load_obj::read(path, &bytes),
        Some(MeshFormat::Gltf) => load_gltf::read(path, &bytes, options.node.as_deref()),
        Some(MeshFormat::Stl) => stl::read(path, &bytes),
        Some(MeshFormat::Ply) => ply::read(path, &bytes),
        Some(MeshFormat::Vtk) => vtk::read(path, &bytes),
        Some(MeshFormat::Vtp) => vtp::read(path, &bytes),
        Some(MeshFormat::Off) => off::read(path, &bytes),
        Some(MeshFormat::Threemf) => threemf::read(path, &bytes),
        None => {
            let remedy = format!("convert it to {EXTENSIONS}");
            Err(vec![Issue::error(path, 1, "not a mesh format that can be read", remedy)])
        }
    }?;
    if let Some(found) = found.filter(|_| found != named) {
        let message = format!("is read as {found:?}, as which it begins, whatever its name says");
        out.issues.push(Issue::warning(path, 1, message, "give it the extension of its format"));
    }
    out.ras |= kind.is_some_and(MeshFormat::is_text) && formats::states_ras(&bytes);
    if out.ras && options.as_written {
        let message = "states that its frame is RAS: taken as it is written, as what names it does";
        out.issues.push(Issue::warning(path, 1, message, ""));
    } else if out.ras {
        let positions = out.parts.iter_mut().flat_map(|part| &mut part.positions);
        positions.for_each(|[x, y, _]| (*x, *y) = (-*x, -*y));
        let message = "states that its frame is RAS: turned into LPS, in which volumes are";
        out.issues.push(Issue::warning(path, 1, message, ""));
    }
    Ok(out)
}

/// Message for a node that a file does not have.
pub(super) fn no_such_node(path: &Path, node: &str, names: &[String]) -> Issue {
    let remedy = crate::settings::suggest::among(node, names.iter().map(String::as_str));
    Issue::error(path, 1, format!("no node or object `{node}` with triangles"), remedy)
}

/// Extensions of readable files, for messages.
pub(super) const EXTENSIONS: &str = ".obj, .stl, .ply, .vtk, .vtp, .off, .3mf, .gltf or .glb";

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum MeshFormat {
    Obj,
    Gltf,
    Stl,
    Ply,
    Vtk,
    Vtp,
    Off,
    Threemf,
}

impl MeshFormat {
    fn of(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_str()?.to_ascii_lowercase();
        match extension.as_str() {
            "obj" => Some(Self::Obj),
            "gltf" | "glb" => Some(Self::Gltf),
            "stl" => Some(Self::Stl),
            "ply" => Some(Self::Ply),
            "vtk" => Some(Self::Vtk),
            "vtp" => Some(Self::Vtp),
            "off" => Some(Self::Off),
            "3mf" => Some(Self::Threemf),
            _ => None,
        }
    }

    /// The format of a file that begins as no file of another does.
    fn by_content(bytes: &[u8]) -> Option<Self> {
        let begins = |word: &[u8]| bytes.starts_with(word);
        let head = &bytes[..bytes.len().min(512)];
        match () {
            () if begins(b"ply\n") || begins(b"ply\r") => Some(Self::Ply),
            () if begins(b"# vtk DataFile Version") => Some(Self::Vtk),
            () if begins(b"PK\x03\x04") => Some(Self::Threemf),
            () if begins(b"<") && head.windows(8).any(|word| word == b"<VTKFile") => {
                Some(Self::Vtp)
            }
            () => None,
        }
    }

    /// Returns whether its files are text, or begin with text.
    fn is_text(self) -> bool {
        match self {
            Self::Obj | Self::Stl | Self::Ply | Self::Vtk | Self::Off => true,
            // XML states its encoding; the others are binary, or JSON.
            Self::Vtp | Self::Gltf | Self::Threemf => false,
        }
    }
}

/// Returns whether the extension is that of a readable mesh file.
pub fn is_mesh(path: &Path) -> bool {
    MeshFormat::of(path).is_some()
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

#[cfg(test)]
mod tests {
    use super::*;

    fn inspected(name: &str, content: &str, options: &Options) -> Inspected {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join(name);
        std::fs::write(&path, content).expect("written");
        inspect(&path, options)
    }

    const OFF: &str = "OFF\n3 1 3\n0 0 0\n90 0 0\n0 60 7\n3 0 1 2\n";

    #[test]
    fn a_stated_frame_is_turned_into_lps() {
        let obj = "v 0 0 0\nv 90 0 0\nv 0 60 7\nf 1 2 3\n";
        let ras = format!("# 3D Slicer output. SPACE=RAS\n{obj}");
        let found = inspected("a.obj", &ras, &Options::default());
        assert_eq!((found.facts.min, found.facts.max), ([-90.0, -60.0, 0.0], [0.0, 0.0, 7.0]));
        assert!(found.issues.iter().any(|i| i.message.contains("RAS")), "{:?}", found.issues);
        let found = inspected("a.obj", &ras.replace("RAS", "LPS"), &Options::default());
        assert_eq!(found.facts.max, [90.0, 60.0, 7.0]);
        assert!(!found.issues.iter().any(|i| i.message.contains("RAS")), "{:?}", found.issues);
    }

    #[test]
    fn units_and_nodes_are_chosen_for_every_format() {
        let cm = Options { units: Units::named("cm"), ..Options::default() };
        assert_eq!(inspected("a.OFF", OFF, &cm).facts.max, [900.0, 600.0, 70.0]);
        let solid = |name: &str, x: u32| {
            format!(
                "solid {name}\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex {x} 0 0\n\
                 vertex 0 9 0\nendloop\nendfacet\nendsolid\n"
            )
        };
        let two = solid("a", 30) + &solid("b c", 50);
        let node = |node: &str| Options { node: Some(node.to_owned()), ..Options::default() };
        assert_eq!(inspected("a.stl", &two, &Options::default()).facts.triangles, 2);
        assert_eq!(inspected("a.stl", &two, &node("a")).facts.max[0], 30.0);
        assert_eq!(inspected("a.stl", &two, &node("b c")).facts.max[0], 50.0);
        let missing = inspected("a.stl", &two, &node("b"));
        assert!(
            missing.issues[0].message.contains("no node or object `b`"),
            "{:?}",
            missing.issues
        );
        let vtk = "# vtk DataFile Version 3.0\nt\nASCII\nDATASET POLYDATA\nPOINTS 3 float\n0 0 0 90 0 0\n\
                   0 60 7\nPOLYGONS 1 4\n3 0 1 2\n";
        let misnamed = inspected("a.stl", vtk, &Options::default());
        assert_eq!(misnamed.facts.triangles, 1);
        assert!(misnamed.issues[0].message.contains("is read as Vtk"), "{:?}", misnamed.issues);
        let unknown = inspected("a.dae", OFF, &cm);
        assert!(unknown.issues[0].remedy.contains(".3mf"), "{:?}", unknown.issues);
    }
}
