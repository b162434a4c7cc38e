//! The layout of the window.

use std::time::Instant;

use egui::{
    CentralPanel, Frame as Space, Panel as Strip, Rect, RichText, TextStyle, Ui, UiBuilder,
};
use glam::DVec3;

use super::bmode;
use super::model::Model;
use super::model::mmode::Strip as MmodeStrip;
use super::panel::{Ask, Desk, Dock, Panel, Seen};
use super::place::Place;
use super::state::State;
use super::{
    beside, body, calipers, cine, colour, deaths, dual, ecg, files, leaving, mmode, naming, notice,
    offer, saved, spectrum, strip, style, view3d,
};
use crate::settings::Exam;

/// Width of the loop's controls, points.
const LOOP: f32 = 565.0;

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
pub(super) fn show(ui: &mut Ui, model: &mut Model, state: &mut State, seen: Seen<'_>) -> Places {
    model.hold_pointer(ui.input(|input| input.pointer.any_down()));
    let line = model.mmode.as_ref().map(MmodeStrip::line);
    let context = ui.ctx().clone();
    each(model, state, seen, |panel, desk| panel.follow(&context, desk));
    each(model, state, seen, |panel, desk| {
        if let Some(Dock::Right(width)) = open(panel, desk) {
            let strip = Strip::right(panel.row().name).resizable(false).exact_size(width);
            strip.show(ui, |ui| within(ui, |ui| panel.show(ui, desk)));
        }
    });
    bar(ui, model, state, seen.now);
    // Where there is no room for both, the panel takes the image's place.
    let mut alone = false;
    each(model, state, seen, |panel, desk| {
        let Some(Dock::Below { height, alone: takes_all }) = open(panel, desk) else { return };
        if takes_all && ui.available_height() < height + LEAST_IMAGE {
            alone = true;
            return;
        }
        let strip = Strip::bottom(panel.row().name).resizable(false).exact_size(height);
        strip.show(ui, |ui| within(ui, |ui| panel.show(ui, desk)));
    });
    let shared = beside_image(ui, model, state, seen, alone);
    let (image, held) = match alone {
        true => {
            CentralPanel::default().show(ui, |ui| {
                each(model, state, seen, |panel, desk| {
                    if let Some(Dock::Below { alone: true, .. }) = open(panel, desk) {
                        panel.show(ui, desk);
                    }
                });
            });
            (None, None)
        }
        false => {
            let centre = CentralPanel::default().frame(Space::NONE);
            centre.show(ui, |ui| images(ui, model, state, seen)).inner
        }
    };
    if let Some((room, width)) = shared {
        view3d::divide(ui, room, width, &mut state.share);
    }
    if model.mmode.as_ref().map(MmodeStrip::line) != line {
        model.touch(seen.now);
    }
    windows(ui, model, state, seen);
    let view3d = state.panels.view3d.place;
    Places { image, held, view3d }
}

