//! The way to a view, in a sonographer's words.

use glam::{DAffine3, DQuat, EulerRot};

/// A movement of the probe along or about one of its own axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// What is done.
    pub act: Act,
    /// By how much: mm, or rad for turns; the sign says which way.
    pub amount: f64,
}

/// What a step does. The picture is seen as scanners show it: x to its right, z down, y towards the viewer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Act {
    /// Slide along the image, x.
    Along,
    /// Slide across the image, y.
    Across,
    /// Press (positive), or ease off, z.
    Press,
    /// Rotate about the beam, z.
    Rotate,
    /// Tilt (fan) about the face's long side, x.
    Tilt,
    /// Rock about the face's short side, y.
    Rock,
}

/// Amounts below which a step is left out: mm, rad.
const LEAST: [f64; 2] = [1.0, 1.0 * std::f64::consts::PI / 180.0];

/// The steps that take a probe from `pose` to `target` (world from probe), one after the other, each about the axes
/// that the probe then has: slides, then rotation, tilt and rocking.
pub fn steps(pose: &DAffine3, target: &DAffine3) -> [Step; 6] {
    let to = pose.inverse() * *target;
    let (rotate, tilt, rock) = DQuat::from_mat3(&to.matrix3).normalize().to_euler(EulerRot::ZXY);
    [
        (Act::Along, to.translation.x),
        (Act::Across, to.translation.y),
        (Act::Press, to.translation.z),
        (Act::Rotate, rotate),
        (Act::Tilt, tilt),
        (Act::Rock, rock),
    ]
    .map(|(act, amount)| Step { act, amount })
}

impl Step {
    /// Returns whether it is too small to be told.
    pub fn is_small(&self) -> bool {
        self.amount.abs() < LEAST[usize::from(!self.slides())]
    }

    fn slides(&self) -> bool {
        matches!(self.act, Act::Along | Act::Across | Act::Press)
    }

    /// The step in words: "slide 12 mm to the right of the image".
    pub fn words(&self) -> String {
        let forth = self.amount >= 0.0;
        let (verb, way) = match (self.act, forth) {
            (Act::Along, true) => ("slide", "to the right of the image"),
            (Act::Along, false) => ("slide", "to the left of the image"),
            (Act::Across, true) => ("slide", "out of the image, towards you"),
            (Act::Across, false) => ("slide", "into the image, away from you"),
            (Act::Press, true) => ("go", "deeper"),
            (Act::Press, false) => ("go", "back"),
            (Act::Rotate, true) => ("rotate", "clockwise, seen from the cable"),
            (Act::Rotate, false) => ("rotate", "anticlockwise, seen from the cable"),
            (Act::Tilt, true) => ("tilt", "so that the beam swings away from you"),
            (Act::Tilt, false) => ("tilt", "so that the beam swings towards you"),
            (Act::Rock, true) => ("rock", "so that the beam swings to the right of the image"),
            (Act::Rock, false) => ("rock", "so that the beam swings to the left of the image"),
        };
        match self.slides() {
            true => format!("{verb} {:.0} mm {way}", self.amount.abs()),
            false => format!("{verb} {:.0}\u{b0} {way}", self.amount.abs().to_degrees()),
        }
    }

    /// An arrow for it on a screen.
    pub fn arrow(&self) -> &'static str {
        match (self.act, self.amount >= 0.0) {
            (Act::Along | Act::Rock, true) => "\u{27a1}",
            (Act::Along | Act::Rock, false) => "\u{2b05}",
            // Into the image, where the beam's far end goes in a tilt, and out of it.
            (Act::Across, false) | (Act::Tilt, true) => "\u{2197}",
            (Act::Across, true) | (Act::Tilt, false) => "\u{2199}",
            (Act::Press, true) => "\u{2b07}",
            (Act::Press, false) => "\u{2b06}",
            (Act::Rotate, true) => "\u{21bb}",
            (Act::Rotate, false) => "\u{21ba}",
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    #[test]
    fn the_steps_lead_to_the_target() {
        let pose = DAffine3::from_rotation_x(1.1)
            * DAffine3::from_translation(DVec3::new(4.0, 50.0, -3.0));
        let target = DAffine3::from_translation(DVec3::new(30.0, -20.0, 7.0))
            * DAffine3::from_rotation_y(-0.8)
            * DAffine3::from_rotation_z(2.0);
        let done = steps(&pose, &target).into_iter().fold(pose, |pose, step| {
            pose * match step.act {
                Act::Along => DAffine3::from_translation(DVec3::X * step.amount),
                Act::Across => DAffine3::from_translation(DVec3::Y * step.amount),
                Act::Press => DAffine3::from_translation(DVec3::Z * step.amount),
                Act::Rotate => DAffine3::from_rotation_z(step.amount),
                Act::Tilt => DAffine3::from_rotation_x(step.amount),
                Act::Rock => DAffine3::from_rotation_y(step.amount),
            }
        });
        assert!(done.abs_diff_eq(target, 1e-9), "{done:?} {target:?}");
        assert!(steps(&pose, &pose).iter().all(Step::is_small));
    }

    #[test]
    fn words_name_the_way_that_the_beam_goes() {
        let beam = |rotation: DAffine3| rotation.transform_vector3(DVec3::Z);
        assert!(beam(DAffine3::from_rotation_x(0.1)).y < 0.0, "away from the viewer");
        assert!(beam(DAffine3::from_rotation_y(0.1)).x > 0.0, "to the right");
        let tilt = Step { act: Act::Tilt, amount: 0.2 };
        assert_eq!(tilt.words(), "tilt 11\u{b0} so that the beam swings away from you");
    }
}
