//! Shapes of a scene file: mesh files, keyframes, and built-in shapes. What several instances name
//! is read once.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use super::document::Document;
use super::error::SceneError;
use super::schema::{MeshTable, Shape, UnitName};
use super::within;
use crate::scene::mesh::{self, Options, Units};
use crate::scene::{Issue, Mesh, shapes};

/// Most keyframes of a mesh: 30 a second for half a minute.
const MAX_KEYFRAMES: usize = 1000;

/// Meshes read so far.
#[derive(Default)]
pub(super) struct Shelf {
    /// All of them.
    pub meshes: Vec<Mesh>,
    /// Triangles of all of them.
    triangles: usize,
    /// For files that have been read: with which options, and where they lie among the meshes.
    read: HashMap<Files, Vec<(Options, Vec<usize>)>>,
}

/// What a mesh is made of.
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
    /// The one at first.
    pub mesh: usize,
    /// All of them; empty where the shape is constant.
    pub keyframes: Vec<usize>,
}

impl Shelf {
    /// Reads or builds what `table`, at `path` in the file, names.
    pub fn shapes(
        &mut self,
        document: &Document<'_>,
        table: &MeshTable,
        path: &str,
        warnings: &mut Vec<Issue>,
    ) -> Result<Shapes, SceneError> {
        let name = &table.name;
        let given = [
            ("file", table.file.is_some()),
            ("keyframes", table.keyframes.is_some()),
            ("shape", table.shape.is_some()),
        ];
        let given: Vec<_> = given.iter().filter(|g| g.1).map(|g| g.0).collect();
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
        let files = match (&table.file, &table.keyframes, &table.shape) {
            (Some(file), ..) => Files::One(folder.join(file)),
            (_, Some(files), _) => {
                if !(1..=MAX_KEYFRAMES).contains(&files.len()) {
                    return Err(document.fail(
                        &format!("{path}.keyframes"),
                        format!("mesh `{name}` has {} keyframes", files.len()),
                        format!("name 1 to {MAX_KEYFRAMES} files"),
                    ));
                }
                Files::Keyframes(files.iter().map(|file| folder.join(file)).collect())
            }
            (_, _, shape) => {
                let shape = shape.as_ref().expect("one of the three is given");
                let mesh = built(document, table, shape, path)?;
                return Ok(Shapes {
                    name: name.clone(),
                    mesh: self.add(name, mesh),
                    keyframes: Vec::new(),
                });
            }
        };
        let options = Self::options(table);
        let known = self.read.get(&files).into_iter().flatten();
        let known = known.clone().find(|(o, _)| *o == options);
        let meshes = match known {
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
            name: name.clone(),
            mesh: meshes[0],
            keyframes: match files {
                Files::One(_) => Vec::new(),
                Files::Keyframes(_) => meshes,
            },
        })
    }

    /// How the files of `table` are read.
    pub fn options(table: &MeshTable) -> Options {
        Options {
            units: table.units.map(length_of),
            node: table.node.clone(),
            cap_openings: table.cap_openings,
            ..Options::default()
        }
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

    /// Keeps a mesh; its number.
    pub fn add(&mut self, name: &str, mesh: Mesh) -> usize {
        self.triangles += mesh.triangles.len();
        self.meshes.push(Mesh { name: name.to_owned(), ..mesh });
        self.meshes.len() - 1
    }

    /// Fails at the mesh table at `path` where the meshes so far have too many triangles.
    pub fn bounded(&self, document: &Document<'_>, path: &str) -> Result<(), SceneError> {
        affordable(document, path, self.triangles)
    }
}

/// Most triangles of all meshes of a scene, keyframes included: some 4 GB while structures are made.
const MAX_TRIANGLES: usize = 16_000_000;

