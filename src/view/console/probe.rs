//! The section for the transducer and its geometry.

use egui::{ComboBox, Ui};

use super::controls::{grid, group};
use crate::settings::{Group, Probe};
use crate::view::model::Settings;

pub(super) fn show(ui: &mut Ui, settings: &mut Settings) {
    let frequency = settings.probe.frequency;
    grid(ui, "preset", |ui| presets(ui, &mut settings.probe));
    group(ui, Probe::TABLE, &mut settings.probe);
    settings.follow_frequency(frequency);
}

fn presets(ui: &mut Ui, probe: &mut Probe) {
    let found = Probe::PRESETS.iter().find(|(_, make)| make() == *probe);
    ui.label("Preset").on_hover_text("Sets everything below");
    ComboBox::from_id_salt("preset")
        .selected_text(found.map_or("changed", |(name, _)| name))
        .show_ui(ui, |ui| {
            for (name, make) in Probe::PRESETS {
                let is_it = found.is_some_and(|f| f.0 == name);
                if ui.selectable_label(is_it, name).clicked() {
                    *probe = make();
                }
            }
        });
    ui.end_row();
}
