//! Measurements and texts on the image: pointer, drawing, table of results.

use std::f64::consts::TAU;
use std::sync::Arc;

use egui::{
    Align2, Area, Color32, Event, FontId, Grid, Id, Key, Modifiers, Painter, PointerButton, Pos2,
    Rect, RichText, Sense, Shape, Stroke, TextEdit, TextWrapMode, Ui, vec2,
};
use glam::DVec2;

use super::model::calipers::{Caliper, CaliperKind, Reading};
use super::model::sheet::{Mark, Sheet, Tool, What};
use super::picture::Frame;
use super::place::Place;
use super::{notes, style};
use crate::settings::Exam;
use insonify_lab::exam;

/// Distance within which the pointer takes a point, points.
const REACH: f32 = 9.0;
/// Colours of the marks, in turn.
const COLOURS: [Color32; 5] = [
    Color32::from_rgb(255, 214, 84),
    Color32::from_rgb(110, 214, 255),
    Color32::from_rgb(160, 236, 120),
    Color32::from_rgb(255, 150, 190),
    Color32::from_rgb(200, 170, 255),
];

/// The keys that take tools, each for its tool.
pub(super) const KEYS: [(Key, Tool); 5] = [
    (Key::L, Tool::Measure(CaliperKind::Distance)),
    (Key::O, Tool::Measure(CaliperKind::Ellipse)),
    (Key::K, Tool::Measure(CaliperKind::Angle)),
    (Key::J, Tool::Measure(CaliperKind::Trace)),
    (Key::N, Tool::Note),
];

/// The tool that a key takes. The code that follows the pointer asks for it: a click before the key belongs to the tool
/// before, though both may arrive at once.
fn tool(key: Key, modifiers: Modifiers) -> Option<Tool> {
    let of = KEYS.into_iter().find(|(of, _)| *of == key && !modifiers.command);
    of.map(|(_, tool)| tool)
}

/// Handles the pointer's events over the picture, and draws all marks.
/// `exam` has the texts that are offered; `listens`: keys may take tools; `bare`: only what belongs to a saved picture is drawn.
pub(super) fn show(
    ui: &mut Ui,
    sheet: &mut Sheet,
    place: &Place,
    frame: &Frame,
    exam: Exam,
    listens: bool,
    bare: bool,
) {
    let room = place.area.intersect(place.seen().expand(12.0));
    pointer(ui, sheet, place, frame, room, listens);
    let painter = ui.painter_at(place.area);
    for (index, mark) in sheet.marks().iter().enumerate() {
        let strength = if mark.of == frame.moment() { 1.0 } else { 0.45 };
        // A text that is being edited is the editor's.
        if sheet.editing() != Some(index) {
            draw_mark(&painter, place, mark, strength);
        }
    }
    if let Some((mark, point)) = sheet.selected().filter(|_| !bare) {
        let at = to_screen(place, sheet.marks()[mark].points()[point]);
        painter.circle_stroke(at, REACH, Stroke::new(1.0, style::TEXT));
    }
    if !bare {
        draft(&painter, sheet, place);
    }
    notes::editor(ui, sheet, place, exam);
}

/// Draws marks that nobody changes, each with what it measures.
pub(super) fn show_held(ui: &Ui, marks: &[Mark], place: &Place) {
    let painter = ui.painter_at(place.area);
    for mark in marks {
        draw_mark(&painter, place, mark, 1.0);
        if let What::Caliper(caliper) = &mark.what {
            let end = to_screen(place, caliper.points[caliper.points.len() - 1]);
            let mut words = reading(&caliper.reading());
            if !caliper.label.is_empty() {
                words.insert(0, caliper.label.clone());
            }
            label(&painter, end + vec2(14.0, -10.0), &words.join("  "), colour(mark.letter));
        }
    }
}

/// Draws a mark, fainter below a `strength` of 1.
fn draw_mark(painter: &Painter, place: &Place, mark: &Mark, strength: f32) {
    let colour = colour(mark.letter).gamma_multiply(strength);
    match &mark.what {
        What::Caliper(caliper) => {
            draw(painter, place, caliper, colour);
            let at = to_screen(place, caliper.points[0]) + vec2(-7.0, -7.0);
            letter(painter, at, mark.letter, colour);
        }
        What::Note(note) => notes::write(painter, place, note, colour),
    }
}

