//! Bounding volume hierarchies for the compute tracer: one per mesh, and one over the placed meshes.
//!
//! Built on the CPU with obvhs: PLOC, reinsertion, then collapse to eight children with quantised
//! boxes. With [`Splits::Object`] every triangle lies in exactly one leaf and the leaf order is a
//! permutation; with [`Splits::Spatial`] a triangle may lie in several. The node format is described in
//! `glsl/intersect_bvh.glsl`.

mod refit;
mod split;

use std::time::Duration;

use glam::{DAffine3, DVec3, Vec3A};
use obvhs::{
    BvhBuildParams,
    aabb::Aabb,
    bvh2::{Bvh2, builder::build_bvh2, reinsertion::ReinsertionOptimizer},
    cwbvh::{CwBvh, builder::build_cwbvh, bvh2_to_cwbvh::bvh2_to_cwbvh, node::CwBvhNode},
    ploc::{PlocSearchDistance, SortPrecision},
};

use super::layout::{BVH_STACK, NONE};
use crate::scene::Mesh;
pub use refit::{Levels, levels};

/// A node as the kernel reads it: 80 bytes.
pub type Node = [u32; 20];

/// Stack entries that the top level leaves while a mesh is traversed, beside one entry per level.
const TOP_LEVEL_ENTRIES: usize = 1;

const MESH_BUILD: BvhBuildParams = BvhBuildParams {
    pre_split: false,
    ploc_search_distance: PlocSearchDistance::Medium,
    search_depth_threshold: 3,
    reinsertion_batch_ratio: 1.0,
    post_collapse_reinsertion_batch_ratio_multiplier: 0.0,
    sort_precision: SortPrecision::U64,
    max_prims_per_leaf: 2,
    collapse_traversal_cost: 1.0,
};

/// Parameters of a quick build, for a tree that is used for one keyframe only.
const QUICK_BUILD: BvhBuildParams = BvhBuildParams {
    ploc_search_distance: PlocSearchDistance::Minimum,
    search_depth_threshold: 1,
    reinsertion_batch_ratio: 0.0,
    ..MESH_BUILD
};

/// The error of a scene that the compute tracer cannot trace.
#[derive(Debug, thiserror::Error)]
pub enum BvhError {
    /// The traversal stack would overflow.
    #[error(
        "the hierarchy needs {0} stack entries and the compute tracer has {BVH_STACK}: \
         remove degenerate triangles, or use the ray-query tracer"
    )]
    TooDeep(usize),
}

/// The choice between trees that may cut triangles and trees that must not.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Splits {
    /// Triangles stay whole: for trees that are refitted, and for trees that serve one keyframe only.
    Object,
    /// Triangles are cut where rays become faster. Builds take longer, and cut triangles are stored several times.
    #[default]
    Spatial,
}

/// The hierarchy of one mesh.
#[derive(Clone, Debug)]
pub struct MeshBvh {
    nodes: Vec<CwBvhNode>,
    depth: usize,
    /// `triangle_order[i]` is the index in [`Mesh::triangles`] of the i-th triangle in leaf order; a triangle
    /// that was cut occurs several times.
    pub triangle_order: Vec<u32>,
    /// Smallest and largest corner of the mesh, object space.
    pub bounds: [[f32; 3]; 2],
}

impl MeshBvh {
    /// Builds the hierarchy of a mesh with finite coordinates; the hierarchy of an empty mesh is empty.
    pub fn build(mesh: &Mesh) -> Self {
        Self::with(mesh, MESH_BUILD)
    }

    /// Like [`Self::build`], but faster to build and slower for rays.
    pub fn build_fast(mesh: &Mesh) -> Self {
        Self::with(mesh, QUICK_BUILD)
    }

    fn with(mesh: &Mesh, params: BvhBuildParams) -> Self {
        let boxes = boxes(&mesh.positions, &mesh.triangles);
        Self::of(wide(&boxes, params))
    }

