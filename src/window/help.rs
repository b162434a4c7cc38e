//! The list of keys.

use egui::{Align2, Key, Ui};

use super::keys;
use super::panel::{Desk, Dock, Panel, Row};

/// Its row in the list of panels.
pub(super) const ROW: Row = Row {
    name: "Keys",
    tip: "What the keyboard does",
    key: Some((Key::Questionmark, "?")),
    dock: Dock::Over,
    has_button: true,
};

/// The list of keys.
#[derive(Default)]
pub(super) struct Help;

impl Panel for Help {
    fn row(&self) -> &'static Row {
        &ROW
    }

    fn show(&mut self, ui: &mut Ui, desk: &mut Desk<'_>) {
        let mut open = true;
        egui::Window::new(ROW.name)
            .anchor(Align2::CENTER_CENTER, [0.0, 0.0])
            .resizable(false)
            .collapsible(false)
            .open(&mut open)
            .show(ui.ctx(), |ui| {
                egui::Grid::new("keys").num_columns(2).spacing([16.0, 4.0]).show(ui, |ui| {
                    for (key, text) in keys::list() {
                        ui.monospace(key);
                        ui.label(text);
                        ui.end_row();
                    }
                });
                ui.small("With Shift the probe moves a quarter of a step.");
            });
        desk.common.open.set(&ROW, open);
    }
}
