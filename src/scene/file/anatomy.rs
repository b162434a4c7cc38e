//! Meshes, shapes and wires of a scene file.

use std::path::PathBuf;

use glam::{DAffine3, DQuat, DVec3};

use super::document::Document;
use super::error::SceneError;
use super::schema::{MeshTable, Shape, SurfaceTable, UnitName, WireTable};
use super::tissues::Tissues;
use super::within;
use crate::scene::mesh::{self, Units};
use crate::scene::{Instance, Issue, Keyframes, Mesh, Surface, Wire, shapes};

/// Distance of a wire's points that no spacing of a scanner resolves and no frame affords.
const MIN_SPACING: f64 = 1e-3;

/// Meshes read so far: a file that several instances name is read once.
#[derive(Default)]
struct Shelf {
    meshes: Vec<Mesh>,
    keys: Vec<Option<(PathBuf, mesh::Options)>>,
}

pub(super) fn meshes(
    document: &Document<'_>,
    tables: &[MeshTable],
    tissues: &mut Tissues<'_>,
    warnings: &mut Vec<Issue>,
) -> Result<(Vec<Mesh>, Vec<Instance>), SceneError> {
    let mut shelf = Shelf::default();
    let mut instances: Vec<Instance> = Vec::new();
    for (i, table) in tables.iter().enumerate() {
        let path = format!("mesh.{i}");
        if instances.iter().any(|other| other.name == table.name) {
            return Err(document.fail(
                &format!("{path}.name"),
                format!("there are two meshes named `{}`", table.name),
                "give each its own name",
            ));
        }
        let tissue = tissues.index(&format!("{path}.tissue"), &table.tissue)?;
        let default = tissues.get(tissue).default_surface();
        instances.push(Instance {
            name: table.name.clone(),
            mesh: source(document, table, &path, &mut shelf, warnings)?,
            keyframes: Keyframes::default(),
            shown: true,
            tissue,
            priority: table.priority,
            world_from_object: placement(document, table, &path)?,
            surface: surfaces(document, table, default, &path)?,
        });
    }
    Ok((shelf.meshes, instances))
}

