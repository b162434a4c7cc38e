//! Placements over time.

use std::f64::consts::TAU;

use glam::{DAffine3, DMat3, DQuat, DVec3};

use super::clock::Clock;
use super::fetal::Fetal;
use super::track::{Track, Trs};

/// A rotation about an axis through a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turn {
    /// A point of the axis, mm.
    pub centre: DVec3,
    /// Unit vector.
    pub axis: DVec3,
    /// Angle by the right-hand rule, rad.
    pub angle: f64,
}

impl Default for Turn {
    /// No rotation.
    fn default() -> Self {
        Self { centre: DVec3::ZERO, axis: DVec3::Z, angle: 0.0 }
    }
}

impl Turn {
    /// The rotation by `share` of the angle.
    pub fn by(&self, share: f64) -> DAffine3 {
        let rotation = DQuat::from_axis_angle(self.axis, self.angle * share);
        let shift = self.centre - rotation * self.centre;
        DAffine3::from_rotation_translation(rotation, shift)
    }
}

/// Motion of a transform node; lengths and axes are those of the node at rest.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Motion {
    /// No motion.
    #[default]
    Still,
    /// To and fro: shift and angle follow the sine of the phase, and factors are to its power.
    Sine {
        /// Full oscillations.
        clock: Clock,
        /// Amplitude of the shift, mm.
        translation: DVec3,
        /// Amplitude of the rotation.
        turn: Turn,
        /// Largest factors along the axes, about the centre of the rotation; where the sine is -1, it is 1 over them.
        scale: DVec3,
    },
    /// Rotation at constant speed: points off the axis go on circles around it.
    Orbit {
        /// Clock; a period is the whole angle.
        clock: Clock,
        /// Rotation in one period.
        turn: Turn,
    },
    /// Fetal movement.
    Fetal(Fetal),
    /// A track of samples.
    Track {
        /// Its period is the time from the first sample to the last.
        clock: Clock,
        /// Time of the samples at the begin of the period, s.
        start: f64,
        /// Placement for quantities without samples.
        rest: Trs,
        /// The samples.
        track: Box<Track>,
    },
}

impl Motion {
    /// The placement at rest, at which nothing squeezes the tissue.
    pub fn rest(&self) -> DAffine3 {
        match self {
            Self::Track { rest, .. } => rest.matrix(),
            Self::Still | Self::Sine { .. } | Self::Orbit { .. } | Self::Fetal(_) => {
                DAffine3::IDENTITY
            }
        }
    }

    /// Returns whether size or proportions of the moved tissue change.
    pub fn scales(&self) -> bool {
        match self {
            Self::Sine { scale, .. } => *scale != DVec3::ONE,
            Self::Track { rest, track, .. } => track.scales(rest.scale),
            Self::Still | Self::Orbit { .. } | Self::Fetal(_) => false,
        }
    }

    /// Placement of the node at `seconds`, relative to rest.
    pub fn at(&self, seconds: f64) -> DAffine3 {
        match self {
            Self::Still => DAffine3::IDENTITY,
            Self::Sine { clock, translation, turn, scale } => {
                let sine = (TAU * clock.fraction(seconds)).sin();
                let moved = DAffine3::from_translation(*translation * sine) * turn.by(sine);
                moved * scaled(scale.map(|factor| factor.powf(sine)), turn.centre)
            }
            Self::Orbit { clock, turn } => turn.by(clock.fraction(seconds)),
            Self::Fetal(fetal) => fetal.at(seconds),
            Self::Track { clock, start, rest, track } => {
                let time = start + clock.period * clock.fraction(seconds);
                track.at(*rest, time).matrix()
            }
        }
    }
}

/// A scaling by factors along the axes, about a point.
fn scaled(factors: DVec3, centre: DVec3) -> DAffine3 {
    DAffine3 { matrix3: DMat3::from_diagonal(factors), translation: centre - factors * centre }
}

#[cfg(test)]
mod tests {
    use super::super::clock::Loop;
    use super::super::track::{Channel, Curve};
    use super::*;

    fn close(a: DVec3, b: DVec3) {
        assert!((a - b).length() < 1e-12, "{a} {b}");
    }

