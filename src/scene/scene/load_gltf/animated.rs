//! One animation of a glTF file: moving nodes, and meshes that change their shape.

use std::collections::HashMap;
use std::path::Path;

use super::budget::Budget;
use super::morph::Morph;
use super::sampler::{Motion, motions};
use super::skin::Skin;
use super::surface::Surfaces;
use super::tree::Tree;
use super::{File, open};
use crate::issue::Issue;
use crate::scene::mesh::{AnimatedNode, Choice, Placement, Soup, bounded};

/// Content of a file for one of its animations.
pub struct AnimatedParts {
    /// Name of the animation.
    pub animation: String,
    /// Nodes above meshes, parents first; lengths in mm.
    pub nodes: Vec<AnimatedNode>,
    /// Nodes with meshes.
    pub parts: Vec<Part>,
    pub issues: Vec<Issue>,
}

/// A mesh in all its shapes as stored, mm.
pub struct Part {
    pub name: String,
    /// Index into the nodes; none for a skinned mesh, which lies in the space of the root.
    pub node: Option<usize>,
    /// The first shape.
    pub soup: Soup,
    /// Positions of the further shapes.
    pub others: Vec<Vec<[f32; 3]>>,
    /// Times of the shapes, s; none where there is one.
    pub times: Vec<f64>,
    /// Cube root of the factor by which the nodes enlarge its volume at time 0.
    pub enlarged: f64,
}

/// Reads an animation of a file; `mm` is the length of its unit, and skins are sampled at no more than
/// `most` times.
pub fn read_animated(
    path: &Path,
    bytes: &[u8],
    node: Option<&str>,
    choice: Choice<'_>,
    mm: f64,
    most: usize,
) -> Result<AnimatedParts, Vec<Issue>> {
    let one = |issue: Issue| vec![issue];
    let mut file = open(path, bytes, Some(choice))?;
    let issues = std::mem::take(&mut file.issues);
    let chosen = file.animation.as_ref().expect("one was asked for");
    let animation = file.gltf.animations().next();
    let animation = animation.expect("the chosen animation was kept");
    let mut surfaces = Surfaces::new(&file);
    surfaces.issues = issues;
    let mut budget = Budget::new(path);
    let moved = motions(&surfaces.reader, &animation, chosen.number, mm, &mut budget);
    let mut meshes = Meshes {
        surfaces,
        tree: Tree::new(&file.gltf, moved.map_err(one)?, mm),
        budget,
        mm,
        most: most.max(2),
        elements: 0,
        parts: Vec::new(),
        visited: vec![false; file.gltf.nodes().len()],
    };
    let only = node.map(|name| file.node(name)).transpose().map_err(one)?;
    for root in file.roots() {
        let only = only.as_ref().map(gltf::Node::index);
        meshes.walk(&root, only).map_err(one)?;
    }
    if let Some(node) = &only
        && !meshes.visited[node.index()]
    {
        meshes.walk(node, None).map_err(one)?;
        let cause = "the node is outside the file's scene";
        meshes.surfaces.warn(1, cause);
    }
    meshes.finish(&file, node).map_err(one)
}

struct Meshes<'a> {
    surfaces: Surfaces<'a>,
    tree: Tree,
    budget: Budget<'a>,
    mm: f64,
    most: usize,
    /// Vertices and triangles of all shapes so far.
    elements: usize,
    /// The parts; until the end they name nodes by the file's numbers.
    parts: Vec<Part>,
    visited: Vec<bool>,
}

impl<'a> Meshes<'a> {
    /// Reads the meshes below a node; with `only`, those of that node and below it. Without recursion, because
    /// a file may nest nodes to any depth.
    fn walk(&mut self, root: &gltf::Node<'_>, only: Option<usize>) -> Result<(), Issue> {
        let mut todo = vec![(root.clone(), only.is_none())];
        while let Some((node, kept)) = todo.pop() {
            let visited = &mut self.visited[node.index()];
            assert!(!*visited, "validation refuses nodes with two parents");
            *visited = true;
            let kept = kept || only == Some(node.index());
            if let Some(mesh) = node.mesh().filter(|_| kept) {
                let own = node.name().or(mesh.name()).map(str::to_owned);
                let name = own.unwrap_or_else(|| format!("node {}", node.index()));
                let mark = self.budget.mark();
                self.mesh(&name, &node, &mesh).map_err(|e| e.of(&name))?;
                self.budget.give_back(mark);
            }
            todo.extend(node.children().map(|child| (child, kept)));
        }
        Ok(())
    }

