//! The message about threads that died.

use egui::{Label, RichText, ScrollArea, Ui};

use crate::model::Model;
use crate::state::State;
use crate::style;

/// Width of the text, points: the smallest window has room for it.
const WIDTH: f32 = 460.0;
/// Height of the list, points.
const HEIGHT: f32 = 220.0;

/// Shows which threads have died until the user has taken note.
pub(crate) fn show(ctx: &egui::Context, model: &mut Model, state: &mut State) {
    let deaths = state.deaths.0.lock().clone();
    if deaths.is_empty() {
        return;
    }
    style::window("The program has a bug", 64.0).show(ctx, |ui| {
        ui.set_width(WIDTH);
        ui.horizontal(|ui| buttons(ui, model, state));
        ui.label(
            "Please report it: the copied text names version, device, scene and what was said.",
        );
        ScrollArea::vertical().max_height(HEIGHT).show(ui, |ui| {
            for death in &deaths {
                let text = format!("The thread '{}' died: {}", death.thread, death.message);
                ui.add(Label::new(RichText::new(text).color(style::WARN)).wrap());
                ui.label(death.remedy(state.stopped));
            }
        });
    });
}

fn buttons(ui: &mut Ui, model: &mut Model, state: &mut State) {
    if state.stopped && ui.button("Start again").clicked() {
        state.restart = true;
    }
    if ui.button("Save settings").clicked() {
        state.common.files.save(model);
    }
    if ui.button("Copy report").clicked() {
        ui.ctx().copy_text(state.deaths.report(&state.common.device.name, model));
    }
    // While the simulation stands still the message stays on the screen.
    if !state.stopped && ui.button("Close").clicked() {
        state.deaths.0.lock().clear();
    }
}
