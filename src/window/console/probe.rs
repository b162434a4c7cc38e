//! The section for the transducer and its geometry.

use egui::{ComboBox, Ui};

use super::controls::{grid, group};
use crate::exam;
use crate::model::Settings;
use crate::panel::OpenPanels;
use crate::settings::{Exam, Group, Probe, Words};

pub(super) fn show(ui: &mut Ui, settings: &mut Settings, open: &mut OpenPanels) {
    let frequency = settings.probe.frequency;
    grid(ui, "preset", |ui| {
        exams(ui, settings, open);
        presets(ui, &mut settings.probe);
    });
    group(ui, Probe::TABLE, &mut settings.probe);
    settings.follow_frequency(frequency);
}

fn exams(ui: &mut Ui, settings: &mut Settings, open: &mut OpenPanels) {
    let tip = "Kind of examination: sets probe, depth, focus, gain, dynamic range and time gain, and chooses the \
               names of measurements. A star: settings have been changed since";
    ui.label("Exam").on_hover_text(tip);
    ui.horizontal(|ui| {
        ComboBox::from_id_salt("exam").selected_text(Exam::title(settings)).show_ui(ui, |ui| {
            for &exam in Exam::ALL {
                if ui.selectable_label(settings.imaging.exam == exam, exam.word()).clicked() {
                    exam.apply(settings);
                }
            }
        });
        open.button(ui, &exam::ROW);
    });
    ui.end_row();
}

fn presets(ui: &mut Ui, probe: &mut Probe) {
    let title = probe.title();
    ui.label("Preset").on_hover_text("Sets everything below");
    ComboBox::from_id_salt("preset").selected_text(title.as_str()).show_ui(ui, |ui| {
        for (name, make) in Probe::PRESETS {
            let is_it = title == name;
            if ui.selectable_label(is_it, name).clicked() {
                *probe = make();
            }
        }
    });
    ui.end_row();
}
