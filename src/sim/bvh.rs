//! Bounding volume hierarchies for the compute tracer: one per mesh, and one over the placed meshes.
//!
//! Built on the CPU with obvhs (PLOC, then reinsertion). Triangles are never split, so that every
//! triangle lies in exactly one leaf and the leaf order is a permutation. Node format: see
//! `glsl/intersect_bvh.glsl`.

use std::time::Duration;

use glam::{DAffine3, DVec3, Vec3A};
use obvhs::{
    BvhBuildParams,
    aabb::Aabb,
    bvh2::{Bvh2, builder::build_bvh2},
    ploc::{PlocSearchDistance, SortPrecision},
};

use super::layout::NONE;
use crate::scene::Mesh;

/// A node as the kernel reads it: both children's boxes and references, 64 bytes.
pub type Node = [u32; 16];

/// Entries of the kernel's stack: levels of the top tree plus levels of the deepest mesh.
pub const STACK: usize = 64;
const LEAF: u32 = 0x8000_0000;
const COUNT_SHIFT: u32 = 27;
const MAX_TRIANGLES: usize = 1 << COUNT_SHIFT;
const MAX_LEAF: u32 = 8;

/// obvhs "medium" quality.
const MESH: BvhBuildParams = BvhBuildParams {
    pre_split: false,
    ploc_search_distance: PlocSearchDistance::Medium,
    search_depth_threshold: 3,
    reinsertion_batch_ratio: 0.05,
    post_collapse_reinsertion_batch_ratio_multiplier: 2.0,
    sort_precision: SortPrecision::U64,
    max_prims_per_leaf: MAX_LEAF,
    collapse_traversal_cost: 3.0,
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
    /// A leaf cannot address so many triangles.
    #[error(
        "{0} triangles, and the compute tracer addresses at most {MAX_TRIANGLES}: simplify the meshes"
    )]
    TooManyTriangles(usize),
}

/// A tree in the kernel's format; node and triangle indices count from the tree's own beginning.
#[derive(Clone, Debug)]
struct Tree {
    nodes: Vec<Node>,
    root: u32,
    order: Vec<u32>,
    depth: usize,
}

/// The hierarchy of one mesh.
#[derive(Clone, Debug)]
pub struct MeshBvh {
    tree: Tree,
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
        let mut tree = if boxes.is_empty() {
            Tree {
                nodes: Vec::new(),
                root: NONE,
                order: Vec::new(),
                depth: 0,
            }
        } else {
            Tree::from_bvh2(
                &build_bvh2(&boxes, MESH, &mut Duration::default()),
                |first, triangles| LEAF | ((triangles.len() as u32 - 1) << COUNT_SHIFT) | first,
            )
        };
        let bounds = boxes.iter().fold(Aabb::INVALID, |all, b| all.union(b));
        let triangle_order = std::mem::take(&mut tree.order);
        Self {
            tree,
            triangle_order,
            bounds: [bounds.min.into(), bounds.max.into()],
        }
    }

    /// Nodes of this mesh alone.
    pub fn nodes(&self) -> usize {
        self.tree.nodes.len()
    }
}

impl Tree {
    /// Depth first, so that a parent and its first child are neighbours in memory. `leaf` makes
    /// the reference of a leaf from the place of its first primitive in the order, and the primitives.
    fn from_bvh2(bvh: &Bvh2, leaf: impl Fn(u32, &[u32]) -> u32) -> Self {
        let mut tree = Self {
            nodes: Vec::new(),
            root: NONE,
            order: Vec::new(),
            depth: 0,
        };
        // (index in the source, where its reference goes, levels above it)
        let mut pending = vec![(0, None::<(usize, usize)>, 0)];
        while let Some((index, slot, depth)) = pending.pop() {
            let source = &bvh.nodes[index];
            let reference = if source.is_leaf() {
                let range =
                    source.first_index as usize..(source.first_index + source.prim_count) as usize;
                let first = tree.order.len() as u32;
                let primitives = &bvh.primitive_indices[range];
                tree.order.extend_from_slice(primitives);
                leaf(first, primitives)
            } else {
                let node = tree.nodes.len();
                let children = [source.first_index as usize, source.first_index as usize + 1];
                tree.nodes
                    .push(boxes_of(children.map(|c| bvh.nodes[c].aabb())));
                tree.depth = tree.depth.max(depth + 1);
                for child in [1, 0] {
                    pending.push((children[child], Some((node, 12 + child)), depth + 1));
                }
                node as u32
            };
            match slot {
                Some((node, word)) => tree.nodes[node][word] = reference,
                None => tree.root = reference,
            }
        }
        tree
    }

