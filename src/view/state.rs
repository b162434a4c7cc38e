//! What of the window is open and chosen; not saved.

use super::deaths::Deaths;
use super::files::Files;
use super::inputs::Inputs;
use super::mmode;
use super::timing;
use super::tools::Tools;
use crate::settings::Machine;

/// State of the window itself.
pub(super) struct State {
    /// The console is open.
    pub(super) console: bool,
    /// The timing panel is open.
    pub(super) timing: bool,
    /// The 3D view.
    pub(super) survey: super::survey::State,
    /// Planes through the acquired volume, in place of the 3D view.
    pub(super) planes: super::planes::State,
    /// What of the timing panel is shown.
    pub(super) times: timing::Page,
    /// The list of keys is open.
    pub(super) help: bool,
    /// The M-mode strip.
    pub(super) mmode: mmode::Panel,
    /// Tissue under inspection: index into the scene's.
    pub(super) tissue: usize,
    /// Mesh under inspection: index into the scene's instances.
    pub(super) mesh: usize,
    /// What the simulation runs on.
    pub(super) machine: Machine,
    /// The device has ray queries.
    pub(super) ray_query: bool,
    /// Size of the device's largest heap of its own, bytes.
    pub(super) heap: u64,
    /// Name and driver of the device.
    pub(super) device: String,
    /// Saving, loading, opening.
    pub(super) files: Files,
    /// What went wrong last, until it goes right again.
    pub(super) problem: Option<String>,
    /// Threads that died by a bug.
    pub(super) deaths: Deaths,
    /// The simulation's thread is dead, and not started again.
    pub(super) stopped: bool,
    /// It is to be started again.
    pub(super) restart: bool,
    /// What is done before there is a picture.
    pub(super) preparing: &'static str,
    /// Loop, measurements, texts.
    pub(super) tools: Tools,
    /// What moves the probe.
    pub(super) inputs: Inputs,
    /// The window is to be closed.
    pub(super) quit: bool,
}
