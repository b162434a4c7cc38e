//! Hierarchies whose triangles move: the order in which nodes are refitted on the device, and the cost of
//! rays in a refitted hierarchy.

use glam::Vec3A;
use obvhs::aabb::Aabb;

use super::MeshBvh;
use crate::push;
use crate::scene::Mesh;

/// The nodes of hierarchies level by level, deepest first, in the order that `refit` needs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Levels {
    /// Numbers of the nodes in the scene's buffer.
    pub order: Vec<u32>,
    /// The part of `order` for each dispatch, in sequence; there is a barrier between two dispatches.
    pub ranges: Vec<push::Refit>,
}

/// The levels of `trees`, each given with the number of its root in the scene's buffer
/// ([`super::SceneBvh::add`]). Trees that are refitted together share their dispatches. Empty trees are
/// allowed, with any root.
pub fn levels(trees: &[(&MeshBvh, u32)]) -> Levels {
    let mut by_level: Vec<Vec<u32>> = Vec::new();
    for &(tree, root) in trees {
        for (node, level) in levels_of(tree).into_iter().enumerate() {
            if by_level.len() <= level {
                by_level.resize(level + 1, Vec::new());
            }
            by_level[level].push(root + node as u32);
        }
    }
    let mut levels = Levels::default();
    for nodes in by_level.into_iter().rev() {
        levels
            .ranges
            .push(push::Refit { first: levels.order.len() as u32, count: nodes.len() as u32 });
        levels.order.extend(nodes);
    }
    levels
}

/// The level of each node, 0 for the root; parents come before their children.
fn levels_of(tree: &MeshBvh) -> Vec<usize> {
    let mut levels = vec![0; tree.nodes.len()];
    for (i, node) in tree.nodes.iter().enumerate() {
        for child in 0..node.imask.count_ones() {
            levels[(node.child_base_idx + child) as usize] = levels[i] + 1;
        }
    }
    levels
}

impl MeshBvh {
    /// The cost of a ray in this hierarchy after refitting it to vertices at `positions`, relative to the cost
    /// where it was built. `mesh` is the mesh from which it was built. The result is 1 where the mesh is
    /// unchanged or only shifted, and 1 for a mesh without surface; at 1.5 a new hierarchy is worth its build.
    /// The cost is that of the surface-area heuristic (Goldsmith, Salmon 1987; MacDonald, Booth 1990) with equal
    /// costs of node and triangle: `sum(A) / A_root` over all nodes and over the leaves, a leaf once for each of
    /// its triangles.
    ///
    /// # Panics
    /// When there are fewer positions than vertices, or `mesh` has other triangles.
    pub fn degradation(&self, mesh: &Mesh, positions: &[[f32; 3]]) -> f64 {
        assert!(
            positions.len() >= mesh.positions.len()
                && self.triangle_order.len() == mesh.triangles.len(),
            "positions of another mesh than `{}`",
            mesh.name
        );
        let ratio = self.cost(mesh, positions) / self.cost(mesh, &mesh.positions);
        if ratio.is_finite() { ratio } else { 1.0 }
    }

