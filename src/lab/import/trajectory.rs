//! Tracked poses as a trajectory of the probe: a table of times, places and turns.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use glam::{DAffine3, DQuat};

use super::plus::{self, DeviceSet};
use crate::issue::FileError;
use crate::scene::tracker::rigid;
use crate::volume::{Pose, TrackedFrame, Transforms, track};

/// A trajectory in the making.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory {
    /// Rows as CSV, with the header and comments.
    pub text: String,
    /// Rows.
    pub rows: usize,
    /// Frames without a valid pose, or no later than the one before.
    pub left_out: usize,
    /// Time from the first row to the last, s.
    pub duration: f64,
}

/// Names of frames, and what is said about them.
#[derive(Clone, Debug)]
pub struct Naming {
    /// Frame of the tool: the probe's marker.
    pub tool: String,
    /// Frame that poses are wanted in: the world, or RAS.
    pub reference: String,
    /// Turns RAS into a world in LPS.
    pub to_lps: bool,
}

/// The poses of a sequence by the names of their transforms. With a configuration of PLUS its transforms join them;
/// where it has a simulator, the rows are poses of its transducer's face, else of the tool, whose axes then are the probe's.
///
/// # Errors
/// The fault of a file, also of the simulator; frames that nothing connects; no pose that is valid.
pub fn import(
    path: &Path,
    config: Option<&Path>,
    naming: &Naming,
) -> Result<Trajectory, FileError> {
    let frames = track(path)?;
    let set = config.map(DeviceSet::simulated).transpose()?.flatten();
    let transforms = match (&set, config) {
        (Some(set), _) => set.transforms.clone(),
        (None, Some(config)) => plus::definitions(config)?,
        (None, None) => Transforms::default(),
    };
    let turn = DAffine3::from_rotation_z(std::f64::consts::PI);
    let to_world = if naming.to_lps { turn } else { DAffine3::IDENTITY };
    let between = |frame: &TrackedFrame, from: &str| {
        transforms.between(&frame.poses, from, &naming.reference)
    };
    let connected = frames.iter().any(|f| between(f, &naming.tool).is_some());
    if !connected {
        let mut names: Vec<_> = frames.iter().flat_map(|f| f.poses.keys().cloned()).collect();
        names.sort();
        names.dedup();
        let message = format!("nothing leads from `{}` to `{}`", naming.tool, naming.reference);
        let remedy = format!(
            "it has {}: choose by --pose FROMToTO, or add transforms by --config",
            names.join(", ")
        );
        return Err(FileError::file(path, message, remedy));
    }
    let probe = |frame: &TrackedFrame| -> Option<DAffine3> {
        let pose = match &set {
            Some(set) => {
                let image = between(frame, &set.image)??;
                set.transducer.placed(&image).world_from_probe()
            }
            None => between(frame, &naming.tool)??,
        };
        rigid(to_world * pose).ok()
    };
    let face = match set {
        Some(_) => "the middle of the transducer's face",
        None => "the tool's origin, whose axes are taken for the probe's",
    };
    let mut text = format!(
        "# Poses of {face}, from {}: `{}` in `{}`{}.\ntime_s,x_mm,y_mm,z_mm,qw,qx,qy,qz\n",
        path.file_name().unwrap_or_default().to_string_lossy(),
        naming.tool,
        naming.reference,
        if naming.to_lps { ", turned from RAS to LPS" } else { "" }
    );
    let (mut rows, mut left_out, mut first, mut last) = (0, 0, None, f64::NEG_INFINITY);
    for frame in &frames {
        let (Some(pose), Some(time)) = (probe(frame), frame.timestamp) else {
            left_out += 1;
            continue;
        };
        let start = *first.get_or_insert(time);
        if time - start <= last {
            left_out += 1;
            continue;
        }
        last = time - start;
        rows += 1;
        let p = pose.translation;
        let q = DQuat::from_mat3(&pose.matrix3);
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{last:.6},{:.7},{:.7},{:.7},{:.9},{:.9},{:.9},{:.9}",
            p.x, p.y, p.z, q.w, q.x, q.y, q.z
        );
    }
    if rows == 0 {
        let message = format!("none of {} frames has a time and a valid rigid pose", frames.len());
        return Err(FileError::file(
            path,
            message,
            "give a sequence with timestamps and poses that are OK",
        ));
    }
    Ok(Trajectory { text, rows, left_out, duration: last })
}

/// The poses of the first frame in which all are valid; of the first where there is no such frame.
///
/// # Errors
/// The fault of the file.
pub fn first_poses(path: &Path) -> Result<BTreeMap<String, Pose>, FileError> {
    let frames = track(path)?;
    let whole =
        frames.iter().position(|f| !f.poses.is_empty() && f.poses.values().all(Pose::is_ok));
    Ok(frames[whole.unwrap_or(0)].poses.clone())
}
