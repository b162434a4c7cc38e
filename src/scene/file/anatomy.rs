//! Placed meshes and wires of a scene file.

use std::collections::HashSet;
use std::ops::Range;

use glam::DAffine3;

use super::document::Document;
use super::error::SceneError;
use super::placing::placed;
use super::playing::{self, Played, Playing};
use super::schema::{MeshTable, WireTable};
use super::shelf::{self, Shelf};
use super::table::Table;
use super::tissues::Tissues;
use super::within;
use crate::scene::{Instance, Issue, Keyframes, Mesh, Origin, Surface, Wire};

/// Distance of a wire's points that no spacing of a scanner resolves and no frame affords.
const MIN_SPACING: f64 = 1e-3;

/// What a mesh table of the file has become.
pub(super) struct Placed {
    /// Parent from object, unmoved.
    pub rest: DAffine3,
    /// Its instances; several only with an animation.
    pub instances: Range<usize>,
    /// The animation that its file brings.
    pub playing: Option<Playing>,
}

/// What all mesh tables hold.
#[derive(Default)]
pub(super) struct Anatomy {
    pub meshes: Vec<Mesh>,
    /// Where they are in their parents, unmoved.
    pub instances: Vec<Instance>,
    /// By table.
    pub placed: Vec<Placed>,
}

impl Anatomy {
    /// Where the file describes each instance.
    pub fn origins(&self, tables: &[Table<Surface, MeshTable>]) -> Vec<Origin> {
        let of = |(Table { other: table, .. }, placed): (&Table<Surface, MeshTable>, &Placed)| {
            let origin = Origin {
                mesh: table.name.clone(),
                // What switches an animation is the mesh's own.
                selector: table.parent.clone().filter(|_| table.keyframes.is_some()),
            };
            std::iter::repeat_n(origin, placed.instances.len())
        };
        tables.iter().zip(&self.placed).flat_map(of).collect()
    }
}

/// Reads every mesh.
pub(super) fn meshes(
    document: &Document<'_>,
    tables: &[Table<Surface, MeshTable>],
    tissues: &mut Tissues<'_>,
    warnings: &mut Vec<Issue>,
) -> Result<Anatomy, SceneError> {
    shelf::countable(document, tables.iter().map(|table| &table.other))?;
    let mut shelf = Shelf::default();
    let mut out = Anatomy::default();
    let mut names = HashSet::new();
    for (i, Table { stated, other: table }) in tables.iter().enumerate() {
        let path = format!("mesh.{i}");
        if names.contains(&table.name) {
            return Err(document.fail(
                &format!("{path}.name"),
                format!("there are two meshes named `{}`", table.name),
                "give each its own name",
            ));
        }
        let tissue = tissues.index(&format!("{path}.tissue"), &table.tissue)?;
        let mut outside = tissues.get(tissue).surface;
        let playing = playing::read(document, table, &path, &mut shelf, warnings)?;
        let shapes = match &playing {
            Some(playing) => playing.meshes.iter().map(Played::shapes).collect(),
            None => vec![shelf.shapes(document, table, &path, warnings)?],
        };
        shelf.bounded(document, &path)?;
        let place = (table.translate, table.rotate.as_ref(), table.scale);
        let rest = placed(document, &path, table.matrix, place)?;
        stated.put(document, &path, &mut outside)?;
        let mut inside = outside;
        table.inside.stated.put(document, &format!("{path}.inside"), &mut inside)?;
        let first = out.instances.len();
        for shapes in shapes {
            names.insert(shapes.name.clone());
            out.instances.push(Instance {
                name: shapes.name,
                mesh: shapes.mesh,
                keyframes: Keyframes {
                    meshes: shapes.keyframes,
                    strategy: table.strategy.unwrap_or_default(),
                    ..Keyframes::default()
                },
                shown: true,
                tissue,
                priority: table.priority,
                world_from_object: rest,
                surface: [outside, inside],
            });
        }
        out.placed.push(Placed { rest, instances: first..out.instances.len(), playing });
    }
    out.meshes = shelf.meshes;
    Ok(out)
}

/// The placed wires have no more points than a frame affords.
pub(super) fn countable(document: &Document<'_>, wires: &[Wire]) -> Result<(), SceneError> {
    let counts = wires.iter().map(Wire::asks_for);
    let (sum, most) = (counts.clone().sum::<f64>(), f64::from(Wire::MOST));
    let longest = (0..).zip(counts).max_by(|(_, a), (_, b)| a.total_cmp(b));
    match longest {
        Some((i, count)) if sum > most => Err(document.fail(
            &format!("wire.{i}"),
            format!("wires have {sum} points, this one {count}; all of them may have {most}"),
            "widen its `spacing`, or bring its ends together; `[model]` scales wires, too",
        )),
        _ => Ok(()),
    }
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
        within(document, &format!("wire.{i}.spacing"), spacing, MIN_SPACING, 1e4, "mm")?;
        within(document, &format!("wire.{i}.amplitude"), table.amplitude.0, -300.0, 60.0, "dB")?;
        out.push(Wire {
            ends: [from, to],
            spacing,
            amplitude: 10f64.powf(table.amplitude.0 / 20.0),
        });
    }
    Ok(out)
}
