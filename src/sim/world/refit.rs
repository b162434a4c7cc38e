//! Shapes of one topology: the device moves their vertices and updates the boxes of the tree.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::arrays::{Averages, GeometryRange, ordered};
use super::changing::{put_tree, put_triangles};
use super::top::TopLevel;
use super::{GeometryBuffers, ShapeKernels, WorldError};
use crate::bvh::{MeshBvh, levels};
use crate::fields::Fields;
use crate::gpu::{Binding, Buffer, BufferKind, Commands, Device, GpuError, Stage};
use crate::layout::{PACKED, SUM, UNIT};
use crate::push;
use crate::scene::smoothed::LEVELS;
use crate::scene::{Instance, Mesh, Scene, Strategy};
use crate::tracer::Tracer;

/// Relative cost of rays from which on a tree is built again instead of refitted (choice; a build costs some
/// ten refits).
const REBUILD_COST: f64 = 1.5;

/// A tree built for one keyframe; it also serves keyframes near it.
struct BaseTree {
    tree: MeshBvh,
    /// Ranges in the list of node numbers, one per level.
    levels: Vec<push::Refit>,
}

/// An instance whose keyframes share their triangles.
struct RefitInstance {
    bases: BTreeMap<usize, BaseTree>,
    /// For each keyframe the base that serves it.
    serving: Vec<usize>,
    /// The base whose tree is in the region now.
    held: Option<usize>,
}

/// The buffers for refitting on the compute tracer.
struct RefitBuffers {
    boxes: Buffer,
    order: Buffer,
}

pub(super) struct Refit {
    bodies: Vec<Option<RefitInstance>>,
    pub(super) kernels: Arc<ShapeKernels>,
    boxes: Option<RefitBuffers>,
}

impl Refit {
    /// Trees of all keyframes that need one of their own, and the kernels; empty for a scene that
    /// refits nothing.
    pub(super) fn new(
        device: &Arc<Device>,
        kernels: &Arc<ShapeKernels>,
        scene: &Scene,
        tracer: Tracer,
        regions: &[Option<GeometryRange>],
    ) -> Result<Self, GpuError> {
        let mut order = Vec::new();
        let mut bodies = Vec::new();
        let mut last_node = 0;
        for (instance, region) in scene.instances.iter().zip(regions) {
            let refits = instance.keyframes.strategy.needs_shared_topology();
            let region = region.as_ref().filter(|_| refits);
            bodies.push(region.map(|region| body(scene, instance, region, tracer, &mut order)));
            last_node = order.iter().copied().fold(last_node, u32::max);
        }
        let boxes = match order.is_empty() {
            true => None,
            false => {
                let bytes = 24 * (u64::from(last_node) + 1);
                Some(RefitBuffers {
                    boxes: device.buffer("boxes", bytes, BufferKind::Storage)?,
                    order: super::upload(device, "refit order", bytemuck::cast_slice(&order))?,
                })
            }
        };
        Ok(Self { bodies, kernels: Arc::clone(kernels), boxes })
    }

    /// Device memory, bytes.
    pub(super) fn bytes(&self) -> u64 {
        self.boxes.as_ref().map_or(0, |b| b.boxes.size() + b.order.size())
    }

    /// Records the triangles and the tree of the base that serves instance `index` now, unless the
    /// region has them already, and the vertices of a keyframe that is shown as it is. Returns true if the region had no such
    /// triangles: a structure must then be built, not refitted.
    #[allow(clippy::too_many_arguments, reason = "the parts of one world")]
    pub(super) fn shape(
        &mut self,
        commands: &mut Commands<'_>,
        scene: &Scene,
        index: usize,
        places: &[GeometryRange],
        geometry: &GeometryBuffers,
        region: &mut GeometryRange,
        top: &mut TopLevel,
    ) -> Result<bool, WorldError> {
        let instance = &scene.instances[index];
        if instance.keyframes.strategy == Strategy::Refit {
            copy(commands, &scene.meshes, instance.mesh, places, geometry, region)?;
        }
        let body = self.bodies[index].as_mut().expect("made for this strategy");
        let serving = body.serving[keyframe(instance)];
        if body.held == Some(serving) {
            return Ok(false);
        }
        let mesh = &scene.meshes[instance.keyframes.meshes[serving]];
        let base = &body.bases[&serving];
        let order = top.bvh().map(|_| &base.tree.triangle_order[..]);
        region.triangles = mesh.triangles.len() as u32;
        region.order = order.map(<[u32]>::to_vec);
        let triangles = ordered(mesh, order, region.first_vertex);
        put_triangles(commands, geometry, region, &triangles)?;
        put_tree(commands, &base.tree, region, top)?;
        body.held = Some(serving);
        Ok(true)
    }

