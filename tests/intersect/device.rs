//! Runs `rays.comp` on the device.

use std::sync::{Arc, Mutex, OnceLock};

use bytemuck::{Pod, Zeroable};
use glam::DVec3;
use insonify::gpu::{Binding, Buffer, BufferKind, Device, Kernel, test_device};
use insonify::scene::Scene;
use insonify::sim::layout::NONE;
use insonify::sim::shaders::Library;
use insonify::sim::tracer::Tracer;
use insonify::sim::world::World;

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
    node_visits: u32,
    triangle_tests: u32,
}

/// What the kernel says of a ray.
#[derive(Clone, Copy, Debug)]
pub struct Traced {
    pub found: Option<Found>,
    pub position: DVec3,
    pub geometric: DVec3,
    pub shading: DVec3,
    pub node_visits: u32,
    pub triangle_tests: u32,
}

/// A scene on the device with one tracer.
pub struct Rig {
    device: Arc<Device>,
    kernel: Kernel,
    world: World,
    meshes: Vec<usize>,
    /// Stands in for one of the world's buffers after an error was planted.
    spoilt: Option<(usize, Buffer)>,
}

/// One device for all tests: validation makes opening one slow. Dispatches take turns.
fn device() -> Arc<Device> {
    static DEVICE: OnceLock<Arc<Device>> = OnceLock::new();
    DEVICE.get_or_init(test_device).clone()
}

impl Rig {
    pub fn new(scene: &Scene, tracer: Tracer) -> Self {
        let device = device();
        assert!(
            device.supports_ray_query(),
            "'{}' has no ray queries: both tracers are tested",
            device.name()
        );
        // The counting variant is the compute tracer's kernel with counters compiled in.
        let stem = match tracer {
            Tracer::Bvh => "rays_count",
            Tracer::RayQuery => "rays_query",
        };
        let kernel = Kernel::new(&device, stem, Library::embedded().words(stem), &[]).unwrap();
        let world = World::new(&device, scene, tracer).unwrap();
        Self {
            kernel,
            world,
            meshes: scene.instances.iter().map(|i| i.mesh).collect(),
            spoilt: None,
            device,
        }
    }

    pub fn trace(&self, rays: &[Ray]) -> Vec<Traced> {
        static TURN: Mutex<()> = Mutex::new(());
        if rays.is_empty() {
            return Vec::new();
        }
        let raw: Vec<RawRay> = rays
            .iter()
            .map(|r| RawRay {
                origin: [r.origin[0], r.origin[1], r.origin[2], r.t_min],
                direction: [r.direction[0], r.direction[1], r.direction[2], r.t_max],
                skip: [r.skip.unwrap_or(NONE), 0, 0, 0],
            })
            .collect();
        let _turn = TURN.lock().unwrap_or_else(|e| e.into_inner());
        let bytes = bytemuck::cast_slice(&raw);
        let list = self
            .device
            .buffer("rays", bytes.len() as u64, BufferKind::Storage)
            .unwrap();
        let hits = self
            .device
            .buffer(
                "hits",
                (size_of::<RawHit>() * rays.len()) as u64,
                BufferKind::Storage,
            )
            .unwrap();
        self.device.upload(&list, bytes).unwrap();
        let mut bindings = self.world.bindings().to_vec();
        if let Some((slot, buffer)) = &self.spoilt {
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
                triangle: self.world.triangle(self.meshes[instance], hit.primitive),
            }
        });
        Traced {
            found,
            position: vector(hit.position),
            geometric: vector(hit.geometric),
            shading: vector(hit.shading),
            node_visits: hit.node_visits,
            triangle_tests: hit.triangle_tests,
        }
    }

    pub fn found(&self, rays: &[Ray]) -> Vec<Option<Found>> {
        self.trace(rays).into_iter().map(|hit| hit.found).collect()
    }

    /// The scene with its instances moved.
    pub fn update(&mut self, scene: &Scene) -> bool {
        let world = &mut self.world;
        self.device
            .once(|commands| Ok(world.update(commands, scene).unwrap()))
            .unwrap()
    }

    /// No validation message so far.
    pub fn assert_silent(&self) {
        let messages = self.device.validation_messages();
        assert!(messages.is_empty(), "{messages:#?}");
    }

    /// Exchanges the planes of one child of the first mesh's root along x.
    pub fn swap_a_bound(&mut self) {
        let Binding::Buffer(nodes) = self.world.structure() else {
            panic!("not this tracer")
        };
        let mut bytes = self.device.read_back(nodes).unwrap();
        let root = 80 * self.world.rows()[0].bvh_root as usize;
        // After corner, exponents, links and kinds: eight lower planes, eight upper planes.
        let child = (0..8)
            .find(|i| bytes[root + 24 + i] != 0)
            .expect("a root has children");
        bytes.swap(root + 32 + child, root + 40 + child);
        self.spoil(4, &bytes);
    }

    /// Makes one triangle a point.
    pub fn drop_a_triangle(&mut self) {
        let mut indices: Vec<u32> = self.device.read_back_as(self.world.triangles()).unwrap();
        indices[301] = indices[300];
        indices[302] = indices[300];
        self.spoil(3, bytemuck::cast_slice(&indices));
    }

    fn spoil(&mut self, slot: usize, bytes: &[u8]) {
        let buffer = self
            .device
            .buffer("spoilt", bytes.len() as u64, BufferKind::Storage)
            .unwrap();
        self.device.upload(&buffer, bytes).unwrap();
        self.spoilt = Some((slot, buffer));
    }
}
