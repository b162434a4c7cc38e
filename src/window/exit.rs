//! Exits: ways out of what is there, by which unsaved work may be lost.

use std::path::PathBuf;

/// Something by which unsaved work would be lost.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Exit {
    /// The window is closed.
    Quit,
    /// Another scene is opened, or the same from its beginning.
    Open(PathBuf),
    /// Another trajectory is recorded.
    Record,
    /// Another trajectory is read from the console's file.
    LoadTrajectory,
}

/// An exit on its way, and how far it has come.
pub(super) struct Leaving {
    pub(super) exit: Exit,
    pub(super) stage: Stage,
    /// The reason why something was not saved.
    pub(super) problem: Option<String>,
}

/// Progress of an exit.
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