    /// Builds the hierarchy of `triangles`, indices into `positions`; unused positions are allowed.
    pub fn over(positions: &[[f32; 3]], triangles: &[[u32; 3]], splits: Splits) -> Self {
        Self::of(match splits {
            Splits::Object => wide(&boxes(positions, triangles), MESH_BUILD),
            Splits::Spatial => {
                let mut tree = split::tree(positions, triangles);
                ReinsertionOptimizer::default().run(
                    &mut tree,
                    MESH_BUILD.reinsertion_batch_ratio,
                    None,
                );
                bvh2_to_cwbvh(&tree, MESH_BUILD.max_prims_per_leaf, true, false)
            }
        })
    }

    fn of(tree: CwBvh) -> Self {
        Self {
            depth: depth(&tree.nodes),
            nodes: tree.nodes,
            triangle_order: tree.primitive_indices,
            bounds: [tree.total_aabb.min.into(), tree.total_aabb.max.into()],
        }
    }

    /// The number of nodes, of 80 bytes each.
    pub fn node_count(&self) -> usize {
        self.nodes.len()
    }

    /// The nodes as a buffer holds them from node `root` on; the triangles in leaf order begin at
    /// `first_triangle`.
    pub fn nodes_at(&self, root: u32, first_triangle: u32) -> impl Iterator<Item = Node> + '_ {
        let moved = move |&node: &CwBvhNode| place(node, root, first_triangle);
        self.nodes.iter().map(moved)
    }
}

/// A binary hierarchy over `boxes`, for searches on the processor.
pub(super) fn binary(boxes: &[Aabb]) -> Bvh2 {
    match boxes.is_empty() {
        true => Bvh2::default(),
        false => build_bvh2(boxes, MESH_BUILD, &mut Duration::default()),
    }
}

fn boxes(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Vec<Aabb> {
    let around = |t: &[u32; 3]| Aabb::from_points(&t.map(|i| Vec3A::from(positions[i as usize])));
    triangles.iter().map(around).collect()
}

fn wide(boxes: &[Aabb], params: BvhBuildParams) -> CwBvh {
    if boxes.is_empty() {
        CwBvh::default()
    } else {
        build_cwbvh(boxes, params, &mut Duration::default())
    }
}

/// The number of levels of the tree; parents come before their children.
fn depth(nodes: &[CwBvhNode]) -> usize {
    let mut levels = vec![1; nodes.len()];
    for (i, node) in nodes.iter().enumerate() {
        for child in 0..node.imask.count_ones() {
            levels[(node.child_base_idx + child) as usize] = levels[i] + 1;
        }
    }
    levels.into_iter().max().unwrap_or(0)
}

/// The node with its references moved to the places of its children and primitives in the buffers.
fn place(mut node: CwBvhNode, first_node: u32, first_primitive: u32) -> Node {
    node.child_base_idx += first_node;
    node.primitive_base_idx += first_primitive;
    bytemuck::cast(node)
}

/// One placed mesh (or several that share a structure) in the top level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BvhInstance {
    /// Index of the instance. An instance may be placed several times; rays enter only the place that
    /// `slot` in its row names.
    pub instance: u32,
    /// Box around everything that can be there, object space, mm.
    pub bounds: [[f32; 3]; 2],
    /// World from object space, mm.
    pub world_from_object: DAffine3,
    /// True if several instances share it and some of them are not shown.
    pub partial: bool,
}

