//! Path tracing and scatterers.

use egui::{ComboBox, Ui};

use super::controls::{choice, count, grid, number, number_or, switch};
use crate::scene::settings::{Live, Quality};
use crate::sim::Tracer;
use crate::view::model::Settings;
use crate::view::state::State;

/// What an image may take while something moves, which the scene may leave to the device.
fn budget(ui: &mut Ui, live: &mut Live) {
    let by_device = (0.0, "device's");
    let mut seconds = live.budget.unwrap_or(by_device.0);
    let usual = 0.01..=0.2;
    number_or(ui, "live.budget", "Image in", &mut seconds, usual, by_device);
    live.budget = (seconds != by_device.0).then_some(seconds);
}

pub(super) fn show(ui: &mut Ui, settings: &mut Settings, state: &State, lattice: f64) {
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
                settings.simulation.set_quality(quality, state.machine);
            }
        }
    });
    grid(ui, "simulation", |ui| {
        ui.label("Tracer").on_hover_text("How rays find surfaces; the pictures agree");
        ComboBox::from_id_salt("tracer").selected_text(settings.tracer.to_string()).show_ui(
            ui,
            |ui| {
                for tracer in [Tracer::RayQuery, Tracer::Bvh] {
                    let possible = tracer == Tracer::Bvh || state.ray_query;
                    ui.add_enabled_ui(possible, |ui| {
                        ui.selectable_value(&mut settings.tracer, tracer, tracer.to_string());
                    });
                }
            },
        );
        ui.end_row();
        budget(ui, &mut settings.live);
        let mut density = settings.simulation.density_scale;
        let s = &mut settings.simulation;
        count(ui, "simulation.paths", "Paths", &mut s.paths, 1..=128);
        number(ui, "simulation.speckle_gain", "Speckle", &mut s.speckle_gain, -30.0..=30.0);
        number(ui, "simulation.surface_gain", "Surfaces", &mut s.surface_gain, -30.0..=30.0);
        number(ui, "simulation.density_scale", "Density", &mut density, 0.1..=4.0);
        number(ui, "simulation.roughness_scale", "Roughness", &mut s.roughness_scale, 0.1..=10.0);
        number(ui, "simulation.thickness_scale", "Thickness", &mut s.thickness_scale, 0.0..=5.0);
        if density != settings.simulation.density_scale {
            settings.set_density_scale(density);
        }
        let s = &mut settings.simulation;
        number(ui, "simulation.cell", "Cell", &mut s.cell, 0.05..=1.0);
        number(
            ui,
            "simulation.scatterers_per_resolution_cell",
            "Scatterers",
            &mut s.scatterers_per_resolution_cell,
            0.0..=64.0,
        );
        choice(ui, "simulation.scatter_mode", "Lookup", &mut s.scatter_mode);
        choice(ui, "simulation.texture_space", "Texture in", &mut s.texture_space);
    });
    let s = &mut settings.simulation;
    ui.collapsing("Paths", |ui| {
        grid(ui, "paths", |ui| {
            choice(ui, "simulation.sampling", "Sampling", &mut s.sampling);
            choice(ui, "simulation.sequence", "Sequence", &mut s.sequence);
            choice(ui, "simulation.coherence", "Coherence", &mut s.coherence);
            let most = &mut s.max_interactions;
            count(ui, "simulation.max_interactions", "Interactions", most, 1..=64);
            let most = &mut s.max_reflections;
            count(ui, "simulation.max_reflections", "Reflections", most, 0..=16);
            number(ui, "simulation.min_weight", "Least weight", &mut s.min_weight, 1e-9..=1e-2);
            let floor = &mut s.volume_floor;
            let none = (f64::NEG_INFINITY, "none");
            number_or(ui, "simulation.volume_floor", "Speckle floor", floor, -100.0..=0.0, none);
            let floor = &mut s.branch_floor;
            number_or(ui, "simulation.branch_floor", "Branch floor", floor, -100.0..=0.0, none);
            let rough = &mut s.rough_transmission;
            switch(ui, "simulation.rough_transmission", "Rough refraction", rough);
            switch(ui, "simulation.face_reflection", "Face reflects", &mut s.face_reflection);
            switch(ui, "simulation.beam_footprint", "Footprint", &mut s.beam_footprint);
            let jitter = &mut s.origin_jitter;
            number(ui, "simulation.origin_jitter", "Origin jitter", jitter, 0.0..=2.0);
            let off = (f64::INFINITY, "off");
            let lobe = &mut s.emission_lobe;
            number_or(ui, "simulation.emission_lobe", "Emission lobe", lobe, 1.0..=10_000.0, off);
            let width = &mut s.beam_width;
            number_or(ui, "simulation.beam_width", "Beam width", width, 0.1..=10.0, off);
            count(ui, "simulation.seed", "Seed", &mut s.seed, 0..=1000);
        });
    });
}