    fn clock(period: f64) -> Clock {
        Clock { period, ..Clock::default() }
    }

    #[test]
    fn a_sine_motion_follows_the_sine() {
        let motion = Motion::Sine {
            clock: Clock { phase: 0.125, ..clock(2.0) },
            translation: DVec3::new(3.0, 0.0, -1.0),
            turn: Turn { centre: DVec3::new(0.0, 5.0, 0.0), axis: DVec3::X, angle: 0.4 },
            scale: DVec3::ONE,
        };
        for i in 0..50 {
            let t = f64::from(i) * 0.17;
            let s = (std::f64::consts::PI * t + std::f64::consts::FRAC_PI_4).sin();
            // The centre of the rotation only shifts; a point 2 mm beside it goes round.
            let shift = DVec3::new(3.0 * s, 0.0, -s);
            let at = motion.at(t);
            close(
                at.transform_point3(DVec3::new(1.0, 5.0, 0.0)),
                DVec3::new(1.0, 5.0, 0.0) + shift,
            );
            let (sin, cos) = (0.4 * s).sin_cos();
            close(
                at.transform_point3(DVec3::new(0.0, 7.0, 0.0)),
                DVec3::new(0.0, 5.0 + 2.0 * cos, 2.0 * sin) + shift,
            );
        }
    }

    #[test]
    fn factors_are_to_the_power_of_the_sine_about_the_centre() {
        let factors = DVec3::new(1.25, 0.5, 1.0);
        let motion = Motion::Sine {
            clock: clock(4.0),
            translation: DVec3::ZERO,
            turn: Turn { centre: DVec3::new(10.0, 0.0, -2.0), ..Turn::default() },
            scale: factors,
        };
        let point = DVec3::new(12.0, 4.0, -1.0);
        for (t, x, y) in [(0.0, 12.0, 4.0), (1.0, 12.5, 2.0), (3.0, 11.6, 8.0)] {
            close(motion.at(t).transform_point3(point), DVec3::new(x, y, -1.0));
        }
        assert!(motion.scales() && !Motion::Still.scales());
    }

    #[test]
    fn an_orbit_is_a_circle_and_an_arc_swings_back() {
        let turn = Turn { centre: DVec3::new(10.0, 0.0, 0.0), axis: DVec3::Z, angle: TAU };
        let motion = Motion::Orbit { clock: clock(4.0), turn };
        let point = DVec3::new(13.0, 0.0, 1.0);
        for (t, x, y) in [(0.0, 13.0, 0.0), (1.0, 10.0, 3.0), (6.0, 7.0, 0.0)] {
            close(motion.at(t).transform_point3(point), DVec3::new(x, y, 1.0));
        }
        let arc = Motion::Orbit {
            clock: Clock { mode: Loop::PingPong, ..clock(4.0) },
            turn: Turn { angle: TAU / 4.0, ..turn },
        };
        for (t, x, y) in [(4.0, 10.0, 3.0), (8.0, 13.0, 0.0)] {
            close(arc.at(t).transform_point3(point), DVec3::new(x, y, 1.0));
        }
        close(arc.at(6.0).transform_point3(point), arc.at(2.0).transform_point3(point));
    }

    #[test]
    fn a_track_runs_from_its_own_first_time() {
        let values = vec![DVec3::ZERO, DVec3::X * 8.0];
        let track = Track {
            translation: Some(Channel::new(vec![3.0, 5.0], values, Curve::Linear).expect("sound")),
            ..Track::default()
        };
        let motion = |mode| Motion::Track {
            clock: Clock { mode, ..clock(2.0) },
            start: 3.0,
            rest: Trs::default(),
            track: Box::new(track.clone()),
        };
        let x = |mode, t: f64| motion(mode).at(t).translation.x;
        assert_eq!(x(Loop::Repeat, 0.5), 2.0);
        assert_eq!(x(Loop::Repeat, 2.5), 2.0);
        assert_eq!(x(Loop::PingPong, 2.5), 6.0);
        assert_eq!(x(Loop::Once, 2.5), 8.0);
        assert_eq!(x(Loop::Once, -1.0), 0.0);
    }
}
