//! Colours of what flows over the image: their box, which the pointer moves, their bar, and why there may be none.

use std::time::Instant;

use egui::{Color32, CursorIcon, Id, Painter, Pos2, Rect, Shape, Stroke, Ui, vec2};

use super::bmode;
use super::model::Model;
use super::picture::{Coloured, Frame};
use super::place::Place;
use super::style;
use crate::probe::Probe;
use crate::settings::Doppler;
use crate::sim::ColourMode;
use crate::sim::colour::colour_map;
use crate::sim::layout::{COLOUR_COLUMNS, COLOUR_ROWS};
use insonify_lab::doppler::nyquist;

/// Distance of the pointer within which an edge of the box is taken, points.
const REACH: f32 = 9.0;
/// Smallest width and height of the box, shares of the image.
const LEAST: f64 = 0.02;
/// Shares in which the pointer sets edges.
const STEP: f64 = 0.001;
/// Parts in which the box's curved edges are drawn.
const PARTS: u32 = 24;

/// True where a frame's colours are on the screen.
pub(super) fn is_shown(frame: &Frame, model: &Model) -> bool {
    model.colour.is_some() && frame.coloured.is_some()
}

/// The text about the packet of a coloured frame: fewer pulses than the settings ask for are said so.
pub(super) fn said(frame: &Frame, model: &Model) -> Option<String> {
    let coloured = frame.coloured.as_ref().filter(|_| model.colour.is_some())?;
    let asked = coloured.mode.doppler(&frame.settings).pulses;
    Some(match coloured.pulses < asked {
        true => format!("{} of {asked} pulses", coloured.pulses),
        false => format!("{asked} pulses"),
    })
}

/// The reason why nothing can be coloured with the settings, and the remedy.
pub(super) fn fault(model: &Model) -> Option<String> {
    let settings = &model.settings;
    let fault = model.colour.and_then(|mode| mode.fault(settings));
    fault.map(|(path, message, remedy)| format!("{path}: {message}. Remedy: {remedy}."))
}

/// Draws the colour bar of a frame: the highest velocity towards the probe on top, or the greatest power; variance to the right.
pub(super) fn bar(painter: &Painter, place: Rect, frame: &Frame, coloured: &Coloured) {
    let doppler = &coloured.mode.doppler(&frame.settings);
    let map = colour_map(coloured.mode, doppler);
    let at = |row: u32, share: f32| {
        let column = ((1.0 - share) * COLOUR_COLUMNS as f32) as u32;
        let [r, g, b] = map[(row * COLOUR_COLUMNS + column.min(COLOUR_COLUMNS - 1)) as usize];
        Color32::from_rgb(r, g, b)
    };
    let texts = match coloured.mode {
        ColourMode::Color | ColourMode::Tissue => {
            let cm = nyquist(&frame.probe, doppler.prf) / 10.0;
            let [lowest, highest] = doppler.velocities().map(|share| speed(share * cm));
            [highest, format!("{lowest}\ncm/s")]
        }
        ColourMode::Power => ["power".to_owned(), String::new()],
    };
    bmode::bar(painter, place, |share| [at(0, share), at(COLOUR_ROWS - 1, share)], texts);
}

/// A velocity as text, cm/s.
fn speed(cm: f64) -> String {
    if cm.abs() < 9.95 { format!("{cm:+.1}") } else { format!("{cm:+.0}") }
}

/// What the pointer holds of the box.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Grip {
    /// Edges across and down: -1 the first, 1 the second; both 0: all of it.
    edges: [i8; 2],
    /// Place where it was taken, shares of the image.
    from: [f64; 2],
    /// The box then: its edges across and down.
    before: [[f64; 2]; 2],
}

impl Grip {
    /// What is taken of a box at a place of which an edge lies within `reach`, all of these shares; none outside.
    fn of(sides: [[f64; 2]; 2], at: [f64; 2], reach: [f64; 2]) -> Option<Self> {
        let near = |axis: usize| {
            let [low, high] = sides[axis];
            let inside = (low - reach[axis]..=high + reach[axis]).contains(&at[axis]);
            let [to_low, to_high] = [low, high].map(|edge| (at[axis] - edge).abs());
            inside.then(|| match to_low.min(to_high) <= reach[axis] {
                true if to_low <= to_high => -1,
                true => 1,
                false => 0,
            })
        };
        Some(Self { edges: [near(0)?, near(1)?], from: at, before: sides })
    }

    /// The box while the pointer is at a place.
    fn moved(&self, to: [f64; 2]) -> [[f64; 2]; 2] {
        let whole = self.edges == [0, 0];
        [0, 1].map(|axis| {
            let [low, high] = self.before[axis];
            let by = to[axis] - self.from[axis];
            let stepped = |edge: f64| (edge / STEP).round() * STEP;
            match self.edges[axis] {
                0 if whole => {
                    let by = stepped(by.clamp(-low, 1.0 - high));
                    [low + by, high + by].map(stepped)
                }
                0 => [low, high],
                -1 => [stepped((low + by).clamp(0.0, high - LEAST)), high],
                _ => [low, stepped((high + by).clamp(low + LEAST, 1.0))],
            }
        })
    }

    fn cursor(&self) -> CursorIcon {
        match self.edges {
            [0, 0] => CursorIcon::Move,
            [_, 0] => CursorIcon::ResizeHorizontal,
            [0, _] => CursorIcon::ResizeVertical,
            [across, down] if across == down => CursorIcon::ResizeNwSe,
            _ => CursorIcon::ResizeNeSw,
        }
    }
}