fn source(
    document: &Document<'_>,
    table: &MeshTable,
    path: &str,
    shelf: &mut Shelf,
    warnings: &mut Vec<Issue>,
) -> Result<usize, SceneError> {
    let name = &table.name;
    let (key, mesh) = match (&table.file, &table.shape) {
        (Some(file), None) => {
            let units = table.units.map(length_of);
            let options = mesh::Options {
                units,
                node: table.node.clone(),
                cap_openings: table.cap_openings,
                ..mesh::Options::default()
            };
            let full = document
                .source
                .path
                .parent()
                .map_or_else(|| file.into(), |p| p.join(file));
            let key = (full, options);
            if let Some(i) = shelf.keys.iter().position(|k| k.as_ref() == Some(&key)) {
                return Ok(i);
            }
            let found = mesh::load(&key.0, &key.1).map_err(|issues| {
                let errors: Vec<_> = issues.iter().filter(|i| i.is_error()).collect();
                let causes: Vec<_> = errors
                    .iter()
                    .map(|e| format!("{}: {}", e.file.display(), e.message))
                    .collect();
                let at = match errors.iter().any(|e| e.message.starts_with("no node")) {
                    true => "node",
                    false => "file",
                };
                document.fail(
                    &format!("{path}.{at}"),
                    format!("mesh `{name}`: {}", causes.join("; ")),
                    errors.first().map_or(String::new(), |e| e.remedy.clone()),
                )
            })?;
            warnings.extend(found.1.into_iter().map(|w| w.of(name)));
            (Some(key), found.0)
        }
        (None, Some(shape)) => {
            let extra = [
                ("units", table.units.is_some()),
                ("node", table.node.is_some()),
                ("cap_openings", table.cap_openings),
            ];
            if let Some((key, _)) = extra.iter().find(|e| e.1) {
                return Err(document.fail(
                    &format!("{path}.{key}"),
                    format!("mesh `{name}`: `{key}` applies to files, not to shapes"),
                    "remove it",
                ));
            }
            (None, build(document, shape, &format!("{path}.shape"))?)
        }
        (given, _) => {
            return Err(document.fail(
                path,
                match given {
                    Some(_) => format!("mesh `{name}` has both `file` and `shape`"),
                    None => format!("mesh `{name}` has neither `file` nor `shape`"),
                },
                "give one of them",
            ));
        }
    };
    shelf.meshes.push(Mesh {
        name: name.clone(),
        ..mesh
    });
    shelf.keys.push(key);
    Ok(shelf.meshes.len() - 1)
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
        within(
            document,
            &format!("{path}.{key}"),
            f64::from(v),
            least,
            most,
            "",
        )?;
        Ok(v)
    };
    let fine = shapes::MAX_SUBDIVISIONS;
    Ok(match shape {
        Shape::Sphere {
            radius,
            subdivisions,
        } => shapes::sphere(
            long("sphere.radius", radius.0)?,
            count("sphere.subdivisions", *subdivisions, 0, fine)?,
        ),
        Shape::Ellipsoid {
            radii,
            subdivisions,
        } => {
            for r in radii {
                long("ellipsoid.radii", r.0)?;
            }
            let n = count("ellipsoid.subdivisions", *subdivisions, 0, fine)?;
            shapes::ellipsoid(radii.map(|r| r.0), n)
        }
        Shape::Cylinder {
            radius,
            length,
            segments,
        } => shapes::cylinder(
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

/// World from object: scale, then rotate, then translate.
fn placement(
    document: &Document<'_>,
    table: &MeshTable,
    path: &str,
) -> Result<DAffine3, SceneError> {
    let scale = table.scale.unwrap_or(1.0);
    within(document, &format!("{path}.scale"), scale, 1e-6, 1e6, "")?;
    let rotation = match &table.rotate {
        Some(rotation) => {
            let axis = DVec3::from(rotation.axis).try_normalize().ok_or_else(|| {
                let remedy = "give a vector such as [0, 0, 1]";
                document.fail(
                    &format!("{path}.rotate.axis"),
                    "this axis has no length",
                    remedy,
                )
            })?;
            within(
                document,
                &format!("{path}.rotate.angle"),
                rotation.angle.0,
                -1e3,
                1e3,
                "rad",
            )?;
            DQuat::from_axis_angle(axis, rotation.angle.0)
        }
        None => DQuat::IDENTITY,
    };
    let translate = table.translate.map_or([0.0; 3], |t| t.map(|q| q.0));
    for v in translate {
        within(document, &format!("{path}.translate"), v, -1e5, 1e5, "mm")?;
    }
    Ok(DAffine3::from_scale_rotation_translation(
        DVec3::splat(scale),
        rotation,
        translate.into(),
    ))
}

fn surfaces(
    document: &Document<'_>,
    table: &MeshTable,
    default: Surface,
    path: &str,
) -> Result<[Surface; 2], SceneError> {
    let front = SurfaceTable {
        roughness: table.roughness,
        thickness: table.thickness,
        specularity: table.specularity,
        surface_gain: table.surface_gain,
    };
    let outside = surface(document, &front, default, path)?;
    let inside = surface(document, &table.inside, outside, &format!("{path}.inside"))?;
    Ok([outside, inside])
}

fn surface(
    document: &Document<'_>,
    table: &SurfaceTable,
    default: Surface,
    path: &str,
) -> Result<Surface, SceneError> {
    let out = Surface {
        roughness: table.roughness.unwrap_or(default.roughness),
        thickness: table.thickness.map_or(default.thickness, |q| q.0),
        specularity: table.specularity.unwrap_or(default.specularity),
        gain: table.surface_gain.map_or(default.gain, |q| q.0),
    };
    for (key, value, (least, most), unit) in [
        ("roughness", out.roughness, (0.0, f64::INFINITY), ""),
        ("thickness", out.thickness, (0.0, 10.0), "mm"),
        ("specularity", out.specularity, (0.0, 1e6), ""),
        ("surface_gain", out.gain, (f64::NEG_INFINITY, 200.0), "dB"),
    ] {
        within(document, &format!("{path}.{key}"), value, least, most, unit)?;
    }
    Ok(out)
}

pub(super) fn wires(
    document: &Document<'_>,
    tables: &[WireTable],
) -> Result<Vec<Wire>, SceneError> {
    let mut out = Vec::new();
    for (i, table) in tables.iter().enumerate() {
        let from = table.from.map(|q| q.0);
        let to = table.to.map_or(from, |t| t.map(|q| q.0));
        for v in from.into_iter().chain(to) {
            within(document, &format!("wire.{i}"), v, -1e5, 1e5, "mm")?;
        }
        let spacing = table.spacing.map_or(0.1, |q| q.0);
        within(
            document,
            &format!("wire.{i}.spacing"),
            spacing,
            MIN_SPACING,
            1e4,
            "mm",
        )?;
        within(
            document,
            &format!("wire.{i}.amplitude"),
            table.amplitude.0,
            -300.0,
            60.0,
            "dB",
        )?;
        out.push(Wire {
            ends: [from, to],
            spacing,
            amplitude: 10f64.powf(table.amplitude.0 / 20.0),
        });
    }
    Ok(out)
}
