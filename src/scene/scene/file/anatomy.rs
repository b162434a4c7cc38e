//! Placed meshes and wires of a scene file.

use std::collections::HashSet;
use std::ops::Range;
use std::sync::Arc;

use glam::DAffine3;

use super::document::Document;
use super::error::SceneError;
use super::nodes::NodeKeys;
use super::placing::{PLACE, placed};
use super::playing::{self, Following, Played, Playing};
use super::shelf::{self, MeshKeys, Shelf};
use super::table::{Stated, Table};
use super::tissues::Tissues;
use crate::scene::{Instance, Issue, Keyframes, Mesh, Origin, Surface, Tissue, Wire};
use crate::settings::group;
use crate::settings::units::{LENGTH, LEVEL};

/// Smallest spacing of a wire's points, mm: no scanner resolves less, and no frame has time for more points.
const MIN_SPACING: f64 = 1e-3;

group! {
    /// A string of point scatterers on a straight line, or one point.
    pub struct WireKeys in "wire" {
        /// One end in the world.
        from: [f64; 3] = [0.0; 3], PLACE.required();
        /// The other end.
        to: Option<[f64; 3]> = None, PLACE.by_default("one point");
        /// Distance of the points, rounded so that both ends have one. All wires together may have 1000000 points.
        spacing: f64 = 0.1, Facts::quantity(&LENGTH, MIN_SPACING, 1e4);
        /// Echo of one point; 0 dB is a perfect flat mirror.
        amplitude: f64 = 0.0, Facts::quantity(&LEVEL, -300.0, 60.0);
    }
}

/// The instances made from a mesh table of the file.
pub(super) struct Placed {
    /// Parent from object, at rest.
    pub rest: DAffine3,
    /// Its instances; several only with an animation.
    pub instances: Range<usize>,
    /// The animation that its file brings.
    pub playing: Option<Playing>,
}

/// The meshes and instances of all mesh tables.
#[derive(Default)]
pub(super) struct Anatomy {
    pub meshes: Vec<Arc<Mesh>>,
    /// Instances, each placed in its parent at rest.
    pub instances: Vec<Instance>,
    /// For each table its instances.
    pub placed: Vec<Placed>,
}

impl Anatomy {
    /// For each instance the place of its description in the file.
    pub fn origins(&self, tables: &[Table<MeshKeys>]) -> Vec<Origin> {
        let of = |(Table { stated, .. }, placed): (&Table<MeshKeys>, &Placed)| {
            let NodeKeys { name, parent } = stated.get("");
            // An animation is switched by the mesh itself.
            let selector = parent.filter(|_| stated.has("keyframes"));
            let origin = Origin { mesh: name, selector };
            std::iter::repeat_n(origin, placed.instances.len())
        };
        tables.iter().zip(&self.placed).flat_map(of).collect()
    }
}

/// Reads every mesh.
pub(super) fn meshes(
    document: &Document<'_>,
    tables: &[Table<MeshKeys>],
    tissues: &mut Tissues<'_>,
    warnings: &mut Vec<Issue>,
) -> Result<Anatomy, SceneError> {
    shelf::countable(document, tables)?;
    let mut shelf = Shelf::default();
    let mut out = Anatomy::default();
    let mut names = HashSet::new();
    for (i, Table { stated, .. }) in tables.iter().enumerate() {
        let path = format!("mesh.{i}");
        let NodeKeys { name, .. } = stated.get("");
        let keys: MeshKeys = stated.get("");
        if names.contains(&name) {
            return Err(document.fail(
                &format!("{path}.name"),
                format!("there are two meshes named `{name}`"),
                "give each its own name",
            ));
        }
        let tissue = tissues.index(&format!("{path}.tissue"), &keys.tissue)?;
        let surface = surfaces(stated, tissues.get(tissue));
        let playing = playing::read(document, stated, &name, &path, &mut shelf, warnings)?;
        let shapes = match &playing {
            Some(playing) => playing.meshes.iter().map(Played::shapes).collect(),
            None => vec![shelf.shapes(document, stated, &name, &path, warnings)?],
        };
        shelf.bounded(document, &path)?;
        let rest = placed(document, &path, stated)?;
        let first = out.instances.len();
        for shapes in shapes {
            names.insert(shapes.name.clone());
            out.instances.push(Instance {
                name: shapes.name,
                mesh: shapes.mesh,
                keyframes: Keyframes {
                    meshes: shapes.keyframes,
                    strategy: stated.get::<Following>("").strategy,
                    ..Keyframes::default()
                },
                shown: true,
                tissue,
                priority: keys.priority,
                world_from_object: rest,
                surface,
            });
        }
        out.placed.push(Placed { rest, instances: first..out.instances.len(), playing });
    }
    out.meshes = shelf.meshes;
    Ok(out)
}

/// Echo properties of a mesh of this tissue, from outside and from inside: the tissue's, but for what its table states.
pub(super) fn surfaces(stated: &Stated, tissue: &Tissue) -> [Surface; 2] {
    let mut outside = tissue.surface;
    stated.put("", &mut outside);
    let mut inside = outside;
    stated.put("inside.", &mut inside);
    [outside, inside]
}

/// Fails if the placed wires have more points than a frame may have.
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

pub(super) fn wires(tables: &[Table<WireKeys>]) -> Vec<Wire> {
    let wire = |table: &Table<WireKeys>| {
        let WireKeys { from, to, spacing, amplitude } = table.stated.get("");
        let ends = [from, to.unwrap_or(from)];
        Wire { ends, spacing, amplitude: 10f64.powf(amplitude / 20.0) }
    };
    tables.iter().map(wire).collect()
}
