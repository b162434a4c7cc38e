//! The last pose from the tracker.

use std::time::{Duration, Instant};

use glam::DAffine3;
use parking_lot::Mutex;

use super::POSE_DEVICE;
use super::message::Message;
use super::wire::Label;
use crate::scene::tracker::{Tracker, rigid};

/// A pose of the probe.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackedPose {
    /// Calibrated: world from probe space, rigid, mm.
    pub world_from_probe: DAffine3,
    /// Time of its arrival here.
    pub arrived: Instant,
    /// Number of the pose, from 1.
    pub number: u64,
    /// Name of the transform or the tool.
    pub device: Label<20>,
}

/// State of the tracker.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TrackerState {
    /// No pose has arrived yet.
    Never,
    /// The latest pose is no older than the tracker's timeout.
    Live(TrackedPose),
    /// It is older, or the tracker reports that it does not see the tool. The last pose: nothing has been seen
    /// since its arrival.
    Lost(TrackedPose),
}

impl TrackerState {
    /// The last pose, live or not.
    pub fn pose(&self) -> Option<&TrackedPose> {
        match self {
            Self::Never => None,
            Self::Live(pose) | Self::Lost(pose) => Some(pose),
        }
    }
}

/// Magnitude from which on a number stands for none: that of NDI's trackers is -3.7e28.
const NO_NUMBER: f32 = 1e20;

/// Returns whether a matrix is what a tracker sends of a tool that it does not see: numbers that are none, or zeros.
fn is_gap(matrix: &[f32; 12]) -> bool {
    let is_none = |value: &f32| !value.is_finite() || value.abs() >= NO_NUMBER;
    matrix.iter().any(is_none) || matrix[..9].iter().all(|value| *value == 0.0)
}

/// The latest pose, and the calibration of messages.
pub(super) struct Tracking {
    tracker: Mutex<Tracker>,
    last: Mutex<Option<LastPose>>,
}

struct LastPose {
    pose: TrackedPose,
    /// True where the tracker has since reported that it does not see the tool.
    missing: bool,
}

impl Tracking {
    pub fn new(tracker: Tracker) -> Self {
        Self { tracker: Mutex::new(tracker), last: Mutex::new(None) }
    }

    pub fn tracker(&self) -> Tracker {
        self.tracker.lock().clone()
    }

    /// Goes on with another calibration. Poses from the one before are forgotten.
    pub fn calibrate(&self, tracker: Tracker) {
        *self.tracker.lock() = tracker;
        *self.last.lock() = None;
    }

    pub fn now(&self) -> TrackerState {
        match &*self.last.lock() {
            None => TrackerState::Never,
            Some(last) => {
                let timeout = Duration::from_secs_f64(self.tracker().timeout);
                match last.missing || last.pose.arrived.elapsed() > timeout {
                    true => TrackerState::Lost(last.pose),
                    false => TrackerState::Live(last.pose),
                }
            }
        }
    }

    /// Returns whether this tool moves the probe. Without a choice all do, except the pose sent from here:
    /// some programs send back what they receive.
    fn is_meant(&self, device: &Label<20>) -> bool {
        match &self.tracker.lock().device {
            Some(wanted) => device.is(wanted),
            None => !device.is(POSE_DEVICE),
        }
    }

    /// Takes a tool's matrix, columns first; returns whether it is the tool that moves the probe.
    ///
    /// # Errors
    /// The fault of the matrix.
    pub fn report(
        &self,
        device: Label<20>,
        matrix: &[f32; 12],
        message: &Message,
    ) -> Result<bool, String> {
        if !self.is_meant(&device) {
            return Ok(false);
        }
        // For a tool out of view PLUS sends the last matrix and a status that is not OK, others no matrix.
        let status = message.metadata("TransformStatus");
        if status.is_some_and(|status| status != "OK") || is_gap(matrix) {
            if let Some(last) = &mut *self.last.lock() {
                last.missing |= last.pose.device == device;
            }
            return Ok(true);
        }
        let reported = DAffine3::from_cols_array(&matrix.map(f64::from));
        let reported =
            rigid(reported).map_err(|why| format!("{device} is no pose of a probe: {why}"))?;
        let world_from_probe = self.tracker().world_from_probe(reported);
        let mut last = self.last.lock();
        let number = last.as_ref().map_or(0, |last| last.pose.number) + 1;
        *last = Some(LastPose {
            pose: TrackedPose { world_from_probe, arrived: Instant::now(), number, device },
            missing: false,
        });
        Ok(true)
    }
}
