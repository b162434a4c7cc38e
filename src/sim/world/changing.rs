//! Instances whose shape is made on the device when it is shown: uploaded and built, or moved and
//! refitted.

use std::sync::Arc;

use super::arrays::{Averages, Bounds, GeometryRange, ordered};
use super::refit::Refit;
use super::top::TopLevel;
use super::{GeometryBuffers, ShapeKernels, WorldError};
use crate::bvh::MeshBvh;
use crate::fields::Fields;
use crate::gpu::{Blas, Commands, Device, DynamicBlas, DynamicSource, GpuError, Stage};
use crate::scene::{Instance, Scene, Strategy};
use crate::tracer::Tracer;

/// The shape of an instance: a mesh of the scene and its revision, or keyframes with their weights.
#[derive(Clone, Copy, Debug, PartialEq)]
enum InstanceShape {
    Mesh(usize, u64),
    Blend([(usize, f64); 4]),
}

impl InstanceShape {
    fn of(instance: &Instance) -> Self {
        match instance.keyframes.strategy {
            Strategy::Interpolate => Self::Blend(instance.keyframes.blend),
            _ => Self::Mesh(instance.mesh, instance.keyframes.revision),
        }
    }
}

/// One instance that changes its shape.
struct ChangingInstance {
    made: Option<InstanceShape>,
    /// The ray query's structure.
    blas: Option<DynamicBlas>,
}

/// All instances that change their shape.
pub(super) struct ChangingInstances {
    bodies: Vec<Option<ChangingInstance>>,
    structures: Vec<Option<Blas>>,
    refit: Refit,
    /// Averaged normals of the meshes that are uploaded when they are shown.
    averages: Vec<Vec<Averages>>,
}

impl ChangingInstances {
    /// Structures and kernels for the instances that have a region; `geometry` has the room.
    pub(super) fn new(
        device: &Arc<Device>,
        kernels: &Arc<ShapeKernels>,
        scene: &Scene,
        tracer: Tracer,
        geometry: &GeometryBuffers,
        regions: &[Option<GeometryRange>],
        averages: Vec<Vec<Averages>>,
    ) -> Result<Self, GpuError> {
        let mut bodies = Vec::new();
        let mut structures = Vec::new();
        for (instance, region) in scene.instances.iter().zip(regions) {
            let body = region
                .as_ref()
                .map(|_| body(device, scene, tracer, instance, geometry))
                .transpose()?;
            let blas = body.as_ref().and_then(|body| body.blas.as_ref());
            structures.push(blas.map(|blas| blas.blas().clone()));
            bodies.push(body);
        }
        let refit = Refit::new(device, kernels, scene, tracer, regions)?;
        Ok(Self { refit, bodies, structures, averages })
    }

    /// Replaces the kernels.
    pub(super) fn reload(&mut self, kernels: &Arc<ShapeKernels>) {
        self.refit.kernels = Arc::clone(kernels);
    }

    /// The ray query's structures, one per instance.
    pub(super) fn structures(&self) -> &[Option<Blas>] {
        &self.structures
    }

    /// Device memory beside the regions, bytes.
    pub(super) fn bytes(&self) -> u64 {
        let bodies = self.bodies.iter().flatten().filter_map(|b| b.blas.as_ref());
        bodies.map(DynamicBlas::bytes).sum::<u64>() + self.refit.bytes()
    }

    /// Records the computation of the shape of every shown instance of `scene` that has changed; `regions`
    /// then describe these shapes. Returns true if anything was recorded.
    #[allow(clippy::too_many_arguments, reason = "the parts of one world")]
    pub(super) fn record(
        &mut self,
        commands: &mut Commands<'_>,
        scene: &Scene,
        geometry: &GeometryBuffers,
        fields: &Fields,
        places: &[GeometryRange],
        regions: &mut [Option<GeometryRange>],
        top: &mut TopLevel,
    ) -> Result<bool, WorldError> {
        let mut due = Vec::new();
        for (i, instance) in scene.instances.iter().enumerate() {
            let (Some(body), Some(region)) = (&mut self.bodies[i], &mut regions[i]) else {
                continue;
            };
            let shape = InstanceShape::of(instance);
            if !instance.shown || body.made == Some(shape) {
                continue;
            }
            body.made = Some(shape);
            region.version += 1;
            let strategy = instance.keyframes.strategy;
            let fresh = match strategy.needs_shared_topology() {
                true => {
                    // Shapes that a program has set are still being written.
                    commands.barrier(Stage::Transfer, Stage::Transfer);
                    self.refit.shape(commands, scene, i, places, geometry, region, top)?
                }
                false => {
                    let place = &places[instance.mesh];
                    let averages = &self.averages[instance.mesh];
                    upload(commands, scene, instance, place, averages, geometry, region, top)?;
                    true
                }
            };
            region.bounds = bounds(instance, places);
            due.push((i, fresh));
        }
        if due.is_empty() {
            return Ok(false);
        }
        commands.barrier(Stage::Transfer, Stage::Compute);
        self.refit.record(commands, scene, places, regions, geometry, fields, &due, top)?;
        for (i, fresh) in due {
            let (Some(body), Some(region)) = (&mut self.bodies[i], &regions[i]) else {
                continue;
            };
            let Some(blas) = &mut body.blas else { continue };
            // Indices count from the beginning of the buffer.
            let source = DynamicSource {
                vertices: &geometry.vertices,
                first_vertex: 0,
                vertex_count: geometry.vertex_count,
                triangles: &geometry.triangles,
                first_triangle: region.first_triangle,
                triangle_count: region.triangles,
            };
            match fresh {
                true => blas.build(commands, source)?,
                false => blas.refit(commands, source)?,
            }
        }
        Ok(true)
    }
}

