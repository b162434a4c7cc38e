//! Trajectories of the probe: recorded, saved, and replayed.
//!
//! A file is a trajectory as scene files and `insonify acquire` read them: time, position and
//! rotation, row by row.

use std::fmt::Write as _;
use std::sync::Arc;
use std::time::{Duration, Instant};

use glam::{DAffine3, DQuat, DVec3};
use serde::{Deserialize, Serialize};

use super::Clock;
use crate::scene::animation::{Channel, Curve, Track, Trs};

/// Time without movement after which the probe counts as having stood still, instead of moving slowly.
const REST: Duration = Duration::from_millis(100);
/// Most rows, as the reader takes them; a tracker of 50 Hz fills them in an hour.
const ROWS: usize = 200_000;

/// The probe's pose at a moment.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Row {
    /// Time since the recording began, s.
    seconds: f64,
    /// World from probe, mm.
    pose: DAffine3,
}

/// A recording under way.
#[derive(Clone, Debug)]
pub struct Recorder {
    began: Instant,
    scene_seconds: f64,
    rows: Vec<Row>,
    /// Devices that moved the probe, each with its first row.
    devices: Vec<(usize, String)>,
}

impl Recorder {
    /// Begins at `pose` (world from probe) when the scene's time is `scene_seconds`.
    pub fn new(pose: DAffine3, scene_seconds: f64, now: Instant) -> Self {
        Self {
            began: now,
            scene_seconds,
            rows: vec![Row { seconds: 0.0, pose }],
            devices: Vec::new(),
        }
    }

    /// Number of rows so far.
    pub fn rows(&self) -> usize {
        self.rows.len()
    }

    /// Length so far, s.
    pub fn seconds(&self, now: Instant) -> f64 {
        now.saturating_duration_since(self.began).as_secs_f64()
    }

    /// Returns whether there is no more room.
    pub fn is_full(&self) -> bool {
        // A movement takes two rows, and the end one.
        self.rows.len() + 3 > ROWS
    }

    /// Notes that `device` has moved the probe to `pose`.
    pub fn note(&mut self, device: &str, pose: DAffine3, now: Instant) {
        if self.is_full() {
            return;
        }
        let last = self.rows[self.rows.len() - 1];
        if pose == last.pose {
            return;
        }
        let seconds = self.seconds(now);
        if self.devices.last().is_none_or(|(_, name)| name != device) {
            self.devices.push((self.rows.len(), device.to_owned()));
        }
        if seconds - last.seconds > REST.as_secs_f64() {
            let seconds = seconds - REST.as_secs_f64() / 2.0;
            self.rows.push(Row { seconds, ..last });
        }
        // Of several events at one moment the last one counts.
        if seconds <= last.seconds && self.rows.len() > 1 {
            self.rows.pop();
        }
        let seconds = seconds.max(self.rows[self.rows.len() - 1].seconds + 1e-6);
        self.rows.push(Row { seconds, pose });
    }

    /// Ends the recording; the probe has stood still since the last row.
    pub fn finish(mut self, now: Instant) -> Recording {
        let last = self.rows[self.rows.len() - 1];
        let seconds = self.seconds(now);
        if seconds > last.seconds {
            self.rows.push(Row { seconds, ..last });
        }
        Recording { scene_seconds: self.scene_seconds, rows: self.rows, devices: self.devices }
    }
}

/// A recorded trajectory of the probe.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Recording {
    scene_seconds: f64,
    rows: Vec<Row>,
    devices: Vec<(usize, String)>,
}

impl Recording {
    /// The text of a trajectory file. Lines that begin with # give what a reader does not need: the
    /// scene's time at the first row, and the device that moved the probe.
    pub fn text(&self) -> String {
        let mut out = format!(
            "# Probe in the world, recorded by insonify.\n# The scene's time at the first row: {} s.\n\
             time_s,x_mm,y_mm,z_mm,qw,qx,qy,qz\n",
            self.scene_seconds
        );
        let mut devices = self.devices.iter().peekable();
        for (index, row) in self.rows.iter().enumerate() {
            while let Some((_, name)) = devices.next_if(|(first, _)| *first <= index) {
                // A name chosen by a client must not end the line.
                let name: String = name.chars().filter(|c| !c.is_control()).collect();
                let _ = writeln!(out, "# {name}");
            }
            let (p, q) = (row.pose.translation, rotation(&row.pose));
            let _ = writeln!(
                out,
                "{},{},{},{},{},{},{},{}",
                row.seconds, p.x, p.y, p.z, q.w, q.x, q.y, q.z
            );
        }
        out
    }

