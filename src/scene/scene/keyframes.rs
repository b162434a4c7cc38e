//! Keyframes: shapes of an instance over time, and the device's strategy for them.

use std::sync::Arc;

use super::mesh::Mesh;
use crate::settings::words;
use glam::DVec3;

words! {
    /// Strategy by which the ray structures follow an instance that changes its shape. The same shape gives
    /// the same image by every strategy that can show it; they differ in storage and in builds.
    #[derive(Default, Hash)]
    pub enum Strategy {
        /// Node exchange (Starkov et al. 2019, section II-B): every keyframe's structure is built once, and the top
        /// level is rebuilt over the one that is shown, with its own tight box.
        #[default]
        Exchange = "exchange",
        /// Like `exchange`, but the top level is refitted. The compute tracer, whose top level is made on
        /// the host, keeps its tree and recomputes its boxes.
        Update = "update",
        /// Every keyframe is in the top level at all times, and rays ignore all but one: no builds.
        Mask = "mask",
        /// Selector node (the same section): one entry in the top level with the union of all keyframes' boxes, whose
        /// child is swapped: no builds. Compute tracer only.
        Selector = "selector",
        /// The keyframe's geometry is uploaded and its structure built, fast, when it is shown.
        Rebuild = "rebuild",
        /// Like `rebuild`, from geometry that has stayed on the device.
        Cached = "cached",
        /// One structure for all keyframes, which must have equal triangles; its boxes follow the vertices.
        Refit = "refit",
        /// Like `refit`, over vertices interpolated between the keyframes.
        Interpolate = "interpolate",
    }
}

impl Strategy {
    /// Returns whether keyframes must have equal triangles.
    pub fn needs_shared_topology(self) -> bool {
        matches!(self, Self::Refit | Self::Interpolate)
    }
}

/// Keyframes of one instance.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Keyframes {
    /// Indices into [`super::Scene::meshes`], in order; empty where the shape is constant.
    pub meshes: Vec<usize>,
    /// Strategy of the device.
    pub strategy: Strategy,
    /// Numbers of up to four keyframes and their weights, which sum to 1: the present shape under
    /// [`Strategy::Interpolate`]. Weights of cubic interpolation may be negative.
    pub blend: [(usize, f64); 4],
    /// Group of instances that change shape together: they have keyframes of the same times, and move the tissue
    /// between them. None: the instance alone.
    pub group: Option<usize>,
    /// How many times a program has set the last one of them ([`Scene::reshape`](super::Scene::reshape)).
    pub revision: u64,
}

impl Keyframes {
    /// Returns whether the same tissue takes the same shapes, by whichever strategy.
    pub fn deforms_as(&self, other: &Self) -> bool {
        self.meshes == other.meshes && self.group == other.group
    }

    /// The keyframe nearest to the present shape: the one of largest weight.
    pub fn nearest(&self) -> usize {
        let heaviest = |a: &(usize, f64), b: &(usize, f64)| a.1.total_cmp(&b.1);
        // The first of equal ones.
        let found = self.blend.iter().rev().copied().max_by(heaviest);
        found.map_or(0, |(keyframe, _)| keyframe)
    }
}

impl Keyframes {
    /// The present shape: vertices and normals weighted by [`Self::blend`].
    ///
    /// # Panics
    /// The keyframes do not share their topology.
    pub fn blended(&self, meshes: &[Arc<Mesh>]) -> Mesh {
        let first = &meshes[self.meshes[0]];
        let mut out = Mesh {
            name: first.name.clone(),
            positions: vec![[0.0; 3]; first.positions.len()],
            normals: vec![[0.0; 3]; first.normals.len()],
            triangles: first.triangles.clone(),
        };
        let mut sums =
            [vec![DVec3::ZERO; first.positions.len()], vec![DVec3::ZERO; first.normals.len()]];
        for &(keyframe, weight) in self.blend.iter().filter(|(_, weight)| *weight != 0.0) {
            let mesh = &meshes[self.meshes[keyframe]];
            assert!(mesh.shares_topology(first), "`{}` has other triangles", mesh.name);
            for (sum, values) in sums.iter_mut().zip([&mesh.positions, &mesh.normals]) {
                for (sum, v) in sum.iter_mut().zip(values) {
                    *sum += weight * DVec3::from(v.map(f64::from));
                }
            }
        }
        for (out, sum) in out.positions.iter_mut().zip(&sums[0]) {
            *out = sum.as_vec3().into();
        }
        for (out, sum) in out.normals.iter_mut().zip(&sums[1]) {
            *out = sum.normalize_or_zero().as_vec3().into();
        }
        out
    }
}
