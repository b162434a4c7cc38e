//! Displacements of blood by its flow: where each generation of scatterers has been carried from where it rests.
//!
//! What flows in an instance has the field of the flow's shape, which never changes; where scatterers are now it says times
//! their way. Before it stand three vectors with what changes from frame to frame: of each generation weight, number and way,
//! and what pulses of a packet hear, the louder one of them: pace (mm/s), number and way.

use glam::{DAffine3, DVec3};
use rayon::prelude::*;

use super::{Fields, Grid, texture_from_object};
use crate::layout::FLOW_VECTORS;
use crate::placement::rigid;
use crate::scene::flow::{Flow, FlowShape};
use crate::scene::{Instance, Scene};
use crate::settings::TextureSpace;

/// Nodes across the narrowest radius of a tube: between them a parabola is missed by 1 / (4 * 6^2) of its height at most.
const NODES_PER_RADIUS: f64 = 6.0;
/// Most nodes of a field: 8 MB on the device. A bifurcation of 80 mm, 5 mm wide, has them at a twelfth of its width.
const MOST_NODES: usize = 1 << 19;

/// The place of what flows in one instance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FlowSlots {
    /// The first generation's vector, in [`Fields::values`].
    first: u32,
    /// Life of a generation, s.
    lifetime: f64,
}

/// The vectors before the field of a flow.
type Vectors = [[f32; 3]; FLOW_VECTORS as usize];

/// What a flow has carried: the vectors before its field, and their place in [`Fields::values`].
pub(crate) type Carried = (u32, Vectors);

impl Fields {
    /// Appends the fields of everything that flows.
    pub(super) fn add_flows(&mut self, scene: &Scene) {
        self.flows = vec![None; scene.instances.len()];
        for flow in &scene.flows {
            let instance = &scene.instances[flow.instance];
            let rest = self.rests[flow.instance].unwrap_or(instance.world_from_object);
            // 0 is the place of no flow.
            if self.values.is_empty() {
                self.values.push([0.0; 3]);
            }
            let first = self.values.len() as u32;
            self.values.resize(self.values.len() + FLOW_VECTORS as usize, [0.0; 3]);
            let (low, high) = bounds(scene, instance);
            let within = |place: DVec3| place.clamp(low, high) == place;
            let (grid, shape) = of_shape(scene, instance, &flow.shape, &rest, within);
            self.values.extend(grid.header());
            self.values.extend(shape);
            let lifetime = flow.lifetime(&rest, within);
            self.flows[flow.instance] = Some(FlowSlots { first, lifetime });
        }
        self.carry(scene);
    }

    /// The offset, in vectors, of what flows in instance `i`; 0 where nothing does, or where
    /// `simulation.texture_space` does not move speckle with the tissue.
    pub fn flow(&self, scene: &Scene, i: usize) -> u32 {
        let moves = scene.simulation.texture_space == TextureSpace::Tissue;
        self.flows[i].filter(|_| moves).map_or(0, |slots| slots.first)
    }

    /// Updates what the flows have carried to the scene as it is now. Returns what has changed.
    pub(crate) fn carry(&mut self, scene: &Scene) -> Vec<Carried> {
        let mut changed = Vec::new();
        for flow in &scene.flows {
            // A world that only tries a tracer has no fields.
            let Some(slots) = self.flows[flow.instance] else { continue };
            let now = vectors(flow, slots.lifetime, 0.0);
            let at = slots.first as usize;
            let kept = &mut self.values[at..at + now.len()];
            if *kept != now {
                kept.copy_from_slice(&now);
                changed.push((slots.first, now));
            }
        }
        changed
    }

    /// What the flows will have carried `after` seconds from the time to which they were brought last.
    pub(crate) fn carried(&self, scene: &Scene, after: f64) -> Vec<Carried> {
        let of = |flow: &Flow| {
            let slots = self.flows[flow.instance]?;
            Some((slots.first, vectors(flow, slots.lifetime, after)))
        };
        scene.flows.iter().filter_map(of).collect()
    }
}

fn vectors(flow: &Flow, lifetime: f64, after: f64) -> Vectors {
    let generations = flow.generations(lifetime, after);
    let [first, second] = generations;
    let louder = if second.weight > first.weight { second } else { first };
    let pulses = [flow.pace(1.0) as f32, louder.number as f32, louder.way as f32];
    let [first, second] = generations.map(|g| [g.weight as f32, g.number as f32, g.way as f32]);
    [first, second, pulses]
}

/// All shapes of an instance.
fn vertices<'a>(scene: &'a Scene, instance: &'a Instance) -> impl Iterator<Item = DVec3> + 'a {
    let meshes = instance.keyframes.meshes.iter().chain([&instance.mesh]);
    let vertices = meshes.flat_map(|&mesh| &scene.meshes[mesh].positions);
    vertices.map(|p| DVec3::from(p.map(f64::from)))
}

/// The box around all shapes of an instance, in its own space: its ends.
fn bounds(scene: &Scene, instance: &Instance) -> (DVec3, DVec3) {
    let none = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    vertices(scene, instance).fold(none, |(low, high), p| (low.min(p), high.max(p)))
}

/// The shape of a flow, and the grid on which it is given: in the texture space of its instance, over all its shapes.
fn of_shape(
    scene: &Scene,
    instance: &Instance,
    shape: &FlowShape,
    rest: &DAffine3,
    within: impl Fn(DVec3) -> bool,
) -> (Grid, Vec<[f32; 3]>) {
    let texture = texture_from_object(rest);
    let vertices = vertices(scene, instance).map(|p| texture.transform_point3(p));
    let grid = match shape.narrowest(&texture, within) {
        None => Grid::one_cell(vertices),
        Some(radius) => Grid::spaced(vertices, radius / NODES_PER_RADIUS, MOST_NODES),
    };
    // Texture space has the directions of the placement's rigid part.
    let turn = rigid(rest).inverse() * *rest;
    let object_from_texture = texture.inverse();
    let node = |i: usize| {
        let place = object_from_texture.transform_point3(grid.place(grid.node(i)));
        shape.velocity(place, &turn.matrix3).as_vec3().to_array()
    };
    let values = (0..grid.nodes()).into_par_iter().map(node).collect();
    (grid, values)
}
