//! Animated glTF: nodes that move, and meshes in several shapes.

use std::path::Path;

use glam::DAffine3;

use super::keyframes::shapes;
use super::{MeshFormat, Options, read_bounded};
use crate::issue::Issue;
use crate::scene::Mesh;
use crate::scene::animation::{Track, Trs};
use crate::scene::load_gltf::{self, AnimatedParts, Part};

/// Number of times at which a skin is sampled unless [`Options::keyframes`] is set.
const KEYFRAMES: usize = 24;

/// Choice of an animation of a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Choice<'a> {
    /// The first animation.
    #[default]
    First,
    /// The first animation of this name. Those without a name are called `animation N`, counted from 0.
    Named(&'a str),
    /// The animation of this number, counted from 0.
    Number(usize),
}

/// One animation of a glTF file. Lengths are in mm, times in seconds since the start of the animation.
#[derive(Clone, Debug)]
pub struct Animated {
    /// Name of the animation; `animation N` if the file gives it none.
    pub animation: String,
    /// Earliest and latest keyframe of any motion of a mesh, s. Outside it everything keeps its first or last
    /// state; the caller may play it in a loop.
    pub span: (f64, f64),
    /// The ancestors of the nodes with meshes, and those nodes; a parent comes before its children.
    pub nodes: Vec<AnimatedNode>,
    /// The meshes of the chosen nodes, in the file's order.
    pub meshes: Vec<AnimatedMesh>,
}

/// A node of the file's tree.
#[derive(Clone, Debug)]
pub struct AnimatedNode {
    /// Name in the file; may be empty, and need not be unique.
    pub name: String,
    /// Index of the parent in [`Animated::nodes`]; none for a root.
    pub parent: Option<usize>,
    /// Parent from node space.
    pub placement: Placement,
}

/// Placement of a node in its parent; has an inverse at every keyframe.
#[derive(Clone, Debug)]
pub enum Placement {
    /// Constant placement; lengths in mm.
    Fixed(DAffine3),
    /// Placement by a track; quantities that it does not set keep their value at rest.
    Moving {
        /// Placement at rest.
        rest: Trs,
        /// Sets at least one of translation, rotation and scale.
        track: Track,
    },
}

impl Placement {
    /// Parent from node space at a time, s.
    pub fn at(&self, time: f64) -> DAffine3 {
        match self {
            Self::Fixed(affine) => *affine,
            Self::Moving { rest, track } => track.at(*rest, time).matrix(),
        }
    }

    /// Checks that it has an inverse; returns the reason where not.
    pub(in crate::scene) fn invertible(&self) -> Result<(), String> {
        let flat = |m: DAffine3| m.matrix3.determinant() == 0.0 || !m.is_finite();
        match self {
            Self::Fixed(affine) if flat(*affine) => {
                Err("its matrix is singular (scale zero)".to_owned())
            }
            Self::Moving { rest, track } if track.scale.is_none() && flat(rest.matrix()) => {
                Err("its matrix is singular (scale zero)".to_owned())
            }
            Self::Moving { track, .. } => track.invertible().map_err(|e| e.to_string()),
            Self::Fixed(_) => Ok(()),
        }
    }
}

/// A mesh of a node.
#[derive(Clone, Debug)]
pub struct AnimatedMesh {
    /// Name of the node, else of the mesh, else `node N`; need not be unique.
    pub name: String,
    /// Index into [`Animated::nodes`] of the node in whose space the shapes are; none for a skinned mesh, whose
    /// shapes are in the space of the file's scene, whichever node has it.
    pub node: Option<usize>,
    /// The shapes, mm, at least one. They share their topology ([`Mesh::shares_topology`]).
    pub shapes: Vec<Mesh>,
    /// Times of the shapes, s, increasing; empty where it has a single shape at all times.
    pub times: Vec<f64>,
}

