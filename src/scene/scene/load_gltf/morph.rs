//! Morph targets: displacements of vertices that are added by weight (glTF 2.0, 3.7.2.2).

use gltf::accessor::Dimensions;

use super::accessor::Reader;
use super::budget::Budget;
use super::sampler::Motion;
use crate::issue::Issue;

/// A surface with morph targets; without targets it has one shape.
pub(super) struct Morph {
    base: Vec<[f64; 3]>,
    targets: Vec<Target>,
    /// Weights that no channel sets.
    rest: Vec<f64>,
}

/// Displacements of the vertices of one primitive.
struct Target {
    /// Index of its weight.
    weight: usize,
    /// First vertex in the surface.
    first: usize,
    displacements: Vec<[f64; 3]>,
}

impl Morph {
    /// A surface with the resting weights of a node: its own, those of its mesh, or zero.
    pub fn new(reader: &Reader<'_>, node: &gltf::Node<'_>) -> Result<Self, Issue> {
        let mesh = node.mesh();
        let stored = node.weights().or(mesh.as_ref().and_then(gltf::Mesh::weights));
        let rest: Vec<f64> = stored.unwrap_or_default().iter().map(|&w| f64::from(w)).collect();
        let counts = mesh.iter().flat_map(gltf::Mesh::primitives).map(|p| p.morph_targets().len());
        let (least, most) = counts.fold((usize::MAX, 0), |(a, b), n| (a.min(n), b.max(n)));
        let fault = |cause: String| {
            let place = format!("/nodes/{}", node.index());
            Issue::error(reader.path, 1, cause, "export it again").of(&place)
        };
        if most > 0 && least != most {
            let cause =
                format!("the primitives of its mesh have from {least} to {most} morph targets");
            return Err(fault(cause));
        }
        if !rest.is_empty() && rest.len() != most {
            let cause = format!("has {} weights for {most} morph targets", rest.len());
            return Err(fault(cause));
        }
        if rest.iter().any(|w| !w.is_finite()) {
            return Err(fault("has weights that are not finite".to_owned()));
        }
        Ok(Self { base: Vec::new(), targets: Vec::new(), rest })
    }

    /// Appends the vertices of a primitive; `mm` is the length of their unit.
    pub fn append(
        &mut self,
        reader: &Reader<'_>,
        primitive: &gltf::Primitive<'_>,
        positions: Vec<[f64; 3]>,
        mm: f64,
        budget: &mut Budget<'_>,
    ) -> Result<(), Issue> {
        let first = self.base.len();
        for (weight, target) in primitive.morph_targets().enumerate() {
            let Some(accessor) = target.positions() else {
                continue;
            };
            let count = accessor.count();
            if count != positions.len() {
                let cause = format!(
                    "morph target {weight} has {count} displacements for {} vertices",
                    positions.len()
                );
                return Err(Issue::error(reader.path, 1, cause, "export it again"));
            }
            budget.hold(count.saturating_mul(3))?;
            let kind = "displacements must be of type VEC3";
            let displacements = reader.vectors(&accessor, Dimensions::Vec3, kind)?;
            self.targets.push(Target { weight, first, displacements: scaled(displacements, mm) });
        }
        self.base.extend(scaled(positions, mm));
        Ok(())
    }

    /// Number of vertices.
    pub fn vertices(&self) -> usize {
        self.base.len()
    }

    /// Vertices at a time, s.
    pub fn at(
        &self,
        motion: Option<&Motion>,
        time: f64,
        budget: &mut Budget<'_>,
    ) -> Result<Vec<[f64; 3]>, Issue> {
        let mut out = self.base.clone();
        for target in &self.targets {
            let channel = motion.and_then(|m| m.weights.get(target.weight));
            let weight = match channel {
                Some(channel) => channel.at(time),
                None => self.rest.get(target.weight).copied().unwrap_or(0.0),
            };
            if weight == 0.0 {
                continue;
            }
            budget.work(target.displacements.len())?;
            for (p, d) in out[target.first..].iter_mut().zip(&target.displacements) {
                *p = std::array::from_fn(|axis| p[axis] + weight * d[axis]);
            }
        }
        Ok(out)
    }
}

fn scaled(mut vectors: Vec<[f64; 3]>, factor: f64) -> Vec<[f64; 3]> {
    for v in &mut vectors {
        *v = v.map(|x| x * factor);
    }
    vectors
}
