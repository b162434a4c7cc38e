//! Ways out of a session.

use std::path::PathBuf;

/// Something by which unsaved work would be lost.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Way {
    /// The window is closed.
    Quit,
    /// Another scene is opened, or the same from its beginning.
    Open(PathBuf),
    /// Another trajectory is recorded.
    Record,
    /// Another trajectory is read from the console's file.
    LoadTrajectory,
}

/// A way out, and how far it has come.
pub(super) struct Leaving {
    pub(super) way: Way,
    pub(super) stage: Stage,
    /// The reason why something was not saved.
    pub(super) problem: Option<String>,
}

/// How far a way out has come.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Stage {
    /// The question has not been drawn yet.
    Begins,
    /// The question is on the screen.
    Asks,
    /// It is gone: the image can be saved as it is in the window.
    Draws,
    /// What was asked for is being written.
    Writes,
}
