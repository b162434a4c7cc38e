//! Acceleration structures and ray queries; skipped on a device without them.

use std::sync::Arc;

use insonify::gpu::{
    Binding, Blas, BlasInput, BlasOptions, Buffer, BufferKind, Device, DeviceOptions, GpuError,
    Kernel, LoneDevice, Stage, Tlas, TlasInstance, build_times, lone_device, lone_test_device,
    refit_times,
};

use super::skip::{Lacking, skip};
use super::timestamps::timestamps;
use super::{assert_clean, words};

const ONE: [[u32; 3]; 1] = [[0, 1, 2]];

/// A triangle around the z axis at depth z.
fn triangle(z: f32) -> [[f32; 3]; 3] {
    [[-10.0, -10.0, z], [10.0, -10.0, z], [0.0, 15.0, z]]
}

fn shifted(z: f32) -> [[f32; 4]; 3] {
    [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, z]]
}

/// A device with ray queries, or `None` with a message that the test is not run.
pub fn ray_query_device() -> Option<LoneDevice> {
    let device = lone_test_device();
    if !device.supports_ray_query() {
        skip(Lacking::Tool, &format!("'{}' has no ray queries", device.name()));
        return None;
    }
    Some(device)
}

/// Two rays along z, one through the middle and one beside everything.
struct Rays {
    kernel: Kernel,
    origins: Buffer,
    hits: Buffer,
}

impl Rays {
    fn new(device: &Arc<Device>) -> Self {
        let spirv = words(include_bytes!("nearest.spv"));
        let storage = |name| device.buffer(name, 32, BufferKind::Storage).unwrap();
        let origins = storage("origins");
        let values = [[0.0_f32, 0.0, 0.0, 0.0], [100.0, 0.0, 0.0, 0.0]];
        device.upload(&origins, bytemuck::cast_slice(&values)).unwrap();
        Self {
            kernel: Kernel::new(device, "nearest", &spirv, &[]).unwrap(),
            origins,
            hits: storage("hits"),
        }
    }

    fn record(
        &self,
        commands: &mut insonify::gpu::Commands<'_>,
        tlas: &Tlas,
    ) -> Result<(), GpuError> {
        let bindings =
            [Binding::Tlas(tlas), Binding::Buffer(&self.origins), Binding::Buffer(&self.hits)];
        commands.dispatch(&self.kernel, [2, 1, 1], bytemuck::bytes_of(&2_u32), &bindings)
    }

    /// Distance, custom index and triangle of the middle ray's hit; the other must miss. Vulkan does not say how exact a
    /// distance is: it is rounded to hundredths, far less than what lies between any two triangles here.
    fn hit(&self, device: &Arc<Device>) -> [f32; 3] {
        let hits = device.read_back_as::<[f32; 4]>(&self.hits).unwrap();
        assert_eq!(hits[1], [-1.0; 4]);
        let [t, index, triangle, _] = hits[0];
        [(t * 1e2).round() / 1e2, index, triangle]
    }
}

/// Two keyframes of a mesh, swapped in the top level by rebuild and by refit.
#[test]
fn keyframes_are_swapped_by_rebuild_and_by_refit() {
    let Some(device) = ray_query_device() else {
        return;
    };
    let (near, far) = (triangle(20.0), triangle(50.0));
    let input = |name, positions| BlasInput { name, positions, triangles: &ONE };
    let keyframes = [input("near", &near[..]), input("far", &far[..])];
    let blas = Blas::build_many(&device, &keyframes, BlasOptions::default()).unwrap();
    assert_eq!((blas[0].name(), blas[1].name()), ("near", "far"));
    let rays = Rays::new(&device);
    let mut tlas = Tlas::new(&device, "scene", 2).unwrap();
    let trace = |tlas: &mut Tlas, keyframe: usize, z: f32, refit: bool| {
        let instance = TlasInstance {
            blas: &blas[keyframe],
            transform: shifted(z),
            custom_index: 70_000 + keyframe as u32,
            mask: 0xff,
        };
        device
            .once(|commands| {
                if refit {
                    tlas.refit(commands, &[instance])?;
                } else {
                    tlas.build(commands, &[instance])?;
                }
                commands.barrier(Stage::Build, Stage::Compute);
                rays.record(commands, tlas)
            })
            .unwrap();
        rays.hit(&device)
    };
    assert_eq!(trace(&mut tlas, 0, 0.0, false), [20.0, 70_000.0, 0.0]);
    assert_eq!(trace(&mut tlas, 1, 0.0, false), [50.0, 70_001.0, 0.0]);
    assert_eq!(trace(&mut tlas, 0, 5.0, true), [25.0, 70_000.0, 0.0]);
    assert_eq!(trace(&mut tlas, 1, -8.0, true), [42.0, 70_001.0, 0.0]);
    drop((blas, rays, tlas));
    assert_clean(device);
}

