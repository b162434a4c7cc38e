//! Recording where the probe goes, and letting it go there again.

use std::sync::Arc;
use std::time::Instant;

use glam::DAffine3;

use super::trajectory::{Recorder, Recording, Replay};
use super::{Model, Source};
use crate::scene::animation::Track;

/// The trajectory that a session has, and what it does with it.
#[derive(Clone, Debug, Default)]
pub struct Ways {
    /// A recording under way.
    pub recorder: Option<Recorder>,
    /// What was recorded or loaded last.
    pub kept: Option<Kept>,
    /// The probe goes along it.
    pub replay: Option<Replay>,
    /// It begins again when it has ended.
    pub looped: bool,
    /// It goes on as the scene's time does, from its first row's time on.
    pub with_scene: bool,
}

/// A trajectory to replay.
#[derive(Clone, Debug)]
pub struct Kept {
    /// Where the probe is when.
    pub track: Arc<Track>,
    /// The recording that is not saved yet.
    pub unsaved: Option<Recording>,
    /// Where it is from.
    pub name: String,
    /// The scene's time at its first row, s, where that is known.
    scene_seconds: Option<f64>,
}

impl Kept {
    /// A trajectory from a file.
    pub fn loaded(track: Track, name: String) -> Self {
        Self { track: Arc::new(track), unsaved: None, name, scene_seconds: None }
    }

    /// Its length, s.
    pub fn seconds(&self) -> f64 {
        let (first, last) = self.track.span().unwrap_or_default();
        last - first
    }
}

impl Model {
    /// Begins a recording, or ends it.
    pub fn record(&mut self, now: Instant) {
        let scene = self.clock.at(now);
        match self.ways.recorder.take() {
            None => self.ways.recorder = Some(Recorder::new(self.pose, scene, now)),
            Some(recorder) => {
                let recording = recorder.finish(now);
                self.ways.kept = Some(Kept {
                    track: Arc::new(recording.track()),
                    scene_seconds: Some(recording.scene_seconds()),
                    name: "recorded".to_owned(),
                    unsaved: Some(recording),
                });
            }
        }
    }

    /// Lets the probe go along the trajectory from its beginning, or stops it where it is. A replay
    /// that goes by the scene's time sets it to that at which the recording began.
    pub fn replay(&mut self, now: Instant) {
        if self.ways.replay.is_some() {
            self.stop(now);
            return self.touch(now);
        }
        let Some(kept) = &self.ways.kept else { return };
        let start = self.animated && self.ways.with_scene;
        let start = start.then(|| kept.scene_seconds.unwrap_or_else(|| self.clock.at(now)));
        if let Some(seconds) = start {
            self.clock.seek(seconds, now);
            self.clock.play(true, now);
        }
        let (track, looped) = (kept.track.clone(), self.ways.looped);
        let mut replay = Replay::new(track, &self.home, start, looped, now);
        replay.hold(self.frozen, now);
        self.ways.replay = Some(replay);
        self.devices.take(Source::Replay);
        self.follow(now);
        self.touch(now);
    }

    /// Puts the probe where a trajectory begins; [`Self::begin_replay`] lets it go.
    pub fn await_replay(&mut self, kept: Kept, now: Instant) {
        self.ways.kept = Some(kept);
        self.replay(now);
        if let Some(replay) = &mut self.ways.replay {
            replay.hold(true, now);
        }
    }

    /// There is a picture to look at: a replay that waits for it goes on.
    pub fn begin_replay(&mut self, now: Instant) {
        if let Some(replay) = &mut self.ways.replay
            && !self.frozen
        {
            replay.hold(false, now);
            self.touch(now);
        }
    }

    /// Another device has taken the probe: it starts from where the replay has brought it.
    /// Whether there was a replay.
    pub(super) fn stop(&mut self, now: Instant) -> bool {
        self.follow(now);
        self.ways.replay.take().is_some()
    }

    /// Takes over where a replay has brought the probe. The simulation knows by itself.
    pub fn follow(&mut self, now: Instant) {
        if let Some(replay) = &self.ways.replay {
            self.pose = replay.pose(&self.clock, now);
            let is_over = replay.is_over(&self.clock, now);
            self.write("replay", self.pose, now);
            if is_over {
                self.ways.replay = None;
            }
        }
    }

    /// Notes in the recording, if there is one, where `device` has moved the probe.
    pub(super) fn write(&mut self, device: &str, pose: DAffine3, now: Instant) {
        if let Some(recorder) = &mut self.ways.recorder {
            recorder.note(device, pose, now);
            if recorder.is_full() {
                self.record(now);
            }
        }
    }
}

#[cfg(test)]
mod tests;
