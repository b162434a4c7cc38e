//! Meshes that change within a frame: rebuilt, refitted, traced, against brute force.

use std::sync::Arc;

use insonify::gpu::{
    Binding, Buffer, BufferKind, Device, DynamicBlas, DynamicSource, Frames, Kernel, Stage, Tlas,
    TlasInstance,
};
use insonify::sim::push;
use insonify::sim::shaders::Library;

use super::accel::ray_query_device;
use super::assert_clean;
use super::sheet::{RAYS, Rays, Vertices, grid, sheet, storage};

fn placed(mesh: &DynamicBlas) -> TlasInstance<'_> {
    let mut transform = [[0.0; 4]; 3];
    (0..3).for_each(|i| transform[i][i] = 1.0);
    TlasInstance { blas: mesh.blas(), transform, custom_index: 0, mask: 1 }
}

fn source<'a>(
    [vertices, triangles]: [&'a Buffer; 2],
    [first_vertex, vertex_count]: [u32; 2],
    [first_triangle, triangle_count]: [u32; 2],
) -> DynamicSource<'a> {
    DynamicSource {
        vertices,
        first_vertex,
        vertex_count,
        triangles,
        first_triangle,
        triangle_count,
    }
}

/// A change of a mesh before a trace.
#[derive(Clone, Copy)]
enum Change<'a> {
    Build(DynamicSource<'a>),
    Refit(DynamicSource<'a>),
    /// The top level is rebuilt over an unchanged mesh.
    None,
}

fn trace(
    rays: &Rays,
    mesh: &mut DynamicBlas,
    tlas: &mut Tlas,
    change: Change<'_>,
) -> Vec<[f32; 4]> {
    let device = rays.device.upgrade().expect("the test holds it");
    let hits = rays.hits(&device);
    device
        .once(|commands| {
            match change {
                Change::Build(source) => mesh.build(commands, source)?,
                Change::Refit(source) => mesh.refit(commands, source)?,
                Change::None => {}
            }
            tlas.build(commands, &[placed(mesh)])?;
            commands.barrier(Stage::Build, Stage::Compute);
            rays.record(commands, tlas, &hits)
        })
        .unwrap();
    device.read_back_as(&hits).unwrap()
}

/// Keyframes of one topology in one buffer: rewritten vertices, or another keyframe's.
#[test]
fn a_refitted_mesh_is_where_its_vertices_are() {
    let Some(device) = ray_query_device() else {
        return;
    };
    let n = 20;
    let poses = [0.0, 0.4, 2.5].map(|phase| sheet(n, phase));
    let count = poses[0].len() as u32;
    let rays = Rays::new(&device);
    let triangles = grid(n, 0);
    let faces = [0, triangles.len() as u32];
    let all: Vertices = poses[..2].concat();
    let vertices = storage(&device, "vertices", bytemuck::cast_slice(&all));
    let indices = storage(&device, "triangles", bytemuck::cast_slice(&triangles));
    for fast_trace in [false, true] {
        device.upload(&vertices, bytemuck::cast_slice(&all)).unwrap();
        let mut mesh = DynamicBlas::new(&device, "sheet", faces[1], count, fast_trace).unwrap();
        assert!(mesh.bytes() > mesh.blas().bytes());
        let mut tlas = Tlas::new(&device, "scene", 1).unwrap();
        let at = |keyframe: u32| source([&vertices, &indices], [keyframe * count, count], faces);
        let found = trace(&rays, &mut mesh, &mut tlas, Change::Build(at(0)));
        assert_eq!(rays.wrong(&found, &poses[0], &triangles), 0, "built");
        let found = trace(&rays, &mut mesh, &mut tlas, Change::Refit(at(1)));
        assert_eq!(rays.wrong(&found, &poses[1], &triangles), 0, "refitted");
        // Overwritten, but not refitted: the comparison notices.
        device.upload(&vertices, bytemuck::cast_slice(&poses[2])).unwrap();
        let found = trace(&rays, &mut mesh, &mut tlas, Change::None);
        assert!(rays.wrong(&found, &poses[2], &triangles) > RAYS / 2, "stale");
        let found = trace(&rays, &mut mesh, &mut tlas, Change::Refit(at(0)));
        assert_eq!(rays.wrong(&found, &poses[2], &triangles), 0, "written anew");
    }
    drop((rays, vertices, indices));
    assert_clean(device);
}

/// Keyframes of different topology in the same memory, with indices that are absolute.
#[test]
fn a_mesh_is_rebuilt_with_other_triangles() {
    let Some(device) = ray_query_device() else {
        return;
    };
    let (fine, coarse) = (sheet(24, 0.0), sheet(7, 1.0));
    let vertices: Vertices = [&fine[..], &coarse[..]].concat();
    let (first, second) = (grid(24, 0), grid(7, fine.len() as u32));
    let all: Vec<[u32; 3]> = [&first[..], &second[..]].concat();
    let rays = Rays::new(&device);
    let buffers = [
        storage(&device, "vertices", bytemuck::cast_slice(&vertices)),
        storage(&device, "triangles", bytemuck::cast_slice(&all)),
    ];
    let (room, split) = (vertices.len() as u32, first.len() as u32);
    let mut mesh = DynamicBlas::new(&device, "sheet", split, room, false).unwrap();
    let mut tlas = Tlas::new(&device, "scene", 1).unwrap();
    let keyframes = [(&first, [0, split]), (&second, [split, second.len() as u32])];
    for &k in &[0, 1, 0, 1, 1] {
        let (triangles, range) = keyframes[k];
        let source = source(buffers.each_ref(), [0, room], range);
        let found = trace(&rays, &mut mesh, &mut tlas, Change::Build(source));
        assert_eq!(rays.wrong(&found, &vertices, triangles), 0, "keyframe {k}");
    }
    drop((rays, mesh, tlas, buffers));
    assert_clean(device);
}

/// Two frames in flight over one structure and one buffer of vertices, interpolated on the device:
/// each frame's rays meet its own pose.
#[test]
fn frames_in_flight_refit_one_structure() {
    let Some(device) = ray_query_device() else {
        return;
    };
    let n = 20;
    let poses = [sheet(n, 0.0), sheet(n, 1.5)];
    let count = poses[0].len() as u32;
    let triangles = grid(n, 2 * count);
    let faces = [0, triangles.len() as u32];
    let room: Vertices = [&poses[0][..], &poses[1], &poses[0]].concat();
    let vertices = storage(&device, "vertices", bytemuck::cast_slice(&room));
    let indices = storage(&device, "triangles", bytemuck::cast_slice(&triangles));
    let spirv = Library::embedded();
    let kernel = Kernel::new(&device, "interpolate", spirv.words("interpolate"), &[]).unwrap();
    let rays = Rays::new(&device);
    let mesh_source = source([&vertices, &indices], [0, 3 * count], faces);
    let mut mesh = DynamicBlas::new(&device, "sheet", faces[1], 3 * count, false).unwrap();
    let mut tlas = Tlas::new(&device, "scene", 1).unwrap();
    device.once(|c| mesh.build(c, mesh_source)).unwrap();
    let mut frames = Frames::new(&device, "frame").unwrap();
    let shown: Vec<(f32, Buffer)> =
        (0..8).map(|frame| (frame as f32 / 7.0, rays.hits(&device))).collect();
    for (blend, hits) in &shown {
        let push = push::Interpolate {
            count,
            target: 2 * count,
            sources: [0, count, 0, 0],
            weights: [1.0 - blend, *blend, 0.0, 0.0],
            stride: 3,
            ..push::Interpolate::default()
        };
        let mut commands = frames.begin().unwrap();
        let bindings = [Binding::Buffer(&vertices)];
        commands.dispatch(&kernel, [count, 1, 1], bytemuck::bytes_of(&push), &bindings).unwrap();
        mesh.refit(&mut commands, mesh_source).unwrap();
        tlas.refit(&mut commands, &[placed(&mesh)]).unwrap();
        commands.barrier(Stage::Build, Stage::Compute);
        rays.record(&mut commands, &tlas, hits).unwrap();
        commands.submit().unwrap();
    }
    // The last submissions keep what they use.
    drop((mesh, tlas, kernel));
    frames.wait().unwrap();
    for (blend, hits) in &shown {
        let between = poses[0].iter().zip(&poses[1]);
        let between = between.map(|(a, b)| [0, 1, 2].map(|i| a[i] * (1.0 - blend) + b[i] * blend));
        let pose: Vertices = room[..2 * count as usize].iter().copied().chain(between).collect();
        let found = device.read_back_as(hits).unwrap();
        assert_eq!(rays.wrong(&found, &pose, &triangles), 0, "blend {blend}");
    }
    drop((frames, vertices, indices, rays, shown));
    assert_clean(device);
}

/// Vertices and triangles of a small wavy surface, and their numbers.
fn small_sheet(device: &Arc<Device>) -> ([Buffer; 2], [u32; 2]) {
    let (pose, triangles) = (sheet(3, 0.0), grid(3, 0));
    let buffers = [
        storage(device, "vertices", bytemuck::cast_slice(&pose)),
        storage(device, "triangles", bytemuck::cast_slice(&triangles)),
    ];
    (buffers, [pose.len() as u32, triangles.len() as u32])
}

/// Mistakes that the device does not notice: vertices overwritten while a build may still read them, and rays
/// through a top level that is older than its mesh.
#[test]
fn missing_barriers_and_stale_top_levels_are_reported() {
    let Some(device) = ray_query_device() else {
        return;
    };
    let (buffers, sizes) = small_sheet(&device);
    let whole = source(buffers.each_ref(), [0, sizes[0]], [0, sizes[1]]);
    let mut mesh = DynamicBlas::new(&device, "sheet", sizes[1], sizes[0], true).unwrap();
    let mut tlas = Tlas::new(&device, "scene", 1).unwrap();
    let rays = Rays::new(&device);
    let hits = rays.hits(&device);
    let last = |what: &str| {
        let messages = device.validation_messages();
        assert!(messages.iter().any(|m| m.contains(what)), "{messages:#?}");
    };
    device
        .once(|commands| {
            mesh.build(commands, whole)?;
            tlas.build(commands, &[placed(&mesh)])?;
            commands.barrier(Stage::Build, Stage::Compute);
            rays.record(commands, &tlas, &hits)
        })
        .unwrap();
    assert!(device.validation_messages().is_empty());
    device
        .once(|commands| {
            mesh.build(commands, whole)?;
            commands.fill(whole.vertices, 0);
            Ok(())
        })
        .unwrap();
    last("no barrier Build -> Transfer");
    device
        .once(|commands| {
            mesh.refit(commands, whole)?;
            rays.record(commands, &tlas, &hits)
        })
        .unwrap();
    last("'nearest' reads 'sheet' that 'build' writes, and no barrier Build -> Compute");
    device.once(|commands| rays.record(commands, &tlas, &hits)).unwrap();
    last("STALE: 'nearest' reads 'scene'");
}

#[test]
fn meshes_that_cannot_be_built_or_refitted_are_refused_by_name() {
    let Some(device) = ray_query_device() else {
        return;
    };
    let (buffers, sizes) = small_sheet(&device);
    let whole = source(buffers.each_ref(), [0, sizes[0]], [0, sizes[1]]);
    assert!(DynamicBlas::new(&device, "none", 0, 3, true).is_err());
    let mut mesh = DynamicBlas::new(&device, "liver", sizes[1], sizes[0], true).unwrap();
    let mut refused = |build: bool, source: DynamicSource<'_>, expected: &str| {
        let error = device
            .once(|c| if build { mesh.build(c, source) } else { mesh.refit(c, source) })
            .err()
            .map_or_else(|| "accepted".into(), |e| e.to_string());
        assert!(error.contains(expected), "{error}");
    };
    refused(false, whole, "'liver': it is refitted and has not been built");
    let fewer = DynamicSource { triangle_count: 5, ..whole };
    refused(true, DynamicSource { triangle_count: 0, ..whole }, "no triangles");
    refused(true, DynamicSource { first_triangle: 1, ..whole }, "'triangles'");
    refused(true, DynamicSource { first_vertex: 1, ..whole }, "'vertices'");
    refused(true, whole, "accepted");
    refused(false, whole, "accepted");
    refused(false, fewer, "after a build of 18 from 0 on of 16 vertices: build it anew");
    let moved = DynamicSource { first_triangle: 1, triangle_count: 17, ..whole };
    refused(false, moved, "build it anew");
    let copy = storage(&device, "copy", bytemuck::cast_slice(&grid(3, 0)));
    refused(false, DynamicSource { triangles: &copy, ..whole }, "in 'copy'");
    let wide = storage(&device, "wide", &[0; 12 * 40]);
    let wider = DynamicSource { vertices: &wide, vertex_count: 40, ..whole };
    refused(true, wider, "room for 18 of 16");
    let upload = device.buffer("upload", 480, BufferKind::Upload).unwrap();
    refused(true, DynamicSource { vertices: &upload, ..whole }, "is of kind Upload");
    drop((mesh, copy, wide, upload, buffers));
    assert_clean(device);
}
