//! Undo: what was before each change of settings, poses, marks and recordings.

use std::time::{Duration, Instant};

use glam::DAffine3;

use super::sheet::Marks;
use super::{KnownPose, Model, Settings, Source, StoredTrajectory, entries};

/// Changes of one thing that follow each other faster count as one: the drag of a slider, a pressed key.
const GESTURE: Duration = Duration::from_millis(700);
/// Number of steps that are kept.
const DEPTH: usize = 100;

/// What was before a change.
pub(super) enum Step {
    /// The settings of the console.
    Settings(Box<Settings>),
    /// World from probe.
    Pose(DAffine3),
    /// The named poses.
    Poses(Vec<KnownPose>),
    /// Measurements and texts.
    Marks(Marks),
    /// The recorded or loaded trajectory.
    Trajectory(Option<StoredTrajectory>),
}

/// What was before each change, and what was undone.
#[derive(Default)]
pub(super) struct History {
    past: Vec<Step>,
    future: Vec<Step>,
    last: Option<Gesture>,
    /// A button of the pointer is down.
    held: bool,
    /// Number of steps so far, those back and forth included.
    steps: u64,
}

/// A change that may go on.
struct Gesture {
    /// What it changes: paths of settings, or a device.
    of: Vec<String>,
    at: Instant,
}

impl History {
    /// Notes what was before a change of all that `of` names; of nothing, the change is a step of its own.
    pub(super) fn push(&mut self, before: Step, of: Vec<String>, now: Instant) {
        self.steps += 1;
        let last = self.last.as_ref().filter(|_| !of.is_empty());
        // On a slow machine the parts of a drag come late.
        let goes_on =
            last.is_some_and(|last| last.of == of && (self.held || now - last.at < GESTURE));
        self.last = Some(Gesture { of, at: now });
        self.future.clear();
        if goes_on && !self.past.is_empty() {
            return;
        }
        self.past.push(before);
        if self.past.len() > DEPTH {
            self.past.remove(0);
        }
    }

    /// Makes the next change a step of its own.
    pub(super) fn end_gesture(&mut self) {
        self.last = None;
    }

    /// Notes whether a button of the pointer is down: what changes meanwhile is one change.
    pub(super) fn hold(&mut self, held: bool) {
        if held && !self.held {
            self.end_gesture();
        }
        self.held = held;
    }

    /// Forgets the steps of the settings: they are those of other anatomy.
    pub(super) fn forget_settings(&mut self) {
        self.last = None;
        for steps in [&mut self.past, &mut self.future] {
            steps.retain(|step| !matches!(step, Step::Settings(_)));
        }
    }
}

impl Model {
    /// Notes that the settings were `before` until now.
    pub fn note(&mut self, before: &Settings, now: Instant) {
        if *before != self.settings {
            self.unite(before);
            self.carry_skin(before);
            let (origins, lattice) = (&self.file.origins, self.file.lattice);
            let changes = entries::changes(before, &self.settings, origins, lattice);
            let paths = changes.into_iter().map(|(path, _)| path).collect();
            self.history.push(Step::Settings(Box::new(before.clone())), paths, now);
            self.touch(now);
        }
    }

    /// Notes that marks were made, moved or removed; not before a drag or a text has ended.
    pub fn note_marks(&mut self, now: Instant) {
        if self.sheet.is_busy() || *self.sheet.all() == self.noted_marks {
            return;
        }
        let marks = self.sheet.all().clone();
        // Keys move a point by a pixel at a time.
        let counts = |marks: &Marks| [marks.shown.len(), marks.kept.len()];
        let moved = counts(&marks) == counts(&self.noted_marks);
        let of = moved.then(|| "marks".to_owned()).into_iter().collect();
        let before = std::mem::replace(&mut self.noted_marks, marks);
        self.history.push(Step::Marks(before), of, now);
    }

    /// Notes that `source` is about to move the probe.
    pub(super) fn note_pose(&mut self, source: Source, now: Instant) {
        let of = vec![format!("pose by {}", source.name())];
        self.history.push(Step::Pose(self.pose), of, now);
    }

    /// Takes another trajectory; the one before comes back by undo.
    pub fn keep_trajectory(&mut self, stored: StoredTrajectory, now: Instant) {
        let before = self.trajectory.stored.replace(stored);
        self.history.push(Step::Trajectory(before), Vec::new(), now);
    }

    /// Notes whether a button of the pointer is down: what it drags is one change, however long that takes.
    pub fn hold_pointer(&mut self, held: bool) {
        self.history.hold(held);
    }

    /// Goes back by one change, if there is one. In an examination the probe does not go back: it may have been where it is to go.
    pub fn undo(&mut self, now: Instant) {
        let examined = self.examined;
        if let Some(step) = self.history.past.pop_if(|step| may_go(examined, step)) {
            let undone = self.put(step, now);
            self.history.future.push(undone);
        }
    }

    /// Goes forward again.
    pub fn redo(&mut self, now: Instant) {
        let examined = self.examined;
        if let Some(step) = self.history.future.pop_if(|step| may_go(examined, step)) {
            let before = self.put(step, now);
            self.history.past.push(before);
        }
    }

    /// Number that grows with every step, those back and forth included.
    pub fn steps(&self) -> u64 {
        self.history.steps
    }

    /// Returns whether there is something to undo, and to redo.
    pub fn undoable(&self) -> [bool; 2] {
        [!self.history.past.is_empty(), !self.history.future.is_empty()]
    }

    /// Puts what a step holds in the place of what there is, which is returned.
    fn put(&mut self, step: Step, now: Instant) -> Step {
        self.history.steps += 1;
        self.history.end_gesture();
        match step {
            Step::Settings(settings) => {
                let before = std::mem::replace(&mut self.settings, *settings);
                self.carry_skin(&before);
                self.touch(now);
                Step::Settings(Box::new(before))
            }
            Step::Pose(pose) => {
                self.stop(now);
                let before = self.pose;
                // A tracker that lies still does not take the probe back.
                self.devices.take(Source::Keyboard);
                self.settle("undo", pose, now);
                Step::Pose(before)
            }
            Step::Poses(poses) => Step::Poses(std::mem::replace(&mut self.poses, poses)),
            Step::Marks(marks) => {
                self.noted_marks.clone_from(&marks);
                Step::Marks(self.sheet.put(marks))
            }
            Step::Trajectory(stored) => {
                self.stop(now);
                self.touch(now);
                Step::Trajectory(std::mem::replace(&mut self.trajectory.stored, stored))
            }
        }
    }
}
/// Returns whether a step may be taken back, or again.
fn may_go(examined: bool, step: &Step) -> bool {
    !(examined && matches!(step, Step::Pose(_)))
}
