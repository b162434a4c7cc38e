//! What is set at the image's edges, at its true depth: the time-gain curve on the left, the transmit focus on the
//! ruler.

use std::time::Instant;

use egui::{CursorIcon, Id, Pos2, Rect, Sense, Shape, Stroke, Ui, pos2, vec2};

use super::bmode;
use super::model::Model;
use super::place::Place;
use super::style;
use crate::settings::{Facts, Group, Imaging};

/// Distance of the curve's middle from the left edge of the image's pane, and half its width, points.
const MIDDLE: f32 = 60.0;
const HALF: f32 = 18.0;
/// Distance of the pointer within which a slider or the focus is taken, points.
const REACH: f32 = 8.0;
/// Steps in which the pointer sets the focus, mm, and a slider, dB.
const FOCUS_STEP: f64 = 1.0;
const LEVEL_STEP: f64 = 0.5;

/// Draws the time-gain curve, and lets the pointer move it and the focus.
pub(super) fn show(ui: &Ui, place: &Place, model: &mut Model, now: Instant) {
    let before = model.settings.clone();
    focus(ui, place, model);
    if place.has_curve() {
        curve(ui, place, model);
    }
    model.note(&before, now);
}

/// Lets the pointer drag the mark of the focus along the ruler, within the image.
fn focus(ui: &Ui, place: &Place, model: &mut Model) {
    let probe = &mut model.settings.probe;
    let mark = bmode::focus_mark(place, probe);
    let grip = Rect::from_center_size(mark, vec2(2.0 * REACH, 2.0 * REACH));
    let response = ui.interact(grip, Id::new("focus"), Sense::drag());
    let response = response.on_hover_cursor(CursorIcon::ResizeVertical);
    if let Some(at) = response.interact_pointer_pos().filter(|_| response.dragged()) {
        let depth = (place.mm(at).y / FOCUS_STEP).round() * FOCUS_STEP;
        probe.focus = depth.clamp(FOCUS_STEP.min(probe.depth), probe.depth);
    }
    response
        .on_hover_text(format!("Transmit focus, {:.0} mm: drag it along the ruler", probe.focus));
}

/// What the scene file says of the sliders of time gain.
fn facts() -> &'static Facts {
    let mut rows = Imaging::rows().iter();
    &rows.find(|row| row.facts.key == "tgc_sliders").expect("a row of the group").facts
}

/// Draws the eight sliders at the depths at which they stand, joined as the gain is between them; each can be dragged to
/// the left (less) and to the right (more).
fn curve(ui: &Ui, place: &Place, model: &mut Model) {
    let depth = model.settings.probe.depth;
    let sliders = &mut model.settings.imaging.tgc_sliders;
    let spacing = depth / (sliders.len() - 1) as f64;
    let [least, most] = facts().usual;
    let per_point = (most - least) / f64::from(2.0 * HALF);
    let middle = place.area.left() + MIDDLE;
    let seen = place.seen().y_range();
    let at = |level: f64, number: usize| -> Pos2 {
        let across = (level.clamp(least, most) / per_point) as f32;
        pos2(middle + across, place.at(0.0, number as f64 * spacing).y)
    };
    let painter = ui.painter_at(place.area);
    let ends = [at(0.0, 0).y, at(0.0, sliders.len() - 1).y].map(|y| seen.clamp(y));
    let zero = Stroke::new(1.0, egui::Color32::from_gray(56));
    painter.line_segment(ends.map(|y| pos2(middle, y)), zero);
    let mut taken = None;
    for (number, level) in sliders.iter_mut().enumerate() {
        let point = at(*level, number);
        if !seen.expand(1.0).contains(point.y) {
            continue;
        }
        let grip = Rect::from_center_size(point, vec2(2.0 * REACH, 2.0 * REACH));
        let response = ui.interact(grip, Id::new("tgc").with(number), Sense::click_and_drag());
        let response = response.on_hover_cursor(CursorIcon::ResizeHorizontal);
        if let Some(to) = response.interact_pointer_pos().filter(|_| response.dragged()) {
            let wanted = f64::from(to.x - middle) * per_point;
            *level = ((wanted / LEVEL_STEP).round() * LEVEL_STEP).clamp(least, most);
        }
        if response.double_clicked() {
            *level = 0.0;
        }
        if response.hovered() || response.dragged() {
            taken = Some(number);
        }
        let deep = number as f64 * spacing;
        response
            .on_hover_text(format!("Time gain at {deep:.0} mm: {level:+.1} dB; double click: 0"));
    }
    let points: Vec<Pos2> = sliders.iter().enumerate().map(|(i, level)| at(*level, i)).collect();
    let seen = Rect::from_x_y_ranges(place.area.x_range(), seen.expand(1.0));
    let inside = painter.with_clip_rect(seen.expand2(vec2(0.0, 4.0)));
    inside.add(Shape::line(points.clone(), Stroke::new(1.0, style::FAINT)));
    for (number, point) in points.into_iter().enumerate() {
        let colour = if taken == Some(number) { style::ACCENT } else { style::FAINT };
        inside.circle_filled(point, if taken == Some(number) { 4.0 } else { 3.0 }, colour);
    }
}
