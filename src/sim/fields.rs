//! Displacement fields of instances whose keyframes share their topology: they say where each tissue point
//! is now, so that speckle follows the deformation.
//!
//! A field is given in the instance's texture space, over the shape of keyframe 0: the tissue point P
//! of the reference shape is at P + v(P) now. The displacement is known on the surfaces alone, where a vertex
//! is the same tissue point in every keyframe. Between them it is the affine map that fits best plus the
//! smoothest remainder, which minimises the area-weighted misfit on the surfaces and the energy of a
//! membrane, and is harmonic where there is no surface. Homogeneous strain and rotation are exact. A
//! membrane alone would give too little strain next to the surfaces, as nothing holds it outside.
//!
//! Tissue that placements scale in time (a palpated artery below a transform that scales) has a field as
//! well. If it has no keyframes, this is one cell over the shape at rest, as the map is affine; else the field of
//! its keyframes, mapped the same way.
//!
//! To draw frames: call [`Fields::build`] once per scene, bind [`Fields::padded`] as `fields` (four
//! floats per vector, so that a device reads them at once) and write [`Fields::offset`] into `field` of every
//! instance's row whenever keyframes or settings have changed. Each instance has one field more, for the shape
//! between keyframes; before a frame it is overwritten as [`Fields::blend`] says.

mod flows;
mod grid;
mod solve;

use std::ops::Range;

use glam::{DAffine3, DVec3};
use rayon::prelude::*;

use super::layout::NONE;
use super::placement::rigid;
use crate::scene::{Instance, Mesh, Scene, Strategy};
use crate::settings::TextureSpace;
pub(crate) use flows::Carried;
use flows::FlowSlots;
pub use grid::Grid;
use solve::{Patch, Solver};

/// Vectors in the header of a field: origin (mm), nodes per mm in each axis, number of nodes in each axis.
pub const HEADER: u32 = 3;

/// Displacement fields of a scene's instances.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Fields {
    /// All fields in sequence: a header, then a displacement (mm) per node, x running fastest.
    pub values: Vec<[f32; 3]>,
    /// For each instance the places of its fields; none without a field.
    slots: Vec<Option<FieldOffsets>>,
    /// For each instance its placement at rest; none where no placement scales it in time.
    rests: Vec<Option<DAffine3>>,
    /// For each instance what flows in it.
    flows: Vec<Option<FlowSlots>>,
}

/// The places of one instance's fields in the values; the fields follow each other.
#[derive(Clone, Copy, Debug, PartialEq)]
struct FieldOffsets {
    /// Offset of the field of keyframe 0; equal to `blended` if keyframes have none.
    first: u32,
    stride: u32,
    /// Offset of the field for shapes between keyframes and for shapes that placements scale. Every strategy has
    /// it, as strategies can be exchanged while the program runs.
    blended: u32,
}

/// A weighted sum of keyframes' fields: `count` vectors from `target` on are the sum of the
/// weighted ones from `sources` on, all counted in vectors of [`Fields::values`]. Weights sum to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldBlend {
    /// The place of each keyframe's displacements, and its weight.
    pub sources: [(u32, f64); 4],
    /// The place of the sum.
    pub target: u32,
    /// The number of vectors.
    pub count: u32,
}

impl Fields {
    /// Computes the fields of every instance that has keyframes of shared topology, or that placements scale in
    /// time; other instances have none. A field is fitted to the vertices of all instances of its group, which
    /// must keep their places relative to each other.
    pub fn build(scene: &Scene) -> Self {
        let rests = scene.graph.rests(scene.instances.len());
        let made: Vec<Option<InstanceFields>> =
            (0..scene.instances.len()).into_par_iter().map(|i| make(scene, i, &rests)).collect();
        let mut fields = Self { rests, ..Self::default() };
        for made in made {
            let slots = made.map(|made| fields.append(&made));
            fields.slots.push(slots);
        }
        fields.follow(scene);
        fields.add_flows(scene);
        fields
    }

    /// No fields: nothing deforms.
    pub fn none(scene: &Scene) -> Self {
        Self {
            values: Vec::new(),
            slots: vec![None; scene.instances.len()],
            rests: vec![None; scene.instances.len()],
            flows: vec![None; scene.instances.len()],
        }
    }

