//! Undo: earlier settings.

use std::time::{Duration, Instant};

use super::Settings;

/// Changes of one setting that follow each other faster count as one: the drag of a slider.
const GESTURE: Duration = Duration::from_millis(700);
/// Number of steps that are kept.
const DEPTH: usize = 100;

/// Settings before each change, and those undone.
#[derive(Default)]
pub(super) struct History {
    past: Vec<Settings>,
    future: Vec<Settings>,
    last: Option<Gesture>,
}

/// A change that may go on.
struct Gesture {
    /// Paths of the settings that it changes.
    paths: Vec<String>,
    at: Instant,
}

impl History {
    /// Notes the settings before a change of those at `paths`.
    pub(super) fn push(&mut self, before: Settings, paths: Vec<String>, now: Instant) {
        let last = self.last.as_ref();
        let goes_on = last.is_some_and(|last| now - last.at < GESTURE && last.paths == paths);
        self.last = Some(Gesture { paths, at: now });
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

    pub(super) fn undo(&mut self, present: Settings) -> Option<Settings> {
        let before = self.past.pop()?;
        self.future.push(present);
        self.last = None;
        Some(before)
    }

    pub(super) fn redo(&mut self, present: Settings) -> Option<Settings> {
        let after = self.future.pop()?;
        self.past.push(present);
        self.last = None;
        Some(after)
    }

    /// Numbers of steps back and forward.
    pub(super) fn depth(&self) -> [usize; 2] {
        [self.past.len(), self.future.len()]
    }
}