fn body(
    device: &Arc<Device>,
    scene: &Scene,
    tracer: Tracer,
    instance: &Instance,
    geometry: &GeometryBuffers,
) -> Result<ChangingInstance, GpuError> {
    let meshes = instance.keyframes.meshes.iter().map(|&m| &scene.meshes[m]);
    let triangles = meshes.map(|m| m.triangles.len()).max().unwrap_or(0);
    let query = tracer == Tracer::RayQuery && triangles > 0;
    // A refitted structure is built once for many frames, the others for one.
    let fast_trace = instance.keyframes.strategy.needs_shared_topology();
    let new = || {
        let count = geometry.vertex_count;
        DynamicBlas::new(device, &instance.name, triangles as u32, count, fast_trace)
    };
    let blas = query.then(new);
    Ok(ChangingInstance { made: None, blas: blas.transpose()? })
}

/// Box around the present shape. A weighted sum of boxes contains the weighted sum of vertices (interval
/// arithmetic).
fn bounds(instance: &Instance, places: &[GeometryRange]) -> Bounds {
    let InstanceShape::Blend(blend) = InstanceShape::of(instance) else {
        return places[instance.mesh].bounds;
    };
    let mut sum = [[0.0_f64; 3]; 2];
    for (keyframe, weight) in blend.into_iter().filter(|(_, weight)| *weight != 0.0) {
        let [low, high] = places[instance.keyframes.meshes[keyframe]].bounds;
        for axis in 0..3 {
            let ends = [low, high].map(|corner| weight * f64::from(corner[axis]));
            sum[0][axis] += ends[0].min(ends[1]);
            sum[1][axis] += ends[0].max(ends[1]);
        }
    }
    // The device rounds each vertex in single precision.
    let margin = |axis: usize| 1e-6 * sum[0][axis].abs().max(sum[1][axis].abs());
    let grown = |side: usize, sign: f64| {
        std::array::from_fn(|axis| (sum[side][axis] + sign * margin(axis)) as f32)
    };
    [grown(0, -1.0), grown(1, 1.0)]
}

/// Records what the strategies `rebuild` and `cached` send to the device.
#[allow(clippy::too_many_arguments, reason = "the parts of one world")]
fn upload(
    commands: &mut Commands<'_>,
    scene: &Scene,
    instance: &Instance,
    place: &GeometryRange,
    averages: &[Averages],
    geometry: &GeometryBuffers,
    region: &mut GeometryRange,
    top: &mut TopLevel,
) -> Result<(), GpuError> {
    let mesh = &scene.meshes[instance.mesh];
    let cached = instance.keyframes.strategy == Strategy::Cached;
    region.triangles = mesh.triangles.len() as u32;
    let tree = top.bvh().map(|_| MeshBvh::build_fast(mesh));
    if cached && tree.is_none() {
        region.first_triangle = place.first_triangle;
        return Ok(());
    }
    let first_vertex = match cached {
        true => place.first_vertex,
        false => region.first_vertex,
    };
    if !cached {
        let at = 12 * u64::from(first_vertex);
        commands.write(&geometry.vertices, at, bytemuck::cast_slice(&mesh.positions))?;
        commands.write(&geometry.normals, at, bytemuck::cast_slice(&mesh.normals))?;
        let at = size_of::<Averages>() as u64 * u64::from(first_vertex);
        commands.write(&geometry.smoothed, at, bytemuck::cast_slice(averages))?;
    }
    let order = tree.as_ref().map(|tree| &tree.triangle_order[..]);
    put_triangles(commands, geometry, region, &ordered(mesh, order, first_vertex))?;
    if let Some(tree) = tree {
        put_tree(commands, &tree, region, top)?;
        region.order = Some(tree.triangle_order);
    }
    Ok(())
}

pub(super) fn put_triangles(
    commands: &mut Commands<'_>,
    geometry: &GeometryBuffers,
    region: &GeometryRange,
    triangles: &[[u32; 3]],
) -> Result<(), GpuError> {
    let at = 12 * u64::from(region.first_triangle);
    commands.write(&geometry.triangles, at, bytemuck::cast_slice(triangles))
}

/// Records the copy of a tree into the region's room among the nodes.
pub(super) fn put_tree(
    commands: &mut Commands<'_>,
    tree: &MeshBvh,
    region: &GeometryRange,
    top: &mut TopLevel,
) -> Result<(), GpuError> {
    let Some((bvh, nodes)) = top.bvh() else {
        return Ok(());
    };
    bvh.deepen(tree);
    let placed: Vec<_> = tree.nodes_at(region.root, region.first_triangle).collect();
    commands.write(nodes, 80 * u64::from(region.root), bytemuck::cast_slice(&placed))
}