/// Where a right click on the image asks what lies there.
pub(super) fn asked(ui: &Ui, place: &Place) -> Option<Pos2> {
    let response = ui.ctx().read_response(Id::new("image"))?;
    let at = response.interact_pointer_pos().filter(|_| response.secondary_clicked());
    at.filter(|at| place.seen().contains(*at))
}

/// Colour of a mark by its letter.
fn colour(letter: char) -> Color32 {
    COLOURS[(u32::from(letter) - u32::from('A')) as usize % COLOURS.len()]
}

pub(super) fn to_screen(place: &Place, point: DVec2) -> Pos2 {
    place.at(point.x, point.y)
}

/// Handles every event by itself: several may have come since the window was last drawn.
fn pointer(
    ui: &mut Ui,
    sheet: &mut Sheet,
    place: &Place,
    frame: &Frame,
    room: Rect,
    listens: bool,
) {
    let response = ui.interact(room, Id::new("image"), Sense::click_and_drag());
    let reach = f64::from(REACH) * place.mm_per_point();
    let over = response.hovered() || response.is_pointer_button_down_on();
    let events = ui.input(|input| input.events.clone());
    let listens = listens && !ui.ctx().egui_wants_keyboard_input();
    for event in events {
        match event {
            Event::Key { key, pressed: true, modifiers, .. } if listens => {
                if let Some(tool) = tool(key, modifiers) {
                    sheet.toggle(tool);
                }
            }
            Event::PointerMoved(at) => sheet.motion(place.mm(at)),
            Event::PointerButton { pos, button: PointerButton::Primary, pressed, .. } => {
                match pressed {
                    true if over && room.contains(pos) => {
                        let at = place.mm(pos);
                        match note_at(ui, sheet, place, pos) {
                            Some(mark)
                                if sheet.near(at, reach).is_none() && !sheet.is_drawing() =>
                            {
                                sheet.hold((mark, 0), at);
                            }
                            _ => sheet.press(at, reach, frame.moment()),
                        }
                    }
                    true => {}
                    false => sheet.release(place.mm(pos), reach),
                }
            }
            _ => {}
        }
    }
    if response.double_clicked()
        && let Some((mark, 0)) = sheet.selected()
        && matches!(sheet.marks()[mark].what, What::Note(_))
    {
        sheet.edit(mark);
    }
    if let (true, Some(at)) = (over, ui.input(|input| input.pointer.hover_pos())) {
        let cursor = match (sheet.near(place.mm(at), reach), sheet.tool()) {
            (Some(_), _) => egui::CursorIcon::Move,
            (None, Some(Tool::Measure(_))) => egui::CursorIcon::Crosshair,
            (None, Some(Tool::Note)) => egui::CursorIcon::Text,
            (None, None) => return,
        };
        ui.set_cursor_icon(cursor);
    }
}

/// Index of the note whose text is at a screen position.
fn note_at(ui: &Ui, sheet: &Sheet, place: &Place, at: Pos2) -> Option<usize> {
    let is_meant = |what: &What| match what {
        What::Note(note) => {
            let galley = laid_out(ui.painter(), &note.text, Color32::WHITE);
            let left = to_screen(place, note.at);
            Align2::LEFT_CENTER.anchor_size(left, galley.size()).expand(4.0).contains(at)
        }
        What::Caliper(_) => false,
    };
    sheet.marks().iter().rposition(|mark| is_meant(&mark.what))
}

/// Draws the unfinished mark, with its measurement so far beside the pointer.
fn draft(painter: &Painter, sheet: &Sheet, place: &Place) {
    let Some(draft) = sheet.draft() else { return };
    let points: Vec<Pos2> = draft.points.iter().map(|&p| to_screen(place, p)).collect();
    let end = points[points.len() - 1];
    let colour = style::TEXT;
    match draft.tool {
        Tool::Measure(kind)
            if kind.points().map_or(draft.points.len() > 2, |all| draft.points.len() == all) =>
        {
            let caliper = Caliper::new(kind, draft.points);
            draw(painter, place, &caliper, colour);
            let text = reading(&caliper.reading()).join("  ");
            label(painter, end + vec2(14.0, -10.0), &text, colour);
        }
        Tool::Measure(_) => {
            points.iter().for_each(|&p| cross(painter, p, colour));
            dots(painter, &points, colour);
        }
        Tool::Note if points[0] != end => notes::arrow(painter, end, points[0], colour),
        Tool::Note => {}
    }
}

