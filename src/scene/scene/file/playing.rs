//! Meshes whose file contains an animation: moving nodes, and shapes over time.

use std::path::Path;

use glam::DAffine3;

use super::document::Document;
use super::error::SceneError;
use super::motion;
use super::shelf::{self, Shapes, Shelf};
use super::table::Stated;
use crate::scene::animation::{Clock, Interpolation, Motion, Sequence};
use crate::scene::graph::{Graph, Node, NodeKind};
use crate::scene::mesh::{self, AnimatedNode, Choice, Placement};
use crate::scene::{Issue, Strategy};
use crate::settings::{Value, group};

group! {
    /// Strategy and interpolation for shapes that change.
    pub struct Following in "" {
        /// Way in which the device follows the shapes.
        strategy: Strategy = Strategy::Exchange, Facts::word::<Strategy>();
        /// Shapes between keyframes: on straight lines, or smoothly. With `interpolate` only.
        interpolation: Interpolation = Interpolation::Linear, Facts::word::<Interpolation>();
    }
}

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

/// Reads the animation that the table of the mesh `name`, at `path` in the file, names.
pub(super) fn read(
    document: &Document<'_>,
    stated: &Stated,
    name: &str,
    path: &str,
    shelf: &mut Shelf,
    warnings: &mut Vec<Issue>,
) -> Result<Option<Playing>, SceneError> {
    let Some(animation) = stated.value("animation") else {
        let keys = ["phase", "loop", "rate", "strategy", "interpolation"];
        return match keys.iter().find(|key| stated.has(key)) {
            None => Ok(None),
            Some(key) => Err(document.fail(
                &format!("{path}.{key}"),
                format!("`{key}` of a mesh applies to its `animation`"),
                "set it on the [[selector]] that is the mesh's parent",
            )),
        };
    };
    let Some(file) = stated.text("file") else {
        return Err(document.fail(
            &format!("{path}.animation"),
            "only a `file` brings an animation",
            "name a .gltf or .glb as `file`",
        ));
    };
    let folder = document.source.path.parent().unwrap_or(Path::new(""));
    let choice = match animation {
        Value::Text(name) => Choice::Named(name),
        _ => Choice::First,
    };
    let options = shelf::options(&stated.get(""));
    let (found, issues) =
        mesh::load_animated(&folder.join(file), &options, choice).map_err(|issues| {
            let about = |i: &Issue| i.is_error() && i.message.contains("animation");
            let key = match issues.iter().any(about) {
                true => "animation",
                false => "file",
            };
            Shelf::unread(document, &issues, name, path, key)
        })?;
    warnings.extend(issues.into_iter().map(|w| w.of(name)));
    let clock = motion::clock(stated, "", motion::lasting(document, path, found.span)?);
    let Following { interpolation, .. } = stated.get("");
    let several = found.meshes.len() > 1;
    let mut meshes: Vec<Played> = Vec::new();
    for mesh in found.meshes {
        let mut name = match several {
            true => format!("{name}/{}", mesh.name),
            false => name.to_owned(),
        };
        // Names need not be unique in the file.
        if meshes.iter().any(|m| m.name == name) {
            name = format!("{name} {}", meshes.len() + 1);
        }
        let times: Vec<f64> = mesh.times.iter().map(|t| t - found.span.0).collect();
        let shapes = mesh.shapes.into_iter().map(|shape| shelf.add(&name, shape));
        meshes.push(Played {
            shapes: shapes.collect(),
            sequence: (!times.is_empty()).then(|| Sequence::timed(clock, &times, interpolation)),
            node: mesh.node,
            name,
        });
    }
    Ok(Some(Playing { clock, start: found.span.0, nodes: found.nodes, meshes }))
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