/// Names of the animations of a file, as [`Choice::Named`] takes them; none where it is no glTF file, or
/// cannot be read.
pub fn animations(path: &Path) -> Vec<String> {
    let bytes = match MeshFormat::of(path) {
        Some(MeshFormat::Gltf) => read_bounded(path).unwrap_or_default(),
        _ => Vec::new(),
    };
    load_gltf::animations(path, &bytes)
}

/// Reads one animation of a .gltf or .glb file; positions end in mm.
///
/// Animated nodes become [`AnimatedNode`]s. Animated morph weights become one shape for each of their
/// keyframes, animated joints of a skin one for each time at which one of them has a keyframe, or
/// [`Options::keyframes`] of them evenly spaced where that is fewer. Every shape is repaired and checked
/// like the keyframes of [`super::load_keyframes`]. [`Options::node`] keeps only that node and those
/// under it.
///
/// # Errors
/// Returns every finding when at least one of them stops loading. Besides those of [`super::load`]: no
/// animation, or none of that name, or one without effect; keyframes out of order, rotations of
/// length zero, scales of zero above a mesh; weights that do not fit the morph targets;
/// joints that a skin does not have, inverse bind matrices without inverse; too much data.
pub fn load_animated(
    path: &Path,
    options: &Options,
    animation: Choice<'_>,
) -> Result<(Animated, Vec<Issue>), Vec<Issue>> {
    if MeshFormat::of(path) != Some(MeshFormat::Gltf) {
        let cause = "only .gltf and .glb files have animations";
        let remedy = "list the shapes as keyframes, or convert them to .glb";
        return Err(vec![Issue::error(path, 1, cause, remedy)]);
    }
    let units = options.units.unwrap_or(load_gltf::METRES);
    let most = options.keyframes.unwrap_or(KEYFRAMES);
    let bytes = read_bounded(path)?;
    let node = options.node.as_deref();
    let AnimatedParts { animation, nodes, parts, mut issues } =
        load_gltf::read_animated(path, &bytes, node, animation, units.0, most)?;
    drop(bytes);
    if parts.is_empty() {
        let remedy = "export a triangle mesh with faces";
        issues.push(Issue::error(path, 1, "holds no triangles", remedy));
    }
    let mut meshes = Vec::new();
    for part in parts {
        let Part { name, node, soup, others, times, enlarged } = part;
        let place = |k: usize| match times.get(k) {
            Some(time) if k > 0 => (path, format!("{name} at {time:.3} s")),
            _ => (path, name.clone()),
        };
        let (shapes, more) = shapes(&soup, others, place, units, enlarged, options.cap_openings);
        issues.extend(gathered(more));
        meshes.push(AnimatedMesh { name, node, shapes, times });
    }
    if issues.iter().any(Issue::is_error) {
        return Err(issues);
    }
    let placed = nodes.iter().filter_map(|n| match &n.placement {
        Placement::Moving { track, .. } => track.span(),
        Placement::Fixed(_) => None,
    });
    let shaped = meshes.iter().filter_map(|m| Some((*m.times.first()?, *m.times.last()?)));
    let span = placed.chain(shaped).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
    let found = Animated { animation, span: span.unwrap_or_default(), nodes, meshes };
    Ok((found, issues))
}

/// The first finding of each kind, with the number of shapes that have it.
fn gathered(issues: Vec<Issue>) -> Vec<Issue> {
    let mut out: Vec<(Issue, usize)> = Vec::new();
    for issue in issues {
        let like = |known: &&mut (Issue, usize)| {
            known.0.severity == issue.severity && known.0.is_like(&issue)
        };
        match out.iter_mut().find(like) {
            Some(known) => known.1 += 1,
            None => out.push((issue, 0)),
        }
    }
    let counted = out.into_iter().map(|(mut issue, more)| {
        if more > 0 {
            issue.message += &format!(" (and in {more} further shapes)");
        }
        issue
    });
    counted.collect()
}