    /// Surface-area cost with the vertices of `mesh` at `positions`.
    fn cost(&self, mesh: &Mesh, positions: &[[f32; 3]]) -> f64 {
        let mut boxes = vec![Aabb::INVALID; self.nodes.len()];
        let mut sum = 0.0;
        // Children come after their parents.
        for (i, node) in self.nodes.iter().enumerate().rev() {
            let mut all = Aabb::INVALID;
            for child in (0..8).filter(|&child| !node.is_child_empty(child)) {
                let below = if node.is_leaf(child) {
                    let (first, count) = node.child_primitives(child);
                    let corners = (first..first + count)
                        .flat_map(|i| mesh.triangles[self.triangle_order[i as usize] as usize]);
                    let leaf = corners.fold(Aabb::INVALID, |leaf, v| {
                        let corner = Vec3A::from(positions[v as usize]);
                        leaf.union(&Aabb::from_point(corner))
                    });
                    sum += f64::from(count) * f64::from(leaf.half_area());
                    leaf
                } else {
                    boxes[node.child_node_index(child) as usize]
                };
                all = all.union(&below);
            }
            sum += f64::from(all.half_area());
            boxes[i] = all;
        }
        sum / boxes.first().map_or(0.0, |root| f64::from(root.half_area()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::{Node, SceneBvh};
    use crate::scene::shapes;
    use insonify_tools::reference::refit::{Child, Geometry, child, refit};

    /// A mesh deformed like a beating heart: every vertex moves by up to 4 mm, neighbours alike.
    fn pulsed(mesh: &Mesh) -> Vec<[f32; 3]> {
        let moved = |p: &[f32; 3]| {
            let swell = 1.0 + 0.2 * (0.3 * p[0] + 0.2 * p[1]).sin();
            [p[0] * swell + 0.2 * p[2], p[1] * swell, p[2] * (1.6 - 0.5 * swell)]
        };
        mesh.positions.iter().map(moved).collect()
    }

    /// The vertices of a mesh in permuted order, so that neighbours are moved far apart.
    fn shuffled(mesh: &Mesh) -> Vec<[f32; 3]> {
        let n = mesh.positions.len();
        let step =
            (n / 2..).find(|s| (2..=*s).all(|d| !n.is_multiple_of(d) || !s.is_multiple_of(d)));
        let step = step.expect("a prime is near");
        (0..n).map(|i| mesh.positions[i * step % n]).collect()
    }

    #[test]
    fn levels_hold_every_node_once_and_children_before_parents() {
        let meshes = [shapes::sphere(10.0, 4), Mesh::default(), shapes::cylinder(3.0, 20.0, 16)];
        let trees = meshes.each_ref().map(MeshBvh::build);
        let (scene, roots) = SceneBvh::of(&trees, &[0, 0, 0], 3);
        let levels = levels(&trees.iter().zip(roots).collect::<Vec<_>>());
        let mut place = vec![None; scene.nodes.len()];
        let mut next = 0;
        for (level, range) in levels.ranges.iter().enumerate() {
            assert_eq!(range.first, next, "ranges follow each other");
            next += range.count;
            for &node in &levels.order[range.first as usize..next as usize] {
                assert_eq!(place[node as usize].replace(level), None, "twice");
            }
        }
        assert_eq!(next as usize, levels.order.len());
        let total: usize = trees.iter().map(MeshBvh::node_count).sum();
        assert_eq!(levels.order.len(), total);
        for &node in &levels.order {
            for c in 0..8 {
                if let Child::Inner(inner) = child(&scene.nodes[node as usize], c) {
                    assert!(place[inner as usize] < place[node as usize]);
                }
            }
        }
    }

    /// The number of triangles that are not inside the quantised boxes above them; 0 for a correct hierarchy.
    fn outside(nodes: &[Node], root: u32, geometry: Geometry<'_>) -> usize {
        let node = &nodes[root as usize];
        let held = |c: usize, p: [f32; 3]| {
            (0..3).all(|axis| {
                let quantum = f64::from(f32::from_bits((node[3] >> (8 * axis) & 0xff) << 23));
                let byte = |word: usize| f64::from(node[word + c / 4] >> (8 * (c % 4)) & 0xff);
                let at = (f64::from(p[axis]) - f64::from(f32::from_bits(node[axis]))) / quantum;
                (byte(8 + 4 * axis)..=byte(10 + 4 * axis)).contains(&at)
            })
        };
        let below = |c: usize| below(nodes, child(node, c));
        let own = (0..8).flat_map(|c| below(c).into_iter().map(move |t| (c, t)));
        let out = own.filter(|&(c, t)| {
            let corners = geometry.triangles[t as usize].map(|v| geometry.vertices[v as usize]);
            !corners.into_iter().all(|p| held(c, p))
        });
        let inner = (0..8).filter_map(|c| match child(node, c) {
            Child::Inner(inner) => Some(outside(nodes, inner, geometry)),
            _ => None,
        });
        out.count() + inner.sum::<usize>()
    }

    fn below(nodes: &[Node], of: Child) -> Vec<u32> {
        match of {
            Child::Empty => Vec::new(),
            Child::Triangles(first, count) => (first..first + count).collect(),
            Child::Inner(node) => {
                (0..8).flat_map(|c| below(nodes, child(&nodes[node as usize], c))).collect()
            }
        }
    }

    #[test]
    fn a_refitted_hierarchy_holds_its_triangles_and_a_box_too_small_is_noticed() {
        let mesh = shapes::ellipsoid([12.0, 9.0, 17.0], 4);
        let tree = MeshBvh::build(&mesh);
        let (scene, roots) = SceneBvh::of(std::slice::from_ref(&tree), &[0], 1);
        let order = tree.triangle_order.iter();
        let triangles: Vec<_> = order.map(|&t| mesh.triangles[t as usize]).collect();
        let levels = levels(&[(&tree, roots[0])]);
        for vertices in [mesh.positions.clone(), pulsed(&mesh), shuffled(&mesh)] {
            let geometry = Geometry { vertices: &vertices, triangles: &triangles };
            let mut nodes = scene.nodes.clone();
            let mut boxes = vec![[[0.0; 3]; 2]; nodes.len()];
            for &range in &levels.ranges {
                let words = nodes.as_flattened_mut();
                let level = &levels.order[range.first as usize..][..range.count as usize];
                refit(level, words, geometry, &mut boxes);
            }
            assert_eq!(outside(&nodes, roots[0], geometry), 0);
            // The box of the last node done, the root: one child one quantum too short.
            let root = &mut nodes[roots[0] as usize];
            root[10] -= 1;
            assert!(outside(&nodes, roots[0], geometry) > 0);
        }
        let still = Geometry { vertices: &pulsed(&mesh), triangles: &triangles };
        let stale = outside(&scene.nodes, roots[0], still);
        assert!(stale > 1000, "without a refit {stale} are outside");
    }

    #[test]
    fn degradation_is_one_at_rest_and_grows_as_neighbours_part() {
        let mesh = shapes::ellipsoid([12.0, 9.0, 17.0], 4);
        let tree = MeshBvh::build(&mesh);
        assert_eq!(tree.degradation(&mesh, &mesh.positions), 1.0);
        let moved = |f: &dyn Fn([f32; 3]) -> [f32; 3]| {
            let positions: Vec<_> = mesh.positions.iter().copied().map(f).collect();
            tree.degradation(&mesh, &positions)
        };
        // Boxes keep their size under shifts and under turns that exchange axes; single precision
        // rounds 17 mm at 1e-6, in areas of leaves of about 1 mm^2.
        let shifted = moved(&|[x, y, z]| [x + 3.3, y - 7.1, z + 0.7]);
        let turned = moved(&|[x, y, z]| [-y, z, -x]);
        let scaled = moved(&|p| p.map(|c| 4.0 * c));
        for ratio in [shifted, turned, scaled] {
            assert!((ratio - 1.0).abs() < 1e-4, "{shifted} {turned} {scaled}");
        }
        let pulse = tree.degradation(&mesh, &pulsed(&mesh));
        let torn = tree.degradation(&mesh, &shuffled(&mesh));
        println!("a pulse {pulse:.3}, torn {torn:.1}");
        assert!((0.8..1.3).contains(&pulse), "a pulse: {pulse}");
        assert!(torn > 10.0, "torn apart: {torn}");
        let empty = Mesh::default();
        assert_eq!(MeshBvh::build(&empty).degradation(&empty, &[]), 1.0);
        assert_eq!(moved(&|_| [1.0, 2.0, 3.0]), 1.0, "a point");
    }
}
