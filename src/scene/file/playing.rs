//! Meshes whose file contains an animation: moving nodes, and shapes over time.

use std::path::Path;

use glam::DAffine3;

use super::document::Document;
use super::error::SceneError;
use super::motion;
use super::schema::{AnimationName, MeshTable};
use super::shelf::{Shapes, Shelf};
use crate::scene::Issue;
use crate::scene::animation::{Clock, Interpolation, Motion, Sequence};
use crate::scene::graph::{Graph, Node, NodeKind};
use crate::scene::mesh::{self, AnimatedNode, Choice, Placement};

/// The animation of one mesh table, as read from its file.
pub(super) struct Playing {
    clock: Clock,
    /// The begin of the animation, in the file's time, s.
    start: f64,
    nodes: Vec<AnimatedNode>,
    /// The meshes that it moves.
    pub meshes: Vec<Played>,
}

/// A mesh of an animation.
pub(super) struct Played {
    /// Name of its instance.
    name: String,
    /// Its shapes, among all meshes; at least one.
    shapes: Vec<usize>,
    /// Their order over time; none where there is one at all times.
    pub sequence: Option<Sequence>,
    /// The node that bears it; none: the file's scene.
    node: Option<usize>,
}

/// Reads the animation that `table`, at `path` in the file, names.
pub(super) fn read(
    document: &Document<'_>,
    table: &MeshTable,
    path: &str,
    shelf: &mut Shelf,
    warnings: &mut Vec<Issue>,
) -> Result<Option<Playing>, SceneError> {
    let Some(animation) = &table.animation else {
        let keys = [
            ("phase", table.phase.is_some()),
            ("loop", table.mode.is_some()),
            ("rate", table.rate.is_some()),
            ("strategy", table.strategy.is_some()),
            ("interpolation", table.interpolation.is_some()),
        ];
        return match keys.iter().find(|k| k.1) {
            None => Ok(None),
            Some((key, _)) => Err(document.fail(
                &format!("{path}.{key}"),
                format!("`{key}` of a mesh applies to its `animation`"),
                "set it on the [[selector]] that is the mesh's parent",
            )),
        };
    };
    let Some(file) = &table.file else {
        return Err(document.fail(
            &format!("{path}.animation"),
            "only a `file` brings an animation",
            "name a .gltf or .glb as `file`",
        ));
    };
    let folder = document.source.path.parent().unwrap_or(Path::new(""));
    let choice = match animation {
        AnimationName::First => Choice::First,
        AnimationName::Named(name) => Choice::Named(name),
    };
    let (found, issues) = mesh::load_animated(&folder.join(file), &Shelf::options(table), choice)
        .map_err(|issues| {
        let about = |i: &Issue| i.is_error() && i.message.contains("animation");
        let key = match issues.iter().any(about) {
            true => "animation",
            false => "file",
        };
        Shelf::unread(document, &issues, &table.name, path, key)
    })?;
    warnings.extend(issues.into_iter().map(|w| w.of(&table.name)));
    let (start, end) = found.span;
    // A single keyframe is a constant state: any period will do.
    let period = if end > start { end - start } else { 1.0 };
    let settings = (table.phase, table.mode, table.rate);
    let clock = motion::clock(document, path, period, settings)?;
    let interpolation = table.interpolation.unwrap_or(Interpolation::Linear);
    let several = found.meshes.len() > 1;
    let mut meshes: Vec<Played> = Vec::new();
    for mesh in found.meshes {
        let mut name = match several {
            true => format!("{}/{}", table.name, mesh.name),
            false => table.name.clone(),
        };
        // Names need not be unique in the file.
        if meshes.iter().any(|m| m.name == name) {
            name = format!("{name} {}", meshes.len() + 1);
        }
        let times: Vec<f64> = mesh.times.iter().map(|t| t - start).collect();
        let shapes = mesh.shapes.into_iter().map(|shape| shelf.add(&name, shape));
        meshes.push(Played {
            shapes: shapes.collect(),
            sequence: (!times.is_empty()).then(|| Sequence::timed(clock, &times, interpolation)),
            node: mesh.node,
            name,
        });
    }
    Ok(Some(Playing { clock, start, nodes: found.nodes, meshes }))
}

impl Played {
    /// The shapes of its instance.
    pub fn shapes(&self) -> Shapes {
        Shapes {
            name: self.name.clone(),
            mesh: self.shapes[0],
            keyframes: match &self.sequence {
                Some(_) => self.shapes.clone(),
                None => Vec::new(),
            },
        }
    }
}

impl Playing {
    /// Adds the file's nodes and meshes below the node `root` of the graph; the meshes' instances
    /// have the numbers from `first` on.
    pub fn grow(self, graph: &mut Graph, root: usize, first: usize) {
        let base = graph.nodes.len();
        let name = graph.nodes[root].name.clone();
        for node in self.nodes {
            let (rest, motion) = match node.placement {
                Placement::Fixed(rest) => (rest, Motion::Still),
                Placement::Moving { rest, track } => (
                    DAffine3::IDENTITY,
                    Motion::Track {
                        clock: self.clock,
                        start: self.start,
                        rest,
                        track: Box::new(track),
                    },
                ),
            };
            graph.nodes.push(Node {
                name: format!("{name}/{}", node.name),
                parent: Some(node.parent.map_or(root, |p| base + p)),
                alternative: None,
                kind: NodeKind::Transform { rest, motion },
            });
        }
        for (mesh, instance) in self.meshes.into_iter().zip(first..) {
            let mut parent = mesh.node.map_or(root, |n| base + n);
            let mut add = |parent, kind| {
                graph.nodes.push(Node {
                    name: mesh.name.clone(),
                    parent: Some(parent),
                    alternative: None,
                    kind,
                });
                graph.nodes.len() - 1
            };
            if let Some(sequence) = mesh.sequence {
                parent = add(parent, NodeKind::Selector(sequence));
            }
            let rest = DAffine3::IDENTITY;
            add(parent, NodeKind::Mesh { instance, rest });
        }
    }
}