fn draw(painter: &Painter, place: &Place, caliper: &Caliper, colour: Color32) {
    let points: Vec<Pos2> = caliper.points.iter().map(|&p| to_screen(place, p)).collect();
    match caliper.kind {
        CaliperKind::Trace => {
            let outline: Vec<Pos2> = points.iter().chain(&points[..1]).copied().collect();
            dots(painter, &outline, colour);
            // A cross at each of hundreds of points would hide what is traced.
            for end in [points[0], points[points.len() - 1]] {
                cross(painter, end, colour);
            }
            return;
        }
        CaliperKind::Distance | CaliperKind::Angle => dots(painter, &points, colour),
        CaliperKind::Ellipse => {
            dots(painter, &points[..2], colour.gamma_multiply(0.5));
            const SIDES: u32 = 72;
            let at = |i| to_screen(place, caliper.outline(TAU * f64::from(i) / f64::from(SIDES)));
            let outline: Vec<Pos2> = (0..=SIDES).map(at).collect();
            dots(painter, &outline, colour);
        }
    }
    points.iter().for_each(|&p| cross(painter, p, colour));
}

/// Draws a dotted line, which hides little of what is measured.
pub(super) fn dots(painter: &Painter, points: &[Pos2], colour: Color32) {
    painter.extend(Shape::dotted_line(points, colour, 5.0, 0.9));
}

/// Draws a cross, open in the middle so that the point itself is seen.
pub(super) fn cross(painter: &Painter, at: Pos2, colour: Color32) {
    for (arm, width, tint) in [(7.0, 3.0, Color32::from_black_alpha(150)), (6.0, 1.4, colour)] {
        let line = Stroke::new(width, tint);
        for way in [vec2(1.0, 0.0), vec2(-1.0, 0.0), vec2(0.0, 1.0), vec2(0.0, -1.0)] {
            painter.line_segment([at + 2.0 * way, at + arm * way], line);
        }
    }
}

fn letter(painter: &Painter, at: Pos2, letter: char, colour: Color32) {
    let font = FontId::proportional(12.0);
    let shadow = Color32::from_black_alpha(200);
    painter.text(at + vec2(1.0, 1.0), Align2::RIGHT_BOTTOM, letter, font.clone(), shadow);
    painter.text(at, Align2::RIGHT_BOTTOM, letter, font, colour);
}

fn laid_out(painter: &Painter, text: &str, colour: Color32) -> Arc<egui::Galley> {
    painter.layout_no_wrap(text.to_owned(), FontId::proportional(13.0), colour)
}

/// Draws a text on a dark ground.
pub(super) fn label(painter: &Painter, at: Pos2, text: &str, colour: Color32) {
    let galley = laid_out(painter, text, colour);
    let room = Align2::LEFT_CENTER.anchor_size(at, galley.size());
    painter.rect_filled(room.expand2(vec2(4.0, 1.0)), 2.0, Color32::from_black_alpha(170));
    painter.galley(room.min, galley, colour);
}

/// The texts of a measurement, one per row.
pub(super) fn reading(reading: &Reading) -> Vec<String> {
    match reading {
        Reading::Distance(mm) => vec![format!("{mm:.1} mm")],
        Reading::Ellipse { axes: [a, b], circumference, area } => vec![
            format!("{a:.1} x {b:.1} mm"),
            format!("C {circumference:.1} mm"),
            format!("A {:.2} cm²", area / 100.0),
        ],
        Reading::Angle(degrees) => vec![format!("{degrees:.1}°")],
        Reading::Trace { circumference, area } => {
            vec![format!("C {circumference:.1} mm"), format!("A {:.2} cm²", area / 100.0)]
        }
    }
}

