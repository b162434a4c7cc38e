//! The console: controls for everything that the model exposes, with the units, ranges and meanings
//! of the scene file's keys.

mod anatomy;
mod animation;
mod controls;
mod fusion;
mod image;
mod input;
mod poses;
mod probe;
mod registration;
mod simulation;

pub(super) use poses::Naming;

use std::time::Instant;

use egui::{Align, CollapsingHeader, RichText, ScrollArea, Ui};

use super::files;
use super::model::{Model, Source};
use super::naming::Wanted;
use super::state::State;
use crate::style::{self, button};

/// Width of the console, points.
pub(super) const WIDTH: f32 = 336.0;

/// Draws the console into a side panel.
pub(super) fn show(ui: &mut Ui, model: &mut Model, state: &mut State, now: Instant) {
    actions(ui, model, now);
    files::row(ui, model, &mut state.files);
    if !state.warnings.is_empty() {
        let text = format!("{} warnings", state.warnings.len());
        let tip = "What is suspicious about the scene, as `insonify check` says it";
        let text = RichText::new(text).small().color(style::WARN);
        ui.toggle_value(&mut state.warned, text).on_hover_text(tip);
    }
    ui.separator();
    let before = model.settings.clone();
    ScrollArea::vertical().auto_shrink([false; 2]).show(ui, |ui| {
        section(ui, "Probe", true, |ui| probe::show(ui, &mut model.settings, &mut state.exam.open));
        section(ui, "Image", true, |ui| image::show(ui, &mut model.settings));
        section(ui, "Poses", false, |ui| poses::show(ui, model, &mut state.poses, now));
        let mut animate = |ui: &mut Ui| animation::show(ui, model, now);
        section(ui, "Animation", false, &mut animate);
        section(ui, "Probe input", false, |ui| {
            input::show(ui, model, state, now);
        });
        let (settings, lattice) = (&mut model.settings, model.file.lattice);
        section(ui, "Simulation", false, |ui| simulation::show(ui, settings, state, lattice));
        if settings.fusion.is_some() {
            section(ui, "Fusion", false, |ui| fusion::show(ui, model, now));
        }
        if model.registration.is_some() {
            let planes = &mut state.planes.open;
            section(ui, "Registration", false, |ui| registration::show(ui, model, planes));
        }
        let (settings, loaded) = (&mut model.settings, &model.loaded);
        let mut layer = model.layer;
        let wanted = state.wanted.take();
        let opens = |is: Wanted| (wanted == Some(is)).then_some(true);
        opened(ui, "Tissues", opens(Wanted::Tissue), |ui| {
            anatomy::layer(ui, &mut layer);
            anatomy::tissues(ui, settings, loaded, &mut state.tissue);
        });
        let meshes = &model.meshes;
        opened(ui, "Surfaces", opens(Wanted::Surface), |ui| {
            anatomy::surfaces(ui, settings, loaded, meshes, &mut state.mesh);
        });
        if layer != model.layer {
            model.layer = layer;
            model.touch(now);
        }
    });
    model.note(&before, now);
}

fn section(ui: &mut Ui, name: &str, open: bool, add: impl FnOnce(&mut Ui)) {
    CollapsingHeader::new(RichText::new(name).strong()).default_open(open).show(ui, add);
}

/// A section that `open` opens or closes for the user.
fn opened(ui: &mut Ui, name: &str, open: Option<bool>, add: impl FnOnce(&mut Ui)) {
    let header = CollapsingHeader::new(RichText::new(name).strong()).open(open).show(ui, add);
    if open.is_some() {
        header.header_response.scroll_to_me(Some(Align::TOP));
    }
}

fn actions(ui: &mut Ui, model: &mut Model, now: Instant) {
    ui.horizontal(|ui| {
        let word = if model.frozen { "Live" } else { "Freeze" };
        if button(ui, word, "Stop or start the image and the scene's time (Space)") {
            model.freeze(!model.frozen, now);
        }
        let [back, forward] = model.undoable();
        let undo = ui.add_enabled(back, egui::Button::new("Undo"));
        if undo
            .on_hover_text(
                "Take back the last change of settings, probe, marks or recording (Ctrl+Z)",
            )
            .clicked()
        {
            model.undo(now);
        }
        let redo = ui.add_enabled(forward, egui::Button::new("Redo"));
        if redo.on_hover_text("Make it again (Ctrl+Y)").clicked() {
            model.redo(now);
        }
        if button(ui, "Reset", "Settings as in the scene file; the probe stays where it is") {
            let before = std::mem::replace(&mut model.settings, model.loaded.clone());
            model.note(&before, now);
        }
        if button(ui, "Home", "Put the probe where the scene file has it (Home)") {
            model.place_probe(Source::Pointer, model.home, now);
        }
    });
}
