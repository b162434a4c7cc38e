//! Shapes of a scene file: mesh files, keyframes, and built-in shapes. A file that several instances name
//! is read once.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::columns::text;
use super::document::Document;
use super::error::SceneError;
use super::lines::{self, Given};
use super::table::{Stated, Table};
use crate::scene::mesh::{self, Options, Units};
use crate::scene::{Issue, Mesh, shapes};
use crate::settings::units::LENGTH;
use crate::settings::{Facts, Form, group};

/// Most keyframes of a mesh: 30 a second for half a minute.
const MAX_KEYFRAMES: usize = 1000;
/// A length of a shape.
const LONG: Facts = Facts::quantity(&LENGTH, 1e-3, 1e4).required();
/// Number of divisions of the faces of a round shape.
const FINE: Facts = Facts::whole(0, shapes::MAX_SUBDIVISIONS);

/// Several lengths of a shape.
const fn longs(count: usize) -> Facts {
    Facts::quantities(&LENGTH, count, 1e-3, 1e4).required()
}

group! {
    /// A placed mesh.
    pub struct MeshKeys in "mesh" {
        /// Tissue that it encloses: one of `[tissues]` or a shipped one.
        tissue: String = String::new(), Facts::of(Form::Text).required();
        /// Priority where meshes overlap: the highest wins.
        priority: i32 = 0, Facts::of(Form::Integer).limits("32 bits, signed");
        /// A mesh file of one of the formats below; the path is relative to the scene file.
        file: Option<String> = None, Facts::of(Form::Text);
        /// Instead of `file`: the shapes that it takes one after the other. The parent must be a selector.
        keyframes: Option<Vec<String>> = None, Facts::of(Form::Texts).limits("up to 1000 files");
        /// Animation of a `.gltf` or `.glb` file: its name, or `true` for the first one. See below.
        animation: Option<String> = None, Facts::of(Form::TextOrTrue).by_default("none");
        /// Only this glTF node with its children, this OBJ object or group, this solid of an STL, or this object of a
        /// 3MF. Files only.
        node: Option<String> = None, Facts::of(Form::Text).by_default("everything");
        /// Unit of the numbers in the file. Files only.
        units: Option<&'static str> = None, Facts::one_of(&Units::WORDS).by_default("the file's, else mm");
        /// Close holes by fans to their centres. Files only.
        cap_openings: bool = false, Facts::switch();
    }
}

group! {
    /// A shape instead of a file.
    pub struct ShapeKeys in "mesh.shape" {
        /// Radius.
        ball: f64 = 0.0, LONG.key("sphere.radius");
        /// 20 * 4^n triangles.
        ball_divisions: u32 = 5, FINE.key("sphere.subdivisions");
        /// Semi-axes along x, y, z.
        radii: [f64; 3] = [0.0; 3], longs(3).key("ellipsoid.radii");
        /// 20 * 4^n triangles.
        divisions: u32 = 5, FINE.key("ellipsoid.subdivisions");
        /// Radius.
        radius: f64 = 0.0, LONG.key("cylinder.radius");
        /// Length along z.
        length: f64 = 0.0, LONG.key("cylinder.length");
        /// Sides of the polygon that stands for the circle.
        segments: u32 = 96, Facts::whole(3, 4096).key("cylinder.segments");
        /// A CSV file of centre lines with radii, relative to the scene file, as of a `[[flow]]`. Ends are round, and the tubes
        /// of several lines reach into each other.
        line: String = String::new(), Facts::of(Form::Text).required().key("tube.file");
        /// Length by which it is wider than the file says: that of a wall.
        wall: f64 = 0.0, Facts::quantity(&LENGTH, 0.0, 1e3).key("tube.wall");
        /// Sides of the polygon that stands for the circle.
        sides: u32 = 48, Facts::whole(3, 4096).key("tube.segments");
        /// Edges along x, y, z.
        edges: [f64; 3] = [0.0; 3], longs(3).key("box.size");
        /// Edges along x and y of a slab whose front is at z = 0.
        size: [f64; 2] = [0.0; 2], longs(2).key("plane.size");
        /// The slab reaches from z = 0 to here.
        thickness: f64 = 0.0, LONG.key("plane.thickness");
    }
}

/// Meshes read so far.
#[derive(Default)]
pub(super) struct Shelf {
    /// All meshes.
    pub meshes: Vec<Arc<Mesh>>,
    /// Triangles of all of them.
    triangles: usize,
    /// For files that have been read: with which options, and their indices among the meshes.
    read: HashMap<Files, Vec<(Options, Vec<usize>)>>,
}

/// The files from which a mesh is read.
#[derive(Clone, PartialEq, Eq, Hash)]
enum Files {
    One(PathBuf),
    /// Keyframes are read together: vertices must keep their numbers.
    Keyframes(Vec<PathBuf>),
}

/// The shapes of one instance.
pub(super) struct Shapes {
    /// Name of the instance.
    pub name: String,
    /// The first shape.
    pub mesh: usize,
    /// All shapes; empty if the shape is constant.
    pub keyframes: Vec<usize>,
}

