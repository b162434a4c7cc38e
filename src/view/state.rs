//! The state of the window itself: open panels and choices; not saved.

use super::deaths::Deaths;
use super::files::Files;
use super::inputs::Inputs;
use super::mmode;
use super::timing;
use super::tools::Tools;
use crate::settings::Machine;

/// State of the window itself.
pub(super) struct State {
    /// True while the console is open.
    pub(super) console: bool,
    /// True while the timing panel is open.
    pub(super) timing: bool,
    /// The 3D view.
    pub(super) view3d: super::view3d::State,
    /// Planes through the acquired volume, in place of the 3D view.
    pub(super) planes: super::planes::State,
    /// The shown page of the timing panel.
    pub(super) times: timing::Page,
    /// True while the list of keys is open.
    pub(super) help: bool,
    /// The M-mode panel.
    pub(super) mmode: mmode::Panel,
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
    /// True once the window is to be closed.
    pub(super) quit: bool,
}
