//! The layout of the window.

use std::time::Instant;

use egui::{Align2, CentralPanel, Frame as Space, Panel, RichText, Ui};
use glam::DVec3;

use super::bmode::{self, Place};
use super::body;
use super::console;
use super::engine::Frame;
use super::look::Pictured;
use super::model::Model;
use super::model::mmode::Strip;
use super::state::State;
use super::statistics::Times;
use super::{
    beside, calipers, cine, deaths, dual, ecg, exam, files, gallery, keys, leaving, lesson, mmode,
    naming, notice, offer, planes, saved, strip, style, timing, view3d,
};
use crate::settings::Exam;

/// Width of the toggles and the loop beside each other, points.
const BAR: f32 = 940.0;
/// Width of one toggle more, where there is a volume.
const PLANES: f32 = 62.0;

/// Least height that is left to the image beside a panel of timings, and least width beside the worksheet, points.
const LEAST_IMAGE: f32 = 200.0;

/// Places of the pictures.
#[derive(Default)]
pub(super) struct Places {
    /// The B-mode image.
    pub(super) image: Option<Place>,
    /// The one that is held beside it.
    pub(super) held: Option<Place>,
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
    model.hold_pointer(ui.input(|input| input.pointer.any_down()));
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
    // The worksheet takes the place of the 3D view where there is no room for both.
    let sheet = state.exam.open.then_some(exam::WIDTH).filter(|sheet| {
        let room = ui.available_width();
        let beside = state.view3d.open || state.planes.open;
        let narrow =
            view3d::width(room, state.share).filter(|_| beside).map(|view3d| room - view3d);
        narrow.is_some_and(|left| left < sheet + LEAST_IMAGE)
    });
    // Transparent: the pictures are below the interface.
    let planes = state.planes.open && model.registration.is_some();
    let beside = (state.view3d.open || planes) && sheet.is_none();
    let both = ui.available_rect_before_wrap();
    let room = view3d::width(both.width(), state.share).filter(|_| beside && !alone);
    if let Some(width) = room.filter(|_| planes) {
        let panel = Panel::right("planes").resizable(false).exact_size(width);
        let panel = panel.frame(Space::NONE).show_separator_line(false);
        panel.show(ui, |ui| planes::show(ui, model, &mut state.planes, now));
    }
    let view3d = room.filter(|_| !planes).map(|width| {
        let panel = Panel::right("view3d").resizable(false).exact_size(width);
        let panel = panel.frame(Space::NONE).show_separator_line(false);
        let shown = panel.show(ui, |ui| {
            let place = view3d::show(ui, model, &mut state.view3d, pictured);
            lesson::in_3d(ui, &place, model, &state.lesson, pictured);
            place
        });
        if let Some((at, ray)) = state.view3d.asked.take() {
            state.asked = Some((at, naming::Question::Sight(ray)));
        }
        shown.inner
    });
    if state.exam.open {
        Panel::left("worksheet")
            .resizable(false)
            .exact_size(exam::WIDTH)
            .show(ui, |ui| exam::show(ui, model, state));
    }
    let centre = CentralPanel::default().frame(Space::NONE);
    let (image, held) = centre
        .show(ui, |ui| match alone {
            true => (None, None),
            false => images(ui, model, state, frame, now),
        })
        .inner;
    if let Some(width) = room {
        view3d::divide(ui, both, width, &mut state.share);
    }
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
    notice::warnings(ui.ctx(), state);
    naming::show(ui, model, state);
    deaths::show(ui.ctx(), model, state);
    match state.leaving.is_some() {
        _ if state.offer.is_some() => offer::show(ui.ctx(), state),
        true => leaving::show(ui.ctx(), model, state, now),
        false => files::dialog(ui.ctx(), model, state, now),
    }
    lesson::show(ui.ctx(), model, &mut state.lesson, now);
    gallery::show(ui.ctx(), model, state, now);
    if state.help {
        help(ui.ctx(), &mut state.help);
    }
    Places { image, held, view3d }
}

/// Draws what belongs to the image, and to one that is held beside it; returns their places.
fn images(
    ui: &mut Ui,
    model: &mut Model,
    state: &mut State,
    frame: Option<&Frame>,
    now: Instant,
) -> (Option<Place>, Option<Place>) {
    // A picture to be saved has its marks and nothing that is pressed.
    let bare = state.tools.wants_shot(model, &state.dual);
    let [room, beside] = state.dual.rooms(ui.max_rect());
    let held = state.dual.show(ui, (beside, bare), model, &state.framing);
    let place = match frame {
        Some(frame) => bmode::show(ui, room, (frame, false), model, &state.framing),
        None => {
            bmode::prepare(ui, state.preparing);
            None
        }
    };
    state.tools.cleared = bare;
    let (sheet, listens) = (&mut model.sheet, !state.has_dialog());
    let kind = model.settings.imaging.exam;
    if let (Some(place), Some(frame)) = (&place, frame) {
        calipers::show(ui, sheet, place, frame, (kind, listens, bare));
        let newest = state.tools.cine.newest().map(|newest| newest.seconds);
        ecg::show(ui, place, (frame, newest), model.beat.filter(|_| kind == Exam::Cardiac));
        state.framing.follow(ui, place);
        if let Some(at) = calipers::asked(ui, place) {
            let mm = place.mm(at);
            let point = frame.pose.transform_point3(DVec3::new(mm.x, 0.0, mm.y));
            state.asked = Some((at, naming::Question::Place(point)));
        }
        calipers::table(ui, sheet, kind, frame, bare);
        if !bare {
            let dual = state.dual.is_on();
            let mark = (&mut model.body, kind, dual);
            if strip::show(ui, &mut state.tools, sheet, mark) {
                dual::hold(model, state, now);
            }
        }
        if let Some(mark) = &mut model.body {
            body::show(ui, mark, bare);
        }
    }
    if let (Some(place), Some(frame), Some(strip)) = (&place, frame, &mut model.mmode) {
        mmode::aim(ui, place, frame, strip, model.frozen);
    }
    if let Some(place) = place.as_ref().filter(|_| !bare) {
        beside::show(ui, place, model, now);
    }
    if !bare {
        notice::show(ui, &mut state.inputs);
        notice::recording(ui, model, now);
        saved::show(ui, &mut state.tools);
        notice::stale(ui, state.stale.as_deref());
    }
    (place, held)
}

/// Buttons that open the panels.
fn toggles(ui: &mut Ui, model: &mut Model, state: &mut State, now: Instant) {
    for (open, name, tip) in [
        (&mut state.console, "Console", "Settings (C)"),
        (&mut state.view3d.open, "3D", "Anatomy, probe and fan from outside (V)"),
        (&mut state.timing, "Timings", "Where the time goes (T)"),
        (&mut state.help, "Keys", "What the keyboard does (?)"),
        (&mut state.gallery.open, "Scenes", "Pictures of the scenes that ship, to open one"),
        (&mut state.lesson.open, "Lesson", "Tasks of this scene, with a guide and a score"),
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