    /// Records the vertices of the instances in `due` and, for the compute tracer, the boxes around
    /// them.
    #[allow(clippy::too_many_arguments, reason = "the parts of one world")]
    pub(super) fn record(
        &self,
        commands: &mut Commands<'_>,
        scene: &Scene,
        places: &[GeometryRange],
        regions: &[Option<GeometryRange>],
        geometry: &GeometryBuffers,
        fields: &Fields,
        due: &[(usize, bool)],
        top: &mut TopLevel,
    ) -> Result<(), GpuError> {
        // All shapes lie in one buffer: a barrier between two dispatches that write it.
        let mut ranges: Vec<&[push::Refit]> = Vec::new();
        for &(index, _) in due {
            let (Some(body), Some(region)) = (&self.bodies[index], &regions[index]) else {
                continue;
            };
            let instance = &scene.instances[index];
            let between = instance.keyframes.strategy == Strategy::Interpolate;
            let made = [
                (&geometry.vertices, SUM, 1),
                (&geometry.normals, UNIT, 1),
                (&geometry.smoothed, PACKED, LEVELS as u32),
            ];
            for (values, kind, each) in made.into_iter().filter(|_| between) {
                let push = interpolation(scene, instance, places, region, kind, each);
                commands.dispatch(
                    &self.kernels.interpolate,
                    [push.count, 1, 1],
                    bytemuck::bytes_of(&push),
                    &[Binding::Buffer(values)],
                )?;
            }
            if let Some(blend) = fields.blend(scene, index) {
                let push = push::Interpolate {
                    count: blend.count,
                    target: blend.target,
                    sources: blend.sources.map(|(at, _)| at),
                    weights: blend.sources.map(|(_, weight)| weight as f32),
                    stride: 4,
                    ..push::Interpolate::default()
                };
                commands.dispatch(
                    &self.kernels.interpolate,
                    [push.count, 1, 1],
                    bytemuck::bytes_of(&push),
                    &[Binding::Buffer(&geometry.fields)],
                )?;
            }
            commands.barrier(Stage::Compute, Stage::Compute);
            ranges.push(&body.bases[&body.held.expect("the base was chosen by `shape`")].levels);
        }
        let (Some(refit), Some((_, nodes))) = (&self.boxes, top.bvh()) else {
            return Ok(());
        };
        for level in ranges.into_iter().flatten() {
            commands.dispatch(
                &self.kernels.refit,
                [8 * level.count, 1, 1],
                bytemuck::bytes_of(level),
                &[
                    Binding::Buffer(nodes),
                    Binding::Buffer(&geometry.vertices),
                    Binding::Buffer(&geometry.triangles),
                    Binding::Buffer(&refit.boxes),
                    Binding::Buffer(&refit.order),
                ],
            )?;
            commands.barrier(Stage::Compute, Stage::Compute);
        }
        commands.barrier(Stage::Compute, Stage::Transfer);
        Ok(())
    }
}

/// Number of the keyframe that the instance shows or is nearest to.
fn keyframe(instance: &Instance) -> usize {
    let keyframes = &instance.keyframes;
    let is = |mesh: &usize| *mesh == instance.mesh;
    match keyframes.strategy {
        Strategy::Interpolate => keyframes.nearest(),
        _ => keyframes.meshes.iter().position(is).expect("a keyframe is shown"),
    }
}

/// Push constants that interpolate `each` vectors of every vertex.
fn interpolation(
    scene: &Scene,
    instance: &Instance,
    places: &[GeometryRange],
    region: &GeometryRange,
    kind: u32,
    each: u32,
) -> push::Interpolate {
    let keyframes = &instance.keyframes;
    let source = |k: usize| each * places[keyframes.meshes[k]].first_vertex;
    push::Interpolate {
        count: each * scene.meshes[keyframes.meshes[0]].positions.len() as u32,
        target: each * region.first_vertex,
        kind,
        sources: keyframes.blend.map(|(k, _)| source(k)),
        weights: keyframes.blend.map(|(_, weight)| weight as f32),
        stride: if kind == PACKED { 1 } else { 3 },
    }
}

/// Records the copy of a mesh's vertices into a region: to the bit what is shown where nothing is refitted.
fn copy(
    commands: &mut Commands<'_>,
    meshes: &[Arc<Mesh>],
    mesh: usize,
    places: &[GeometryRange],
    geometry: &GeometryBuffers,
    region: &GeometryRange,
) -> Result<(), GpuError> {
    let count = meshes[mesh].positions.len() as u64;
    let copied = [
        (&geometry.vertices, size_of::<[f32; 3]>()),
        (&geometry.normals, size_of::<[f32; 3]>()),
        (&geometry.smoothed, size_of::<Averages>()),
    ];
    for (buffer, each) in copied {
        let at = |vertex: u32| each as u64 * u64::from(vertex);
        let from = at(places[mesh].first_vertex);
        commands.copy((buffer, from), (buffer, at(region.first_vertex)), each as u64 * count)?;
    }
    Ok(())
}

fn body(
    scene: &Scene,
    instance: &Instance,
    region: &GeometryRange,
    tracer: Tracer,
    order: &mut Vec<u32>,
) -> RefitInstance {
    let meshes: Vec<_> = instance.keyframes.meshes.iter().map(|&m| &scene.meshes[m]).collect();
    let mut bases: BTreeMap<usize, BaseTree> = BTreeMap::new();
    let mut serving = Vec::new();
    for (k, mesh) in meshes.iter().enumerate() {
        let fits = |(&b, base): (&usize, &BaseTree)| {
            let cost = base.tree.degradation(meshes[b], &mesh.positions);
            (cost <= REBUILD_COST).then_some((b, cost))
        };
        let best = bases.iter().filter_map(fits).min_by(|a, b| a.1.total_cmp(&b.1));
        serving.push(best.map_or(k, |(b, _)| b));
        if best.is_none() {
            bases.insert(k, base(mesh, region, tracer, order));
        }
    }
    RefitInstance { bases, serving, held: None }
}

fn base(
    mesh: &crate::scene::Mesh,
    region: &GeometryRange,
    tracer: Tracer,
    order: &mut Vec<u32>,
) -> BaseTree {
    let tree = MeshBvh::build(mesh);
    let mut ranges = Vec::new();
    if tracer == Tracer::Bvh {
        let all = levels(&[(&tree, region.root)]);
        ranges = all.ranges;
        for range in &mut ranges {
            range.first += order.len() as u32;
        }
        order.extend(all.order);
    }
    BaseTree { tree, levels: ranges }
}
