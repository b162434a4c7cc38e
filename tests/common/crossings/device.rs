//! Runs of `rays.comp` on the device.

use std::sync::{Arc, Mutex};

use bytemuck::{Pod, Zeroable};
use glam::DVec3;
use insonify::gpu::{Binding, Buffer, BufferKind, Device, Kernel};
use insonify::scene::Scene;
use insonify::sim::bvh::Splits;
use insonify::sim::layout::NONE;
use insonify::sim::shaders::Library;
use insonify::sim::tracer::Tracer;
use insonify::sim::world::{ShapeKernels, World};

use super::compare::Found;
use super::rays::Ray;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct RawRay {
    origin: [f32; 4],
    direction: [f32; 4],
    skip: [u32; 4],
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct RawHit {
    position: [f32; 4],
    geometric: [f32; 4],
    shading: [f32; 4],
    instance: u32,
    primitive: u32,
    counts: Counts,
}

/// Counts of the compute tracer for a ray; zero with the ray query. As in `rays.comp`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Counts {
    pub node_visits: u32,
    pub triangle_tests: u32,
    pub top_visits: u32,
    pub instances_reached: u32,
    pub false_unions: u32,
    pub false_boxes: u32,
}

/// Result of the kernel for a ray.
#[derive(Clone, Copy, Debug)]
pub struct Traced {
    pub found: Option<Found>,
    pub position: DVec3,
    pub geometric: DVec3,
    pub shading: DVec3,
    pub counts: Counts,
}

/// A scene on the device with one tracer.
pub struct Rig {
    pub device: Arc<Device>,
    kernel: Kernel,
    pub world: World,
    meshes: Vec<usize>,
    /// Buffers that replace those of the world, by binding.
    pub replaced: Vec<(usize, Buffer)>,
}

impl Rig {
    pub fn on(device: &Arc<Device>, scene: &Scene, tracer: Tracer) -> Self {
        Self::with_splits(device, scene, tracer, Splits::default())
    }

    pub fn with_splits(
        device: &Arc<Device>,
        scene: &Scene,
        tracer: Tracer,
        splits: Splits,
    ) -> Self {
        // The counting variant is the compute tracer's kernel with counters compiled in.
        let stem = match tracer {
            Tracer::Bvh => "rays_count",
            Tracer::RayQuery => "rays_query",
        };
        let kernel = Kernel::new(device, stem, Library::embedded().words(stem), &[]).unwrap();
        let kernels = Arc::new(ShapeKernels::new(device, &Library::embedded()).unwrap());
        let world = World::with_splits(device, &kernels, scene, tracer, splits).unwrap();
        Self {
            kernel,
            world,
            meshes: scene.instances.iter().map(|i| i.mesh).collect(),
            replaced: Vec::new(),
            device: device.clone(),
        }
    }

    /// Moves or reshapes the scene's instances; returns whether anything had changed.
    pub fn update(&mut self, scene: &Scene) -> bool {
        self.meshes = scene.instances.iter().map(|i| i.mesh).collect();
        let world = &mut self.world;
        let other = !world.serves(scene);
        if other {
            world.exchange(&self.device, scene).unwrap();
        }
        let device = &self.device;
        let changed = device.once(|commands| Ok(world.update(commands, scene).unwrap())).unwrap();
        changed || other
    }

    pub fn trace(&self, rays: &[Ray]) -> Vec<Traced> {
        static TURN: Mutex<()> = Mutex::new(());
        if rays.is_empty() {
            return Vec::new();
        }
        let (mask, slots) = self.world.ray_mask();
        let raw: Vec<RawRay> = rays
            .iter()
            .map(|r| RawRay {
                origin: [r.origin[0], r.origin[1], r.origin[2], r.t_min],
                direction: [r.direction[0], r.direction[1], r.direction[2], r.t_max],
                skip: [r.skip.unwrap_or(NONE), mask, slots.into(), 0],
            })
            .collect();
        let _turn = TURN.lock().unwrap_or_else(|e| e.into_inner());
        let bytes = bytemuck::cast_slice(&raw);
        let list = self.device.buffer("rays", bytes.len() as u64, BufferKind::Storage).unwrap();
        let hits = self
            .device
            .buffer("hits", (size_of::<RawHit>() * rays.len()) as u64, BufferKind::Storage)
            .unwrap();
        self.device.upload(&list, bytes).unwrap();
        let mut bindings = self.world.bindings().to_vec();
        for (slot, buffer) in &self.replaced {
            bindings[*slot] = Binding::Buffer(buffer);
        }
        bindings.extend([Binding::Buffer(&list), Binding::Buffer(&hits)]);
        self.device
            .once(|commands| {
                commands.dispatch(&self.kernel, [rays.len() as u32, 1, 1], &[], &bindings)
            })
            .unwrap();
        let hits: Vec<RawHit> = self.device.read_back_as(&hits).unwrap();
        hits.iter().map(|hit| self.traced(hit)).collect()
    }

    fn traced(&self, hit: &RawHit) -> Traced {
        let vector = |v: [f32; 4]| DVec3::new(v[0].into(), v[1].into(), v[2].into());
        let found = (hit.instance != NONE).then(|| {
            let instance = hit.instance as usize;
            Found {
                t: hit.position[3].into(),
                instance,
                triangle: (self.world).triangle(instance, self.meshes[instance], hit.primitive),
            }
        });
        Traced {
            found,
            position: vector(hit.position),
            geometric: vector(hit.geometric),
            shading: vector(hit.shading),
            counts: hit.counts,
        }
    }

    pub fn found(&self, rays: &[Ray]) -> Vec<Option<Found>> {
        self.trace(rays).into_iter().map(|hit| hit.found).collect()
    }
}