/// Edges of the box across and down, shares of the image.
fn sides(doppler: &Doppler) -> [[f64; 2]; 2] {
    [[doppler.left, doppler.right], [doppler.top, doppler.bottom]]
}

/// Screen position of a place, shares of the image across and down.
fn at(place: &Place, probe: &Probe, [across, down]: [f64; 2]) -> Pos2 {
    let (origin, direction) = probe.ray_across(across - 0.5);
    let point = origin + direction * (down * probe.depth);
    place.at(point.x, point.z)
}

/// Draws the colour box while colours are on, and lets the pointer move it by its inside and set its edges.
pub(super) fn the_box(ui: &Ui, place: &Place, probe: &Probe, model: &mut Model, now: Instant) {
    if model.colour.is_none() || model.frozen {
        return;
    }
    let id = Id::new("colour box");
    let before = model.settings.clone();
    let [[left, right], [top, bottom]] = sides(&model.settings.doppler);
    let corner = |across, down| at(place, probe, [across, down]);
    let middle = [(left + right) / 2.0, (top + bottom) / 2.0];
    // Shares of the image in a point of the screen, in the middle of the box.
    let shares =
        |from: Pos2, to: Pos2, of: f64| of.max(LEAST) / f64::from(from.distance(to).max(1.0));
    let per_point = [
        shares(corner(left, middle[1]), corner(right, middle[1]), right - left),
        shares(corner(middle[0], top), corner(middle[0], bottom), bottom - top),
    ];
    let under = |point: Pos2| {
        let mm = place.mm(point);
        let [across, depth] = probe.across(mm.x, mm.y);
        [across + 0.5, depth / probe.depth]
    };
    let taken = |point: Pos2| {
        let free = model.sheet.tool().is_none() && !model.sheet.is_busy();
        let reach = per_point.map(|share| share * f64::from(REACH));
        let grip = Grip::of(sides(&model.settings.doppler), under(point), reach);
        grip.filter(|_| free && place.seen().contains(point))
    };
    let mut held: Option<Grip> = ui.data(|data| data.get_temp(id)).flatten();
    let mut over = None;
    if let Some(response) = ui.ctx().read_response(Id::new("image")) {
        if response.drag_started_by(egui::PointerButton::Primary) {
            held = ui.input(|input| input.pointer.press_origin()).and_then(taken);
        }
        over = held.or_else(|| response.hover_pos().and_then(taken));
        if let (Some(grip), Some(to)) = (held, response.interact_pointer_pos()) {
            let doppler = &mut model.settings.doppler;
            let [across, down] = grip.moved(under(to));
            [doppler.left, doppler.right] = across;
            [doppler.top, doppler.bottom] = down;
        }
        if !response.dragged_by(egui::PointerButton::Primary) {
            held = None;
        }
    }
    ui.data_mut(|data| data.insert_temp(id, held));
    if let Some(grip) = over {
        ui.ctx().set_cursor_icon(grip.cursor());
    }
    model.note(&before, now);
    let colour = if over.is_some() { style::TEXT } else { style::ACCENT };
    draw(ui, place, probe, &model.settings.doppler, colour);
}

/// Draws the box and its corners.
fn draw(ui: &Ui, place: &Place, probe: &Probe, doppler: &Doppler, colour: Color32) {
    let [[left, right], [top, bottom]] = sides(doppler);
    let along = |part: u32| left + (right - left) * f64::from(part) / f64::from(PARTS);
    let upper = (0..=PARTS).map(|part| at(place, probe, [along(part), top]));
    let lower = (0..=PARTS).rev().map(|part| at(place, probe, [along(part), bottom]));
    let painter = ui.painter_at(place.seen());
    painter.add(Shape::closed_line(upper.chain(lower).collect(), Stroke::new(1.0, colour)));
    for corner in [[left, top], [right, top], [left, bottom], [right, bottom]] {
        let mark = Rect::from_center_size(at(place, probe, corner), vec2(6.0, 6.0));
        painter.rect_filled(mark, 0.0, colour);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOX: [[f64; 2]; 2] = [[0.2, 0.8], [0.3, 0.5]];

    fn moved(at: [f64; 2], by: [f64; 2]) -> Option<[[f64; 2]; 2]> {
        let grip = Grip::of(BOX, at, [0.02, 0.02])?;
        Some(grip.moved([at[0] + by[0], at[1] + by[1]]))
    }

    #[test]
    fn the_inside_moves_the_box_and_its_edges_resize_it() {
        let near = |found: Option<[[f64; 2]; 2]>, expected: [[f64; 2]; 2]| {
            let found = found.expect("taken");
            let all = found.as_flattened().iter().zip(expected.as_flattened());
            assert!(all.clone().all(|(a, b)| (a - b).abs() < 1e-9), "{found:?} {expected:?}");
        };
        near(moved([0.5, 0.4], [0.1, -0.1]), [[0.3, 0.9], [0.2, 0.4]]);
        // Not beyond the image, at its own size.
        near(moved([0.5, 0.4], [0.9, -0.9]), [[0.4, 1.0], [0.0, 0.2]]);
        near(moved([0.21, 0.4], [0.1, 0.1]), [[0.3, 0.8], [0.3, 0.5]]);
        near(moved([0.79, 0.51], [0.1, 0.1]), [[0.2, 0.9], [0.3, 0.6]]);
        // An edge stops before the other one.
        near(moved([0.5, 0.3], [0.0, 0.9]), [[0.2, 0.8], [0.48, 0.5]]);
        assert_eq!(moved([0.1, 0.4], [0.1, 0.0]), None);
    }
}
