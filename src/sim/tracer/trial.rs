//! A trial of a device's ray query: it has to find what our own hierarchy finds, on a scene's own rays.
//!
//! Drivers and hardware differ, and nothing later would notice: a surface that is found twice leaves the
//! path in the wrong tissue to its end.

use std::sync::Arc;

use glam::DVec3;

use super::Tracer;
use crate::gpu::{Binding, BufferKind, Device, GpuError, Kernel};
use crate::scene::Scene;
use crate::sim::SimError;
use crate::sim::bvh::Splits;
use crate::sim::fields::Fields;
use crate::sim::layout::{NONE, Ray, RayHit};
use crate::sim::shaders::Library;
use crate::sim::world::{Kernels, World};

/// Rays followed at the same time, one per line where there are as many.
const RAYS: u32 = 1344;
/// Surfaces that each meets at most, one behind the other.
const BOUNCES: usize = 8;
/// Surfaces closer together than this, mm, may change places: both tracers round.
const MARGIN: f32 = 1e-3;
/// Of ten thousand rays so many may differ: one that grazes an edge may pass it on either side.
const DIFFERENT: usize = 3;
/// How far a new ray begins from the surface that it leaves, over the largest coordinate (glsl/path.glsl).
const CLEARANCE: f32 = 4e-6;

/// Rays that were compared, and how many met another surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Trial {
    /// All of them.
    pub rays: usize,
    /// Those for which the tracers disagree.
    pub different: usize,
}

impl Trial {
    /// Follows rays of the scene's probe from surface to surface with both tracers: straight on and
    /// mirrored, from where a ray has met a surface, which is where tracers find it again.
    ///
    /// # Errors
    /// What the device refuses; a scene that the ray query does not serve.
    pub fn run(device: &Arc<Device>, library: &Library, scene: &Scene) -> Result<Self, SimError> {
        let own = Bench::new(device, library, scene, Tracer::Bvh)?;
        let query = Bench::new(device, library, scene, Tracer::RayQuery)?;
        let mut trial = Self::default();
        let mut rays = first_rays(scene);
        for _ in 0..BOUNCES {
            let (mine, theirs) = (own.trace(device, &rays)?, query.trace(device, &rays)?);
            let different = |(a, b): &(&RayHit, &RayHit)| !agree(a, b);
            trial.different += mine.iter().zip(&theirs).filter(different).count();
            trial.rays += rays.len();
            rays = next_rays(&rays, &mine);
            if rays.is_empty() {
                break;
            }
        }
        Ok(trial)
    }

    /// Whether the ray query may be used.
    pub fn passed(&self) -> bool {
        10_000 * self.different <= DIFFERENT * self.rays
    }
}

/// The same number for the same kernels and geometry: a trial of them needs no repetition.
pub(super) fn id(library: &Library, scene: &Scene) -> u64 {
    let crc = crc::Crc::<u64>::new(&crc::CRC_64_XZ);
    let mut digest = crc.digest();
    for stem in ["rays_bvh", "rays_query", "trace_query"] {
        if library.stems().any(|s| s == stem) {
            digest.update(bytemuck::cast_slice(library.words(stem)));
        }
    }
    for mesh in &scene.meshes {
        digest.update(bytemuck::cast_slice(&mesh.positions));
    }
    digest.finalize()
}

/// One tracer with the scene.
struct Bench {
    kernel: Kernel,
    world: World,
}

impl Bench {
    fn new(
        device: &Arc<Device>,
        library: &Library,
        scene: &Scene,
        tracer: Tracer,
    ) -> Result<Self, SimError> {
        let stem = format!("rays_{}", tracer.suffix());
        let kernel = Kernel::new(device, &stem, library.words(&stem), &[])?;
        let kernels = Arc::new(Kernels::new(device, library)?);
        // Rays do not ask where tissue has gone.
        let fields = Fields::none(scene);
        let apart = vec![false; scene.instances.len()];
        let world =
            World::with_fields(device, &kernels, scene, tracer, Splits::default(), fields, apart)?;
        Ok(Self { kernel, world })
    }

    fn trace(&self, device: &Arc<Device>, rays: &[Ray]) -> Result<Vec<RayHit>, GpuError> {
        let (mask, slots) = self.world.ray_mask();
        let slots = slots.into();
        let rays: Vec<Ray> = rays.iter().map(|ray| Ray { mask, slots, ..*ray }).collect();
        let bytes = bytemuck::cast_slice(&rays);
        let list = device.buffer("trial rays", bytes.len() as u64, BufferKind::Storage)?;
        let size = size_of::<RayHit>() * rays.len();
        let hits = device.buffer("trial hits", size as u64, BufferKind::Storage)?;
        device.upload(&list, bytes)?;
        let mut bindings = self.world.bindings().to_vec();
        bindings.extend([Binding::Buffer(&list), Binding::Buffer(&hits)]);
        device.once(|commands| {
            commands.dispatch(&self.kernel, [rays.len() as u32, 1, 1], &[], &bindings)
        })?;
        device.read_back_as(&hits)
    }
}

/// Both met nothing, or the same surface at the same place, or two that lie there together.
fn agree(a: &RayHit, b: &RayHit) -> bool {
    match (a.instance, b.instance) {
        (NONE, NONE) => true,
        (NONE, _) | (_, NONE) => false,
        _ => (a.t - b.t).abs() <= MARGIN,
    }
}

fn first_rays(scene: &Scene) -> Vec<Ray> {
    let (probe, place) = (&scene.probe, &scene.world_from_probe);
    let lines = probe.scanlines * probe.elevation_layers;
    // Evenly from all of them where there are more.
    let line = |i: u32| (u64::from(i) * u64::from(lines) / u64::from(lines.min(RAYS))) as u32;
    (0..lines.min(RAYS))
        .map(|i| {
            let line = line(i);
            let (origin, direction) = probe.ray(line % probe.scanlines, line / probe.scanlines);
            ray(
                place.transform_point3(origin).as_vec3().to_array(),
                place.transform_vector3(direction).normalize(),
                0.0,
            )
        })
        .collect()
}

fn ray(origin: [f32; 3], direction: DVec3, t_min: f32) -> Ray {
    Ray {
        origin,
        t_min,
        direction: direction.as_vec3().to_array(),
        t_max: f32::MAX,
        skip: NONE,
        mask: 0,
        slots: 0,
        unused: 0,
    }
}

/// From each surface straight on, or mirrored by it, in turn.
fn next_rays(rays: &[Ray], hits: &[RayHit]) -> Vec<Ray> {
    let hit = |(_, hit): &(&Ray, &RayHit)| hit.instance != NONE;
    (rays.iter().zip(hits).filter(hit).enumerate())
        .map(|(i, (before, hit))| {
            let widen = |v: [f32; 3]| DVec3::from(v.map(f64::from));
            let (d, n) = (widen(before.direction), widen(hit.geometric));
            let turned = if i % 3 == 0 { d - 2.0 * d.dot(n) * n } else { d };
            let largest = hit.position.iter().fold(1.0, |m: f32, x| m.max(x.abs()));
            ray(hit.position, turned.normalize(), CLEARANCE * largest)
        })
        .collect()
}

#[cfg(test)]
mod tests;
