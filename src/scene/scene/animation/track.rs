//! Sampled placements: translation, rotation and scale over time, with glTF's interpolations.

use glam::{DAffine3, DQuat, DVec3};

use super::EDGE;

/// Translation, rotation and scale; applied to a point in the order scale, rotation, translation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trs {
    /// Shift, mm.
    pub translation: DVec3,
    /// Unit quaternion.
    pub rotation: DQuat,
    /// Factors along the axes.
    pub scale: DVec3,
}

impl Default for Trs {
    fn default() -> Self {
        Self { translation: DVec3::ZERO, rotation: DQuat::IDENTITY, scale: DVec3::ONE }
    }
}

impl Trs {
    /// Parent from child.
    pub fn matrix(&self) -> DAffine3 {
        DAffine3::from_scale_rotation_translation(self.scale, self.rotation, self.translation)
    }
}

/// Interpolation from one value of a channel to the next: the samplers of glTF 2.0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Curve {
    /// The earlier value, until the next one's time.
    Step,
    /// Along the line; for rotations along the great circle, the short way.
    #[default]
    Linear,
    /// Hermite spline; the values are triples of in-tangent (per second), value, out-tangent.
    CubicSpline,
}

/// The reason why samples are no channel.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TrackError {
    /// There is no time.
    #[error("there are no keyframes")]
    Empty,
    /// The number of values does not fit the number of times.
    #[error("{values} values for {times} times")]
    Count {
        /// Number of times.
        times: usize,
        /// Number of values; a cubic spline has three for each time.
        values: usize,
    },
    /// A time or value is NaN or infinite.
    #[error("keyframe {0} is not finite")]
    NotFinite(usize),
    /// A time is not after the one before.
    #[error("keyframe {0} is not later than the one before")]
    Order(usize),
    /// A rotation without length.
    #[error("keyframe {0} is a zero quaternion")]
    ZeroQuaternion(usize),
    /// A scale that is zero somewhere, so that the placement has no inverse.
    #[error("the scale is zero at or before keyframe {0}")]
    ZeroScale(usize),
}

/// A value that a channel can hold.
pub trait Sample: Copy {
    /// Straight interpolation from `self` to `other`, `t` from 0 to 1.
    fn between(self, other: Self, t: f64) -> Self;
    /// Sum of products with the weights of a spline, as a value of this kind.
    fn weighted(parts: [(Self, f64); 4]) -> Self;
    /// Returns whether all components are finite.
    fn finite(self) -> bool;
}

impl Sample for f64 {
    fn between(self, other: Self, t: f64) -> Self {
        self + (other - self) * t
    }

    fn weighted(parts: [(Self, f64); 4]) -> Self {
        parts.iter().map(|&(value, weight)| value * weight).sum()
    }

    fn finite(self) -> bool {
        self.is_finite()
    }
}

impl Sample for DVec3 {
    fn between(self, other: Self, t: f64) -> Self {
        self.lerp(other, t)
    }

    fn weighted(parts: [(Self, f64); 4]) -> Self {
        parts.iter().map(|&(value, weight)| value * weight).sum()
    }

    fn finite(self) -> bool {
        self.is_finite()
    }
}

impl Sample for DQuat {
    /// Spherical interpolation as in glTF 2.0, appendix C.4: the short way round.
    fn between(self, other: Self, t: f64) -> Self {
        self.slerp(other, t).normalize()
    }

    fn weighted(parts: [(Self, f64); 4]) -> Self {
        let sum = parts
            .iter()
            .fold(Self::from_array([0.0; 4]), |sum, &(value, weight)| sum + value * weight);
        match sum.length_squared() > 0.0 {
            true => sum.normalize(),
            // Tangents may cancel the values exactly; there is no direction then.
            false => parts[0].0.normalize(),
        }
    }

    fn finite(self) -> bool {
        self.is_finite()
    }
}

/// One quantity over time, s. Before the first time it has the first value, after the last time the
/// last.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel<T> {
    times: Vec<f64>,
    values: Vec<T>,
    curve: Curve,
}

impl<T: Sample> Channel<T> {
    /// `times` in s, increasing; one value for each, three with [`Curve::CubicSpline`].
    ///
    /// # Errors
    /// Samples that are empty, do not match, are not finite or not in order.
    pub fn new(times: Vec<f64>, values: Vec<T>, curve: Curve) -> Result<Self, TrackError> {
        let each = match curve {
            Curve::CubicSpline => 3,
            Curve::Step | Curve::Linear => 1,
        };
        if times.is_empty() {
            return Err(TrackError::Empty);
        }
        if values.len() != each * times.len() {
            return Err(TrackError::Count { times: times.len(), values: values.len() });
        }
        for (i, &time) in times.iter().enumerate() {
            let own = &values[each * i..each * (i + 1)];
            if !time.is_finite() || own.iter().any(|v| !v.finite()) {
                return Err(TrackError::NotFinite(i));
            }
            if i > 0 && time <= times[i - 1] {
                return Err(TrackError::Order(i));
            }
        }
        Ok(Self { times, values, curve })
    }