impl Shelf {
    /// Reads or builds the shapes that the table of the mesh `name`, at `path` in the file, names.
    pub fn shapes(
        &mut self,
        document: &Document<'_>,
        stated: &Stated,
        name: &str,
        path: &str,
        warnings: &mut Vec<Issue>,
    ) -> Result<Shapes, SceneError> {
        let keys: MeshKeys = stated.get("");
        let given = ["file", "keyframes", "shape"].into_iter().filter(|key| stated.has(key));
        let given: Vec<_> = given.collect();
        if let (Some(mesh), []) = (document.source.given.get(name), &given[..]) {
            let mesh = self.add(name, Mesh::clone(mesh));
            return Ok(Shapes { name: name.to_owned(), mesh, keyframes: Vec::new() });
        }
        let [given] = given[..] else {
            return Err(document.fail(
                path,
                match given[..] {
                    [] => format!("mesh `{name}` has neither `file` nor `keyframes` nor `shape`"),
                    [a, b, ..] => format!("mesh `{name}` has both `{a}` and `{b}`"),
                    [_] => unreachable!("taken above"),
                },
                "give one of them",
            ));
        };
        let folder = document.source.path.parent().unwrap_or(Path::new(""));
        let files = match (&keys.file, &keys.keyframes) {
            (Some(file), _) => Files::One(folder.join(file)),
            (_, Some(files)) => {
                if !(1..=MAX_KEYFRAMES).contains(&files.len()) {
                    return Err(document.fail(
                        &format!("{path}.keyframes"),
                        format!("mesh `{name}` has {} keyframes", files.len()),
                        format!("name 1 to {MAX_KEYFRAMES} files"),
                    ));
                }
                Files::Keyframes(files.iter().map(|file| folder.join(file)).collect())
            }
            (None, None) => {
                let mesh = built(document, stated, name, path)?;
                return Ok(Shapes {
                    name: name.to_owned(),
                    mesh: self.add(name, mesh),
                    keyframes: Vec::new(),
                });
            }
        };
        let options = options(&keys);
        let mut known = self.read.get(&files).into_iter().flatten();
        let meshes = match known.find(|known| known.0 == options) {
            Some((_, meshes)) => meshes.clone(),
            None => {
                let (found, issues) = load(&files, &options)
                    .map_err(|issues| Self::unread(document, &issues, name, path, given))?;
                warnings.extend(issues.into_iter().map(|w| w.of(name)));
                let found = found.into_iter().map(|mesh| self.add(name, mesh));
                let meshes: Vec<_> = found.collect();
                let known = self.read.entry(files.clone()).or_default();
                known.push((options, meshes.clone()));
                meshes
            }
        };
        Ok(Shapes {
            name: name.to_owned(),
            mesh: meshes[0],
            keyframes: match files {
                Files::One(_) => Vec::new(),
                Files::Keyframes(_) => meshes,
            },
        })
    }

    /// The error for mesh files that cannot be used, at the key that names them.
    pub fn unread(
        document: &Document<'_>,
        issues: &[Issue],
        name: &str,
        path: &str,
        given: &str,
    ) -> SceneError {
        let errors: Vec<_> = issues.iter().filter(|i| i.is_error()).collect();
        let causes: Vec<_> =
            errors.iter().map(|e| format!("{}: {}", e.file.display(), e.message)).collect();
        let at = match errors.iter().any(|e| e.message.starts_with("no node")) {
            true => "node",
            false => given,
        };
        document.fail(
            &format!("{path}.{at}"),
            format!("mesh `{name}`: {}", causes.join("; ")),
            errors.first().map_or(String::new(), |e| e.remedy.clone()),
        )
    }

    /// Stores a mesh and returns its number.
    pub fn add(&mut self, name: &str, mesh: Mesh) -> usize {
        self.triangles += mesh.triangles.len();
        self.meshes.push(Arc::new(Mesh { name: name.to_owned(), ..mesh }));
        self.meshes.len() - 1
    }

    /// Fails at the mesh table at `path` if the meshes so far have too many triangles.
    pub fn bounded(&self, document: &Document<'_>, path: &str) -> Result<(), SceneError> {
        affordable(document, path, self.triangles)
    }
}

/// Most triangles of all meshes of a scene, keyframes included: some 4 GB while structures are made.
const MAX_TRIANGLES: usize = 16_000_000;

/// Fails at the mesh table at `path`, with which the scene has so many triangles, if they are too many.
fn affordable(document: &Document<'_>, path: &str, triangles: usize) -> Result<(), SceneError> {
    if triangles <= MAX_TRIANGLES {
        return Ok(());
    }
    Err(document.fail(
        path,
        format!("with this mesh the scene has {triangles} triangles; it may have {MAX_TRIANGLES}"),
        "lower `subdivisions` and `segments` of shapes, reduce meshes in the modeller, or name fewer keyframes",
    ))
}

