//! The scene at a time: what its graph and the acquired volume make of it then, and where its parts are placed.

use glam::DAffine3;

use super::animation::{Clock, Loop, Motion};
use super::fusion::Acquired;
use super::graph::{Node, NodeKind, Placed};
use super::{Instance, Scene};

impl Scene {
    /// The mesh or transform called `name`, at `seconds`; none where no such part has a placement.
    pub fn placed(&self, name: &str, seconds: f64) -> Option<Placed> {
        let named = self.origins.instances.iter().enumerate();
        let own: Vec<_> = named.filter(|(_, o)| o.mesh == name).map(|(i, _)| i).collect();
        let node = self.graph.nodes.iter().position(|n| n.name == name);
        let kind = if own.is_empty() { "transform" } else { "mesh" };
        let (parent, rest, instances) = match node.map(|i| (i, &self.graph.nodes[i])) {
            Some((i, node)) => match node.kind {
                NodeKind::Transform { rest, .. } | NodeKind::Mesh { rest, .. } => {
                    (node.parent, rest, self.graph.instances_of(i))
                }
                NodeKind::Group | NodeKind::Selector(_) => return None,
            },
            // A mesh without a parent is in no graph.
            None => {
                let model_from_world = self.graph.world_from_model.inverse();
                let first = self.instances[*own.first()?].world_from_object;
                (None, model_from_world * first, own)
            }
        };
        Some(Placed {
            kind,
            world_from_parent: self.graph.world_from(parent, seconds),
            rest,
            instances,
        })
    }

    /// Sets everything to its state at `seconds`: placements, choices of selectors, shapes, and the acquired
    /// volume. Any time, in any order. Without animation the scene stays as it is.
    pub fn set_time(&mut self, seconds: f64) {
        self.graph.evaluate(seconds, &mut self.instances);
        self.flows.iter_mut().for_each(|flow| flow.seconds = seconds);
        if let Some(acquired) = &mut self.volume {
            acquired.set_time(seconds);
        }
    }

    /// Returns whether anything follows time: the anatomy, blood that flows, or the acquired volume.
    pub fn is_animated(&self) -> bool {
        let moves = |node: &Node| match &node.kind {
            NodeKind::Transform { motion, .. } => *motion != Motion::Still,
            NodeKind::Selector(_) => true,
            NodeKind::Group | NodeKind::Mesh { .. } => false,
        };
        let changes = |acquired: &Acquired| acquired.sequence.is_some();
        let changing = self.volume.as_ref().is_some_and(changes);
        self.graph.nodes.iter().any(moves) || changing || !self.flows.is_empty()
    }

    /// Clock of what beats: of the first selector whose keyframes follow each other again and again, from the first one.
    /// Whether that is a heart, the examination says.
    pub fn beat(&self) -> Option<Clock> {
        self.graph.nodes.iter().find_map(|node| match &node.kind {
            NodeKind::Selector(sequence) => {
                Some(*sequence.clock()).filter(|clock| clock.mode == Loop::Repeat)
            }
            _ => None,
        })
    }

    /// Places the whole model, meshes and wires, in the world: probe and acquired volume stay. Nodes of the graph
    /// follow at the next [`Scene::set_time`].
    pub fn place_model(&mut self, world_from_model: DAffine3) {
        let before = self.graph.world_from_model;
        if before == world_from_model {
            return;
        }
        let change = world_from_model * before.inverse();
        let mut loose = vec![true; self.instances.len()];
        for node in &self.graph.nodes {
            if let NodeKind::Mesh { instance, .. } = node.kind {
                loose[instance] = false;
            }
        }
        let instances = self.instances.iter_mut().zip(loose);
        for (instance, _) in instances.filter(|(_, loose)| *loose) {
            instance.world_from_object = change * instance.world_from_object;
        }
        for end in self.wires.iter_mut().flat_map(|wire| &mut wire.ends) {
            *end = change.transform_point3((*end).into()).into();
        }
        self.graph.world_from_model = world_from_model;
    }

    /// Returns whether all keyframes of an instance consist of the same triangles over vertices of their own,
    /// which strategies that move vertices need.
    pub fn shares_topology(&self, instance: &Instance) -> bool {
        let mut all = instance.keyframes.meshes.iter().map(|&m| &self.meshes[m]);
        let first = all.next();
        first.is_none_or(|first| all.all(|m| m.shares_topology(first)))
    }
}