    /// Times of the keyframes, s.
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// Values at the times, without tangents.
    fn keys(&self) -> impl Iterator<Item = T> {
        (0..self.times.len()).map(|i| self.key(i))
    }

    fn key(&self, i: usize) -> T {
        match self.curve {
            Curve::CubicSpline => self.values[3 * i + 1],
            Curve::Step | Curve::Linear => self.values[i],
        }
    }

    /// The value at `time`, s: glTF 2.0, appendix C.
    pub fn at(&self, time: f64) -> T {
        let early = match self.curve {
            Curve::Step => EDGE,
            Curve::Linear | Curve::CubicSpline => 0.0,
        };
        let next = self.times.partition_point(|&t| t <= time + early);
        if next == 0 {
            return self.key(0);
        }
        let k = next - 1;
        if next == self.times.len() {
            return self.key(k);
        }
        let step = self.times[next] - self.times[k];
        let t = (time - self.times[k]) / step;
        match self.curve {
            Curve::Step => self.key(k),
            Curve::Linear => self.key(k).between(self.key(next), t),
            Curve::CubicSpline => {
                let (t2, t3) = (t * t, t * t * t);
                T::weighted([
                    (self.key(k), 2.0 * t3 - 3.0 * t2 + 1.0),
                    (self.values[3 * k + 2], step * (t3 - 2.0 * t2 + t)),
                    (self.key(next), 3.0 * t2 - 2.0 * t3),
                    (self.values[3 * next], step * (t3 - t2)),
                ])
            }
        }
    }
}

impl Channel<DQuat> {
    /// A channel of rotations; they need not be of unit length.
    ///
    /// # Errors
    /// Those of [`Channel::new`], and a zero quaternion.
    pub fn rotations(
        times: Vec<f64>,
        mut values: Vec<DQuat>,
        curve: Curve,
    ) -> Result<Self, TrackError> {
        // A tangent may be zero, and has no unit length.
        let (each, first) = match curve {
            Curve::CubicSpline => (3, 1),
            Curve::Step | Curve::Linear => (1, 0),
        };
        for (i, value) in values.iter_mut().skip(first).step_by(each).enumerate() {
            // Neither tiny nor huge components may spoil the length.
            let largest = value.to_array().into_iter().fold(0.0, |m: f64, c| m.max(c.abs()));
            if largest == 0.0 {
                return Err(TrackError::ZeroQuaternion(i));
            }
            if value.is_finite() {
                *value = (*value / largest).normalize();
            }
        }
        Self::new(times, values, curve)
    }
}

/// Placement of a node over time; a quantity without a channel keeps its rest value.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Track {
    /// Shift, mm.
    pub translation: Option<Channel<DVec3>>,
    /// Rotation.
    pub rotation: Option<Channel<DQuat>>,
    /// Factors along the axes.
    pub scale: Option<Channel<DVec3>>,
}

impl Track {
    /// The placement at `time`, s; quantities without a channel come from `rest`.
    pub fn at(&self, rest: Trs, time: f64) -> Trs {
        let translation = self.translation.as_ref().map(|c| c.at(time));
        let rotation = self.rotation.as_ref().map(|c| c.at(time));
        let scale = self.scale.as_ref().map(|c| c.at(time));
        Trs {
            translation: translation.unwrap_or(rest.translation),
            rotation: rotation.unwrap_or(rest.rotation),
            scale: scale.unwrap_or(rest.scale),
        }
    }

    /// Returns whether the factors differ from `rest` at some time.
    pub fn scales(&self, rest: DVec3) -> bool {
        let differs = |c: &Channel<DVec3>| {
            c.curve == Curve::CubicSpline || c.keys().any(|factors| factors != rest)
        };
        self.scale.as_ref().is_some_and(differs)
    }

    /// Times of all keyframes, s, channel by channel.
    pub fn times(&self) -> impl Iterator<Item = f64> {
        let all = [
            self.translation.as_ref().map(Channel::times),
            self.rotation.as_ref().map(Channel::times),
            self.scale.as_ref().map(Channel::times),
        ];
        all.into_iter().flatten().flatten().copied()
    }

    /// First and last time of any channel, s; none where there is no channel.
    pub fn span(&self) -> Option<(f64, f64)> {
        let ends = self.times().map(|t| (t, t));
        ends.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
    }

    /// Checks that no scale passes zero: such a placement has no inverse, and rays need it.
    ///
    /// # Errors
    /// [`TrackError::ZeroScale`].
    pub fn invertible(&self) -> Result<(), TrackError> {
        let Some(scale) = &self.scale else {
            return Ok(());
        };
        let first = scale.key(0).signum();
        // Between keys of one sign a line keeps it; tangents are left to the author.
        let same = |v: DVec3| v.cmpne(DVec3::ZERO).all() && v.signum() == first;
        match scale.keys().position(|v| !same(v)) {
            Some(i) => Err(TrackError::ZeroScale(i)),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests;