    /// The curve between the rows: straight lines and great circles.
    pub fn track(&self) -> Track {
        let times: Vec<f64> = self.rows.iter().map(|row| row.seconds).collect();
        let positions: Vec<DVec3> = self.rows.iter().map(|r| r.pose.translation).collect();
        let rotations: Vec<DQuat> = self.rows.iter().map(|r| rotation(&r.pose)).collect();
        let linear = Curve::Linear;
        Track {
            translation: Some(
                Channel::new(times.clone(), positions, linear).expect("rows are in order"),
            ),
            rotation: Some(Channel::rotations(times, rotations, linear).expect("unit quaternions")),
            scale: None,
        }
    }

    /// The scene's time at the first row, s.
    pub fn scene_seconds(&self) -> f64 {
        self.scene_seconds
    }
}

fn rotation(pose: &DAffine3) -> DQuat {
    DQuat::from_mat3(&pose.matrix3).normalize()
}

/// A trajectory that the probe follows.
#[derive(Clone, Debug)]
pub struct Replay {
    track: Arc<Track>,
    /// The scene file's pose, of which position or rotation is used where the trajectory has none.
    rest: Trs,
    /// Its first and last time, s.
    span: [f64; 2],
    /// Seconds since its first row, where it follows wall-clock time.
    clock: Clock,
    /// The scene's time at its first row, where it follows the scene's time.
    with_scene: Option<f64>,
    looped: bool,
}

impl Replay {
    /// Begins now. With the scene's time at the first row (s) it follows that time; else the pace of
    /// the file's times. Position or rotation that the trajectory lacks is that of `home`.
    pub fn new(
        track: Arc<Track>,
        home: &DAffine3,
        with_scene: Option<f64>,
        looped: bool,
        now: Instant,
    ) -> Self {
        let (first, last) = track.span().expect("a trajectory has rows");
        let rest =
            Trs { translation: home.translation, rotation: rotation(home), ..Trs::default() };
        Self {
            track,
            rest,
            span: [first, last],
            clock: Clock::new(0.0, true, now),
            with_scene,
            looped,
        }
    }

    /// Time since the first row, s; more than its length once it has ended.
    fn gone(&self, scene: &Clock, now: Instant) -> f64 {
        match self.with_scene {
            Some(start) => scene.at(now) - start,
            None => self.clock.at(now),
        }
    }

    /// Length, s.
    pub fn length(&self) -> f64 {
        self.span[1] - self.span[0]
    }

    /// Present place on the trajectory, s from the first row.
    pub fn position(&self, scene: &Clock, now: Instant) -> f64 {
        let gone = self.gone(scene, now);
        match self.looped && self.length() > 0.0 {
            true => gone.rem_euclid(self.length()),
            false => gone.clamp(0.0, self.length()),
        }
    }

    /// World from probe, mm.
    pub fn pose(&self, scene: &Clock, now: Instant) -> DAffine3 {
        let time = self.span[0] + self.position(scene, now);
        self.track.at(self.rest, time).matrix()
    }

    /// Returns whether it has ended, and the probe stays at its end.
    pub fn is_over(&self, scene: &Clock, now: Instant) -> bool {
        let length = self.length();
        length == 0.0 || !self.looped && self.gone(scene, now) >= length
    }

    /// Returns whether the probe moves by itself after `since`: a trajectory that follows the scene's time
    /// stands still with it.
    pub fn moves(&self, scene: &Clock, since: Instant) -> bool {
        let clock = match self.with_scene {
            Some(_) => scene,
            None => &self.clock,
        };
        clock.runs() && !self.is_over(scene, since)
    }

    /// Makes it stand still as long as it is held.
    pub fn hold(&mut self, held: bool, now: Instant) {
        self.clock.hold(held, now);
    }
}

#[cfg(test)]
mod tests;
