//! Bounding volume hierarchies for the compute tracer: one per mesh, and one over the placed meshes.
//!
//! Built on the CPU with obvhs: PLOC, reinsertion, then collapse to eight children with quantised
//! boxes. Triangles are never split, so that every triangle lies in exactly one leaf and the leaf
//! order is a permutation. The node format is described in `glsl/intersect_bvh.glsl`.

use std::time::Duration;

use glam::{DAffine3, DVec3, Vec3A};
use obvhs::{
    BvhBuildParams,
    aabb::Aabb,
    cwbvh::{CwBvh, builder::build_cwbvh, node::CwBvhNode},
    ploc::{PlocSearchDistance, SortPrecision},
};

use super::layout::NONE;
use crate::scene::Mesh;

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
        let boxes: Vec<Aabb> = mesh
            .triangles
            .iter()
            .map(|t| Aabb::from_points(&t.map(|i| Vec3A::from(mesh.positions[i as usize]))))
            .collect();
        let tree = wide(&boxes, MESH);
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

/// All nodes of a scene. First come the header, the top level and its table of instances, so that
/// moving an instance rewrites only those.
#[derive(Clone, Debug)]
pub struct SceneBvh {
    /// The buffer's contents.
    pub nodes: Vec<Node>,
    /// Per mesh: its root, [`NONE`] for an empty mesh.
    pub roots: Vec<u32>,
    bounds: Vec<[[f32; 3]; 2]>,
    deepest: usize,
    instances: usize,
}

impl SceneBvh {
    /// Puts the meshes' trees into one buffer with room for `instances` placements.
    /// `first_triangles[m]` is where mesh m's leaf-ordered triangles begin.
    pub fn new(meshes: &[MeshBvh], first_triangles: &[u32], instances: usize) -> Self {
        // A tree never has more nodes than primitives.
        let mut nodes = vec![[0; 20]; 1 + instances + instances.div_ceil(20)];
        nodes[0][..2].copy_from_slice(&[NONE, 1 + instances as u32]);
        let mut roots = Vec::with_capacity(meshes.len());
        for (mesh, &first_triangle) in meshes.iter().zip(first_triangles) {
            let root = nodes.len() as u32;
            nodes.extend(
                mesh.nodes
                    .iter()
                    .map(|&node| place(node, root, first_triangle)),
            );
            roots.push(if mesh.nodes.is_empty() { NONE } else { root });
        }
        let deepest = meshes.iter().map(|m| m.depth).max().unwrap_or(0);
        Self {
            nodes,
            roots,
            bounds: meshes.iter().map(|m| m.bounds).collect(),
            deepest,
            instances,
        }
    }

    /// Rebuilds the top level over `placements`, (mesh, world from object) per instance, and
    /// returns the nodes that changed: the buffer's beginning.
    ///
    /// # Errors
    /// When the kernel's stack could overflow.
    pub fn place(&mut self, placements: &[(usize, DAffine3)]) -> Result<&[Node], BvhError> {
        assert_eq!(
            placements.len(),
            self.instances,
            "instances were added or removed after the upload"
        );
        let (ids, boxes): (Vec<u32>, Vec<Aabb>) = placements
            .iter()
            .enumerate()
            .filter(|(_, (mesh, _))| self.roots[*mesh] != NONE)
            .map(|(i, (mesh, matrix))| (i as u32, world_box(self.bounds[*mesh], matrix)))
            .unzip();
        // Entering an instance costs more than a box: one per leaf.
        let top = wide(
            &boxes,
            BvhBuildParams {
                max_prims_per_leaf: 1,
                reinsertion_batch_ratio: 1.0,
                ..MESH
            },
        );
        let needed = depth(&top.nodes) + ENTRY + self.deepest;
        if needed > STACK {
            return Err(BvhError::TooDeep(needed));
        }
        self.nodes[0][0] = if boxes.is_empty() { NONE } else { 1 };
        for (slot, node) in self.nodes[1..].iter_mut().zip(&top.nodes) {
            *slot = place(*node, 1, 0);
        }
        let table = 1 + self.instances;
        let end = table + self.instances.div_ceil(20);
        for (slot, &index) in self.nodes[table..end]
            .as_flattened_mut()
            .iter_mut()
            .zip(&top.primitive_indices)
        {
            *slot = ids[index as usize];
        }
        Ok(&self.nodes[..end])
    }
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