/// Draws the table of measurements, at first beside the grey bar, where a sector leaves room; `bare`: without its buttons.
pub(super) fn table(ui: &Ui, sheet: &mut Sheet, exam: Exam, frame: &Frame, bare: bool) {
    let is_measured = |what: &What| matches!(what, What::Caliper(_));
    if !sheet.marks().iter().any(|mark| is_measured(&mark.what)) {
        return;
    }
    // In a saved picture it has a column of its own.
    let corner = ui.max_rect().left_top() + if bare { vec2(8.0, 12.0) } else { vec2(46.0, 64.0) };
    let mut removed = None;
    // On the screen it can be dragged aside, from the time-gain curve or from the image.
    let area = match bare {
        true => Area::new(Id::new("results in a picture")).fixed_pos(corner),
        false => Area::new(Id::new("results")).default_pos(corner).movable(true),
    };
    area.constrain_to(ui.max_rect()).show(ui.ctx(), |ui| {
        egui::Frame::NONE
            .fill(Color32::from_black_alpha(190))
            .inner_margin(6)
            .corner_radius(4)
            .show(ui, |ui| {
                ui.style_mut().wrap_mode = Some(TextWrapMode::Extend);
                Grid::new("results").min_col_width(0.0).num_columns(4).spacing([8.0, 3.0]).show(
                    ui,
                    |ui| {
                        for index in 0..sheet.marks().len() {
                            row(ui, sheet, index, exam, bare, frame, &mut removed);
                        }
                    },
                );
            });
    });
    if let Some(mark) = removed {
        sheet.remove(mark);
    }
}

fn row(
    ui: &mut Ui,
    sheet: &mut Sheet,
    index: usize,
    exam: Exam,
    bare: bool,
    frame: &Frame,
    removed: &mut Option<usize>,
) {
    let mark = &sheet.marks()[index];
    let What::Caliper(caliper) = &mark.what else {
        return;
    };
    let (kind, name, stands) = (caliper.kind, caliper.label.clone(), mark.of == frame.moment());
    let lines = reading(&caliper.reading());
    let letter = RichText::new(mark.letter).strong().color(colour(mark.letter));
    if bare {
        let shown = if name.is_empty() { kind.name() } else { &name };
        ui.label(letter);
        ui.label(RichText::new(shown).size(12.0).color(style::TEXT));
        values(ui, lines, stands);
        ui.end_row();
        return;
    }
    let is_selected = sheet.selected().is_some_and(|(mark, _)| mark == index);
    let tip = match stands {
        true => "Select: arrow keys move its last point by a pixel, Del removes it",
        false => "Measured on another image: the probe or the scene has moved since",
    };
    if ui.selectable_label(is_selected, letter).on_hover_text(tip).clicked() {
        sheet.select(index);
    }
    named(ui, sheet, index, exam, kind, name);
    values(ui, lines, stands);
    if ui.small_button("x").on_hover_text("Remove (Del)").clicked() {
        *removed = Some(index);
    }
    ui.end_row();
}

/// Draws the texts of a measurement one below the other.
fn values(ui: &mut Ui, lines: Vec<String>, stands: bool) {
    let colour = if stands { style::TEXT } else { style::FAINT };
    ui.vertical(|ui| {
        for line in lines {
            ui.label(RichText::new(line).color(colour).size(13.0));
        }
    });
}

/// Draws the name of a measurement, which is chosen or typed.
fn named(
    ui: &mut Ui,
    sheet: &mut Sheet,
    index: usize,
    exam: Exam,
    kind: CaliperKind,
    name: String,
) {
    let shown = if name.is_empty() { kind.name() } else { name.as_str() };
    let button = ui.menu_button(RichText::new(shown).size(12.0), |ui| {
        ui.set_max_width(120.0);
        let mut typed = name.clone();
        let field = ui.add(TextEdit::singleline(&mut typed).hint_text("name").char_limit(24));
        if field.changed() {
            sheet.set_text(index, typed);
        }
        if field.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter)) {
            ui.close();
        }
        for item in exam::names(exam, kind) {
            if ui.button(item.name).on_hover_text(item.meaning).clicked() {
                sheet.set_text(index, item.name.to_owned());
                ui.close();
            }
        }
    });
    button.response.on_hover_text("What is measured: choose a name or type one");
}
