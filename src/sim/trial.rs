//! The choice of a tracer, and the trial of a device's ray query: on a scene's own rays it must find what our own
//! hierarchy finds.
//!
//! Drivers and hardware differ, and nothing later would detect a mistake: a surface found twice puts the
//! path into the wrong tissue up to its end.

use std::sync::Arc;

use glam::DVec3;

use crate::SimError;
use crate::bvh::Splits;
use crate::fields::Fields;
use crate::gpu::{AdapterKind, Binding, BufferKind, Device, GpuError, Kernel};
use crate::layout::{NONE, Ray, RayHit};
use crate::scene::Scene;
use crate::shaders::Library;
use crate::tracer::Tracer;
use crate::world::{ShapeKernels, World};

/// Rays followed at the same time: one per line, if there are as many lines.
const RAYS: u32 = 1344;
/// Most surfaces that each ray meets, one behind the other.
const SURFACES_PER_RAY: usize = 8;
/// Distance below which two surfaces may be found in either order, mm, as both tracers round.
const ORDER_MARGIN: f32 = 1e-3;
/// Differing rays allowed in ten thousand: a ray that grazes an edge may pass it on either side.
const MOST_DIFFERENT: usize = 3;
/// Distance from a surface at which the next ray begins, relative to the largest coordinate (glsl/path.glsl).
const CLEARANCE: f32 = 4e-6;

impl Tracer {
    /// Chooses the tracer. If `wanted` names none, it is the device's ray query if the hardware has one, else the
    /// compute tracer, which is two to three times as fast as a ray query that a driver emulates on the
    /// processor (benches/RESULTS.md). A ray query is first tried on the scene's own rays; if the device keeps
    /// results from one start to the next, only once per geometry. Returns the tracer, and a line that says why
    /// the ray query is not used where that needs saying.
    pub fn choose(
        wanted: Option<Self>,
        device: &Arc<Device>,
        library: &Library,
        scene: &Scene,
    ) -> (Self, Option<String>) {
        match wanted {
            Some(tracer) => (tracer, None),
            None if device.info().kind == AdapterKind::Cpu => (Self::Bvh, None),
            None if device.supports_ray_query() => match tried(device, library, scene) {
                Ok(()) => (Self::RayQuery, None),
                Err(why) => {
                    let name = device.name();
                    let why =
                        format!("tracing with the compute BVH: the ray query of '{name}' {why}");
                    (Self::Bvh, Some(why))
                }
            },
            None => {
                let why =
                    format!("tracing with the compute BVH: '{}' has no ray queries", device.name());
                (Self::Bvh, Some(why))
            }
        }
    }
}

/// Checks that the device's ray query finds what it should; the error completes "the ray query ...".
fn tried(device: &Arc<Device>, library: &Library, scene: &Scene) -> Result<(), String> {
    let id = id(library, scene);
    if device.remembers(id) {
        return Ok(());
    }
    match Trial::run(device, library, scene) {
        Ok(trial) if trial.passed() => {
            device.remember(id);
            Ok(())
        }
        Ok(trial) => Err(format!(
            "meets other surfaces on {} of {} rays; --tracer ray-query takes it all the same",
            trial.different, trial.rays
        )),
        Err(error) => Err(format!("cannot be tried: {error}")),
    }
}

/// The result of a trial.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Trial {
    /// Number of rays compared.
    pub rays: usize,
    /// Number of rays for which the tracers disagree.
    pub different: usize,
}

impl Trial {
    /// Follows rays of the scene's probe from surface to surface with both tracers, in turn straight on and
    /// mirrored. New rays begin at the surface found last, where a tracer may find the same surface again.
    ///
    /// # Errors
    /// A device error; a scene that the ray query cannot serve.
    pub fn run(device: &Arc<Device>, library: &Library, scene: &Scene) -> Result<Self, SimError> {
        let own = TrialWorld::new(device, library, scene, Tracer::Bvh)?;
        let query = TrialWorld::new(device, library, scene, Tracer::RayQuery)?;
        let mut trial = Self::default();
        let mut rays = first_rays(scene);
        for _ in 0..SURFACES_PER_RAY {
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

    /// True if the ray query may be used.
    pub fn passed(&self) -> bool {
        10_000 * self.different <= MOST_DIFFERENT * self.rays
    }
}

/// A number that is equal for equal kernels and geometry; their trial need not be repeated.
fn id(library: &Library, scene: &Scene) -> u64 {
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

/// The scene with one of the tracers.
struct TrialWorld {
    kernel: Kernel,
    world: World,
}

impl TrialWorld {
    fn new(
        device: &Arc<Device>,
        library: &Library,
        scene: &Scene,
        tracer: Tracer,
    ) -> Result<Self, SimError> {
        let stem = format!("rays_{}", tracer.suffix());
        let kernel = Kernel::new(device, &stem, library.words(&stem), &[])?;
        let kernels = Arc::new(ShapeKernels::new(device, library)?);
        // Rays do not use displacement fields.
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

/// True if both met nothing, or the same surface at the same place, or two surfaces at that place.
fn agree(a: &RayHit, b: &RayHit) -> bool {
    match (a.instance, b.instance) {
        (NONE, NONE) => true,
        (NONE, _) | (_, NONE) => false,
        _ => (a.t - b.t).abs() <= ORDER_MARGIN,
    }
}

fn first_rays(scene: &Scene) -> Vec<Ray> {
    let (probe, place) = (&scene.probe, &scene.world_from_probe);
    let lines = probe.scanlines * probe.elevation_layers;
    // If there are more lines than rays, lines are taken at equal steps.
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

/// The rays that continue from each surface: straight on and mirrored in turn.
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
