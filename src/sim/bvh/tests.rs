//! Tests of trees and of the top level, traversed as the kernel does.

use super::*;

/// A wavy square of `2 n^2` triangles, 10 mm wide, with slivers and flat parts.
fn sheet(n: u32) -> Mesh {
    let at = |i: u32, j: u32| {
        let (x, y) = (10.0 * i as f32 / n as f32, 10.0 * (j as f32 / n as f32).powi(3));
        [x, y, (x * 1.3).sin().max(0.0) * y]
    };
    let vertex = |i: u32, j: u32| i * (n + 1) + j;
    Mesh {
        positions: (0..=n).flat_map(|i| (0..=n).map(move |j| at(i, j))).collect(),
        triangles: (0..n)
            .flat_map(|i| (0..n).map(move |j| (i, j)))
            .flat_map(|(i, j)| {
                let [a, b, c, d] =
                    [vertex(i, j), vertex(i + 1, j), vertex(i + 1, j + 1), vertex(i, j + 1)];
                [[a, b, c], [a, c, d]]
            })
            .collect(),
        ..Mesh::default()
    }
}

/// Traverses a tree as the kernel does. Checks that the quantised box of each child, widened by half of
/// the kernel's margin, contains the triangles below it, and counts how often each triangle is reached.
fn walk(nodes: &[Node], node: u32, mesh: &Mesh, order: &[u32], seen: &mut [u32]) -> Aabb {
    let node: CwBvhNode = bytemuck::cast(nodes[node as usize]);
    let mut all = Aabb::INVALID;
    for child in (0..8).filter(|&child| !node.is_child_empty(child)) {
        let below = if node.is_leaf(child) {
            let (first, count) = node.child_primitives(child);
            (first..first + count).fold(Aabb::INVALID, |below, i| {
                seen[i as usize] += 1;
                let corners = mesh.triangles[order[i as usize] as usize];
                corners.iter().fold(below, |b, &v| {
                    b.union(&Aabb::from_point(Vec3A::from(mesh.positions[v as usize])))
                })
            })
        } else {
            walk(nodes, node.child_node_index(child), mesh, order, seen)
        };
        let (stated, margin) = (node.child_aabb(child), node.compute_extent() * 2.5e-4);
        assert!(
            below.min.cmpge(stated.min - margin).all()
                && below.max.cmple(stated.max + margin).all(),
            "{below:?} leaves {stated:?}"
        );
        all = all.union(&below);
    }
    all
}

#[test]
fn every_triangle_lies_in_one_leaf_and_in_its_boxes() {
    for n in [1, 2, 3, 40] {
        let mesh = sheet(n);
        let tree = MeshBvh::build(&mesh);
        let mut scene = SceneBvh::new(0);
        let root = scene.add(&tree, 0);
        let mut seen = vec![0; mesh.triangles.len()];
        let bounds = walk(&scene.nodes, root, &mesh, &tree.triangle_order, &mut seen);
        assert!(seen.iter().all(|&count| count == 1), "{n}: {seen:?}");
        assert_eq!([bounds.min.to_array(), bounds.max.to_array()], tree.bounds);
    }
}

#[test]
fn trees_of_two_meshes_share_one_buffer() {
    let meshes = [sheet(5), Mesh::default(), sheet(9)];
    let trees = meshes.each_ref().map(MeshBvh::build);
    let mut scene = SceneBvh::new(4);
    let roots = [0, 1, 2].map(|m| scene.add(&trees[m], [0, 50, 50][m]));
    assert_eq!(roots[1], NONE, "an empty mesh has no root");
    let order: Vec<u32> = [0, 2].iter().flat_map(|&m| trees[m].triangle_order.clone()).collect();
    let mut seen = vec![0; order.len()];
    walk(&scene.nodes, roots[2], &meshes[2], &order, &mut seen);
    assert!(seen[..50].iter().all(|&n| n == 0) && seen[50..].iter().all(|&n| n == 1));
}