/// Calls `act` with each panel in the order of the list, and what it draws from.
fn each(
    model: &mut Model,
    state: &mut State,
    seen: Seen<'_>,
    mut act: impl FnMut(&mut dyn Panel, &mut Desk<'_>),
) {
    let mut desk = Desk { model, common: &mut state.common, seen };
    for panel in state.panels.all() {
        act(panel, &mut desk);
    }
}

/// The dock of a panel; none while it is closed.
fn open(panel: &dyn Panel, desk: &Desk<'_>) -> Option<Dock> {
    panel.is_open(desk.model, &desk.common.open).then_some(panel.row().dock)
}

/// Draws into the room of a strip, which keeps its size whatever the content wants: the image would move under the hand.
fn within(ui: &mut Ui, content: impl FnOnce(&mut Ui)) {
    let room = ui.available_rect_before_wrap();
    content(&mut ui.new_child(UiBuilder::new().max_rect(room)));
    ui.advance_cursor_after_rect(room);
}

/// Draws the buttons of the panels, and the controls of the loop: one below the other where there is no room beside
/// each other, the buttons in as many rows as they need.
fn bar(ui: &mut Ui, model: &mut Model, state: &mut State, now: Instant) {
    let (room, buttons) = (ui.available_width(), toggled(ui, model, state));
    let rows = if room < LOOP + buttons { 1 + (buttons / room).ceil() as usize } else { 1 };
    let more = ui.spacing().interact_size.y + ui.spacing().item_spacing.y;
    let height = cine::HEIGHT + (rows - 1) as f32 * more;
    let strip = Strip::bottom("bar").resizable(false).exact_size(height);
    strip.show(ui, |ui| {
        within(ui, |ui| match rows {
            1 => drop(ui.horizontal_centered(|ui| {
                toggles(ui, model, state, now);
                ui.separator();
                cine::show(ui, model, &mut state.common.tools, now);
            })),
            _ => {
                ui.add_space(4.0);
                ui.horizontal_wrapped(|ui| toggles(ui, model, state, now));
                ui.horizontal(|ui| cine::show(ui, model, &mut state.common.tools, now));
            }
        });
    });
}

/// Width of the buttons that open the panels, points.
fn toggled(ui: &Ui, model: &Model, state: &mut State) -> f32 {
    let font = TextStyle::Button.resolve(ui.style());
    let beside = 2.0 * ui.spacing().button_padding.x + ui.spacing().item_spacing.x;
    let width = |name: &str| {
        let text = ui.painter().layout_no_wrap(name.to_owned(), font.clone(), style::TEXT);
        text.size().x + beside
    };
    let all = state.panels.all().into_iter();
    all.filter(|panel| has_button(*panel, model)).map(|panel| width(panel.row().name)).sum()
}

fn has_button(panel: &dyn Panel, model: &Model) -> bool {
    panel.row().has_button && panel.is_offered(model)
}

/// Buttons that open the panels.
fn toggles(ui: &mut Ui, model: &mut Model, state: &mut State, now: Instant) {
    for panel in state.panels.all() {
        let row = panel.row();
        if !has_button(panel, model) {
            continue;
        }
        let is_open = panel.is_open(model, &state.common.open);
        let button = ui.selectable_label(is_open, row.name);
        if button.on_hover_text(row.hint()).clicked() {
            panel.toggle(model, &mut state.common.open, now);
        }
    }
}

/// Draws the column at the left, and the panel that shares the room with the image, unless the image is not drawn. Returns
/// that room, and what the panel has of its width.
fn beside_image(
    ui: &mut Ui,
    model: &mut Model,
    state: &mut State,
    seen: Seen<'_>,
    alone: bool,
) -> Option<(Rect, f32)> {
    let (mut last, mut left) = (None, None::<f32>);
    each(model, state, seen, |panel, desk| match open(panel, desk) {
        Some(Dock::Beside) => last = Some(panel.row().name),
        Some(Dock::Left(width)) => left = Some(width),
        _ => {}
    });
    let mut room = ui.available_rect_before_wrap();
    if let Some(left) = left.filter(|left| room.width() - left >= LEAST_IMAGE) {
        room.min.x += left;
    }
    let width = view3d::width(room.width(), state.share).filter(|_| last.is_some());
    // The column takes the shared room where there is too little for both.
    let fits = |width: &f32| left.is_none() || room.width() - width >= LEAST_IMAGE;
    let width = width.filter(fits).filter(|_| !alone);
    if let Some(width) = width {
        // Transparent: the pictures are below the interface.
        let strip = Strip::right("beside").resizable(false).exact_size(width);
        let strip = strip.frame(Space::NONE).show_separator_line(false);
        strip.show(ui, |ui| {
            each(model, state, seen, |panel, desk| {
                if Some(panel.row().name) == last {
                    panel.show(ui, desk);
                }
            });
        });
        let view3d = &mut state.panels.view3d;
        if let Some(place) = &view3d.place {
            state.panels.lesson.in_3d(ui, place, model, seen.pictured);
        }
        if let Some((at, ray)) = view3d.asked.take() {
            state.naming.asked = Some((at, naming::Question::Sight(ray)));
        }
    }
    each(model, state, seen, |panel, desk| {
        if let Some(Dock::Left(width)) = open(panel, desk) {
            let strip = Strip::left(panel.row().name).resizable(false).exact_size(width);
            strip.show(ui, |ui| within(ui, |ui| panel.show(ui, desk)));
        }
    });
    width.map(|width| (room, width))
}

/// Draws what lies over everything: messages, dialogs, panels that are windows; and does what was asked for.
fn windows(ui: &mut Ui, model: &mut Model, state: &mut State, seen: Seen<'_>) {
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
    notice::warnings(ui.ctx(), &mut state.common);
    if let Some(wanted) = naming::show(ui, model, &mut state.naming) {
        state.panels.console.want(wanted, &mut state.common.open);
    }
    deaths::show(ui.ctx(), model, state);
    match state.leaving.is_some() {
        _ if state.offer.is_some() => offer::show(ui.ctx(), state),
        true => leaving::show(ui.ctx(), model, state, seen.now),
        false => {
            let exit = files::dialog(ui.ctx(), model, &mut state.common.files, seen.now);
            state.common.asks.extend(exit.map(Ask::Leave));
        }
    }
    each(model, state, seen, |panel, desk| {
        if open(panel, desk) == Some(Dock::Over) {
            panel.show(ui, desk);
        }
    });
    for ask in std::mem::take(&mut state.common.asks) {
        match ask {
            Ask::Leave(exit) => leaving::leave(exit, model, state, seen.now),
            Ask::Record => leaving::record(model, state, seen.now),
        }
    }
}

/// Draws what belongs to the image, and to one that is held beside it; returns their places.
fn images(
    ui: &mut Ui,
    model: &mut Model,
    state: &mut State,
    seen: Seen<'_>,
) -> (Option<Place>, Option<Place>) {
    let Seen { frame, now, .. } = seen;
    let [room, beside] = state.dual.rooms(ui.max_rect());
    let held = state.dual.show(ui, beside, false, model, &state.framing);
    let place = frame.and_then(|frame| bmode::show(ui, room, frame, false, model, &state.framing));
    let listens = !state.has_dialog() && !state.common.fills;
    let sheet = &mut model.sheet;
    let kind = model.settings.imaging.exam;
    if let (Some(place), Some(frame)) = (&place, frame) {
        calipers::show(ui, sheet, place, frame, kind, listens, false);
        let newest = state.common.tools.cine.newest().map(|newest| newest.seconds);
        ecg::show(ui, place, frame, newest, model.beat.filter(|_| kind == Exam::Cardiac));
        state.framing.follow(ui, place);
        if let Some(at) = calipers::asked(ui, place) {
            let mm = place.mm(at);
            let point = frame.pose.transform_point3(DVec3::new(mm.x, 0.0, mm.y));
            state.naming.asked = Some((at, naming::Question::Place(point)));
        }
        calipers::table(ui, sheet, kind, frame, false);
        let (tools, dual) = (&mut state.common.tools, state.dual.is_on());
        if strip::show(ui, tools, sheet, &mut model.body, kind, dual) {
            dual::hold(model, &mut state.dual, &state.common.tools, now);
        }
        if let Some(mark) = &mut model.body {
            body::show(ui, mark, false);
        }
    }
    if let (Some(place), Some(frame), Some(strip)) = (&place, frame, &mut model.mmode) {
        mmode::aim(ui, place, frame, strip, model.frozen);
    }
    if let Some(place) = &place {
        beside::show(ui, place, model, now);
    }
    if let (Some(place), Some(frame)) = (&place, frame) {
        colour::the_box(ui, place, &frame.probe, model, now);
        spectrum::gate(ui, place, &frame.probe, model, now);
    }
    if let Some(fault) = colour::fault(model) {
        notice::badge(ui, "no colours", "What flows cannot be coloured:", &fault);
    }
    if let Some(fault) = spectrum::fault(model) {
        notice::badge(ui, "no spectra", "Spectra cannot be made:", &fault);
    }
    match &state.common.files.opening {
        Some(scene) => notice::preparing(ui, &format!("Opening {scene}")),
        None if state.prepares => notice::preparing(ui, state.preparing),
        None => {}
    }
    notice::show(ui, &mut state.common.inputs);
    notice::recording(ui, model, now);
    saved::show(ui, &mut state.common.tools);
    notice::stale(ui, state.stale.as_deref());
    (place, held)
}
