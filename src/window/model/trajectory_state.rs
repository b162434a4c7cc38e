//! Recording the probe's trajectory, and replaying it.

use std::sync::Arc;
use std::time::Instant;

use glam::DAffine3;

use super::trajectory::{Recorder, Recording, Replay};
use super::{Model, Source};
use crate::scene::animation::Track;

/// The trajectory of a session, and its state.
#[derive(Clone, Debug, Default)]
pub struct TrajectoryState {
    /// A recording under way.
    pub recorder: Option<Recorder>,
    /// The last trajectory recorded or loaded.
    pub stored: Option<StoredTrajectory>,
    /// The replay that the probe follows.
    pub replay: Option<Replay>,
    /// True where the replay begins again after its end.
    pub looped: bool,
    /// True where it follows the scene's time, from its first row's time on.
    pub with_scene: bool,
}

/// A trajectory to replay.
#[derive(Clone, Debug)]
pub struct StoredTrajectory {
    /// The probe's pose over time.
    pub track: Arc<Track>,
    /// The recording that is not saved yet.
    pub unsaved: Option<Recording>,
    /// Name of its file, or of the recording.
    pub name: String,
    /// The scene's time at its first row, s, where known.
    scene_seconds: Option<f64>,
}

impl StoredTrajectory {
    /// A trajectory from a file.
    pub fn loaded(track: Track, name: String) -> Self {
        Self { track: Arc::new(track), unsaved: None, name, scene_seconds: None }
    }

    /// A trajectory that has just been recorded.
    pub fn recorded(recording: Recording) -> Self {
        Self {
            track: Arc::new(recording.track()),
            scene_seconds: Some(recording.scene_seconds()),
            name: "recorded".to_owned(),
            unsaved: Some(recording),
        }
    }

    /// Its length, s.
    pub fn seconds(&self) -> f64 {
        let (first, last) = self.track.span().unwrap_or_default();
        last - first
    }
}

impl Model {
    /// The recorded trajectory that no file holds yet.
    pub fn unsaved_trajectory(&self) -> Option<&StoredTrajectory> {
        self.trajectory.stored.as_ref().filter(|stored| stored.unsaved.is_some())
    }

    /// Begins a recording, or ends it.
    pub fn record(&mut self, now: Instant) {
        let scene = self.clock.at(now);
        match self.trajectory.recorder.take() {
            None => self.trajectory.recorder = Some(Recorder::new(self.pose, scene, now)),
            Some(recorder) => {
                let recording = recorder.finish(now);
                self.keep_trajectory(StoredTrajectory::recorded(recording), now);
            }
        }
    }

    /// Starts the replay from its beginning, or stops it. A replay that follows the scene's time
    /// sets that to the time at which the recording began.
    pub fn replay(&mut self, now: Instant) {
        if self.trajectory.replay.is_some() {
            self.stop(now);
            return self.touch(now);
        }
        let Some(stored) = &self.trajectory.stored else { return };
        let start = self.animated && self.trajectory.with_scene;
        let start = start.then(|| stored.scene_seconds.unwrap_or_else(|| self.clock.at(now)));
        if let Some(seconds) = start {
            self.clock.seek(seconds, now);
            self.clock.play(true, now);
        }
        let (track, looped) = (stored.track.clone(), self.trajectory.looped);
        self.note_pose(Source::Replay, now);
        let mut replay = Replay::new(track, &self.home, start, looped, now);
        replay.hold(self.frozen, now);
        self.trajectory.replay = Some(replay);
        self.devices.take(Source::Replay);
        self.follow(now);
        self.touch(now);
    }

    /// Puts the probe to the start of a trajectory and waits; [`Self::begin_replay`] starts it.
    pub fn await_replay(&mut self, stored: StoredTrajectory, now: Instant) {
        self.trajectory.stored = Some(stored);
        self.replay(now);
        if let Some(replay) = &mut self.trajectory.replay {
            replay.hold(true, now);
        }
    }

    /// Starts a waiting replay: there is a picture to look at.
    pub fn begin_replay(&mut self, now: Instant) {
        if let Some(replay) = &mut self.trajectory.replay
            && !self.frozen
        {
            replay.hold(false, now);
            self.touch(now);
        }
    }

    /// Stops the replay for another device, which starts from the place that it has reached.
    /// Returns whether there was a replay.
    pub(super) fn stop(&mut self, now: Instant) -> bool {
        self.follow(now);
        self.trajectory.replay.take().is_some()
    }

    /// Moves the model's pose to the replay's. The simulation follows the replay by itself.
    pub fn follow(&mut self, now: Instant) {
        if let Some(replay) = &self.trajectory.replay {
            self.pose = replay.pose(&self.clock, now);
            let is_over = replay.is_over(&self.clock, now);
            self.write("replay", self.pose, now);
            if is_over {
                self.trajectory.replay = None;
            }
        }
    }

    /// Notes a movement of the probe by `device` in the recording, if there is one.
    pub(super) fn write(&mut self, device: &str, pose: DAffine3, now: Instant) {
        if let Some(recorder) = &mut self.trajectory.recorder {
            recorder.note(device, pose, now);
            if recorder.is_full() {
                self.record(now);
            }
        }
    }
}

#[cfg(test)]
mod tests;