fn places(trees: &[(usize, f64)], of: &[MeshBvh]) -> Vec<BvhInstance> {
    let placed = trees.iter().enumerate().map(|(i, &(tree, x))| BvhInstance {
        instance: 10 + i as u32,
        bounds: of[tree].bounds,
        world_from_object: DAffine3::from_translation(DVec3::new(x, 0.0, 0.0)),
        partial: false,
    });
    placed.collect()
}

/// The places whose boxes contain a point, found by a walk over the top level.
fn reached(scene: &SceneBvh, p: Vec3A) -> Vec<u32> {
    let mut todo = vec![scene.nodes[0][0]];
    let mut found = Vec::new();
    while let Some(index) = todo.pop() {
        let node: CwBvhNode = bytemuck::cast(scene.nodes[index as usize]);
        for child in (0..8).filter(|&child| !node.is_child_empty(child)) {
            let (bounds, margin) = (node.child_aabb(child), node.compute_extent() * 2.5e-4);
            if p.cmplt(bounds.min - margin).any() || p.cmpgt(bounds.max + margin).any() {
                continue;
            }
            if node.is_leaf(child) {
                found.push(node.child_primitives(child).0);
            } else {
                todo.push(node.child_node_index(child));
            }
        }
    }
    found
}

#[test]
fn the_top_level_follows_by_rebuild_and_by_refit() {
    let trees = [sheet(5), sheet(9)].map(|m| MeshBvh::build(&m));
    let mut scene = SceneBvh::new(4);
    for tree in &trees {
        scene.add(tree, 0);
    }
    let before = scene.nodes.clone();
    let start = places(&[(0, 0.0), (1, 50.0), (0, 100.0), (1, 150.0)], &trees);
    let moved = places(&[(0, 10.0), (1, -50.0), (1, 110.0), (0, 60.0)], &trees);
    let changed = scene.place(&start, false).unwrap().len();
    assert_eq!(scene.nodes[changed..], before[changed..]);
    for refit in [false, true] {
        scene.place(&start, false).unwrap();
        scene.place(&moved, refit).unwrap();
        for (placed, &slot) in moved.iter().zip(&scene.slots) {
            let middle = Vec3A::from(placed.bounds[0]).midpoint(placed.bounds[1].into());
            let middle = middle + placed.world_from_object.translation.as_vec3a();
            assert_eq!(reached(&scene, middle), [slot]);
            let table = scene.nodes[5].iter().chain(&scene.nodes[6]);
            assert_eq!(table.copied().nth(slot as usize), Some(placed.instance));
        }
    }
    scene.place(&moved[..1], true).unwrap();
    assert_eq!(scene.slots.len(), 1, "fewer places are a new tree");
}

#[test]
fn an_empty_scene_has_no_root() {
    let mut scene = SceneBvh::new(1);
    assert_eq!(scene.add(&MeshBvh::build(&Mesh::default()), 0), NONE);
    let nodes = scene.place(&[], false).unwrap();
    assert_eq!(nodes[0][0], NONE);
}

#[test]
fn too_deep_a_tree_is_refused() {
    let mut tree = MeshBvh::build(&sheet(3));
    tree.depth = BVH_STACK - 1;
    let mut scene = SceneBvh::new(1);
    scene.add(&tree, 0);
    let error = scene.place(&places(&[(0, 0.0)], &[tree]), false).unwrap_err();
    assert!(matches!(error, BvhError::TooDeep(33)), "{error}");
}

#[test]
fn a_world_box_holds_its_turned_mesh() {
    let mesh = sheet(7);
    let tree = MeshBvh::build(&mesh);
    let matrix = DAffine3::from_scale_rotation_translation(
        DVec3::new(2.0, -3.0, 0.5),
        glam::DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 1.0),
        DVec3::new(100.0, -40.0, 7.0),
    );
    let found = world_box(tree.bounds, &matrix);
    for p in &mesh.positions {
        let p = matrix.transform_point3(DVec3::from(p.map(f64::from))).as_vec3a();
        assert!(p.cmpge(found.min).all() && p.cmple(found.max).all());
    }
}