    fn append(&mut self, made: &InstanceFields) -> FieldOffsets {
        let first = self.values.len() as u32;
        let header = made.grid.header();
        for displacements in &made.keyframes {
            self.values.extend(header);
            self.values.extend_from_slice(displacements);
        }
        let blended = self.values.len() as u32;
        self.values.extend(header);
        let nodes = made.grid.nodes();
        match made.keyframes.first() {
            Some(displacements) => self.values.extend_from_slice(displacements),
            None => self.values.resize(self.values.len() + nodes, [0.0; 3]),
        }
        FieldOffsets { first, stride: HEADER + nodes as u32, blended }
    }

    /// The buffer that kernels bind; it is never empty.
    pub fn padded(&self) -> Vec<[f32; 4]> {
        match self.is_empty() {
            true => vec![[0.0; 4]],
            false => padded(&self.values),
        }
    }

    /// True if no instance deforms.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// The offset, in vectors, of the field of instance `i` in its present shape; [`NONE`] for an
    /// instance without one, or where `simulation.texture_space` does not move speckle with the tissue.
    pub fn offset(&self, scene: &Scene, i: usize) -> u32 {
        if scene.simulation.texture_space != TextureSpace::Tissue {
            return NONE;
        }
        let keyframes = &scene.instances[i].keyframes;
        self.slots[i].map_or(NONE, |slots| match keyframes.strategy {
            _ if self.rests[i].is_some() => slots.blended,
            Strategy::Interpolate => slots.blended,
            // Back at rest tissue is what it was before a program had moved it.
            _ if keyframes.revision > 0 && keyframes.nearest() == 0 => NONE,
            _ => slots.first + keyframes.nearest() as u32 * slots.stride,
        })
    }

    /// The sum by which the device computes the field of instance `i` before a frame; none where a keyframe is
    /// shown unchanged, and where [`Self::follow`] computes it.
    pub fn blend(&self, scene: &Scene, i: usize) -> Option<FieldBlend> {
        let keyframes = &scene.instances[i].keyframes;
        let between = keyframes.strategy == Strategy::Interpolate && self.rests[i].is_none();
        let slots = self.slots[i].filter(|_| between)?;
        let at = |keyframe: usize| slots.first + keyframe as u32 * slots.stride + HEADER;
        Some(FieldBlend {
            sources: keyframes.blend.map(|(keyframe, weight)| (at(keyframe), weight)),
            target: slots.blended + HEADER,
            count: slots.stride - HEADER,
        })
    }
}

impl Fields {
    /// Updates the fields of the instances that placements scale to the placements of now. Returns the ranges of
    /// [`Self::values`], in vectors, that have changed.
    pub fn follow(&mut self, scene: &Scene) -> Vec<Range<usize>> {
        let mut changed = Vec::new();
        for (i, instance) in scene.instances.iter().enumerate() {
            let (Some(rest), Some(slots)) = (&self.rests[i], self.slots[i]) else {
                continue;
            };
            let at = slots.blended as usize;
            let range = at + HEADER as usize..at + slots.stride as usize;
            let now = self.squeezed(instance, rest, slots);
            if self.values[range.clone()] != now {
                self.values[range.clone()].copy_from_slice(&now);
                changed.push(range);
            }
        }
        changed
    }

    /// Updates the field of the last keyframe of instance `i`, which has taken another shape. Returns its range in
    /// [`Self::values`]; none of an instance without a field.
    pub fn follow_shape(&mut self, scene: &Scene, i: usize) -> Option<Range<usize>> {
        let slots = self.slots[i]?;
        let last = scene.instances[i].keyframes.meshes.len() - 1;
        let begin = slots.first as usize + last * slots.stride as usize;
        let range = begin + HEADER as usize..begin + slots.stride as usize;
        // At rest nothing moves.
        let made = make(scene, i, &self.rests).and_then(|mut made| made.keyframes.pop());
        let moved = made.unwrap_or_else(|| vec![[0.0; 3]; range.len()]);
        self.values[range.clone()].copy_from_slice(&moved);
        Some(range)
    }