/// Fails at the mesh table at `path`, with which the scene has so many triangles, where they are too many.
fn affordable(document: &Document<'_>, path: &str, triangles: usize) -> Result<(), SceneError> {
    if triangles <= MAX_TRIANGLES {
        return Ok(());
    }
    Err(document.fail(
        path,
        format!("with this mesh the scene has {triangles} triangles; it may have {MAX_TRIANGLES}"),
        "lower `subdivisions` of shapes, reduce meshes in the modeller, or name fewer keyframes",
    ))
}

/// Fails where built-in shapes alone have too many triangles: before one of them is made.
pub(super) fn countable<'t>(
    document: &Document<'_>,
    tables: impl Iterator<Item = &'t MeshTable>,
) -> Result<(), SceneError> {
    let mut sum = 0usize;
    for (i, table) in tables.enumerate() {
        sum = sum.saturating_add(table.shape.as_ref().map_or(0, |shape| match shape {
            // Out of its range it is refused for that.
            Shape::Sphere { subdivisions, .. } | Shape::Ellipsoid { subdivisions, .. } => {
                20 << (2 * (*subdivisions).min(shapes::MAX_SUBDIVISIONS))
            }
            Shape::Cylinder { segments, .. } => 4 * *segments as usize,
            Shape::Box { .. } | Shape::Plane { .. } => 12,
        }));
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

/// A built-in shape, with none of the keys that files take.
fn built(
    document: &Document<'_>,
    table: &MeshTable,
    shape: &Shape,
    path: &str,
) -> Result<Mesh, SceneError> {
    let extra = [
        ("units", table.units.is_some()),
        ("node", table.node.is_some()),
        ("cap_openings", table.cap_openings),
    ];
    if let Some((key, _)) = extra.iter().find(|e| e.1) {
        return Err(document.fail(
            &format!("{path}.{key}"),
            format!("mesh `{}`: `{key}` applies to files, not to shapes", table.name),
            "remove it",
        ));
    }
    build(document, shape, &format!("{path}.shape"))
}

fn length_of(unit: UnitName) -> Units {
    let name = match unit {
        UnitName::Um => "um",
        UnitName::Mm => "mm",
        UnitName::Cm => "cm",
        UnitName::M => "m",
        UnitName::In => "in",
    };
    Units::named(name).expect("every unit of the schema has a length")
}

fn build(document: &Document<'_>, shape: &Shape, path: &str) -> Result<Mesh, SceneError> {
    let long = |key: &str, v: f64| {
        within(document, &format!("{path}.{key}"), v, 1e-3, 1e4, "mm")?;
        Ok(v)
    };
    let count = |key: &str, v: u32, least: u32, most: u32| {
        let (least, most) = (f64::from(least), f64::from(most));
        within(document, &format!("{path}.{key}"), f64::from(v), least, most, "")?;
        Ok(v)
    };
    let fine = shapes::MAX_SUBDIVISIONS;
    Ok(match shape {
        Shape::Sphere { radius, subdivisions } => shapes::sphere(
            long("sphere.radius", radius.0)?,
            count("sphere.subdivisions", *subdivisions, 0, fine)?,
        ),
        Shape::Ellipsoid { radii, subdivisions } => {
            for r in radii {
                long("ellipsoid.radii", r.0)?;
            }
            let n = count("ellipsoid.subdivisions", *subdivisions, 0, fine)?;
            shapes::ellipsoid(radii.map(|r| r.0), n)
        }
        Shape::Cylinder { radius, length, segments } => shapes::cylinder(
            long("cylinder.radius", radius.0)?,
            long("cylinder.length", length.0)?,
            count("cylinder.segments", *segments, 3, 4096)?,
        ),
        Shape::Box { size } => {
            for s in size {
                long("box.size", s.0)?;
            }
            shapes::cuboid(size.map(|s| s.0))
        }
        Shape::Plane { size, thickness } => {
            for s in size {
                long("plane.size", s.0)?;
            }
            shapes::plane(size.map(|s| s.0), long("plane.thickness", thickness.0)?)
        }
    })
}
