//! The layout of the window.

use std::time::Instant;

use egui::{Align2, CentralPanel, Frame as Space, Panel, RichText, Ui};

use super::bmode::{self, Place};
use super::console;
use super::engine::Frame;
use super::look::Pictured;
use super::model::Model;
use super::model::mmode::Strip;
use super::state::State;
use super::statistics::Times;
use super::{
    calipers, cine, deaths, files, keys, mmode, notice, planes, saved, strip, style, timing, view3d,
};

/// Width of the toggles and the loop beside each other, points.
const BAR: f32 = 760.0;
/// Width of one toggle more, where there is a volume.
const PLANES: f32 = 62.0;

/// Least height that is left to the image beside a panel of timings, points.
const LEAST_IMAGE: f32 = 200.0;

/// Places of the pictures.
#[derive(Default)]
pub(super) struct Places {
    /// The B-mode image.
    pub(super) image: Option<Place>,
    /// The 3D view.
    pub(super) view3d: Option<view3d::Place>,
}

/// Draws the interface; returns the places of the pictures.
pub(super) fn show(
    ui: &mut Ui,
    model: &mut Model,
    state: &mut State,
    statistics: &Times,
    (frame, pictured): (Option<&Frame>, Option<&Pictured>),
    now: Instant,
) -> Places {
    let line = model.mmode.as_ref().map(Strip::line);
    if state.console {
        Panel::right("console")
            .resizable(false)
            .exact_size(console::WIDTH)
            .show(ui, |ui| console::show(ui, model, state, now));
    }
    // One below the other where there is no room beside each other.
    let more = if model.registration.is_some() { PLANES } else { 0.0 };
    let rows = if ui.available_width() < BAR + more { 2 } else { 1 };
    Panel::bottom("bar").resizable(false).exact_size(cine::HEIGHT * rows as f32).show(ui, |ui| {
        match rows {
            1 => drop(ui.horizontal_centered(|ui| {
                toggles(ui, model, state, now);
                ui.separator();
                cine::show(ui, model, &mut state.tools, now);
            })),
            _ => {
                ui.add_space(6.0);
                ui.horizontal(|ui| toggles(ui, model, state, now));
                ui.horizontal(|ui| cine::show(ui, model, &mut state.tools, now));
            }
        }
    });
    // Where there is no room for both, the panel takes the image's place.
    let alone = state.timing && ui.available_height() < timing::HEIGHT + LEAST_IMAGE;
    if alone {
        CentralPanel::default().show(ui, |ui| timing::show(ui, statistics, frame, model, state));
    } else if state.timing {
        Panel::bottom("timing")
            .resizable(false)
            .exact_size(timing::HEIGHT)
            .show(ui, |ui| timing::show(ui, statistics, frame, model, state));
    }
    if model.mmode.is_some() {
        Panel::bottom("mmode")
            .resizable(false)
            .exact_size(mmode::HEIGHT)
            .show(ui, |ui| mmode::show(ui, model, &mut state.mmode));
    } else {
        state.mmode.close();
    }
    // Transparent: the pictures are below the interface.
    let planes = state.planes.open && model.registration.is_some();
    let beside = state.view3d.open || planes;
    let room = view3d::width(ui.available_width()).filter(|_| beside && !alone);
    if let Some(width) = room.filter(|_| planes) {
        let panel = Panel::right("planes").resizable(false).exact_size(width);
        let panel = panel.frame(Space::NONE).show_separator_line(false);
        panel.show(ui, |ui| planes::show(ui, model, &mut state.planes, now));
    }
    let view3d = room.filter(|_| !planes).map(|width| {
        let panel = Panel::right("view3d").resizable(false).exact_size(width);
        let panel = panel.frame(Space::NONE).show_separator_line(false);
        let shown = panel.show(ui, |ui| view3d::show(ui, model, &mut state.view3d, pictured));
        shown.inner
    });
    let centre = CentralPanel::default().frame(Space::NONE);
    let place = centre.show(ui, |ui| {
        if alone {
            return None;
        }
        let place = bmode::show(ui, frame, model, state.preparing);
        let sheet = &mut state.tools.sheet;
        if let (Some(place), Some(frame)) = (&place, frame) {
            calipers::show(ui, sheet, place, frame);
            calipers::table(ui, sheet, frame);
            strip::show(ui, &mut state.tools);
        }
        if let (Some(place), Some(frame), Some(strip)) = (&place, frame, &mut model.mmode) {
            mmode::aim(ui, place, frame, strip, model.frozen);
        }
        notice::show(ui, &state.inputs);
        saved::show(ui, &mut state.tools);
        place
    });
    if model.mmode.as_ref().map(Strip::line) != line {
        model.touch(now);
    }
    if let Some(problem) = &state.problem {
        let mut open = true;
        style::window("A problem", 64.0).open(&mut open).show(ui.ctx(), |ui| {
            ui.set_max_width(460.0);
            ui.label(RichText::new(problem).color(style::WARN));
        });
        if !open {
            state.problem = None;
        }
    }
    deaths::show(ui.ctx(), model, state);
    files::dialog(ui.ctx(), model, &mut state.files, now);
    if state.help {
        help(ui.ctx(), &mut state.help);
    }
    Places { image: place.inner, view3d }
}

/// Buttons that open the panels.
fn toggles(ui: &mut Ui, model: &mut Model, state: &mut State, now: Instant) {
    for (open, name, tip) in [
        (&mut state.console, "Console", "Settings (C)"),
        (&mut state.view3d.open, "3D", "Anatomy, probe and fan from outside (V)"),
        (&mut state.timing, "Timings", "Where the time goes (T)"),
        (&mut state.help, "Keys", "What the keyboard does (?)"),
    ] {
        ui.toggle_value(open, name).on_hover_text(tip);
    }
    if model.registration.is_some() {
        let tip = "Three planes through the acquired volume, in place of the 3D view (G)";
        ui.toggle_value(&mut state.planes.open, "Planes").on_hover_text(tip);
    }
    let tip = "One scanline against time (M)";
    let strip = ui.selectable_label(model.mmode.is_some(), "M-mode");
    if strip.on_hover_text(tip).clicked() {
        mmode::toggle(model, now);
    }
}

fn help(ctx: &egui::Context, open: &mut bool) {
    egui::Window::new("Keys")
        .anchor(Align2::CENTER_CENTER, [0.0, 0.0])
        .resizable(false)
        .collapsible(false)
        .open(open)
        .show(ctx, |ui| {
            egui::Grid::new("keys").num_columns(2).spacing([16.0, 4.0]).show(ui, |ui| {
                for (key, text) in keys::list() {
                    ui.monospace(key);
                    ui.label(text);
                    ui.end_row();
                }
            });
            ui.small("With Shift the probe moves a quarter of a step.");
        });
}
