//! Triangles that two instances of a scene share exactly: a ray meets both at once.

use std::collections::HashMap;
use std::path::Path;

use glam::DVec3;

use crate::scene::{Issue, Mesh, Scene};

/// World positions nearer than this count as equal, mm: single precision at 100 mm resolves 8 nm,
/// and no two anatomical surfaces are drawn this close on purpose.
const SAME: f64 = 1e-4;

/// A shape that an instance takes, and what it takes for that.
struct Pose<'s> {
    instance: usize,
    mesh: &'s Mesh,
    /// Selectors, by node, and the choice of each.
    conditions: Vec<(usize, usize)>,
}

impl Pose<'_> {
    /// Whether both are shown at one time.
    fn meets(&self, other: &Self) -> bool {
        let apart = |a: &(usize, usize)| {
            let b = other.conditions.iter().find(|b| b.0 == a.0);
            b.is_some_and(|b| b.1 != a.1)
        };
        self.instance != other.instance && !self.conditions.iter().any(apart)
    }
}

impl Scene {
    /// Number of triangles that some other instance covers exactly, whatever the orientation: over
    /// all keyframes, also those of meshes that are hidden now, at the present placement. (Meshes
    /// that move against each other may still meet for a moment, triangle on triangle.)
    pub fn coincident_triangles(&self) -> usize {
        self.coincident_pairs().values().sum()
    }

    /// One warning for each pair of instances that share triangles.
    pub(crate) fn coincidences(&self, file: &Path) -> Vec<Issue> {
        let mut pairs: Vec<_> = self.coincident_pairs().into_iter().collect();
        pairs.sort_unstable();
        let name = |i: usize| &self.instances[i].name;
        pairs
            .into_iter()
            .map(|([a, b], count)| {
                let tie = self.instances[a].priority == self.instances[b].priority;
                Issue::warning(
                    file,
                    count,
                    format!("coincident interfaces: {count} triangles of `{}` and `{}` are the same", name(a), name(b)),
                    match tie {
                        true => "give the meshes different priorities, so that the order of crossing them does not matter",
                        false => "the mesh of higher priority decides the tissue",
                    },
                )
            })
            .collect()
    }

    /// Every shape of every instance.
    fn poses(&self) -> Vec<Pose<'_>> {
        let mut out = Vec::new();
        for (i, instance) in self.instances.iter().enumerate() {
            let conditions = self.graph.conditions(i);
            let switch = self.graph.switch_of(i);
            let shapes = match instance.keyframes.meshes.as_slice() {
                [] => std::slice::from_ref(&instance.mesh),
                all => all,
            };
            for (k, &mesh) in shapes.iter().enumerate() {
                let mut conditions = conditions.clone();
                if !instance.keyframes.meshes.is_empty() {
                    conditions.extend(switch.map(|node| (node, k)));
                }
                out.push(Pose {
                    instance: i,
                    mesh: &self.meshes[mesh],
                    conditions,
                });
            }
        }
        out
    }

    fn coincident_pairs(&self) -> HashMap<[usize; 2], usize> {
        let poses = self.poses();
        // By the triangle's corners, the last pose that has it, as an index into `seen`; from there
        // on to the pose before.
        let mut last: HashMap<[[i64; 3]; 3], usize> = HashMap::new();
        let mut seen: Vec<(usize, Option<usize>)> = Vec::new();
        let mut pairs = HashMap::new();
        for (p, pose) in poses.iter().enumerate() {
            let placement = self.instances[pose.instance].world_from_object;
            for triangle in &pose.mesh.triangles {
                let mut key = triangle.map(|v| {
                    let local = DVec3::from(pose.mesh.positions[v as usize].map(f64::from));
                    let world = placement.transform_point3(local) / SAME;
                    world.to_array().map(|x| x.round() as i64)
                });
                key.sort_unstable();
                let before = last.insert(key, seen.len());
                seen.push((p, before));
                let mut at = before;
                while let Some((other, next)) = at.map(|i| seen[i]) {
                    // Counted once, against the first of the instances that share it.
                    if pose.meets(&poses[other]) {
                        let pair = [poses[other].instance, pose.instance];
                        *pairs.entry(pair).or_default() += 1;
                        break;
                    }
                    at = next;
                }
            }
        }
        pairs
    }
}
