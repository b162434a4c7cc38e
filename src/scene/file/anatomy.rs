//! Placed meshes and wires of a scene file.

use super::document::Document;
use super::error::SceneError;
use super::placing::placement;
use super::schema::{MeshTable, SurfaceTable, WireTable};
use super::shelf::Shelf;
use super::tissues::Tissues;
use super::within;
use crate::scene::{Instance, Issue, Keyframes, Mesh, Surface, Wire};

/// Distance of a wire's points that no spacing of a scanner resolves and no frame affords.
const MIN_SPACING: f64 = 1e-3;

/// Every mesh where it is placed in its parent, unmoved.
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
        let shapes = shelf.shapes(document, table, &path, warnings)?;
        let place = (table.translate, table.rotate.as_ref(), table.scale);
        instances.push(Instance {
            name: table.name.clone(),
            mesh: shapes.mesh,
            keyframes: Keyframes {
                meshes: shapes.keyframes,
                ..Keyframes::default()
            },
            shown: true,
            tissue,
            priority: table.priority,
            world_from_object: placement(document, &path, place)?,
            surface: surfaces(document, table, default, &path)?,
        });
    }
    Ok((shelf.meshes, instances))
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
