//! Undo: settings as they were.

use std::time::{Duration, Instant};

use super::Settings;

/// Changes of one thing that follow each other faster are one: the drag of a slider.
const GESTURE: Duration = Duration::from_millis(700);
/// Steps that are kept.
const DEPTH: usize = 100;

/// Settings before each change, and those that were undone.
#[derive(Default)]
pub(super) struct History {
    past: Vec<Settings>,
    future: Vec<Settings>,
    last: Option<Gesture>,
}

/// A change that may go on.
struct Gesture {
    /// What it changes.
    paths: Vec<String>,
    at: Instant,
}

impl History {
    /// Notes what the settings were before a change of what lies at `paths`.
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

    /// What comes next is a change of its own.
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

    /// Steps back and forward that there are.
    pub(super) fn depth(&self) -> [usize; 2] {
        [self.past.len(), self.future.len()]
    }
}
