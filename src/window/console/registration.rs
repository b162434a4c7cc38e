//! The section for the registration of the acquired volume with the model, by numbers.

use egui::{DragValue, Ui};
use glam::{DAffine3, DQuat, DVec3};

use super::controls::{explained, grid, section};
use crate::model::Model;
use crate::model::registration::Moves;
use crate::panel::OpenPanels;
use crate::planes;
use crate::scene::file::SCALES;
use crate::settings::{Display, Group};
use crate::style::button;

pub(super) fn show(ui: &mut Ui, model: &mut Model, open: &mut OpenPanels) {
    let Some(registration) = &mut model.registration else {
        return;
    };
    ui.horizontal(|ui| {
        open.button(ui, &planes::ROW);
        ui.label("Moves:");
        for (moves, name, tip) in [
            (Moves::Volume, "Volume", "The volume moves; model and probe stay"),
            (Moves::Model, "Model", "All meshes move; volume and probe stay"),
        ] {
            ui.selectable_value(&mut registration.moves, moves, name).on_hover_text(tip);
        }
    });
    let place = registration.place(&model.settings);
    let mut changed = place;
    grid(ui, "registration", |ui| placement(ui, &mut changed));
    if changed != place {
        registration.put(&mut model.settings, changed);
    }
    if button(ui, "Place as in the file", "Volume and model where the scene file has them") {
        let (settings, loaded) = (&mut model.settings, &model.loaded);
        settings.model = loaded.model;
        if let (Some(volume), Some(as_loaded)) = (&mut settings.volume, &loaded.volume) {
            volume.world_from_lps = as_loaded.world_from_lps;
        }
    }
    if let Some(display) = &mut model.settings.volume {
        levels(ui, display);
    }
    masks(ui, model);
}

/// Draws shift, rotation and scale.
fn placement(ui: &mut Ui, place: &mut DAffine3) {
    let (scale, rotation, mut shift) = place.to_scale_rotation_translation();
    let mut factor = scale.x;
    let (axis, angle) = rotation.to_axis_angle();
    let mut turn = (axis * angle).to_array().map(f64::to_degrees);
    let mut any = false;
    let mut row = |label: &str, what: &str, parts: &mut [f64], speed: f64, range: [f64; 2]| {
        ui.label(label).on_hover_text(what);
        ui.horizontal(|ui| {
            for part in parts {
                let value = DragValue::new(part).speed(speed).max_decimals(4);
                let value = value.range(range[0]..=range[1]);
                any |= ui.add(value).on_hover_text(what).changed();
            }
        });
        ui.end_row();
    };
    let all = [f64::NEG_INFINITY, f64::INFINITY];
    row("Shift", "mm, along the axes of the world", shift.as_mut(), 0.1, all);
    let what = "Degrees: a vector along the axis of the rotation, as long as its angle";
    row("Turn", what, &mut turn, 0.1, all);
    row("Scale", "Size factor", std::slice::from_mut(&mut factor), 0.002, SCALES);
    if any {
        let turn = DVec3::from(turn.map(f64::to_radians));
        let rotation = DQuat::from_scaled_axis(turn);
        *place = DAffine3::from_scale_rotation_translation(DVec3::splat(factor), rotation, shift);
    }
}

/// Draws the window of grey levels.
fn levels(ui: &mut Ui, display: &mut Display) {
    let step = (display.white - display.black).abs() / 200.0;
    let before = *display;
    section(ui, Display::TABLE, display, "", &mut |ui, facts, display| {
        let level = if facts.key == "black" { &mut display.black } else { &mut display.white };
        explained(ui.label(facts.label), Display::TABLE, facts);
        explained(ui.add(DragValue::new(level).speed(step)), Display::TABLE, facts);
        ui.end_row();
        true
    });
    if display.black == display.white {
        *display = before;
    }
}

/// Draws the list of masking meshes.
fn masks(ui: &mut Ui, model: &mut Model) {
    let (Some(registration), Some(fusion)) = (&model.registration, &mut model.settings.fusion)
    else {
        return;
    };
    ui.collapsing("Masks", |ui| {
        ui.label("What the checked meshes enclose is simulated.");
        for (index, mesh) in model.meshes.iter().enumerate() {
            let mut chosen = fusion.masks.contains(&index);
            let closed = registration.is_closed(index);
            // A scene without a mask would be no fusion.
            let last = chosen && fusion.masks.len() == 1;
            let response =
                ui.add_enabled(closed && !last, egui::Checkbox::new(&mut chosen, &mesh.name));
            let response = response.on_disabled_hover_text(match closed {
                true => "One mesh has to be a mask",
                false => "Not closed: it has no inside",
            });
            if response.changed() {
                fusion.masks.retain(|&i| i != index);
                if chosen {
                    fusion.masks.push(index);
                    fusion.masks.sort_unstable();
                }
            }
        }
    });
}
