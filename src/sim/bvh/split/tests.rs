//! Tests of trees whose triangles are cut: the leaves must cover every triangle.

use glam::DVec3;

use super::*;
use crate::scene::{Mesh, shapes};

/// Long thin triangles across each other, which fill little of their boxes, over a surface of small ones.
fn straw() -> Mesh {
    let mut mesh = shapes::sphere(6.0, 1);
    for i in 0..200 {
        let turn = 0.7 * i as f32;
        let (sin, cos) = turn.sin_cos();
        let [x, y, z] = [20.0 * cos, 20.0 * sin, 14.0 * (1.3 * turn).sin()];
        let first = mesh.positions.len() as u32;
        mesh.positions.extend([[x, y, z], [-x, -y, -z], [0.2 - x, 0.1 - y, -z]]);
        mesh.triangles.push([first, first + 1, first + 2]);
    }
    mesh
}

/// For each triangle, the boxes of the leaves that hold it.
fn leaves(tree: &Bvh2, triangles: usize) -> Vec<Vec<Aabb>> {
    let mut leaves = vec![Vec::new(); triangles];
    for node in tree.nodes.iter().filter(|node| node.is_leaf()) {
        assert_eq!(node.prim_count, 1);
        leaves[tree.primitive_indices[node.first_index as usize] as usize].push(*node.aabb());
    }
    leaves
}

/// The number of points on triangles that are in none of the triangle's leaves.
fn uncovered(tree: &Bvh2, mesh: &Mesh) -> usize {
    const STEPS: i32 = 40;
    let leaves = leaves(tree, mesh.triangles.len());
    let mut missed = 0;
    for (corners, leaves) in mesh.triangles.iter().zip(&leaves) {
        let [a, b, c] = corners.map(|v| DVec3::from(mesh.positions[v as usize].map(f64::from)));
        for (i, j) in (0..=STEPS).flat_map(|i| (0..=STEPS - i).map(move |j| (i, j))) {
            let [u, v] = [i, j].map(|step| f64::from(step) / f64::from(STEPS));
            let p = a + u * (b - a) + v * (c - a);
            let holds = |leaf: &Aabb| {
                let [low, high] = [leaf.min, leaf.max].map(|corner| corner.as_dvec3());
                p.cmpge(low - 1e-12).all() && p.cmple(high + 1e-12).all()
            };
            missed += usize::from(!leaves.iter().any(holds));
        }
    }
    missed
}

/// The depth of a tree; fails unless each box contains those below it.
fn depth(tree: &Bvh2, node: usize) -> usize {
    let node = &tree.nodes[node];
    if node.is_leaf() {
        return 1;
    }
    let first = node.first_index as usize;
    for child in [first, first + 1] {
        let (outer, inner) = (node.aabb(), tree.nodes[child].aabb());
        assert_eq!(outer.union(inner), *outer, "a child leaves its node");
    }
    1 + depth(tree, first).max(depth(tree, first + 1))
}

fn tree_of(mesh: &Mesh) -> Bvh2 {
    tree(&mesh.positions, &mesh.triangles)
}

#[test]
fn every_part_of_a_triangle_lies_in_a_leaf_that_holds_it() {
    for mesh in [straw(), shapes::cylinder(2.0, 60.0, 24), shapes::cuboid([3.0, 30.0, 9.0])] {
        let built = tree_of(&mesh);
        assert_eq!(uncovered(&built, &mesh), 0);
        depth(&built, 0);
        let bounds = built.nodes[0].aabb();
        assert_eq!([bounds.min.to_array(), bounds.max.to_array()], mesh.bounds());
    }
    // The comparison notices a box that is too small, and a part that is missing.
    let mesh = straw();
    let built = tree_of(&mesh);
    let parts = leaves(&built, mesh.triangles.len());
    let most = parts.iter().map(Vec::len).max();
    assert!(most >= Some(2), "straws are cut: {most:?}");
    let cut = parts.iter().position(|parts| Some(parts.len()) == most).expect("the most");
    let leaf = built.nodes.iter().position(|node| {
        node.is_leaf() && built.primitive_indices[node.first_index as usize] as usize == cut
    });
    for share in [0.1, 1.0] {
        let mut spoilt = built.clone();
        let node = &mut spoilt.nodes[leaf.expect("it has leaves")];
        let mut bounds = *node.aabb();
        let axis = bounds.largest_axis();
        bounds.max[axis] -= share * bounds.diagonal()[axis];
        node.set_aabb(bounds);
        assert!(uncovered(&spoilt, &mesh) > 0, "{share} of a leaf is not missed");
    }
}