    /// Copies the nodes to the end of `nodes`, moves their references, and returns the root's.
    fn append_to(&self, nodes: &mut Vec<Node>, first_triangle: u32) -> u32 {
        let first_node = nodes.len() as u32;
        let place = |reference: u32| match reference {
            NONE => NONE,
            r if r & LEAF != 0 => r + first_triangle,
            r => r + first_node,
        };
        nodes.extend(self.nodes.iter().map(|node| {
            let mut node = *node;
            node[12] = place(node[12]);
            node[13] = place(node[13]);
            node
        }));
        place(self.root)
    }
}

fn boxes_of([a, b]: [&Aabb; 2]) -> Node {
    let f = |v: f32| v.to_bits();
    [
        f(a.min.x),
        f(a.max.x),
        f(a.min.y),
        f(a.max.y),
        f(b.min.x),
        f(b.max.x),
        f(b.min.y),
        f(b.max.y),
        f(a.min.z),
        f(a.max.z),
        f(b.min.z),
        f(b.max.z),
        NONE,
        NONE,
        0,
        0,
    ]
}

/// All nodes of a scene. The first `1 + instances` are the header and room for the top level, so
/// that moving an instance rewrites only those.
#[derive(Clone, Debug)]
pub struct SceneBvh {
    /// The buffer's contents.
    pub nodes: Vec<Node>,
    /// Per mesh: the reference of its root, [`NONE`] for an empty mesh.
    pub roots: Vec<u32>,
    bounds: Vec<[[f32; 3]; 2]>,
    deepest: usize,
    reserved: usize,
}

impl SceneBvh {
    /// Puts the meshes' trees into one buffer with room for `instances` placements.
    /// `first_triangles[m]` is where mesh m's leaf-ordered triangles begin.
    pub fn new(
        meshes: &[MeshBvh],
        first_triangles: &[u32],
        instances: usize,
    ) -> Result<Self, BvhError> {
        let triangles: usize = meshes.iter().map(|m| m.triangle_order.len()).sum();
        if triangles > MAX_TRIANGLES {
            return Err(BvhError::TooManyTriangles(triangles));
        }
        let reserved = 1 + instances;
        let mut nodes = vec![[0; 16]; reserved];
        nodes[0][0] = NONE;
        let roots = meshes
            .iter()
            .zip(first_triangles)
            .map(|(m, &f)| m.tree.append_to(&mut nodes, f))
            .collect();
        let deepest = meshes.iter().map(|m| m.tree.depth).max().unwrap_or(0);
        if deepest > STACK {
            return Err(BvhError::TooDeep(deepest));
        }
        Ok(Self {
            nodes,
            roots,
            bounds: meshes.iter().map(|m| m.bounds).collect(),
            deepest,
            reserved,
        })
    }

    /// Rebuilds the top level over `placements`, (mesh, world from object) per instance, and
    /// returns the nodes that changed: the buffer's beginning.
    pub fn place(&mut self, placements: &[(usize, DAffine3)]) -> Result<&[Node], BvhError> {
        assert!(
            placements.len() < self.reserved,
            "instances were added after the upload"
        );
        let (ids, boxes): (Vec<u32>, Vec<Aabb>) = placements
            .iter()
            .enumerate()
            .filter(|(_, (mesh, _))| self.roots[*mesh] != NONE)
            .map(|(i, (mesh, matrix))| (i as u32, world_box(self.bounds[*mesh], matrix)))
            .unzip();
        self.nodes[0][0] = NONE;
        if !boxes.is_empty() {
            // One instance per leaf: entering an instance costs more than a box.
            let params = BvhBuildParams {
                max_prims_per_leaf: 1,
                reinsertion_batch_ratio: 1.0,
                ..MESH
            };
            let bvh = build_bvh2(&boxes, params, &mut Duration::default());
            let tree = Tree::from_bvh2(&bvh, |_, single| LEAF | ids[single[0] as usize]);
            if tree.depth + self.deepest > STACK {
                return Err(BvhError::TooDeep(tree.depth + self.deepest));
            }
            let mut top = vec![self.nodes[0]];
            top[0][0] = tree.append_to(&mut top, 0);
            self.nodes[..top.len()].copy_from_slice(&top);
        }
        Ok(&self.nodes[..self.reserved])
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
