//! Bounding volume hierarchies for the compute tracer: one per mesh, and one over the placed meshes.
//!
//! Built on the CPU with obvhs: PLOC, reinsertion, then collapse to eight children with quantised
//! boxes. Triangles are never split, so that every triangle lies in exactly one leaf and the leaf
//! order is a permutation. The node format is described in `glsl/intersect_bvh.glsl`.

mod refit;

use std::time::Duration;

use glam::{DAffine3, DVec3, Vec3A};
use obvhs::{
    BvhBuildParams,
    aabb::Aabb,
    bvh2::{Bvh2, builder::build_bvh2},
    cwbvh::{CwBvh, builder::build_cwbvh, bvh2_to_cwbvh::bvh2_to_cwbvh, node::CwBvhNode},
    ploc::{PlocSearchDistance, SortPrecision},
};

use super::layout::NONE;
use crate::scene::Mesh;
pub use refit::{Levels, levels};

/// A node as the kernel reads it: 80 bytes.
pub type Node = [u32; 20];

/// Entries of the kernel's stack.
pub const STACK: usize = 32;
/// Left on the stack by the top level while a mesh is walked, beside one entry per level.
const ENTRY: usize = 1;

const MESH: BvhBuildParams = BvhBuildParams {
    pre_split: false,
    ploc_search_distance: PlocSearchDistance::Medium,
    search_depth_threshold: 3,
    reinsertion_batch_ratio: 0.05,
    post_collapse_reinsertion_batch_ratio_multiplier: 0.0,
    sort_precision: SortPrecision::U64,
    max_prims_per_leaf: 3,
    collapse_traversal_cost: 1.0,
};

/// A quick build, for a tree that lives for one keyframe.
const FAST: BvhBuildParams = BvhBuildParams {
    ploc_search_distance: PlocSearchDistance::Minimum,
    search_depth_threshold: 1,
    reinsertion_batch_ratio: 0.0,
    ..MESH
};

/// Why a scene cannot be traced by the compute tracer.
#[derive(Debug, thiserror::Error)]
pub enum BvhError {
    /// The traversal stack would overflow.
    #[error(
        "the hierarchy needs {0} stack entries and the compute tracer has {STACK}: \
         remove degenerate triangles, or use the ray-query tracer"
    )]
    TooDeep(usize),
}

/// The hierarchy of one mesh.
#[derive(Clone, Debug)]
pub struct MeshBvh {
    nodes: Vec<CwBvhNode>,
    depth: usize,
    /// `triangle_order[i]` is the index in [`Mesh::triangles`] of the i-th triangle in leaf order.
    pub triangle_order: Vec<u32>,
    /// Smallest and largest corner of the mesh, object space.
    pub bounds: [[f32; 3]; 2],
}

impl MeshBvh {
    /// Builds the hierarchy of a mesh with finite coordinates; an empty mesh has an empty one.
    pub fn build(mesh: &Mesh) -> Self {
        Self::with(mesh, MESH)
    }

    /// As [`Self::build`], sooner and for slower rays.
    pub fn build_fast(mesh: &Mesh) -> Self {
        Self::with(mesh, FAST)
    }

    fn with(mesh: &Mesh, params: BvhBuildParams) -> Self {
        let boxes: Vec<Aabb> = mesh
            .triangles
            .iter()
            .map(|t| Aabb::from_points(&t.map(|i| Vec3A::from(mesh.positions[i as usize]))))
            .collect();
        let tree = wide(&boxes, params);
        Self {
            depth: depth(&tree.nodes),
            nodes: tree.nodes,
            triangle_order: tree.primitive_indices,
            bounds: [tree.total_aabb.min.into(), tree.total_aabb.max.into()],
        }
    }

    /// How many nodes of 80 bytes this mesh takes.
    pub fn node_count(&self) -> usize {
        self.nodes.len()
    }

    /// The nodes as they stand in a buffer from `root` on; leaf-ordered triangles begin at
    /// `first_triangle`.
    pub fn nodes_at(&self, root: u32, first_triangle: u32) -> impl Iterator<Item = Node> + '_ {
        let moved = move |&node: &CwBvhNode| place(node, root, first_triangle);
        self.nodes.iter().map(moved)
    }
}

fn wide(boxes: &[Aabb], params: BvhBuildParams) -> CwBvh {
    if boxes.is_empty() {
        CwBvh::default()
    } else {
        build_cwbvh(boxes, params, &mut Duration::default())
    }
}

/// Levels of the tree; parents come before their children.
fn depth(nodes: &[CwBvhNode]) -> usize {
    let mut levels = vec![1; nodes.len()];
    for (i, node) in nodes.iter().enumerate() {
        for child in 0..node.imask.count_ones() {
            levels[(node.child_base_idx + child) as usize] = levels[i] + 1;
        }
    }
    levels.into_iter().max().unwrap_or(0)
}

