//! The state of the window itself: open panels and choices; not saved.

use super::console;
use super::deaths::Deaths;
use super::files::Files;
use super::inputs::Inputs;
use super::keeper::{Keeper, Orphan};
use super::leaving::Leaving;
use super::mmode;
use super::naming;
use super::timing;
use super::tools::Tools;
use crate::settings::Machine;

/// State of the window itself.
pub(super) struct State {
    /// True while the console is open.
    pub(super) console: bool,
    /// The part of the image that is seen.
    pub(super) framing: super::framing::Framing,
    /// An image that is held beside the one that goes on.
    pub(super) dual: super::dual::Dual,
    /// True while the timing panel is open.
    pub(super) timing: bool,
    /// The 3D view.
    pub(super) view3d: super::view3d::State,
    /// What the 3D view has of the room that it shares with the image.
    pub(super) share: f32,
    /// Planes through the acquired volume, in place of the 3D view.
    pub(super) planes: super::planes::State,
    /// The shown page of the timing panel.
    pub(super) times: timing::Page,
    /// True while the list of keys is open.
    pub(super) help: bool,
    /// Pictures of the scenes that ship.
    pub(super) gallery: super::gallery::Gallery,
    /// The worksheet of the examination.
    pub(super) exam: super::exam::Examination,
    /// Tasks of the scene.
    pub(super) lesson: super::lesson::Lesson,
    /// The M-mode panel.
    pub(super) mmode: mmode::Panel,
    /// Names of poses that are being typed.
    pub(super) poses: console::Naming,
    /// Tissue under inspection: index into the scene's.
    pub(super) tissue: usize,
    /// Mesh under inspection: index into the scene's instances.
    pub(super) mesh: usize,
    /// Facts about the machine that the simulation runs on.
    pub(super) machine: Machine,
    /// True where the device has ray queries.
    pub(super) ray_query: bool,
    /// Size of the device's largest heap of its own, bytes.
    pub(super) heap: u64,
    /// Name and driver of the device.
    pub(super) device: String,
    /// Saving, loading, opening.
    pub(super) files: Files,
    /// The last error, until the next success.
    pub(super) problem: Option<String>,
    /// Threads that died by a bug.
    pub(super) deaths: Deaths,
    /// The simulation's thread is dead, and not started again.
    pub(super) stopped: bool,
    /// True where the simulation is to be started again.
    pub(super) restart: bool,
    /// The work being done before the first picture.
    pub(super) preparing: &'static str,
    /// Loop, measurements, texts.
    pub(super) tools: Tools,
    /// The devices that move the probe.
    pub(super) inputs: Inputs,
    /// A way out on which something unsaved would be lost.
    pub(super) leaving: Option<Leaving>,
    /// Keeps what is unsaved.
    pub(super) keeper: Keeper,
    /// What an earlier session has left unsaved, until the user has decided; and what is to be taken up.
    pub(super) offer: Option<Orphan>,
    pub(super) taken_up: Option<Orphan>,
    /// Where the pointer asks what lies there; the answer; the settings of it that are wanted.
    pub(super) asked: Option<(egui::Pos2, naming::Question)>,
    pub(super) answer: Option<naming::Answer>,
    pub(super) wanted: Option<naming::Wanted>,
    /// The reason why changed files of the scene cannot be used.
    pub(super) stale: Option<String>,
    /// What is suspicious about the scene.
    pub(super) warnings: Vec<String>,
    /// True while these are shown.
    pub(super) warned: bool,
    /// True once the window is to be closed.
    pub(super) quit: bool,
}

impl State {
    /// Returns whether a dialog has the keyboard.
    pub(super) fn has_dialog(&self) -> bool {
        self.leaving.is_some() || self.offer.is_some() || self.files.is_asking()
    }
}