/// Many meshes of different size keep their order, and compaction saves memory.
#[test]
fn batches_keep_their_order_and_compaction_saves_memory() {
    let Some(device) = ray_query_device() else {
        return;
    };
    let meshes: Vec<_> = (1..20_u32)
        .map(|n| {
            let z = 10.0 * n as f32;
            let positions: Vec<_> = (0..n).flat_map(|i| triangle(z + i as f32)).collect();
            let triangles: Vec<_> = (0..n).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
            (positions, triangles)
        })
        .collect();
    let inputs: Vec<BlasInput> = (meshes.iter())
        .map(|(positions, triangles)| BlasInput { name: "mesh", positions, triangles })
        .collect();
    let loose = BlasOptions { compact: false, ..Default::default() };
    let bytes = |all: &[Blas]| all.iter().map(Blas::bytes).sum::<u64>();
    let loose_bytes = bytes(&Blas::build_many(&device, &inputs, loose).unwrap());
    let before = device.memory().current;
    let blas = Blas::build_many(&device, &inputs, BlasOptions::default()).unwrap();
    assert!(bytes(&blas) <= loose_bytes, "{} {loose_bytes}", bytes(&blas));
    // Only alignment to 256 bytes may be added: inputs and scratch are gone.
    let kept = device.memory().current - before;
    assert!(kept <= bytes(&blas) + 256 * 20, "{kept} {}", bytes(&blas));

    let rays = Rays::new(&device);
    let mut tlas = Tlas::new(&device, "scene", 1).unwrap();
    for (n, blas) in blas.iter().enumerate() {
        let instance = TlasInstance { blas, transform: shifted(0.5), custom_index: 1, mask: 1 };
        device
            .once(|commands| {
                tlas.build(commands, &[instance])?;
                commands.barrier(Stage::Build, Stage::Compute);
                rays.record(commands, &tlas)
            })
            .unwrap();
        assert_eq!(rays.hit(&device), [10.0 * (n + 1) as f32 + 0.5, 1.0, 0.0]);
    }
    drop((blas, rays, tlas));
    assert_clean(device);
}

#[test]
fn rays_pass_a_scene_without_instances() {
    let Some(device) = ray_query_device() else {
        return;
    };
    let rays = Rays::new(&device);
    let mut tlas = Tlas::new(&device, "empty", 4).unwrap();
    device
        .once(|commands| {
            tlas.build(commands, &[])?;
            commands.barrier(Stage::Build, Stage::Compute);
            rays.record(commands, &tlas)
        })
        .unwrap();
    assert_eq!(rays.hit(&device), [-1.0; 3]);
    drop((rays, tlas));
    assert_clean(device);
}

/// The validation layers do not see a trace of a structure that is still being built.
#[test]
fn a_missing_barrier_between_build_and_trace_is_reported() {
    let Some(device) = ray_query_device() else {
        return;
    };
    let positions = triangle(20.0);
    let input = BlasInput { name: "t", positions: &positions, triangles: &ONE };
    let blas = Blas::build_many(&device, &[input], BlasOptions::default()).unwrap();
    let rays = Rays::new(&device);
    let mut tlas = Tlas::new(&device, "scene", 1).unwrap();
    let instance =
        TlasInstance { blas: &blas[0], transform: shifted(0.0), custom_index: 0, mask: 1 };
    device
        .once(|commands| {
            tlas.build(commands, &[instance])?;
            rays.record(commands, &tlas)
        })
        .unwrap();
    let messages = device.validation_messages();
    let reported =
        |m: &String| m.contains("'nearest' reads 'scene'") && m.contains("Build -> Compute");
    assert!(messages.iter().any(reported), "{messages:#?}");
}

#[test]
fn geometry_that_cannot_be_built_is_refused_by_name() {
    let Some(device) = ray_query_device() else {
        return;
    };
    let positions = triangle(20.0);
    let build = |triangles: &[[u32; 3]]| {
        let input = BlasInput { name: "liver", positions: &positions, triangles };
        Blas::build_many(&device, &[input], BlasOptions::default())
    };
    let text = build(&[]).err().unwrap().to_string();
    assert!(text.contains("'liver'") && text.contains("no triangles"), "{text}");
    let text = build(&[[0, 1, 2], [0, 1, 3]]).err().unwrap().to_string();
    assert!(text.contains("triangle 1 is [0, 1, 3], of 3 vertices"), "{text}");

    let blas = build(&ONE).unwrap();
    let mut tlas = Tlas::new(&device, "scene", 1).unwrap();
    let one = TlasInstance { blas: &blas[0], transform: shifted(0.0), custom_index: 0, mask: 1 };
    let error = device.once(|c| tlas.build(c, &[one, one])).unwrap_err();
    assert!(error.to_string().contains("2 instances, room for 1"), "{error}");
    let wide = TlasInstance { custom_index: 1 << 24, ..one };
    assert!(device.once(|c| tlas.build(c, &[wide])).is_err());
    let rays = Rays::new(&device);
    let error = device.once(|c| rays.record(c, &tlas)).unwrap_err();
    assert!(error.to_string().contains("has not been built"), "{error}");
    drop((blas, tlas, rays));
    assert_clean(device);
}

