//! The tracker that may move the probe: choice of its tool, and the relation of its frames to the scene's.

use glam::{DAffine3, DMat3, DVec3};

use crate::settings::units::FARTHEST;
use crate::settings::words;

/// Largest deviation of the axes of a rigid transform from unit vectors at right angles: the rounding of
/// 32-bit floats and of three written decimals.
const RIGID: f64 = 2e-3;

words! {
    /// Meaning of x and y of the scene's world. z grows to the head in both.
    pub enum Axes {
        /// To the patient's left and back, as in DICOM, ITK and the volumes of a scene.
        Lps = "lps",
        /// To the patient's right and front, as in 3D Slicer.
        Ras = "ras",
    }
}

/// Calibration and choice of a tracked tool.
#[derive(Clone, Debug, PartialEq)]
pub struct Tracker {
    /// Name of the tool's transform; none: every tool moves the probe.
    pub device: Option<String>,
    /// Silence after which the tracker counts as lost, s.
    pub timeout: f64,
    /// Axes of the world.
    pub axes: Axes,
    /// World from the frame in which the tracker reports, rigid, mm.
    pub world_from_reference: DAffine3,
    /// Frame of the tracked tool from probe space (x lateral, y elevation, z depth; the origin is the
    /// centre of the face), rigid, mm.
    pub tool_from_probe: DAffine3,
}

impl Tracker {
    /// World from probe, mm, when the tracker reports `reference_from_tool`.
    pub fn world_from_probe(&self, reference_from_tool: DAffine3) -> DAffine3 {
        self.world_from_reference * reference_from_tool * self.tool_from_probe
    }
}

impl Axes {
    /// RAS, the frame of OpenIGTLink messages, from the world: half a turn about z, or the identity. Its own
    /// inverse.
    pub fn to_ras(self) -> DAffine3 {
        match self {
            Self::Lps => DAffine3::from_scale(DVec3::new(-1.0, -1.0, 1.0)),
            Self::Ras => DAffine3::IDENTITY,
        }
    }
}

impl Default for Tracker {
    /// Any tool, in the RAS frame of 3D Slicer over a world in LPS; the tool's frame is the probe's.
    fn default() -> Self {
        Self {
            device: None,
            timeout: 0.5,
            axes: Axes::Lps,
            world_from_reference: Axes::Lps.to_ras(),
            tool_from_probe: DAffine3::IDENTITY,
        }
    }
}

/// The rigid transform nearest to `transform`, which may be off by rounding only.
///
/// # Errors
/// The reason why it is no rigid transform.
pub fn rigid(transform: DAffine3) -> Result<DAffine3, String> {
    if !transform.is_finite() {
        return Err("it holds values that are no finite numbers".to_owned());
    }
    if transform.translation.length() > FARTHEST {
        return Err(format!("it lies more than {FARTHEST} mm from the origin"));
    }
    let m = transform.matrix3;
    let off = (m.transpose() * m - DMat3::IDENTITY).to_cols_array();
    let off = off.iter().fold(0.0, |worst: f64, x| worst.max(x.abs()));
    if off > RIGID {
        return Err(format!("its axes are no unit vectors at right angles (off by {off:.2})"));
    }
    if m.determinant() < 0.0 {
        return Err("it mirrors".to_owned());
    }
    let x = m.x_axis.normalize();
    let y = (m.y_axis - x * x.dot(m.y_axis)).normalize();
    Ok(DAffine3::from_mat3_translation(DMat3::from_cols(x, y, x.cross(y)), transform.translation))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_probe_is_where_tool_and_calibration_put_it() {
        let tracker = Tracker {
            world_from_reference: DAffine3::from_translation(DVec3::new(100.0, 0.0, 0.0)),
            tool_from_probe: DAffine3::from_translation(DVec3::new(0.0, 0.0, 30.0)),
            ..Tracker::default()
        };
        // The tool's z axis points along the tracker's y.
        let tool = DAffine3::from_rotation_translation(
            glam::DQuat::from_rotation_arc(DVec3::Z, DVec3::Y),
            DVec3::new(1.0, 2.0, 3.0),
        );
        let probe = tracker.world_from_probe(tool);
        let (face, depth) = (probe.translation, probe.transform_vector3(DVec3::Z));
        assert!((face - DVec3::new(101.0, 32.0, 3.0)).length() < 1e-12, "{face}");
        assert!((depth - DVec3::Y).length() < 1e-12, "{depth}");
    }

    #[test]
    fn slicer_moves_the_probe_of_a_world_in_lps_by_default() {
        let tool = DAffine3::from_translation(DVec3::new(10.0, 20.0, 30.0));
        let probe = Tracker::default().world_from_probe(tool);
        assert_eq!(probe.translation, DVec3::new(-10.0, -20.0, 30.0));
        let sent = Axes::Lps.to_ras() * probe;
        assert_eq!(sent, tool, "what comes in goes out");
    }

    #[test]
    fn only_rigid_transforms_pass_and_rounding_is_taken_out() {
        let turn = DAffine3::from_rotation_y(0.3);
        let rounded = DAffine3::from_mat3(turn.matrix3.as_mat3().as_dmat3());
        let exact = rigid(rounded).expect("rigid");
        let gram = exact.matrix3.transpose() * exact.matrix3;
        assert!(gram.abs_diff_eq(DMat3::IDENTITY, 1e-15), "{gram}");
        assert!(exact.matrix3.abs_diff_eq(turn.matrix3, 1e-7));
        for (wrong, why) in [
            (DAffine3::from_scale(DVec3::splat(1.01)), "right angles"),
            (DAffine3::from_mat3(DMat3::ZERO), "right angles"),
            (DAffine3::from_scale(DVec3::new(1.0, 1.0, -1.0)), "mirrors"),
            (DAffine3::from_translation(DVec3::new(f64::NAN, 0.0, 0.0)), "finite"),
            (DAffine3::from_translation(DVec3::new(2e5, 0.0, 0.0)), "mm from"),
        ] {
            let message = rigid(wrong).expect_err(why);
            assert!(message.contains(why), "{message}");
        }
    }
}
