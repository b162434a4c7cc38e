//! The scene graph: groups, transforms and selectors over meshes, and its evaluation at a time into
//! the flat list of instances that a frame depends on.

use glam::{DAffine3, DMat3, DVec3};

use super::animation::{Motion, Sequence};
use super::instance::Instance;
use super::keyframes::Strategy;

/// Nodes, each after its parent.
#[derive(Clone, Debug, Default)]
pub struct Graph {
    /// Nodes in any order in which parents come before their children.
    pub nodes: Vec<Node>,
    /// World from the frame of the whole model, in which nodes without a parent and instances without a node are
    /// placed. Scales alike in all directions.
    pub world_from_model: DAffine3,
}

/// A node with its place in the graph.
#[derive(Clone, Debug)]
pub struct Node {
    /// Name in messages, and for overrides; unique.
    pub name: String,
    /// Index of the parent, which is less than this node's own; none: the world.
    pub parent: Option<usize>,
    /// If the parent is a selector: the number of its choice with which this node is shown. None if
    /// it is shown with every choice, as meshes with keyframes are, which change with the choice.
    pub alternative: Option<usize>,
    /// Effect of the node.
    pub kind: NodeKind,
}

/// Effect of a node on those below it.
#[derive(Clone, Debug)]
pub enum NodeKind {
    /// No effect: a common name.
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
        /// Sequence of its choices.
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

/// The moving nodes that an instance's place depends on.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Carrier {
    /// The nearest transform above it that moves, by node.
    pub mover: Option<usize>,
    /// Placements from there down that are not the identity, outermost first. Instances that agree in both
    /// fields keep their places relative to each other.
    pub within: Vec<DAffine3>,
    /// True where a selector shows it at some times only.
    pub switched: bool,
}

/// A mesh or transform of a scene file, whose placement can be set there.
#[derive(Clone, Debug, PartialEq)]
pub struct Placed {
    /// The kind of its table: `mesh` or `transform`.
    pub kind: &'static str,
    /// World from its parent, at the given time.
    pub world_from_parent: DAffine3,
    /// The placement.
    pub rest: DAffine3,
    /// Instances that it carries: indices into [`Scene::instances`].
    pub instances: Vec<usize>,
}

/// The state of a node at a time.
struct State {
    world: DAffine3,
    shown: bool,
}

impl Graph {
    /// Writes placement, visibility and shape of every mesh at `seconds` into `instances`, by the
    /// instance's own strategy.
    pub fn evaluate(&self, seconds: f64, instances: &mut [Instance]) {
        let mut states: Vec<State> = Vec::with_capacity(self.nodes.len());
        for node in &self.nodes {
            let (mut world, mut shown) = (self.world_from_model, true);
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

    /// The carrier of each of `count` instances; the default for those that are not in the graph.
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

    /// World from object of each of `count` instances at rest, for those whose placements squeeze or stretch them over
    /// time: where a motion scales, or turns a shape that a placement above it scales unevenly. None for the others,
    /// whose tissue moves as a rigid body.
    pub fn rests(&self, count: usize) -> Vec<Option<DAffine3>> {
        /// Placement at rest, whether it scales unevenly, and whether it squeezes over time.
        type Rest = (DAffine3, bool, bool);
        let mut of_nodes: Vec<Rest> = Vec::with_capacity(self.nodes.len());
        let mut rests = vec![None; count];
        for node in &self.nodes {
            let above = node.parent.map(|parent| of_nodes[parent]);
            let top = (self.world_from_model, false, false);
            let (mut world, mut uneven, mut squeezes) = above.unwrap_or(top);
            match &node.kind {
                NodeKind::Transform { rest, motion } => {
                    world *= *rest * motion.rest();
                    uneven |= !is_even(rest);
                    squeezes |= motion.scales() || uneven && *motion != Motion::Still;
                    uneven |= !is_even(&motion.rest());
                }
                NodeKind::Mesh { instance, rest } => {
                    rests[*instance] = squeezes.then_some(world * *rest);
                }
                NodeKind::Group | NodeKind::Selector(_) => {}
            }
            of_nodes.push((world, uneven, squeezes));
        }
        rests
    }

    /// The node of each of `count` instances; none for those that are not in the graph.
    pub(super) fn nodes_of(&self, count: usize) -> Vec<Option<usize>> {
        let mut out = vec![None; count];
        for (number, node) in self.nodes.iter().enumerate() {
            if let NodeKind::Mesh { instance, .. } = node.kind {
                out[instance] = Some(number);
            }
        }
        out
    }

    /// Conditions for a node to be shown: selectors, by node, and the choice of each.
    pub(super) fn conditions(&self, node: Option<usize>) -> Vec<(usize, usize)> {
        let mut out = Vec::new();
        let mut at = node;
        while let Some(node) = at.map(|i| &self.nodes[i]) {
            out.extend(node.parent.zip(node.alternative));
            at = node.parent;
        }
        out
    }

    /// World from the space below `node` at `seconds`; without a node, from the model's.
    pub(super) fn world_from(&self, mut node: Option<usize>, seconds: f64) -> DAffine3 {
        let mut out = DAffine3::IDENTITY;
        while let Some(below) = node.map(|i| &self.nodes[i]) {
            if let NodeKind::Transform { rest, motion } = &below.kind {
                out = *rest * motion.at(seconds) * out;
            }
            node = below.parent;
        }
        self.world_from_model * out
    }

    /// Instances at `node` and below it.
    pub(super) fn instances_of(&self, node: usize) -> Vec<usize> {
        let mut within = vec![false; self.nodes.len()];
        let mut out = Vec::new();
        for (i, n) in self.nodes.iter().enumerate() {
            within[i] = i == node || n.parent.is_some_and(|parent| within[parent]);
            if let NodeKind::Mesh { instance, .. } = n.kind
                && within[i]
            {
                out.push(instance);
            }
        }
        out
    }

    /// The selector, by node, that switches the keyframes of a mesh's node.
    pub(super) fn switch_of(&self, node: Option<usize>) -> Option<usize> {
        let parent = self.nodes[node?].parent?;
        matches!(self.nodes[parent].kind, NodeKind::Selector(_)).then_some(parent)
    }
}

/// Returns whether a placement scales alike in all directions.
pub fn is_even(placement: &DAffine3) -> bool {
    let m = placement.matrix3;
    let gram = m.transpose() * m;
    let size = gram.x_axis.x;
    gram.abs_diff_eq(DMat3::from_diagonal(DVec3::splat(size)), 1e-9 * size)
}

/// Sets the present keyframe, or the blend of keyframes.
fn choose(instance: &mut Instance, sequence: &Sequence, seconds: f64) {
    let keyframes = &mut instance.keyframes;
    assert_eq!(keyframes.meshes.len(), sequence.count(), "one for each turn");
    keyframes.blend = match keyframes.strategy {
        Strategy::Interpolate => sequence.blend(seconds),
        _ => [(sequence.step(seconds), 1.0), (0, 0.0), (0, 0.0), (0, 0.0)],
    };
    instance.mesh = keyframes.meshes[keyframes.nearest()];
}

#[cfg(test)]
mod tests;
