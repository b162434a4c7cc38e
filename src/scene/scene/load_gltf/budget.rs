//! Limits on the work for a small file: its parts may be named any number of times.

use std::path::Path;

use crate::issue::Issue;

/// Most numbers held at a time, 128 MB.
const HELD: usize = 16_000_000;

/// Most numbers read, and vertices and matrices computed; some seconds.
const STEPS: usize = 200_000_000;

/// The remaining budget.
pub(super) struct Budget<'p> {
    path: &'p Path,
    held: usize,
    steps: usize,
}

impl<'p> Budget<'p> {
    pub fn new(path: &'p Path) -> Self {
        Self { path, held: HELD, steps: STEPS }
    }

    /// Takes room for `count` numbers, and time to read them: they may be read for many nodes.
    pub fn hold(&mut self, count: usize) -> Result<(), Issue> {
        self.held = self.held.checked_sub(count).ok_or_else(|| {
            let cause = format!("its animation has more than {HELD} numbers");
            Issue::error(
                self.path,
                count,
                cause,
                "reduce keyframes or morph targets, or split the file",
            )
        })?;
        self.work(count)
    }

    /// Numbers that can still be held, for [`Budget::give_back`].
    pub fn mark(&self) -> usize {
        self.held
    }

    /// Gives back the room taken since the mark.
    pub fn give_back(&mut self, mark: usize) {
        self.held = mark;
    }

    /// Takes time for `count` steps.
    pub fn work(&mut self, count: usize) -> Result<(), Issue> {
        self.steps = self.steps.checked_sub(count).ok_or_else(|| {
            let cause = format!("its animation takes more than {STEPS} steps to evaluate");
            Issue::error(
                self.path,
                count,
                cause,
                "reduce keyframes, morph targets or joints, or split the file",
            )
        })?;
        Ok(())
    }
}
