//! A panel of the window: its row in the list of panels, and what it draws from and changes.
//!
//! A panel has its own state and asks the window for what is not its own, so that none knows of the others.

use std::collections::BTreeSet;
use std::time::Instant;

use egui::{Context, Key, Ui};

use super::exit::Exit;
use super::files::Files;
use super::inputs::Inputs;
use super::look::Pictured;
use super::model::Model;
use super::picture::Frame;
use super::statistics::Times;
use super::tools::Tools;
use super::wake::Wake;
use crate::settings::Machine;

/// Where a panel is drawn.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Dock {
    /// A column at the right edge of the window, so wide, points.
    Right(f32),
    /// A strip below the image, so high, points; if `alone`, it takes the image's place where there is no room for both.
    Below {
        /// Height, points.
        height: f32,
        /// See above.
        alone: bool,
    },
    /// The room that the image shares; of several open panels the last one has it.
    Beside,
    /// A column at the left edge, so wide, points; it takes the shared room where there is too little for both.
    Left(f32),
    /// A window over everything.
    Over,
}

/// The row of a panel in the list: what buttons, keys and the layout know of it.
pub(super) struct Row {
    /// Its name, on its button too; no two are equal.
    pub(super) name: &'static str,
    /// What it shows, in a few words.
    pub(super) tip: &'static str,
    /// Its key, with the key's name.
    pub(super) key: Option<(Key, &'static str)>,
    /// Where it is drawn.
    pub(super) dock: Dock,
    /// True where the bar below the image has a button for it.
    pub(super) has_button: bool,
}

impl Row {
    /// The tip of its button: what it shows, and its key.
    pub(super) fn hint(&self) -> String {
        match self.key {
            Some((_, key)) => format!("{} ({key})", self.tip),
            None => self.tip.to_owned(),
        }
    }
}

/// A panel.
pub(super) trait Panel {
    /// Its row.
    fn row(&self) -> &'static Row;

    /// Returns whether this scene has something for it.
    fn is_offered(&self, _model: &Model) -> bool {
        true
    }

    /// Returns whether it is drawn.
    fn is_open(&self, model: &Model, open: &OpenPanels) -> bool {
        open.has(self.row()) && self.is_offered(model)
    }

    /// Opens it, or closes it.
    fn toggle(&self, _model: &mut Model, open: &mut OpenPanels, _now: Instant) {
        open.toggle(self.row());
    }

    /// Does what is to be done at every drawing, also while it is closed.
    fn follow(&mut self, _ctx: &Context, _desk: &mut Desk<'_>) {}

    /// Draws it, into its dock; one of [`Dock::Over`] draws a window of its own.
    fn show(&mut self, ui: &mut Ui, desk: &mut Desk<'_>);

    /// Forgets what belongs to the scene, which another one takes the place of.
    fn leave(&mut self) {}

    /// Drops what lies on the device, which is lost.
    fn lose(&mut self) {}
}

/// The open panels.
#[derive(Default)]
pub(super) struct OpenPanels(BTreeSet<&'static str>);

impl OpenPanels {
    /// Returns whether the panel is open.
    pub(super) fn has(&self, panel: &Row) -> bool {
        self.0.contains(panel.name)
    }

    /// Opens the panel or closes it.
    pub(super) fn set(&mut self, panel: &Row, open: bool) {
        match open {
            true => self.0.insert(panel.name),
            false => self.0.remove(panel.name),
        };
    }

    /// Closes the panel if it is open, else opens it.
    pub(super) fn toggle(&mut self, panel: &Row) {
        self.set(panel, !self.has(panel));
    }

    /// Draws a button that opens and closes the panel.
    pub(super) fn button(&mut self, ui: &mut Ui, panel: &Row) {
        let mut open = self.has(panel);
        ui.toggle_value(&mut open, panel.name).on_hover_text(panel.hint());
        self.set(panel, open);
    }
}

/// What panels ask of the window, carried out when all of them are drawn.
pub(super) enum Ask {
    /// A way out of what is there, which may lose unsaved work.
    Leave(Exit),
    /// The recording of the probe's way begins or ends.
    Record,
}

/// Facts about the device that the simulation runs on.
pub(super) struct DeviceFacts {
    /// Name and driver.
    pub(super) name: String,
    /// Its kind.
    pub(super) machine: Machine,
    /// True where it has ray queries.
    pub(super) ray_query: bool,
    /// Size of its largest heap of its own, bytes.
    pub(super) heap: u64,
}

/// What all panels share.
pub(super) struct Common {
    /// The open panels.
    pub(super) open: OpenPanels,
    /// Loop, measurements, texts.
    pub(super) tools: Tools,
    /// Saving, loading, opening.
    pub(super) files: Files,
    /// The devices that move the probe.
    pub(super) inputs: Inputs,
    /// The device of the simulation.
    pub(super) device: DeviceFacts,
    /// What is suspicious about the scene.
    pub(super) warnings: Vec<String>,
    /// True while these are shown.
    pub(super) warned: bool,
    /// True where the last click was into a form: letters beside its fields are no keys then.
    pub(super) fills: bool,
    /// Called by threads of panels that have something to show.
    pub(super) wake: Wake,
    /// What is asked of the window.
    pub(super) asks: Vec<Ask>,
}

/// What a drawing of the window shows.
#[derive(Clone, Copy)]
pub(super) struct Seen<'a> {
    /// Times of the last frames.
    pub(super) times: &'a Times,
    /// The image.
    pub(super) frame: Option<&'a Frame>,
    /// The picture of the 3D view.
    pub(super) pictured: Option<&'a Pictured>,
    /// The moment of the last input.
    pub(super) now: Instant,
}

/// What a panel draws from and changes.
pub(super) struct Desk<'a> {
    /// The session.
    pub(super) model: &'a mut Model,
    /// What all panels share.
    pub(super) common: &'a mut Common,
    /// What is shown.
    pub(super) seen: Seen<'a>,
}
