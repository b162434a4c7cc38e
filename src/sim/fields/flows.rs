//! Displacements of blood by its flow: where each generation of scatterers has been carried from where it rests.
//!
//! What flows in an instance has a field of the flow's shape, which never changes, and for each of its two generations a
//! field that is the shape times its way until now. Before the second kind of field stands a vector: the generation's
//! weight, its number, and how many vectors farther on the next generation's begins; 0: it is the last.

use glam::{DAffine3, DVec3};

use super::{FieldBlend, Fields, Grid, HEADER, texture_from_object};
use crate::placement::rigid;
use crate::scene::flow::{Flow, FlowShape};
use crate::scene::{Instance, Scene};
use crate::settings::TextureSpace;

/// Vectors before the header of a generation's field.
pub const GENERATION: u32 = 1;

/// Nodes across the narrowest radius of a tube: between them a parabola is missed by 1 / (4 * 6^2) of its height at most.
const NODES_PER_RADIUS: f64 = 6.0;
/// Most nodes of a field: 2 MB.
const MOST_NODES: usize = 1 << 17;

/// The places of what flows in one instance, in vectors of [`Fields::values`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FlowSlots {
    /// The first vector of the shape.
    shape: u32,
    /// The vector before the first generation's header.
    first: u32,
    /// Number of nodes.
    nodes: u32,
    /// Life of a generation, s.
    lifetime: f64,
}

impl FlowSlots {
    /// Vectors from one generation to the next.
    fn stride(&self) -> u32 {
        GENERATION + HEADER + self.nodes
    }
}

/// What the device writes before a frame for one generation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Carried {
    /// Place of the vector before its field, and the vector.
    pub(crate) head: (u32, [f32; 3]),
    /// Its field.
    pub(crate) field: FieldBlend,
}

impl Fields {
    /// Appends the fields of everything that flows.
    pub(super) fn add_flows(&mut self, scene: &Scene) {
        self.flows = vec![None; scene.instances.len()];
        for flow in &scene.flows {
            let instance = &scene.instances[flow.instance];
            let rest = self.rests[flow.instance].unwrap_or(instance.world_from_object);
            let (grid, shape) = of_shape(scene, instance, &flow.shape, &rest);
            let nodes = shape.len();
            let header = grid.header();
            self.values.extend(header);
            let at = self.values.len() as u32;
            self.values.extend(shape);
            let slots = FlowSlots {
                shape: at,
                first: self.values.len() as u32,
                nodes: nodes as u32,
                lifetime: flow.lifetime(&rest),
            };
            for _ in 0..2 {
                self.values.push([0.0; 3]);
                self.values.extend(header);
                self.values.resize(self.values.len() + nodes, [0.0; 3]);
            }
            self.flows[flow.instance] = Some(slots);
        }
    }

    /// The offset, in vectors, of what flows in instance `i`; 0 where nothing does, or where
    /// `simulation.texture_space` does not move speckle with the tissue.
    pub fn flow(&self, scene: &Scene, i: usize) -> u32 {
        let moves = scene.simulation.texture_space == TextureSpace::Tissue;
        self.flows[i].filter(|_| moves).map_or(0, |slots| slots.first)
    }

    /// What the device has to write before a frame of `scene` as it is now.
    pub(crate) fn carried(&self, scene: &Scene) -> Vec<Carried> {
        let of = |flow: &Flow| {
            let slots = self.flows[flow.instance].expect("made for these flows");
            let generations = flow.generations(slots.lifetime).into_iter().enumerate();
            generations.map(move |(i, generation)| {
                let at = slots.first + i as u32 * slots.stride();
                let next = if i == 0 { slots.stride() as f32 } else { 0.0 };
                Carried {
                    head: (at, [generation.weight as f32, generation.number as f32, next]),
                    field: FieldBlend {
                        sources: [(slots.shape, generation.way), (0, 0.0), (0, 0.0), (0, 0.0)],
                        target: at + GENERATION + HEADER,
                        count: slots.nodes,
                    },
                }
            })
        };
        scene.flows.iter().flat_map(of).collect()
    }
}

/// The shape of a flow, and the grid on which it is given: in the texture space of its instance, over all its shapes.
fn of_shape(
    scene: &Scene,
    instance: &Instance,
    shape: &FlowShape,
    rest: &DAffine3,
) -> (Grid, Vec<[f32; 3]>) {
    let texture = texture_from_object(rest);
    let meshes = instance.keyframes.meshes.iter().chain([&instance.mesh]);
    let vertices = meshes.flat_map(|&mesh| &scene.meshes[mesh].positions);
    let vertices = vertices.map(|&p| texture.transform_point3(DVec3::from(p.map(f64::from))));
    let grid = match shape.narrowest() {
        None => Grid::one_cell(vertices),
        Some(radius) => {
            let m = &texture.matrix3;
            let thinnest = [m.x_axis, m.y_axis, m.z_axis].map(DVec3::length);
            let thinnest = thinnest.into_iter().fold(f64::INFINITY, f64::min);
            Grid::spaced(vertices, radius * thinnest / NODES_PER_RADIUS, MOST_NODES)
        }
    };
    // Texture space has the directions of the placement's rigid part.
    let turn = rigid(rest).inverse() * *rest;
    let object_from_texture = texture.inverse();
    let node = |i: usize| {
        let place = object_from_texture.transform_point3(grid.place(grid.node(i)));
        shape.velocity(place, &turn.matrix3).as_vec3().to_array()
    };
    let values = (0..grid.nodes()).map(node).collect();
    (grid, values)
}
