//! Instances that share one structure: instances that stay together are traversed once, not once each.
//!
//! Nested organs overlap, and a ray enters the structure of each that is around it. Instances whose
//! relative placement never changes share the object space. One structure over the triangles of all of them
//! then needs no other vertices, and rays meet the same triangles at the same distances.

use std::collections::BTreeMap;

use glam::DAffine3;

use super::arrays::{Bounds, GeometryRange};
use super::entry::union;
use crate::scene::{Instance, Scene, Strategy};

/// Most instances that can share: a triangle's owner has 16 bits, so later instances have structures of their own.
const MOST_OWNERS: usize = 1 << 16;

/// Instances that share their structures.
#[derive(Clone, Debug)]
pub(super) struct SharingSet {
    /// Indices into [`Scene::instances`], ascending; two at least.
    pub(super) members: Vec<usize>,
    /// Their structure at each keyframe; only one for a constant shape.
    pub(super) shapes: Vec<GeometryRange>,
}

impl SharingSet {
    /// The mesh that member `instance` shows in structure `shape`.
    pub(super) fn mesh(scene: &Scene, instance: usize, shape: usize) -> usize {
        let instance = &scene.instances[instance];
        let keyframe = instance.keyframes.meshes.get(shape);
        keyframe.copied().unwrap_or(instance.mesh)
    }

    /// The number of the structure that is shown now.
    pub(super) fn shape(&self, scene: &Scene) -> usize {
        present(&scene.instances[self.members[0]])
    }

    /// Box around all members at `shape`, whose meshes lie at `places`.
    pub(super) fn bounds(&self, scene: &Scene, places: &[GeometryRange], shape: usize) -> Bounds {
        let boxes = self.members.iter();
        let boxes = boxes.map(|&i| places[Self::mesh(scene, i, shape)].bounds);
        boxes.reduce(union).expect("a set has members")
    }

    /// True if all members have the placement and the keyframe of the first one.
    fn holds(&self, scene: &Scene) -> bool {
        let first = &scene.instances[self.members[0]];
        let with_first = |&i: &usize| {
            let other = &scene.instances[i];
            other.world_from_object == first.world_from_object && present(other) == present(first)
        };
        self.members.iter().all(with_first)
    }
}

/// Number of the keyframe that an instance shows; 0 for a constant shape.
fn present(instance: &Instance) -> usize {
    let meshes = &instance.keyframes.meshes;
    let shown = meshes.iter().position(|&mesh| mesh == instance.mesh);
    shown.unwrap_or(0)
}

/// All sets of a scene.
#[derive(Clone, Debug, Default)]
pub(super) struct SharingSets {
    pub(super) all: Vec<SharingSet>,
    /// For each instance the set to which it belongs.
    of: Vec<Option<usize>>,
}

impl SharingSets {
    /// The sets of `scene`, without structures yet. A set has instances with the same placement that nothing
    /// moves apart, whose shapes are constant or keyframes exchanged together by selectors, and whose
    /// meshes no other instance shows, so that no triangle is stored twice. `apart` are the instances that
    /// have been moved on their own before.
    pub(super) fn new(scene: &Scene, apart: &[bool]) -> Self {
        let mut uses = vec![0_u32; scene.meshes.len()];
        for instance in &scene.instances {
            for &mesh in shapes(instance) {
                uses[mesh] += 1;
            }
        }
        let carriers = scene.graph.carriers(scene.instances.len());
        let mut alike: BTreeMap<Vec<u64>, Vec<usize>> = BTreeMap::new();
        for (i, instance) in scene.instances.iter().enumerate().take(MOST_OWNERS) {
            let keyframes = &instance.keyframes;
            let own = shapes(instance)
                .iter()
                .all(|&m| uses[m] == 1 && !scene.meshes[m].triangles.is_empty());
            let together = keyframes.meshes.is_empty() || keyframes.group.is_some();
            let selected = keyframes.strategy == Strategy::Exchange;
            let loose = apart.get(i).copied().unwrap_or(false);
            let carrier = &carriers[i];
            if !own || !together || !selected || loose || carrier.switched {
                continue;
            }
            let number = |n: Option<usize>| n.map_or(0, |n| n as u64 + 1);
            let mut key = vec![
                number(carrier.mover),
                keyframes.meshes.len() as u64,
                number(keyframes.group.filter(|_| !keyframes.meshes.is_empty())),
            ];
            let within = carrier.mover.map_or(&[][..], |_| &carrier.within);
            for placement in within.iter().chain([&instance.world_from_object]) {
                key.extend(placement.to_cols_array().map(f64::to_bits));
            }
            alike.entry(key).or_default().push(i);
        }
        let mut sets = Self { all: Vec::new(), of: vec![None; scene.instances.len()] };
        let mut found: Vec<_> = alike.into_values().filter(|m| m.len() > 1).collect();
        found.sort();
        for members in found {
            for &i in &members {
                sets.of[i] = Some(sets.all.len());
            }
            sets.all.push(SharingSet { members, shapes: Vec::new() });
        }
        sets
    }

    /// The set to which an instance belongs.
    pub(super) fn of(&self, instance: usize) -> Option<(usize, &SharingSet)> {
        let set = self.of[instance]?;
        Some((set, &self.all[set]))
    }

    /// True if the members of every set are still together.
    pub(super) fn hold(&self, scene: &Scene) -> bool {
        self.all.iter().all(|set| set.holds(scene))
    }

    /// Marks in `apart` the instances that are no longer where most of their set is.
    pub(super) fn mark_apart(&self, scene: &Scene, apart: &mut [bool]) {
        for set in self.all.iter().filter(|set| !set.holds(scene)) {
            let state = |i: usize| {
                let instance = &scene.instances[i];
                (instance.world_from_object, present(instance))
            };
            let alike = |a: (DAffine3, usize)| set.members.iter().filter(move |&&i| state(i) == a);
            let most = set.members.iter().map(|&i| state(i));
            let most = most.max_by_key(|&a| alike(a).count());
            for &i in &set.members {
                apart[i] |= Some(state(i)) != most;
            }
        }
    }
}

/// Meshes that an instance may show.
fn shapes(instance: &Instance) -> &[usize] {
    match instance.keyframes.meshes.is_empty() {
        true => std::slice::from_ref(&instance.mesh),
        false => &instance.keyframes.meshes,
    }
}
