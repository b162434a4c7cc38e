//! Hierarchies refitted on the device: rays meet the moved triangles as brute force says.

use std::sync::Arc;

use glam::DAffine3;
use insonify::gpu::{Binding, Buffer, Kernel, Stage};
use insonify::scene::{Scene, shapes};
use insonify::sim::bvh::{Levels, MeshBvh, Splits, levels};
use insonify::sim::shaders::Library;
use rayon::prelude::*;

use super::compare::{self, Found};
use super::device::Rig;
use super::rays::{mirrored, rays, scene, turned};

/// The bindings of the kernels that trace.
const VERTICES: usize = 1;
const NODES: usize = 4;

/// Two meshes at rest.
fn rest() -> Scene {
    let small = shapes::ellipsoid([12.0, 20.0, 9.0], 3);
    scene(vec![
        (shapes::sphere(20.0, 3), turned()),
        (small, mirrored() * DAffine3::from_translation(glam::DVec3::Z)),
    ])
}

/// Adds bumps and dents within the box of the mesh at rest: the top level stays as it is.
fn deform(scene: &mut Scene) {
    for mesh in &mut scene.meshes {
        for p in &mut Arc::make_mut(mesh).positions {
            let size = 0.7 + 0.25 * (0.4 * p[0]).sin() * (0.35 * p[1] + 0.3 * p[2]).cos();
            *p = p.map(|c| c * size);
        }
    }
}

/// The nodes of `rig`'s world with the boxes for `moved` vertices.
fn refitted(rig: &Rig, levels: &Levels, moved: &Buffer) -> Buffer {
    let Binding::Buffer(nodes) = rig.world.structure() else { panic!("not this tracer") };
    let nodes = rig.storage("refitted", &rig.device.read_back(nodes).unwrap());
    let boxes = rig.storage("boxes", &vec![0; nodes.size() as usize / 80 * 24]);
    let order = rig.storage("order", bytemuck::cast_slice(&levels.order));
    let library = Library::embedded();
    let kernel = Kernel::new(&rig.device, "refit", library.words("refit"), &[]).unwrap();
    let bindings = [&nodes, moved, rig.world.triangles(), &boxes, &order].map(Binding::Buffer);
    rig.device
        .once(|commands| {
            for level in &levels.ranges {
                let threads = [8 * level.count, 1, 1];
                commands.dispatch(&kernel, threads, bytemuck::bytes_of(level), &bindings)?;
                commands.barrier(Stage::Compute, Stage::Compute);
            }
            Ok(())
        })
        .unwrap();
    nodes
}

#[test]
fn rays_through_a_refitted_hierarchy_are_those_of_brute_force() {
    let rest = rest();
    let mut moved = rest.clone();
    deform(&mut moved);
    let rays = rays(&moved, 20_000, 17);
    let expected: Vec<_> = rays.par_iter().map(|ray| compare::expected(&moved, ray)).collect();
    let mut rig = Rig::split(&rest, Splits::Object);
    let positions: Vec<[f32; 3]> = moved.meshes.iter().flat_map(|m| m.positions.clone()).collect();
    let vertices = rig.storage("moved", bytemuck::cast_slice(&positions));
    let trees: Vec<MeshBvh> = rest.meshes.iter().map(|mesh| MeshBvh::build(mesh)).collect();
    let roots = rig.world.rows().iter().map(|row| row.bvh_root);
    let moving: Vec<_> = trees.iter().zip(roots).collect();
    let levels = levels(&moving);
    let mut found = |nodes: Option<Buffer>| {
        rig.replaced = vec![(VERTICES, vertices.clone())];
        rig.replaced.extend(nodes.map(|nodes| (NODES, nodes)));
        rig.found(&rays)
    };
    let nodes = refitted(&Rig::split(&rest, Splits::Object), &levels, &vertices);
    let wrong = compare::wrong(&moved, &rays, &expected, &found(Some(nodes)));
    assert!(wrong.is_empty(), "{wrong:?}");

    // The comparison notices: no refit at all, and one node's boxes that did not follow. A missed surface is
    // detected without looking for rays beside it, which takes long.
    let missed = |found: &[Option<Found>]| {
        let pairs = expected.iter().zip(found);
        let missed = pairs.filter(|(e, f)| match (e, f) {
            (Some(e), Some(f)) => f.t > e.t + 0.5,
            (Some(_), None) => true,
            (None, _) => false,
        });
        missed.count()
    };
    let stale = missed(&found(None));
    assert!(stale > rays.len() / 10, "only {stale} notice the stale boxes");
    let mut short = levels.clone();
    let largest = short.ranges.iter_mut().max_by_key(|range| range.count);
    largest.expect("a tree has levels").count -= 1;
    let nodes = refitted(&Rig::split(&rest, Splits::Object), &short, &vertices);
    let stale = missed(&found(Some(nodes)));
    assert!(stale > 0, "a node without its boxes goes unnoticed");
    rig.assert_silent();
}
