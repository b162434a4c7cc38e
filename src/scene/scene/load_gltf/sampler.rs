//! Channels of an animation: placement of each node and weights of its morph targets, over time in seconds.

use std::collections::HashMap;

use glam::{DQuat, DVec3};
use gltf::accessor::Dimensions;
use gltf::animation::{Interpolation, Property};

use super::accessor::Reader;
use super::budget::Budget;
use crate::issue::Issue;
use crate::scene::animation::{Channel, Curve, Track, TrackError};

/// The animation of one node.
#[derive(Debug, Default)]
pub(super) struct Motion {
    /// Placement, lengths in mm.
    pub track: Track,
    /// Weight of each morph target; none where the weights rest.
    pub weights: Vec<Channel<f64>>,
}

impl Motion {
    /// Times at which weights are given, s.
    pub fn weight_times(&self) -> &[f64] {
        self.weights.first().map_or(&[], Channel::times)
    }
}

/// Reads the channels of an animation, by node; `number` is the animation's in the file, `mm` the length
/// of the file's unit.
pub(super) fn motions(
    reader: &Reader<'_>,
    animation: &gltf::Animation<'_>,
    number: usize,
    mm: f64,
    budget: &mut Budget<'_>,
) -> Result<HashMap<usize, Motion>, Issue> {
    let mut out: HashMap<usize, Motion> = HashMap::new();
    for (c, channel) in animation.channels().enumerate() {
        let sampler = channel.sampler();
        let keys = Keys {
            reader,
            place: format!("/animations/{number}/channels/{c}"),
            times: Vec::new(),
            curve: match sampler.interpolation() {
                Interpolation::Step => Curve::Step,
                Interpolation::Linear => Curve::Linear,
                Interpolation::CubicSpline => Curve::CubicSpline,
            },
            output: sampler.output(),
        };
        let values = sampler.output().count();
        budget.hold(sampler.input().count().saturating_add(values))?;
        let keys = keys.timed(&sampler.input())?;
        let node = channel.target().node();
        let motion = out.entry(node.index()).or_default();
        let property = channel.target().property();
        let placed = matches!(node.transform(), gltf::scene::Transform::Matrix { .. });
        if placed && property != Property::MorphTargetWeights {
            return Err(keys.fault(format!("moves node {}, which has a matrix", node.index())));
        }
        let twice = match property {
            Property::Translation => {
                let channel = keys.vectors("translations", mm)?;
                motion.track.translation.replace(channel).is_some()
            }
            Property::Rotation => {
                let channel = keys.rotations()?;
                motion.track.rotation.replace(channel).is_some()
            }
            Property::Scale => {
                let channel = keys.vectors("scales", 1.0)?;
                motion.track.scale.replace(channel).is_some()
            }
            Property::MorphTargetWeights => {
                let targets = targets(&node).map_err(|cause| keys.fault(cause))?;
                budget.hold(targets.saturating_mul(keys.times.len()))?;
                let channels = keys.weights(targets)?;
                !std::mem::replace(&mut motion.weights, channels).is_empty()
            }
        };
        if twice {
            return Err(keys.fault("moves what another channel moves".to_owned()));
        }
    }
    Ok(out)
}

/// Number of morph targets of a node's mesh.
fn targets(node: &gltf::Node<'_>) -> Result<usize, String> {
    let mesh = node.mesh();
    let primitives = mesh.iter().flat_map(gltf::Mesh::primitives);
    match primitives.map(|p| p.morph_targets().len()).max() {
        Some(targets) if targets > 0 => Ok(targets),
        _ => Err(format!("weighs morph targets of node {}, which has none", node.index())),
    }
}

/// One channel while it is read.
struct Keys<'a> {
    reader: &'a Reader<'a>,
    /// JSON pointer of the channel.
    place: String,
    times: Vec<f64>,
    curve: Curve,
    output: gltf::Accessor<'a>,
}

impl Keys<'_> {
    fn fault(&self, cause: String) -> Issue {
        Issue::error(self.reader.path, 1, cause, "export it again").of(&self.place)
    }

    fn bad(&self, error: &TrackError) -> Issue {
        let remedy = match error {
            TrackError::Order(_) => "sort the keyframes by time, no two at the same",
            TrackError::ZeroQuaternion(_) => "a rotation is a quaternion of length 1",
            _ => "export it again",
        };
        Issue::error(self.reader.path, 1, error.to_string(), remedy).of(&self.place)
    }

    fn timed(mut self, input: &gltf::Accessor<'_>) -> Result<Self, Issue> {
        let kind = "key times must be of type SCALAR";
        let times = self.reader.vectors(input, Dimensions::Scalar, kind)?;
        self.times = times.into_iter().map(|[t]| t).collect();
        Ok(self)
    }

    fn vectors(&self, what: &str, factor: f64) -> Result<Channel<DVec3>, Issue> {
        let kind = format!("{what} must be of type VEC3");
        let values = self.reader.vectors(&self.output, Dimensions::Vec3, &kind)?;
        let values = values.into_iter().map(|v| DVec3::from_array(v) * factor).collect();
        Channel::new(self.times.clone(), values, self.curve).map_err(|e| self.bad(&e))
    }

    fn rotations(&self) -> Result<Channel<DQuat>, Issue> {
        let kind = "rotations must be of type VEC4";
        let values = self.reader.vectors(&self.output, Dimensions::Vec4, kind)?;
        let values = values.into_iter().map(DQuat::from_array).collect();
        Channel::rotations(self.times.clone(), values, self.curve).map_err(|e| self.bad(&e))
    }

    /// One channel for each target: a key's values are stored together, with splines first all
    /// in-tangents, then all values, then all out-tangents (glTF 2.0, appendix C.5).
    fn weights(&self, targets: usize) -> Result<Vec<Channel<f64>>, Issue> {
        let kind = "weights must be of type SCALAR";
        let values: Vec<[f64; 1]> = self.reader.vectors(&self.output, Dimensions::Scalar, kind)?;
        let each = match self.curve {
            Curve::CubicSpline => 3,
            Curve::Step | Curve::Linear => 1,
        };
        let wanted = targets.saturating_mul(each * self.times.len());
        if values.len() != wanted {
            return Err(self.fault(format!(
                "has {} weights; {targets} morph targets at {} keyframes make {wanted}",
                values.len(),
                self.times.len()
            )));
        }
        let channels = (0..targets).map(|target| {
            let own = values.iter().skip(target).step_by(targets);
            let own = own.map(|&[weight]| weight).collect();
            Channel::new(self.times.clone(), own, self.curve).map_err(|e| self.bad(&e))
        });
        channels.collect()
    }
}