/// Surface area of all nodes, leaves included, relative to that of the root.
fn cost(tree: &Bvh2) -> f32 {
    let areas = tree.nodes.iter().map(|node| node.aabb().half_area());
    areas.sum::<f32>() / tree.nodes[0].aabb().half_area()
}

#[test]
fn cuts_make_straws_cheap_and_their_number_is_bounded() {
    let mesh = straw();
    let whole =
        Builder { positions: &mesh.positions, triangles: &mesh.triangles, least_overlap: 0.0 };
    let parts: Vec<TrianglePart> = (0..mesh.triangles.len())
        .map(|t| TrianglePart {
            bounds: Aabb::from_points(
                &mesh.triangles[t].map(|v| mesh.positions[v as usize].into()),
            ),
            triangle: t as u32,
        })
        .collect();
    let objects = flat(whole.build(parts, 0, 0));
    assert_eq!(objects.primitive_indices.len(), mesh.triangles.len());
    let built = tree_of(&mesh);
    let (with, without) = (cost(&built), cost(&objects));
    println!("surface of all nodes: {with} with cuts, {without} without");
    assert!(with < 0.9 * without, "{with} with cuts, {without} without");
    let most = mesh.triangles.len() as f64 * (1.0 + MOST_DUPLICATES);
    assert!(built.primitive_indices.len() as f64 <= most);
}

/// Degenerate triangles do not hang the builder, do not make a deep tree, and none is lost.
#[test]
fn odd_triangles_are_built_over() {
    let copies = |corners: [[f32; 3]; 3], count: u32| Mesh {
        positions: corners.to_vec(),
        triangles: vec![[0, 1, 2]; count as usize],
        ..Mesh::default()
    };
    let corner = [[1.0, 2.0, 3.0], [40.0, -9.0, 5.0], [7.0, 30.0, -20.0]];
    let scales = (0..120).map(|i| (0.5_f32).powi(i));
    let nested = Mesh {
        positions: scales.flat_map(|s| corner.map(|p| p.map(|x| x * s))).collect(),
        triangles: (0..120).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
        ..Mesh::default()
    };
    let line = [[0.0; 3], [5.0, 5.0, 5.0], [10.0, 10.0, 10.0]];
    let mut grid = shapes::plane([20.0, 30.0], 0.0);
    grid.triangles = grid.triangles.repeat(50);
    let huge = corner.map(|p| p.map(|x: f32| x * 1e17));
    let cases = [
        ("one", copies(corner, 1)),
        ("two at one place", copies(corner, 2)),
        ("all at one place", copies(corner, 3000)),
        ("points", copies([[1.0, 2.0, 3.0]; 3], 3000)),
        ("lines", copies(line, 500)),
        ("in one plane", grid),
        ("within each other", nested),
        ("far away", copies(huge, 9)),
    ];
    for (name, mesh) in cases {
        let built = tree_of(&mesh);
        let held = leaves(&built, mesh.triangles.len());
        assert!(held.iter().all(|leaves| !leaves.is_empty()), "{name}");
        assert!(depth(&built, 0) <= MOST_LEVELS + 14, "{name}: {}", depth(&built, 0));
        let most = mesh.triangles.len() as f64 * (1.0 + MOST_DUPLICATES);
        assert!(built.primitive_indices.len() as f64 <= most, "{name}");
        if !name.starts_with("far") {
            assert_eq!(uncovered(&built, &mesh), 0, "{name}");
        }
    }
    assert!(tree(&[], &[]).nodes.is_empty());
}

/// The tree does not depend on the number of threads.
#[test]
fn the_same_triangles_are_the_same_tree() {
    let mesh = shapes::ellipsoid([3.0, 9.0, 27.0], 5);
    assert!(mesh.triangles.len() > 2 * PARALLEL_PARTS);
    let boxes = |tree: &Bvh2| -> Vec<[[f32; 3]; 2]> {
        let nodes = tree.nodes.iter().map(|node| node.aabb());
        nodes.map(|b| [b.min.into(), b.max.into()]).collect()
    };
    let (a, b) = (tree_of(&mesh), tree_of(&mesh));
    assert_eq!(boxes(&a), boxes(&b));
    assert_eq!(a.primitive_indices, b.primitive_indices);
}
