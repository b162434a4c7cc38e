//! Places of the nodes of a file over time.

use std::collections::HashMap;
use std::path::Path;

use glam::{DAffine3, DMat4, DQuat, DVec3};
use gltf::scene::Transform;

use super::budget::Budget;
use super::sampler::Motion;
use crate::issue::Issue;
use crate::scene::animation::{Track, Trs};
use crate::scene::mesh::{AnimatedNode, Placement};

/// All nodes of a file; lengths in mm.
pub(super) struct Tree {
    parents: Vec<Option<usize>>,
    placements: Vec<Placement>,
    names: Vec<String>,
    /// Motion of each node, apart from its placement.
    pub motions: HashMap<usize, Motion>,
}

impl Tree {
    /// The nodes of a file; `mm` is the length of its unit.
    pub fn new(gltf: &gltf::Document, mut motions: HashMap<usize, Motion>, mm: f64) -> Self {
        let mut parents = vec![None; gltf.nodes().len()];
        let mut placements = Vec::new();
        let mut names = Vec::new();
        for node in gltf.nodes() {
            for child in node.children() {
                parents[child.index()] = Some(node.index());
            }
            let motion = motions.get_mut(&node.index());
            placements.push(placement(node.transform(), motion, mm));
            names.push(node.name().unwrap_or_default().to_owned());
        }
        Self { parents, placements, names, motions }
    }

    /// A node and its ancestors, upwards.
    pub fn chain(&self, node: usize) -> impl Iterator<Item = usize> {
        std::iter::successors(Some(node), |&n| self.parents[n])
    }

    /// Times at which the placement of a node is given, s.
    pub fn times(&self, node: usize) -> impl Iterator<Item = f64> {
        let track = match &self.placements[node] {
            Placement::Moving { track, .. } => Some(track),
            Placement::Fixed(_) => None,
        };
        track.into_iter().flat_map(Track::times)
    }

    /// Root from node space at a time, s. `known` holds results for that time.
    pub fn global(
        &self,
        node: usize,
        time: f64,
        known: &mut HashMap<usize, DAffine3>,
        budget: &mut Budget<'_>,
    ) -> Result<DAffine3, Issue> {
        let above: Vec<usize> = self.chain(node).take_while(|n| !known.contains_key(n)).collect();
        budget.work(1 + above.len())?;
        for &n in above.iter().rev() {
            let parent = self.parents[n].map_or(DAffine3::IDENTITY, |p| known[&p]);
            known.insert(n, parent * self.placements[n].at(time));
        }
        Ok(known[&node])
    }

    /// Given nodes and all their ancestors, parents first; and the place of each in that list. Refuses nodes
    /// that flatten their descendants.
    pub fn above(
        &self,
        path: &Path,
        nodes: impl Iterator<Item = usize>,
    ) -> Result<(Vec<AnimatedNode>, HashMap<usize, usize>), Issue> {
        let mut out: Vec<AnimatedNode> = Vec::new();
        let mut place = HashMap::new();
        for node in nodes {
            let new: Vec<usize> = self.chain(node).take_while(|n| !place.contains_key(n)).collect();
            for &n in new.iter().rev() {
                self.placements[n].invertible().map_err(|cause| {
                    let remedy = "leave it a small scale, or hide it in the modeller";
                    let at = format!("/nodes/{n}");
                    Issue::error(path, 1, format!("`{}`: {cause}", self.names[n]), remedy).of(&at)
                })?;
                place.insert(n, out.len());
                out.push(AnimatedNode {
                    name: self.names[n].clone(),
                    parent: self.parents[n].map(|p| place[&p]),
                    placement: self.placements[n].clone(),
                });
            }
        }
        Ok((out, place))
    }
}

fn placement(transform: Transform, motion: Option<&mut Motion>, mm: f64) -> Placement {
    match transform {
        Transform::Matrix { matrix } => {
            let columns = matrix.map(|column| column.map(f64::from));
            let mut affine = DAffine3::from_mat4(DMat4::from_cols_array_2d(&columns));
            affine.translation *= mm;
            Placement::Fixed(affine)
        }
        Transform::Decomposed { translation, rotation, scale } => {
            let rest = Trs {
                translation: DVec3::from(translation.map(f64::from)) * mm,
                rotation: DQuat::from_array(rotation.map(f64::from)).normalize(),
                scale: DVec3::from(scale.map(f64::from)),
            };
            match motion.map(|m| std::mem::take(&mut m.track)) {
                Some(track) if track.span().is_some() => Placement::Moving { rest, track },
                _ => Placement::Fixed(rest.matrix()),
            }
        }
    }
}