/// Fails if built-in shapes alone have too many triangles: before one of them is made.
pub(super) fn countable(
    document: &Document<'_>,
    tables: &[Table<MeshKeys>],
) -> Result<(), SceneError> {
    let mut sum = 0usize;
    for (i, Table { stated, .. }) in tables.iter().enumerate() {
        let s: ShapeKeys = stated.get("shape.");
        let has = |kind: &str| stated.has(&format!("shape.{kind}"));
        let divided = |divisions: u32| 20usize << (2 * divisions.min(shapes::MAX_SUBDIVISIONS));
        sum = sum.saturating_add(match () {
            () if has("sphere") => divided(s.ball_divisions),
            () if has("ellipsoid") => divided(s.divisions),
            () if has("cylinder") => 4 * s.segments as usize,
            // How many rings there are its file says: it is counted where it is read.
            () if has("tube") => 0,
            () => 12 * usize::from(has("box") || has("plane")),
        });
        affordable(document, &format!("mesh.{i}"), sum)?;
    }
    Ok(())
}

fn load(files: &Files, options: &Options) -> Result<(Vec<Mesh>, Vec<Issue>), Vec<Issue>> {
    match files {
        Files::One(file) => {
            let (mesh, issues) = mesh::load(file, options)?;
            Ok((vec![mesh], issues))
        }
        Files::Keyframes(files) => mesh::load_keyframes(files, options),
    }
}

/// Options for reading the files of a mesh.
pub(super) fn options(keys: &MeshKeys) -> Options {
    Options {
        units: keys.units.and_then(Units::named),
        node: keys.node.clone(),
        cap_openings: keys.cap_openings,
        ..Options::default()
    }
}

/// A built-in shape, with none of the keys that files take.
fn built(
    document: &Document<'_>,
    stated: &Stated,
    name: &str,
    path: &str,
) -> Result<Mesh, SceneError> {
    let capped = stated.get::<MeshKeys>("").cap_openings;
    let is_extra = |key: &&str| stated.has(key) && (*key != "cap_openings" || capped);
    if let Some(key) = ["units", "node", "cap_openings"].into_iter().find(is_extra) {
        return Err(document.fail(
            &format!("{path}.{key}"),
            format!("mesh `{name}`: `{key}` applies to files, not to shapes"),
            "remove it",
        ));
    }
    let kinds = ["sphere", "ellipsoid", "cylinder", "tube", "box", "plane"];
    let given = kinds.into_iter().filter(|kind| stated.has(&format!("shape.{kind}")));
    let given: Vec<_> = given.collect();
    let s: ShapeKeys = stated.get("shape.");
    Ok(match given[..] {
        ["sphere"] => shapes::sphere(s.ball, s.ball_divisions),
        ["ellipsoid"] => shapes::ellipsoid(s.radii, s.divisions),
        ["cylinder"] => shapes::cylinder(s.radius, s.length, s.segments),
        ["tube"] => tubes(document, &s, name, path)?,
        ["box"] => shapes::cuboid(s.edges),
        ["plane"] => shapes::plane(s.size, s.thickness),
        _ => {
            return Err(document.fail(
                &format!("{path}.shape"),
                format!("mesh `{name}` has {} shapes", given.len()),
                format!("give one of `{}`", kinds.join("`, `")),
            ));
        }
    })
}

/// The tubes around the lines of a file, as one mesh.
fn tubes(
    document: &Document<'_>,
    keys: &ShapeKeys,
    name: &str,
    path: &str,
) -> Result<Mesh, SceneError> {
    let fail = |message: String, remedy: &str| {
        document.fail(
            &format!("{path}.shape.tube.file"),
            format!("mesh `{name}`: {message}"),
            remedy,
        )
    };
    let folder = document.source.path.parent().unwrap_or(Path::new(""));
    let file = folder.join(&keys.line);
    let content = text(&file).map_err(|e| fail(e.to_string(), "check the path of the file"))?;
    let lines = lines::read(&file, &content)?;
    let rings = |line: &Given| line.points.len() + 2 * shapes::END_RINGS as usize;
    let triangles = 2 * keys.sides as usize * lines.iter().map(rings).sum::<usize>();
    affordable(document, path, triangles)?;
    let mut mesh = Mesh::default();
    for Given { points, radii, .. } in lines {
        let Some(radii) = radii else {
            return Err(fail("the file has no radii".to_owned(), "add the column radius_mm"));
        };
        if let Some(i) = points.windows(2).position(|ends| ends[0] == ends[1]) {
            let message = format!("points {} and {} of a line are the same", i + 1, i + 2);
            return Err(fail(message, "give every point once"));
        }
        let wide: Vec<f64> = radii.iter().map(|radius| radius + keys.wall).collect();
        let tube = shapes::tube(&points, &wide, keys.sides);
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(tube.positions);
        mesh.normals.extend(tube.normals);
        mesh.triangles.extend(tube.triangles.iter().map(|t| t.map(|vertex| vertex + first)));
    }
    Ok(mesh)
}