/// Without the extensions everything except rays works, and the error gives the reason.
#[test]
fn a_device_without_acceleration_structures_runs_kernels_and_refuses_rays() {
    let options = DeviceOptions {
        validate: true,
        without_acceleration_structures: true,
        ..Default::default()
    };
    let device = lone_device(&options).unwrap();
    assert!(!device.supports_ray_query() && !device.supports_acceleration_structure());
    let positions = triangle(1.0);
    let input = BlasInput { name: "t", positions: &positions, triangles: &ONE };
    let error = Blas::build_many(&device, &[input], BlasOptions::default()).err().unwrap();
    assert!(matches!(error, GpuError::Unsupported { .. }), "{error}");
    assert!(Tlas::new(&device, "scene", 1).is_err());
    assert!(device.buffer("scratch", 64, BufferKind::Scratch).is_err());
    let spirv = words(include_bytes!("nearest.spv"));
    let error = Kernel::new(&device, "nearest", &spirv, &[]).err().unwrap();
    assert!(error.to_string().contains("needs ray queries"), "{error}");

    let kernel = super::add_kernel(&device, 1);
    let [a, b] = ["a", "b"].map(|name| super::buffer_of(&device, name, &[4; 8]));
    let push = [8, 1_u32];
    device
        .once(|commands| {
            commands.scope("add");
            let bindings = [Binding::Buffer(&a), Binding::Buffer(&b)];
            commands.dispatch(&kernel, [8, 1, 1], bytemuck::bytes_of(&push), &bindings)
        })
        .unwrap();
    assert_eq!(device.read_back_as::<u32>(&b).unwrap(), [5; 8]);
    drop((kernel, a, b));
    assert_clean(device);
}

/// Without ray queries, as on GPUs for data centres, structures are built and timed, and rays are refused.
#[test]
fn structures_are_built_and_timed_without_ray_queries() {
    if ray_query_device().is_none() {
        return;
    }
    let options = DeviceOptions { validate: true, without_ray_query: true, ..Default::default() };
    let device = lone_device(&options).unwrap();
    assert!(!device.supports_ray_query() && device.supports_acceleration_structure());
    let spirv = words(include_bytes!("nearest.spv"));
    let error = Kernel::new(&device, "nearest", &spirv, &[]).err().unwrap();
    assert!(error.to_string().contains("needs ray queries"), "{error}");

    let positions: Vec<_> = (0..100_000).flat_map(|i| triangle(i as f32)).collect();
    let all: Vec<_> = (0..100_000).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let mesh = |triangles| BlasInput { name: "mesh", positions: &positions, triangles };
    let (many, few) = (mesh(&all[..]), mesh(&all[..20]));
    let loose = BlasOptions { fast_trace: false, compact: false };
    let compacted = build_times(&device, &[many, few], BlasOptions::default()).unwrap();
    let large = build_times(&device, &[many], loose).unwrap();
    let small = build_times(&device, &[few], loose).unwrap();
    let changing = refit_times(&device, &[many, few], false).unwrap();
    println!("{compacted:?}\n{large:?}\n{small:?}\n{changing:?}");
    assert!(compacted.compacted_bytes <= compacted.bytes);
    assert_eq!((large.compact_ms, large.compacted_bytes), (0.0, large.bytes));
    // Five thousand times the triangles; what is there for any number of them counts in the small one.
    assert!(large.bytes > 100 * small.bytes && changing.bytes > large.bytes);
    if timestamps(&device) {
        assert!(compacted.build_ms > 0.0 && compacted.compact_ms > 0.0);
        assert!(changing.build_ms > 0.0 && changing.refit_ms > 0.0);
        // The time is that of the build.
        assert!(large.build_ms > small.build_ms);
    } else {
        let untimed = [compacted.build_ms, small.build_ms, changing.build_ms, changing.refit_ms];
        assert!(untimed.iter().all(|ms| ms.is_nan()), "{untimed:?}");
    }

    // Top levels and meshes that change need no ray queries either.
    let blas = Blas::build_many(&device, &[few], BlasOptions::default()).unwrap();
    let mut tlas = Tlas::new(&device, "scene", 1).unwrap();
    let one = TlasInstance { blas: &blas[0], transform: shifted(0.0), custom_index: 0, mask: 1 };
    device
        .once(|commands| {
            commands.scope("top");
            tlas.build(commands, &[one])
        })
        .unwrap();
    drop((blas, tlas));
    assert_clean(device);
}
