//! Transducer and its geometry.

use egui::{ComboBox, Ui};

use super::controls::{angle, count, grid, number, number_or};
use crate::probe::{Kind, Probe};
use crate::view::model::Settings;

pub(super) fn show(ui: &mut Ui, settings: &mut Settings) {
    let frequency = settings.probe.frequency;
    grid(ui, "probe", |ui| {
        presets(ui, settings);
        let p = &mut settings.probe;
        number(ui, "probe.depth", "Depth", &mut p.depth, 20.0..=300.0);
        number(ui, "probe.frequency", "Frequency", &mut p.frequency, 1.0..=15.0);
        number(ui, "probe.focus", "Focus", &mut p.focus, 5.0..=200.0);
        match &mut p.kind {
            Kind::Convex { radius, field_of_view } => {
                number(ui, "probe.radius", "Radius", radius, 5.0..=80.0);
                angle(ui, "probe.field_of_view", "Field of view", field_of_view, 180.0);
            }
            Kind::Phased { field_of_view } => {
                angle(ui, "probe.field_of_view", "Field of view", field_of_view, 120.0);
            }
            Kind::Linear { width } => number(ui, "probe.width", "Width", width, 10.0..=80.0),
        }
    });
    ui.collapsing("Beam", |ui| grid(ui, "beam", |ui| beam(ui, &mut settings.probe)));
    settings.follow_frequency(frequency);
}

fn presets(ui: &mut Ui, settings: &mut Settings) {
    let found = Probe::PRESETS.iter().find(|(_, make)| make() == settings.probe);
    ui.label("Preset").on_hover_text(&crate::view::catalogue::entry("probe.preset").meaning);
    ComboBox::from_id_salt("preset")
        .selected_text(found.map_or("changed", |(name, _)| name))
        .show_ui(ui, |ui| {
            for (name, make) in Probe::PRESETS {
                let is_it = found.is_some_and(|f| f.0 == name);
                if ui.selectable_label(is_it, name).clicked() {
                    settings.probe = make();
                }
            }
        });
    ui.end_row();
}

fn beam(ui: &mut Ui, p: &mut Probe) {
    count(ui, "probe.scanlines", "Scanlines", &mut p.scanlines, 32..=512);
    let layers = &mut p.elevation_layers;
    count(ui, "probe.elevation_layers", "Layers", layers, 1..=15);
    count(ui, "probe.samples", "Samples", &mut p.samples, 256..=8192);
    number(ui, "probe.bandwidth", "Bandwidth", &mut p.bandwidth, 0.1..=1.2);
    number(ui, "probe.speed", "Speed", &mut p.speed, 1.4..=1.7);
    let transmit = &mut p.f_number_transmit;
    number(ui, "probe.f_number_transmit", "F transmit", transmit, 1.0..=8.0);
    let receive = &mut p.f_number_receive;
    number(ui, "probe.f_number_receive", "F receive", receive, 1.0..=8.0);
    let unlimited = (f64::INFINITY, "unlimited");
    let aperture = &mut p.aperture;
    number_or(ui, "probe.aperture", "Aperture", aperture, 5.0..=60.0, unlimited);
    let focus = &mut p.elevation_focus;
    number(ui, "probe.elevation_focus", "Lens focus", focus, 5.0..=200.0);
    let height = &mut p.elevation_height;
    number(ui, "probe.elevation_height", "Height", height, 1.0..=20.0);
    let slice = &mut p.slice_thickness;
    number(ui, "probe.slice_thickness", "Slice", slice, 0.0..=20.0);
}
