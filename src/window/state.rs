//! The state of the window itself: panels, dialogs, choices; not saved.

use super::deaths::Deaths;
use super::dual::Dual;
use super::exit::Leaving;
use super::framing::Framing;
use super::keeper::{Keeper, Orphan};
use super::naming::Naming;
use super::panel::Common;
use super::panels::Panels;

/// State of the window itself.
pub(super) struct State {
    /// The panels.
    pub(super) panels: Panels,
    /// What they share.
    pub(super) common: Common,
    /// The part of the image that is seen.
    pub(super) framing: Framing,
    /// An image that is held beside the one that goes on.
    pub(super) dual: Dual,
    /// What the panel beside the image has of the room that it shares with the image.
    pub(super) share: f32,
    /// What lies where the pointer asks.
    pub(super) naming: Naming,
    /// The last error, until the next success.
    pub(super) problem: Option<String>,
    /// Threads that died by a bug.
    pub(super) deaths: Deaths,
    /// The simulation's thread is dead, and not started again.
    pub(super) stopped: bool,
    /// True where the simulation is to be started again.
    pub(super) restart: bool,
    /// The work being done before the first picture, or before another one that takes longer than usual.
    pub(super) preparing: &'static str,
    /// True while it is being done.
    pub(super) prepares: bool,
    /// A way out on which something unsaved would be lost.
    pub(super) leaving: Option<Leaving>,
    /// Keeps what is unsaved.
    pub(super) keeper: Keeper,
    /// What an earlier session has left unsaved, until the user has decided.
    pub(super) offer: Option<Orphan>,
    /// What of it is to be taken up.
    pub(super) taken_up: Option<Orphan>,
    /// The reason why changed files of the scene cannot be used.
    pub(super) stale: Option<String>,
    /// True once the window is to be closed.
    pub(super) quit: bool,
}

impl State {
    /// Returns whether a dialog has the keyboard.
    pub(super) fn has_dialog(&self) -> bool {
        self.leaving.is_some() || self.offer.is_some() || self.common.files.is_asking()
    }
}