/// All nodes of a scene. The header, the top level and its table of instances come first, so that
/// moving an instance rewrites only these; the trees of the meshes follow.
#[derive(Clone)]
pub struct SceneBvh {
    /// The buffer's contents.
    pub nodes: Vec<Node>,
    /// For each place of the last [`Self::place`]: the value that `slot` in its instance's row has while
    /// rays enter this place.
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
        Self { nodes, slots: Vec::new(), top: Bvh2::default(), deepest: 0, capacity }
    }

    /// A scene of meshes, whose triangles in leaf order begin at `first_triangles`, with room for
    /// `capacity` places; and the root node of each mesh, NONE for an empty one.
    pub fn of(meshes: &[MeshBvh], first_triangles: &[u32], capacity: usize) -> (Self, Vec<u32>) {
        let mut scene = Self::new(capacity);
        let trees = meshes.iter().zip(first_triangles);
        let roots = trees.map(|(tree, &first)| scene.add(tree, first)).collect();
        (scene, roots)
    }

    /// Appends the tree of a mesh, whose triangles in leaf order begin at `first_triangle`. Returns its root
    /// node, NONE for an empty mesh.
    pub fn add(&mut self, tree: &MeshBvh, first_triangle: u32) -> u32 {
        let root = self.nodes.len() as u32;
        self.nodes.extend(tree.nodes_at(root, first_triangle));
        self.deepen(tree);
        if tree.nodes.is_empty() { NONE } else { root }
    }

    /// Appends room for `count` nodes of later trees. Returns the number of the first node.
    pub fn reserve(&mut self, count: usize) -> u32 {
        let first = self.nodes.len() as u32;
        self.nodes.resize(self.nodes.len() + count, [0; 20]);
        first
    }

    /// Takes into account the depth of a tree that will be put into reserved room.
    pub fn deepen(&mut self, tree: &MeshBvh) {
        self.deepest = self.deepest.max(tree.depth);
    }

    /// Removes the trees of the meshes, once the device has them; the top level stays.
    pub fn forget_meshes(&mut self) {
        self.nodes.truncate(self.table() + self.capacity.div_ceil(20));
        self.nodes.shrink_to_fit();
    }

    fn table(&self) -> usize {
        1 + self.capacity
    }

    /// Builds the top level over `placed` and returns the nodes that changed: the beginning of the buffer.
    /// With `refit`, and if the number of places is that of the last call, the tree is kept and only its boxes
    /// are updated.
    ///
    /// # Errors
    /// An error when the kernel's stack could overflow.
    pub fn place(&mut self, placed: &[BvhInstance], refit: bool) -> Result<&[Node], BvhError> {
        assert!(placed.len() <= self.capacity, "more places than reserved");
        let boxes: Vec<Aabb> =
            placed.iter().map(|p| world_box(p.bounds, &p.world_from_object)).collect();
        if refit && self.top.primitives_to_nodes.len() == boxes.len() {
            for (node, bounds) in self.top.primitives_to_nodes.iter().zip(&boxes) {
                self.top.nodes[*node as usize].set_aabb(*bounds);
            }
            self.top.refit_all();
        } else {
            self.top = top_tree(&boxes);
        }
        let wide = bvh2_to_cwbvh(&self.top, 1, true, false);
        let needed = depth(&wide.nodes) + TOP_LEVEL_ENTRIES + self.deepest;
        if needed > BVH_STACK {
            return Err(BvhError::TooDeep(needed));
        }
        self.nodes[0][0] = if boxes.is_empty() { NONE } else { 1 };
        self.nodes[0][2] = placed.iter().any(|p| p.partial).into();
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

/// The tree of the top level. It has one box per leaf, because entering an instance costs more than a box.
fn top_tree(boxes: &[Aabb]) -> Bvh2 {
    if boxes.is_empty() {
        return Bvh2::default();
    }
    let params =
        BvhBuildParams { max_prims_per_leaf: 1, reinsertion_batch_ratio: 1.0, ..MESH_BUILD };
    let mut tree = build_bvh2(boxes, params, &mut Duration::default());
    tree.update_primitives_to_nodes();
    tree
}

/// World box of a placed object box, widened by the rounding of the kernel's single-precision
/// transforms (a few ulps of the largest coordinate that enters).
fn world_box([lo, hi]: [[f32; 3]; 2], world_from_object: &DAffine3) -> Aabb {
    let corners = (0..8).map(|i| {
        let pick = |axis: usize| f64::from(if i >> axis & 1 == 0 { lo[axis] } else { hi[axis] });
        world_from_object.transform_point3(DVec3::new(pick(0), pick(1), pick(2)))
    });
    let (min, max) =
        corners.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(a, b), p| (a.min(p), b.max(p)));
    let margin = DVec3::splat(2e-6 * min.abs().max(max.abs()).max_element());
    Aabb::new((min - margin).as_vec3a(), (max + margin).as_vec3a())
}

#[cfg(test)]
mod tests;
