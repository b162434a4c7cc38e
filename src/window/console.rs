//! The console: controls for everything that the model exposes, with the units, ranges and meanings
//! of the scene file's keys.

mod anatomy;
mod animation;
pub(super) mod controls;
mod fusion;
mod image;
mod input;
mod poses;
mod probe;
mod registration;
mod simulation;

use std::time::Instant;

use egui::{Align, CollapsingHeader, Key, RichText, ScrollArea, Ui};

use super::files;
use super::model::{ELABORATE, Model, Source};
use super::naming::Wanted;
use super::panel::{Desk, Dock, OpenPanels, Panel, Row};
use crate::settings::{self, Doppler, Group, Member, Visitor};
use crate::sim::ColourMode;
use crate::style::{self, button};
use poses::Naming;

/// Its row in the list of panels.
pub(super) const ROW: Row = Row {
    name: "Console",
    tip: "Settings",
    key: Some((Key::C, "C")),
    dock: Dock::Right(336.0),
    has_button: true,
};

/// The console.
#[derive(Default)]
pub(super) struct Console {
    /// Names of poses that are being typed.
    poses: Naming,
    /// Tissue under inspection: index into the scene's.
    tissue: usize,
    /// Mesh under inspection: index into the scene's instances.
    mesh: usize,
    /// The section that is to be opened.
    wanted: Option<Wanted>,
}

impl Console {
    /// Opens the section of a tissue or of a surface.
    pub(super) fn want(&mut self, wanted: Wanted, open: &mut OpenPanels) {
        match wanted {
            Wanted::Tissue(tissue) => self.tissue = tissue,
            Wanted::Surface(mesh) => self.mesh = mesh,
        }
        self.wanted = Some(wanted);
        open.set(&ROW, true);
    }

    /// Another scene, or the same one read again, has other tissues and meshes.
    pub(super) fn forget_indices(&mut self) {
        (self.tissue, self.mesh) = (0, 0);
    }
}

impl Panel for Console {
    fn row(&self) -> &'static Row {
        &ROW
    }

    fn show(&mut self, ui: &mut Ui, desk: &mut Desk<'_>) {
        let now = desk.seen.now;
        actions(ui, desk.model, now);
        files::row(ui, desk.model, &mut desk.common.files);
        if !desk.common.warnings.is_empty() {
            let text = format!("{} warnings", desk.common.warnings.len());
            let tip = "What is suspicious about the scene, as `insonify check` says it";
            let text = RichText::new(text).small().color(style::WARN);
            ui.toggle_value(&mut desk.common.warned, text).on_hover_text(tip);
        }
        ui.separator();
        let before = desk.model.settings.clone();
        ScrollArea::vertical().auto_shrink([false; 2]).show(ui, |ui| self.sections(ui, desk));
        desk.model.note(&before, now);
    }

    fn leave(&mut self) {
        self.poses = Naming::default();
    }
}

impl Console {
    fn sections(&mut self, ui: &mut Ui, desk: &mut Desk<'_>) {
        let now = desk.seen.now;
        section(ui, "Probe", true, |ui| {
            probe::show(ui, &mut desk.model.settings, &mut desk.common.open);
        });
        section(ui, "Image", true, |ui| image::show(ui, &mut desk.model.settings));
        section(ui, "Poses", false, |ui| match desk.model.examined {
            true => drop(ui.label(EXAMINED)),
            false => poses::show(ui, desk.model, &mut self.poses, now),
        });
        let shown = desk.seen.frame.map(|frame| frame.seconds);
        section(ui, "Animation", false, |ui| animation::show(ui, desk.model, shown, now));
        section(ui, "Probe input", false, |ui| input::show(ui, desk));
        let (settings, lattice) = (&mut desk.model.settings, desk.model.file.lattice);
        section(ui, "Simulation", false, |ui| {
            simulation::show(ui, settings, &desk.common.device, lattice);
        });
        let (before, mut colour) = (desk.model.colour, desk.model.colour);
        let settings = &mut desk.model.settings;
        settings::Settings::each(&mut Others {
            ui,
            settings: &mut settings.imaged,
            colour: &mut colour,
        });
        if colour != before {
            desk.model.colour = colour;
            desk.model.touch(now);
        }
        let settings = &desk.model.settings;
        if settings.fusion.is_some() {
            section(ui, "Fusion", false, |ui| fusion::show(ui, desk.model, now));
        }
        if desk.model.registration.is_some() {
            section(ui, "Registration", false, |ui| {
                registration::show(ui, desk.model, &mut desk.common.open);
            });
        }
        match desk.model.examined {
            true => section(ui, "Tissues and surfaces", false, |ui| drop(ui.label(EXAMINED))),
            false => self.anatomy(ui, desk.model, now),
        }
    }

    fn anatomy(&mut self, ui: &mut Ui, model: &mut Model, now: Instant) {
        let (settings, loaded) = (&mut model.settings, &model.loaded);
        let mut layer = model.layer;
        let wanted = self.wanted.take();
        let tissue = matches!(wanted, Some(Wanted::Tissue(_))).then_some(true);
        let surface = matches!(wanted, Some(Wanted::Surface(_))).then_some(true);
        opened(ui, "Tissues", tissue, |ui| {
            anatomy::layer(ui, &mut layer);
            anatomy::tissues(ui, settings, loaded, &mut self.tissue);
        });
        let meshes = &model.meshes;
        opened(ui, "Surfaces", surface, |ui| {
            anatomy::surfaces(ui, settings, loaded, meshes, &mut self.mesh);
        });
        if layer != model.layer {
            model.layer = layer;
            model.touch(now);
        }
    }
}

/// Sections of the groups that are no more than their rows.
struct Others<'s> {
    ui: &'s mut Ui,
    settings: &'s mut settings::Settings,
    /// What the colours of what flows show.
    colour: &'s mut Option<ColourMode>,
}

impl Visitor for Others<'_> {
    fn visit<T: Group>(&mut self, group: Member<T>) {
        if !ELABORATE.contains(&T::TABLE) {
            let (first, rest) = T::TABLE.split_at(1);
            let colour = (T::TABLE == Doppler::TABLE).then_some(&mut *self.colour);
            section(self.ui, &(first.to_uppercase() + &rest.replace('_', " ")), false, |ui| {
                if let Some(colour) = colour {
                    switch(ui, colour);
                }
                controls::group(ui, T::TABLE, (group.of_mut)(self.settings));
            });
        }
    }
}

/// The switch of the colours of what flows.
fn switch(ui: &mut Ui, colour: &mut Option<ColourMode>) {
    ui.horizontal(|ui| {
        ui.label("Colours").on_hover_text("What flows in the colour box (F5)");
        for (choice, name, tip) in [
            (None, "Off", "The image alone"),
            (Some(ColourMode::Color), "Velocity", "How fast it flows, towards the probe and away"),
            (Some(ColourMode::Power), "Power", "How much flows"),
            (
                Some(ColourMode::Tissue),
                "Tissue",
                "How fast tissue moves, towards the probe and away",
            ),
        ] {
            ui.selectable_value(colour, choice, name).on_hover_text(tip);
        }
    });
}

/// Text of sections that would name what is to be found.
const EXAMINED: &str = "Hidden while a task of an examination is under way.";

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
            model.go_home(Source::Pointer, now);
        }
    });
}