/// The node with its references moved to where its children and primitives lie in the buffers.
fn place(mut node: CwBvhNode, first_node: u32, first_primitive: u32) -> Node {
    node.child_base_idx += first_node;
    node.primitive_base_idx += first_primitive;
    bytemuck::cast(node)
}

/// What the top level holds at one place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placed {
    /// Index of the instance; it may have several places, of which rays enter only the one that its
    /// row's `slot` names.
    pub instance: u32,
    /// Box around everything that may be found there, object space, mm.
    pub bounds: [[f32; 3]; 2],
    /// World from object space, mm.
    pub world_from_object: DAffine3,
}

/// All nodes of a scene. First come the header, the top level and its table of instances, so that
/// moving an instance rewrites only those; behind them the meshes' trees.
#[derive(Clone)]
pub struct SceneBvh {
    /// The buffer's contents.
    pub nodes: Vec<Node>,
    /// Per place of the last [`Self::place`]: what the row of its instance says as `slot` while the
    /// place is the one that rays enter.
    pub slots: Vec<u32>,
    top: Bvh2,
    deepest: usize,
    capacity: usize,
}

impl SceneBvh {
    /// An empty scene with room for `capacity` places.
    pub fn new(capacity: usize) -> Self {
        // A tree never has more nodes than primitives.
        let mut nodes = vec![[0; 20]; 1 + capacity + capacity.div_ceil(20)];
        nodes[0][..2].copy_from_slice(&[NONE, 1 + capacity as u32]);
        Self {
            nodes,
            slots: Vec::new(),
            top: Bvh2::default(),
            deepest: 0,
            capacity,
        }
    }

    /// A scene of meshes, whose leaf-ordered triangles begin at `first_triangles`, with room for
    /// `capacity` places; and the root of each, NONE for an empty mesh.
    pub fn of(meshes: &[MeshBvh], first_triangles: &[u32], capacity: usize) -> (Self, Vec<u32>) {
        let mut scene = Self::new(capacity);
        let trees = meshes.iter().zip(first_triangles);
        let roots = trees.map(|(tree, &first)| scene.add(tree, first)).collect();
        (scene, roots)
    }

    /// Appends a mesh's tree, whose leaf-ordered triangles begin at `first_triangle`; its root, NONE
    /// for an empty mesh.
    pub fn add(&mut self, tree: &MeshBvh, first_triangle: u32) -> u32 {
        let root = self.nodes.len() as u32;
        self.nodes.extend(tree.nodes_at(root, first_triangle));
        self.deepen(tree);
        if tree.nodes.is_empty() { NONE } else { root }
    }

    /// Appends room for `count` nodes of trees to come; the first of them.
    pub fn reserve(&mut self, count: usize) -> u32 {
        let first = self.nodes.len() as u32;
        self.nodes.resize(self.nodes.len() + count, [0; 20]);
        first
    }

    /// Counts with the depth of a tree that is put into reserved room.
    pub fn deepen(&mut self, tree: &MeshBvh) {
        self.deepest = self.deepest.max(tree.depth);
    }

    /// Forgets the meshes' trees, once the device has them; the top level stays.
    pub fn forget_meshes(&mut self) {
        self.nodes
            .truncate(self.table() + self.capacity.div_ceil(20));
        self.nodes.shrink_to_fit();
    }

    fn table(&self) -> usize {
        1 + self.capacity
    }

    /// Makes the top level over `placed` and returns the nodes that changed: the buffer's beginning.
    /// With `refit` the tree of the last call is kept where it has as many places, and only its boxes
    /// follow.
    ///
    /// # Errors
    /// When the kernel's stack could overflow.
    pub fn place(&mut self, placed: &[Placed], refit: bool) -> Result<&[Node], BvhError> {
        assert!(placed.len() <= self.capacity, "more places than reserved");
        let boxes: Vec<Aabb> = placed
            .iter()
            .map(|p| world_box(p.bounds, &p.world_from_object))
            .collect();
        if refit && self.top.primitives_to_nodes.len() == boxes.len() {
            for (node, bounds) in self.top.primitives_to_nodes.iter().zip(&boxes) {
                self.top.nodes[*node as usize].set_aabb(*bounds);
            }
            self.top.refit_all();
        } else {
            self.top = top_tree(&boxes);
        }
        let wide = bvh2_to_cwbvh(&self.top, 1, true, false);
        let needed = depth(&wide.nodes) + ENTRY + self.deepest;
        if needed > STACK {
            return Err(BvhError::TooDeep(needed));
        }
        self.nodes[0][0] = if boxes.is_empty() { NONE } else { 1 };
        for (slot, node) in self.nodes[1..].iter_mut().zip(&wide.nodes) {
            *slot = place(*node, 1, 0);
        }
        let table = self.table();
        let end = table + self.capacity.div_ceil(20);
        self.slots = vec![NONE; placed.len()];
        for (slot, (word, &index)) in self.nodes[table..end]
            .as_flattened_mut()
            .iter_mut()
            .zip(&wide.primitive_indices)
            .enumerate()
        {
            *word = placed[index as usize].instance;
            self.slots[index as usize] = slot as u32;
        }
        Ok(&self.nodes[..end])
    }
}

