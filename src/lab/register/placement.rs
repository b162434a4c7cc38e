//! A placement in the form of a scene file: scale, then rotation, then shift.

use glam::{DAffine3, DQuat, DVec3};

use super::Transformation;
use crate::scene::file::Entry;

/// Steps per unit when writing shifts (mm), angles (degrees), axes and scales: a point 1 m away moves by
/// nanometres.
const STEPS_PER_UNIT: [f64; 4] = [1e6, 1e7, 1e9, 1e9];

/// Scale, rotation and shift, rounded as written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Size factor.
    pub scale: f64,
    /// Axis of the rotation; a unit vector up to rounding.
    pub axis: DVec3,
    /// Angle about it by the right-hand rule, degrees.
    pub degrees: f64,
    /// Shift, mm.
    pub translate: DVec3,
    scaled: bool,
}

impl Placement {
    /// The placement of a similarity found as `transformation`: a rigid one leaves the scale as it is.
    pub fn of(similarity: &DAffine3, transformation: Transformation) -> Self {
        let round = |x: f64, per: f64| (x * per).round() / per + 0.0;
        let scale = super::scale_of(similarity);
        let rotation = DQuat::from_mat3(&(similarity.matrix3 * scale.recip())).normalize();
        let (axis, angle) = rotation.to_axis_angle();
        let degrees = round(angle.to_degrees(), STEPS_PER_UNIT[1]);
        let scaled = transformation == Transformation::Similarity;
        Self {
            scale: if scaled { round(scale, STEPS_PER_UNIT[3]) } else { scale },
            axis: match degrees == 0.0 {
                true => DVec3::Z,
                false => axis.map(|x| round(x, STEPS_PER_UNIT[2])),
            },
            degrees,
            translate: similarity.translation.map(|x| round(x, STEPS_PER_UNIT[0])),
            scaled,
        }
    }

    /// The similarity that a scene file with these numbers gives.
    pub fn similarity(&self) -> DAffine3 {
        DAffine3::from_scale_rotation_translation(
            DVec3::splat(self.scale),
            DQuat::from_axis_angle(self.axis.normalize(), self.degrees.to_radians()),
            self.translate,
        )
    }

    /// Entries of the file at `table`, such as `volume`.
    pub fn entries(&self, table: &str) -> Vec<Entry> {
        let list = |v: DVec3| format!("[{}, {}, {}]", v.x, v.y, v.z);
        let angle = self.degrees;
        let rotate = format!("{{ axis = {}, angle = \"{angle} deg\" }}", list(self.axis));
        let mut out = vec![
            (format!("{table}.translate"), Some(list(self.translate))),
            (format!("{table}.rotate"), Some(rotate)),
        ];
        if self.scaled {
            out.push((format!("{table}.scale"), Some(self.scale.to_string())));
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_similarity_is_written_to_nanometres() {
        let axes = [DVec3::X, DVec3::new(0.2, -0.7, 0.4), DVec3::new(-1.0, -1.0, -1.0)];
        for axis in axes {
            for degrees in [0.0, 1e-9, 0.5, 90.0, 179.999, 180.0, 300.0] {
                let wanted = DAffine3::from_scale_rotation_translation(
                    DVec3::splat(1.07),
                    DQuat::from_axis_angle(axis.normalize(), f64::to_radians(degrees)),
                    DVec3::new(-123.456_789_012, 0.1, 77.7),
                );
                let made = Placement::of(&wanted, Transformation::Similarity);
                let again = made.similarity();
                let far = DVec3::splat(500.0);
                let off = again.transform_point3(far) - wanted.transform_point3(far);
                assert!(off.length() < 5e-6, "{degrees} {off}");
                assert_eq!(
                    Placement::of(&again, Transformation::Similarity).entries("v")[0],
                    made.entries("v")[0]
                );
            }
        }
    }

    #[test]
    fn a_rigid_placement_says_nothing_of_the_scale() {
        let placed = DAffine3::from_scale(DVec3::splat(0.3));
        let made = Placement::of(&placed, Transformation::Rigid);
        assert!((made.scale - 0.3).abs() < 1e-15);
        let keys: Vec<_> = made.entries("volume").into_iter().map(|(key, _)| key).collect();
        assert_eq!(keys, ["volume.translate", "volume.rotate"]);
    }
}
