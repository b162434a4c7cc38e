//! The section for path tracing and scatterers.

use egui::{ComboBox, Ui};

use super::controls::{grid, group};
use crate::model::Settings;
use crate::panel::DeviceFacts;
use crate::settings::{Group, Live, Quality, Simulation};
use crate::sim::Tracer;

pub(super) fn show(ui: &mut Ui, settings: &mut Settings, device: &DeviceFacts, lattice: f64) {
    ui.horizontal(|ui| {
        ui.label("Quality").on_hover_text("Path and scatterer counts that suit the device");
        for (name, quality) in [
            ("draft", Quality::Draft),
            ("standard", Quality::Standard),
            ("reference", Quality::Reference),
        ] {
            if ui.button(name).clicked() {
                settings.simulation.cell = lattice / settings.probe.frequency;
                settings.simulation.cell /= settings.simulation.crowding();
                settings.simulation.set_quality(quality, device.machine);
            }
        }
    });
    grid(ui, "tracer", |ui| tracer(ui, &mut settings.tracer, device.ray_query));
    group(ui, Live::TABLE, &mut settings.live);
    let before = settings.simulation.density_scale;
    group(ui, Simulation::TABLE, &mut settings.simulation);
    let density = settings.simulation.density_scale;
    if density != before {
        settings.simulation.density_scale = before;
        settings.set_density_scale(density);
    }
}

fn tracer(ui: &mut Ui, chosen: &mut Tracer, ray_query: bool) {
    ui.label("Tracer").on_hover_text("How rays find surfaces; the pictures agree");
    ComboBox::from_id_salt("tracer").selected_text(chosen.to_string()).show_ui(ui, |ui| {
        for tracer in [Tracer::RayQuery, Tracer::Bvh] {
            let possible = tracer == Tracer::Bvh || ray_query;
            ui.add_enabled_ui(possible, |ui| {
                ui.selectable_value(chosen, tracer, tracer.to_string());
            });
        }
    });
    ui.end_row();
}
