//! The scene graph: groups, transforms and selectors over meshes, and its evaluation at a time into
//! the flat list of instances that a frame depends on.

use glam::DAffine3;

use super::animation::{Motion, Sequence};
use super::{Instance, Scene, Strategy};

/// Nodes, each after its parent.
#[derive(Clone, Debug, Default)]
pub struct Graph {
    /// In any order in which parents come before their children.
    pub nodes: Vec<Node>,
}

/// A node with its place in the graph.
#[derive(Clone, Debug)]
pub struct Node {
    /// Name in messages, and for overrides; unique.
    pub name: String,
    /// Index of the parent, which is less than this node's own; none: the world.
    pub parent: Option<usize>,
    /// Where the parent is a selector: the number of its choice with which this node is shown. None
    /// where it is shown with every choice: keyframed meshes, which change with it.
    pub alternative: Option<usize>,
    /// What it does.
    pub kind: NodeKind,
}

/// What a node does to those below it.
#[derive(Clone, Debug)]
pub enum NodeKind {
    /// Nothing: a common name.
    Group,
    /// Places and moves: world from child is world from parent times `rest` times the motion.
    Transform {
        /// Placement at rest, parent from child.
        rest: DAffine3,
        /// Movement over time.
        motion: Motion,
    },
    /// Shows one of its alternatives, with all below it, and one keyframe of its keyframed meshes.
    Selector(
        /// Which, and when.
        Sequence,
    ),
    /// A placed mesh.
    Mesh {
        /// Index into [`Scene::instances`].
        instance: usize,
        /// Parent from object.
        rest: DAffine3,
    },
}

/// What an instance's place follows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Carrier {
    /// The nearest transform above it that moves, by node.
    pub mover: Option<usize>,
    /// Placements from there down that are not the identity, outermost first. Instances that agree in
    /// both keep their places relative to each other.
    pub within: Vec<DAffine3>,
    /// Whether a selector shows it at some times only.
    pub switched: bool,
}

/// A node at a time.
struct State {
    world: DAffine3,
    shown: bool,
}

impl Graph {
    /// Writes placement, visibility and shape of every mesh at `seconds` into `instances`, by its
    /// instance's own strategy.
    fn evaluate(&self, seconds: f64, instances: &mut [Instance]) {
        let mut states: Vec<State> = Vec::with_capacity(self.nodes.len());
        for node in &self.nodes {
            let (mut world, mut shown) = (DAffine3::IDENTITY, true);
            let mut sequence = None;
            if let Some(parent) = node.parent {
                (world, shown) = (states[parent].world, states[parent].shown);
                if let NodeKind::Selector(s) = &self.nodes[parent].kind {
                    shown &= node.alternative.is_none_or(|own| own == s.step(seconds));
                    sequence = Some(s);
                }
            }
            match &node.kind {
                NodeKind::Group | NodeKind::Selector(_) => {}
                NodeKind::Transform { rest, motion } => world *= *rest * motion.at(seconds),
                NodeKind::Mesh { instance, rest } => {
                    let instance = &mut instances[*instance];
                    instance.world_from_object = world * *rest;
                    instance.shown = shown;
                    if !instance.keyframes.meshes.is_empty() {
                        let sequence = sequence.expect("keyframes lie under a selector");
                        choose(instance, sequence, seconds);
                    }
                }
            }
            states.push(State { world, shown });
        }
    }

    /// What each of `count` instances follows; nothing for those that are not in the graph.
    pub fn carriers(&self, count: usize) -> Vec<Carrier> {
        let mut of_nodes: Vec<Carrier> = Vec::with_capacity(self.nodes.len());
        let mut carriers = vec![Carrier::default(); count];
        for (number, node) in self.nodes.iter().enumerate() {
            let above = node.parent.map(|parent| of_nodes[parent].clone());
            let mut carrier = above.unwrap_or_default();
            carrier.switched |= node.alternative.is_some();
            match &node.kind {
                NodeKind::Transform { motion, .. } if !matches!(motion, Motion::Still) => {
                    carrier.mover = Some(number);
                    carrier.within.clear();
                }
                NodeKind::Transform { rest, .. } | NodeKind::Mesh { rest, .. } => {
                    let moves = *rest != DAffine3::IDENTITY;
                    carrier.within.extend(moves.then_some(*rest));
                }
                NodeKind::Group | NodeKind::Selector(_) => {}
            }
            if let NodeKind::Mesh { instance, .. } = node.kind {
                carriers[instance] = carrier.clone();
            }
            of_nodes.push(carrier);
        }
        carriers
    }

    /// What has to hold for an instance to be shown: selectors, by node, and the choice of each.
    pub(super) fn conditions(&self, instance: usize) -> Vec<(usize, usize)> {
        let is_it =
            |n: &Node| matches!(n.kind, NodeKind::Mesh { instance: i, .. } if i == instance);
        let mut out = Vec::new();
        let mut at = self.nodes.iter().position(is_it);
        while let Some(node) = at.map(|i| &self.nodes[i]) {
            out.extend(node.parent.zip(node.alternative));
            at = node.parent;
        }
        out
    }

    /// The selector, by node, that switches an instance's keyframes.
    pub(super) fn switch_of(&self, instance: usize) -> Option<usize> {
        let is_it =
            |n: &Node| matches!(n.kind, NodeKind::Mesh { instance: i, .. } if i == instance);
        let node = self.nodes.iter().find(|n| is_it(n))?;
        let parent = node.parent?;
        matches!(self.nodes[parent].kind, NodeKind::Selector(_)).then_some(parent)
    }
}

/// Takes the present keyframe, or the place between keyframes.
fn choose(instance: &mut Instance, sequence: &Sequence, seconds: f64) {
    let keyframes = &mut instance.keyframes;
    assert_eq!(
        keyframes.meshes.len(),
        sequence.count(),
        "one for each turn"
    );
    keyframes.blend = match keyframes.strategy {
        Strategy::Interpolate => sequence.blend(seconds),
        _ => [(sequence.step(seconds), 1.0), (0, 0.0), (0, 0.0), (0, 0.0)],
    };
    instance.mesh = keyframes.meshes[keyframes.nearest()];
}

impl Scene {
    /// Moves everything to where it is at `seconds`: placements, what selectors show, and shapes.
    /// Any time, in any order. The scene stays as it is where nothing moves.
    pub fn set_time(&mut self, seconds: f64) {
        self.graph.evaluate(seconds, &mut self.instances);
    }

    /// Whether all keyframes of an instance consist of the same triangles over vertices of their
    /// own, as strategies that move vertices need it.
    pub fn shares_topology(&self, instance: &Instance) -> bool {
        let mut all = instance.keyframes.meshes.iter().map(|&m| &self.meshes[m]);
        let first = all.next();
        first.is_none_or(|first| all.all(|m| m.shares_topology(first)))
    }
}

#[cfg(test)]
mod tests;