    fn mesh(
        &mut self,
        name: &str,
        node: &gltf::Node<'_>,
        mesh: &gltf::Mesh<'_>,
    ) -> Result<(), Issue> {
        let (mm, path) = (self.mm, self.surfaces.reader.path);
        let mut morph = Morph::new(&self.surfaces.reader, node)?;
        let mut skin = match node.skin() {
            Some(skin) => Some(Skin::new(&self.surfaces.reader, &skin, mm, &mut self.budget)?),
            None => None,
        };
        let mut triangles = Vec::new();
        for primitive in mesh.primitives() {
            let Some(surface) = self.surfaces.primitive(name, &primitive)? else {
                continue;
            };
            let (reader, budget) = (&self.surfaces.reader, &mut self.budget);
            let first = morph.vertices() as u32;
            let vertices = surface.positions.len();
            triangles.extend(surface.triangles.iter().map(|t| t.map(|i| i + first)));
            if let Some(skin) = &mut skin {
                skin.append(reader, &primitive, vertices, budget)?;
            }
            morph.append(reader, &primitive, surface.positions, mm, budget)?;
        }
        if triangles.is_empty() {
            return Ok(());
        }
        let motion = self.tree.motions.get(&node.index());
        let times = self.times(motion, skin.as_ref());
        let shapes = times.len().max(1);
        let elements = morph.vertices() + triangles.len();
        bounded(path, elements, shapes)?;
        self.elements += elements * shapes;
        bounded(path, self.elements, 1)?;
        let mut positions = Vec::with_capacity(shapes);
        for &time in times.first().map_or(&[0.0][..], |_| &times) {
            let mut shape = morph.at(motion, time, &mut self.budget)?;
            if let Some(skin) = &skin {
                let mut known = HashMap::new();
                let mut globals = Vec::with_capacity(skin.joints.len());
                for &joint in &skin.joints {
                    globals.push(self.tree.global(joint, time, &mut known, &mut self.budget)?);
                }
                let mirrored = skin.place(&mut shape, &globals, &mut self.budget)?;
                // A mirroring transform turns the winding around (glTF 2.0, 3.7.4).
                if mirrored && positions.is_empty() {
                    triangles.iter_mut().for_each(|t| t.swap(1, 2));
                }
            }
            let single = shape.into_iter().map(|p| p.map(|v| v as f32));
            positions.push(single.collect::<Vec<_>>());
        }
        let others = positions.split_off(1);
        self.parts.push(Part {
            name: name.to_owned(),
            node: node.skin().is_none().then(|| node.index()),
            soup: Soup { name: name.to_owned(), positions: positions.remove(0), triangles },
            others,
            times,
            enlarged: 1.0,
        });
        Ok(())
    }

    /// Times at which a mesh is sampled, s: the keyframes of its morph weights, and those of its joints while
    /// these are not too many. None where it keeps its shape.
    fn times(&self, motion: Option<&Motion>, skin: Option<&Skin>) -> Vec<f64> {
        let weights = motion.map_or(&[][..], Motion::weight_times);
        let Some(skin) = skin else {
            return weights.to_vec();
        };
        let mut times = weights.to_vec();
        let mut seen = vec![false; self.visited.len()];
        for &joint in &skin.joints {
            for node in self.tree.chain(joint) {
                if std::mem::replace(&mut seen[node], true) {
                    break;
                }
                times.extend(self.tree.times(node));
            }
        }
        times.sort_unstable_by(f64::total_cmp);
        times.dedup();
        thinned(times, self.most)
    }

    fn finish(mut self, file: &File<'_>, node: Option<&str>) -> Result<AnimatedParts, Issue> {
        let path = file.path;
        let chosen = file.animation.as_ref().expect("one was asked for");
        let placing = self.parts.iter().filter_map(|part| part.node);
        let (nodes, place) = self.tree.above(path, placing)?;
        let mut known = HashMap::new();
        for part in &mut self.parts {
            let Some(node) = part.node else { continue };
            let global = self.tree.global(node, 0.0, &mut known, &mut self.budget)?;
            part.enlarged = global.matrix3.determinant().abs().cbrt();
            part.node = Some(place[&node]);
        }
        let moving = |node: &AnimatedNode| matches!(node.placement, Placement::Moving { .. });
        let moves = self.parts.iter().any(|part| !part.times.is_empty());
        if !moves && !nodes.iter().any(moving) && !self.parts.is_empty() {
            return Err(chosen.moves_nothing(path, node));
        }
        let mut issues = self.surfaces.issues;
        issues.extend(file.remarks(&self.visited));
        Ok(AnimatedParts { animation: chosen.name.clone(), nodes, parts: self.parts, issues })
    }
}

/// Unchanged times, or `most` of them evenly spaced from the first to the last.
fn thinned(times: Vec<f64>, most: usize) -> Vec<f64> {
    let (Some(&first), Some(&last)) = (times.first(), times.last()) else {
        return times;
    };
    if times.len() <= most {
        return times;
    }
    let even = |k: usize| first + (last - first) * k as f64 / (most - 1) as f64;
    (0..most).map(even).collect()
}