    /// Present displacements, at the nodes, of an instance that placements scale: those of its keyframes followed
    /// by the affine map from its texture space at rest to the present one.
    fn squeezed(&self, instance: &Instance, rest: &DAffine3, slots: FieldOffsets) -> Vec<[f32; 3]> {
        let placed = &instance.world_from_object;
        let map = texture_from_object(placed) * texture_from_object(rest).inverse();
        let keyframes = &instance.keyframes;
        let weights = match keyframes.strategy {
            _ if slots.first == slots.blended => Vec::new(),
            Strategy::Interpolate => keyframes.blend.to_vec(),
            _ => vec![(keyframes.nearest(), 1.0)],
        };
        let grid = Grid::from_header(&self.values[slots.blended as usize..]);
        let node = |number: usize| {
            let at = grid.place(grid.node(number));
            let moved: DVec3 = (weights.iter())
                .map(|&(keyframe, weight)| {
                    let first = slots.first as usize + keyframe * slots.stride as usize;
                    let v = self.values[first + HEADER as usize + number];
                    weight * DVec3::from(v.map(f64::from))
                })
                .sum();
            (map.transform_point3(at + moved) - at).as_vec3().to_array()
        };
        (0..grid.nodes()).map(node).collect()
    }
}

/// The map from object to texture space: the placement without its rigid part.
fn texture_from_object(world_from_object: &DAffine3) -> DAffine3 {
    rigid(world_from_object).inverse() * *world_from_object
}

/// The vectors with an unused fourth float.
pub fn padded(vectors: &[[f32; 3]]) -> Vec<[f32; 4]> {
    vectors.iter().map(|&[x, y, z]| [x, y, z, 0.0]).collect()
}

/// Fields of one instance.
struct InstanceFields {
    grid: Grid,
    keyframes: Vec<Vec<[f32; 3]>>,
}

/// Meshes of an instance's keyframes; none unless all share their topology and at least one differs from the
/// first.
fn keyframes<'a>(scene: &'a Scene, instance: &Instance) -> Option<Vec<&'a Mesh>> {
    let meshes: Vec<&Mesh> =
        (instance.keyframes.meshes.iter()).map(|&m| &*scene.meshes[m]).collect();
    let (reference, others) = meshes.split_first()?;
    let same = |mesh: &&Mesh| mesh.shares_topology(reference);
    let moves = |mesh: &&Mesh| mesh.positions != reference.positions;
    (others.iter().all(same) && others.iter().any(moves)).then_some(meshes)
}

fn make(scene: &Scene, index: usize, rests: &[Option<DAffine3>]) -> Option<InstanceFields> {
    let instance = &scene.instances[index];
    let rest = |i: usize| rests[i].unwrap_or(scene.instances[i].world_from_object);
    let texture_from_world = rigid(&rest(index)).inverse();
    let vertices = |mesh: &Mesh| {
        let texture: DAffine3 = texture_from_world * rest(index);
        let place = move |&p: &[f32; 3]| texture.transform_point3(DVec3::from(p.map(f64::from)));
        mesh.positions.iter().map(place).collect::<Vec<_>>()
    };
    let Some(own) = keyframes(scene, instance) else {
        // The grid holds all shapes that the instance may show.
        rests[index]?;
        let shown = instance.keyframes.meshes.iter().chain([&instance.mesh]);
        let all = shown.flat_map(|&mesh| vertices(&scene.meshes[mesh]));
        return Some(InstanceFields { grid: Grid::one_cell(all), keyframes: Vec::new() });
    };
    let patch =
        |i: usize, meshes| Patch { meshes, texture_from_object: texture_from_world * rest(i) };
    let grid = Grid::around(vertices(own[0]).into_iter());
    let count = own.len();
    let group = instance.keyframes.group;
    let others = scene.instances.iter().enumerate().filter(|(other, placed)| {
        *other != index && group.is_some() && placed.keyframes.group == group
    });
    let mut patches: Vec<Patch<'_>> = others
        .filter_map(|(i, placed)| Some(patch(i, keyframes(scene, placed)?)))
        .filter(|patch| patch.meshes.len() == count)
        .collect();
    patches.push(patch(index, own));
    let solver = Solver::new(&grid, &patches);
    let keyframes = (0..count).into_par_iter().map(|k| solver.displacements(k)).collect();
    Some(InstanceFields { grid, keyframes })
}

#[cfg(test)]
mod tests;