/// One box per leaf, because entering an instance costs more than a box.
fn top_tree(boxes: &[Aabb]) -> Bvh2 {
    if boxes.is_empty() {
        return Bvh2::default();
    }
    let params = BvhBuildParams {
        max_prims_per_leaf: 1,
        reinsertion_batch_ratio: 1.0,
        ..MESH
    };
    let mut tree = build_bvh2(boxes, params, &mut Duration::default());
    tree.update_primitives_to_nodes();
    tree
}

/// World box of a placed object box, widened by the rounding of the kernel's single-precision
/// transforms (a few ulps of the largest coordinate that enters).
fn world_box([lo, hi]: [[f32; 3]; 2], world_from_object: &DAffine3) -> Aabb {
    let corners = (0..8).map(|i| {
        let pick = |axis: usize| {
            f64::from(if i >> axis & 1 == 0 {
                lo[axis]
            } else {
                hi[axis]
            })
        };
        world_from_object.transform_point3(DVec3::new(pick(0), pick(1), pick(2)))
    });
    let (min, max) = corners.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(a, b), p| {
        (a.min(p), b.max(p))
    });
    let margin = DVec3::splat(2e-6 * min.abs().max(max.abs()).max_element());
    Aabb::new((min - margin).as_vec3a(), (max + margin).as_vec3a())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wavy square of `2 n^2` triangles, 10 mm wide, with slivers and flat parts.
    fn sheet(n: u32) -> Mesh {
        let at = |i: u32, j: u32| {
            let (x, y) = (
                10.0 * i as f32 / n as f32,
                10.0 * (j as f32 / n as f32).powi(3),
            );
            [x, y, (x * 1.3).sin().max(0.0) * y]
        };
        let vertex = |i: u32, j: u32| i * (n + 1) + j;
        Mesh {
            positions: (0..=n)
                .flat_map(|i| (0..=n).map(move |j| at(i, j)))
                .collect(),
            triangles: (0..n)
                .flat_map(|i| (0..n).map(move |j| (i, j)))
                .flat_map(|(i, j)| {
                    let [a, b, c, d] = [
                        vertex(i, j),
                        vertex(i + 1, j),
                        vertex(i + 1, j + 1),
                        vertex(i, j + 1),
                    ];
                    [[a, b, c], [a, c, d]]
                })
                .collect(),
            ..Mesh::default()
        }
    }

    /// Walks a tree as the kernel does; checks that each child's quantised box, widened by half of
    /// the kernel's margin, holds the triangles below it, and counts how often each is reached.
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
        let order: Vec<u32> = [0, 2]
            .iter()
            .flat_map(|&m| trees[m].triangle_order.clone())
            .collect();
        let mut seen = vec![0; order.len()];
        walk(&scene.nodes, roots[2], &meshes[2], &order, &mut seen);
        assert!(seen[..50].iter().all(|&n| n == 0) && seen[50..].iter().all(|&n| n == 1));
    }

    fn places(trees: &[(usize, f64)], of: &[MeshBvh]) -> Vec<Placed> {
        let placed = trees.iter().enumerate().map(|(i, &(tree, x))| Placed {
            instance: 10 + i as u32,
            bounds: of[tree].bounds,
            world_from_object: DAffine3::from_translation(DVec3::new(x, 0.0, 0.0)),
        });
        placed.collect()
    }

    /// Where a point of the middle of each place is found, by a walk over the top level.
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
        tree.depth = STACK - 1;
        let mut scene = SceneBvh::new(1);
        scene.add(&tree, 0);
        let error = scene
            .place(&places(&[(0, 0.0)], &[tree]), false)
            .unwrap_err();
        assert!(matches!(error, BvhError::TooDeep(33)), "{error}");
    }

    #[test]
    fn the_kernel_has_the_stack_that_is_promised() {
        let glsl = include_str!("../../glsl/intersect_bvh.glsl");
        assert!(glsl.contains(&format!("const uint BVH_STACK = {STACK}u;")));
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
            let p = matrix
                .transform_point3(DVec3::from(p.map(f64::from)))
                .as_vec3a();
            assert!(p.cmpge(found.min).all() && p.cmple(found.max).all());
        }
    }
}
