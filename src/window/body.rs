//! The body mark in the corner of the image: the drawing, and the pointer that places the probe on it.

use egui::{Id, Painter, Pos2, Rect, Sense, Shape, Stroke, Ui, pos2, vec2};
use glam::{DVec2, dvec2};

use super::model::body::{BodyMark, Figure};
use super::style;

/// Width and height of the figure, points.
const SIZE: f32 = 76.0;
/// Room from the lower left corner of the image: toolbar and time gain, and the electrocardiogram, points.
const CORNER: [f32; 2] = [88.0, 62.0];
/// Distance from an end of the probe within which the pointer takes it, points.
const REACH: f32 = 9.0;

/// Points of a line, from -1 to 1 across and down.
type Line = &'static [[f32; 2]];

/// The lines of a figure; circles have their middle and radius.
fn lines(figure: Figure) -> (&'static [Line], &'static [[f32; 3]]) {
    match figure {
        Figure::Abdomen => (
            &[
                &[[-0.8, -1.0], [-0.62, -0.4], [-0.52, 0.1], [-0.66, 0.6], [-0.7, 1.0]],
                &[[0.8, -1.0], [0.62, -0.4], [0.52, 0.1], [0.66, 0.6], [0.7, 1.0]],
                &[[-0.6, -0.35], [-0.3, -0.45], [0.0, -0.75], [0.3, -0.45], [0.6, -0.35]],
                &[[-0.5, 0.75], [0.0, 1.0], [0.5, 0.75]],
            ],
            &[[0.0, 0.25, 0.05]],
        ),
        Figure::Heart => (
            &[
                &[[-0.3, -1.0], [-0.9, -0.75], [-0.85, 0.3], [-0.7, 1.0]],
                &[[0.3, -1.0], [0.9, -0.75], [0.85, 0.3], [0.7, 1.0]],
                &[
                    [0.05, -0.4],
                    [-0.22, -0.2],
                    [-0.2, 0.2],
                    [0.12, 0.45],
                    [0.55, 0.5],
                    [0.5, 0.1],
                    [0.3, -0.25],
                    [0.05, -0.4],
                ],
                &[[0.0, -0.8], [0.0, -0.5]],
            ],
            &[],
        ),
        Figure::Fetus => (
            &[
                &[[-0.1, -0.28], [0.35, -0.3], [0.6, 0.05], [0.5, 0.5], [0.1, 0.6]],
                &[[-0.15, 0.05], [0.1, 0.05], [0.2, 0.25], [0.0, 0.35]],
                &[[0.1, 0.6], [-0.2, 0.4], [-0.4, 0.6]],
            ],
            &[[0.0, 0.0, 0.95], [-0.35, -0.15, 0.28]],
        ),
        Figure::Neck => (
            &[
                &[[-0.6, -1.0], [-0.45, -0.55], [0.0, -0.3], [0.45, -0.55], [0.6, -1.0]],
                &[[-0.4, -0.5], [-0.38, 0.3], [-0.6, 0.6], [-1.0, 0.75]],
                &[[0.4, -0.5], [0.38, 0.3], [0.6, 0.6], [1.0, 0.75]],
                &[[-0.5, 0.75], [-0.08, 0.62], [0.08, 0.62], [0.5, 0.75]],
                &[[-0.12, 0.05], [-0.2, 0.25], [0.0, 0.3], [0.2, 0.25], [0.12, 0.05]],
            ],
            &[],
        ),
        Figure::Limb => (
            &[
                &[[-0.45, -1.0], [-0.3, -0.3], [-0.3, 0.0], [-0.2, 0.7], [-0.2, 0.85]],
                &[[0.4, -1.0], [0.25, -0.3], [0.3, 0.05], [0.1, 0.65], [0.55, 0.85]],
                &[[-0.2, 0.85], [0.0, 0.95], [0.55, 0.95], [0.55, 0.85]],
            ],
            &[[0.0, -0.2, 0.14]],
        ),
    }
}

/// Draws the mark, and lets the pointer place and turn its probe; `bare`: a saved picture is drawn.
pub(super) fn show(ui: &Ui, mark: &mut BodyMark, bare: bool) {
    let area = ui.max_rect();
    let corner = area.left_bottom() + vec2(CORNER[0], -CORNER[1] - SIZE);
    let rect = Rect::from_min_size(corner, vec2(SIZE, SIZE));
    if !bare {
        pointer(ui, mark, rect);
    }
    let painter = ui.painter_at(area);
    painter.rect_filled(rect.expand(4.0), 3.0, egui::Color32::from_black_alpha(150));
    draw(&painter, mark.figure, rect, Stroke::new(1.3, style::TEXT));
    let [first, second] = mark.ends().map(|end| on(rect, end));
    painter.line_segment([first, second], Stroke::new(4.0, style::ACCENT));
    painter.circle_filled(first, 4.0, style::ACCENT);
}

/// Draws a figure into its room.
pub(super) fn draw(painter: &Painter, figure: Figure, rect: Rect, line: Stroke) {
    let at = |[x, y]: [f32; 2]| rect.center() + 0.5 * rect.size() * vec2(x, y);
    let (lines, circles) = lines(figure);
    for points in lines {
        painter.add(Shape::line(points.iter().copied().map(at).collect(), line));
    }
    for [x, y, radius] in circles {
        painter.circle_stroke(at([*x, *y]), 0.5 * rect.width() * radius, line);
    }
}

fn on(rect: Rect, at: DVec2) -> Pos2 {
    rect.center() + 0.5 * rect.size() * vec2(at.x as f32, at.y as f32)
}

fn pointer(ui: &Ui, mark: &mut BodyMark, rect: Rect) {
    let id = Id::new("body mark");
    let response = ui.interact(rect.expand(4.0), id, Sense::click_and_drag());
    let response = response.on_hover_text("Drag the probe; drag one of its ends to turn it");
    let Some(pointer) = response.interact_pointer_pos() else {
        return;
    };
    // Which end is held, from the press to the release.
    let pressed = ui.input(|input| input.pointer.press_origin()).unwrap_or(pointer);
    let end_at = |at: Pos2| mark.ends().iter().position(|end| on(rect, *end).distance(at) < REACH);
    let held: Option<usize> =
        ui.data_mut(|data| *data.get_temp_mut_or_insert_with(id, || end_at(pressed)));
    if !response.is_pointer_button_down_on() {
        ui.data_mut(|data| data.remove::<Option<usize>>(id));
    }
    let from = pointer - rect.center();
    let half = f64::from(SIZE) / 2.0;
    let at = dvec2(f64::from(from.x) / half, f64::from(from.y) / half);
    match held {
        Some(end) => mark.point(end == 0, at),
        None => mark.place(at),
    }
}

/// Draws the button's sign into its room.
pub(super) fn sign(painter: &Painter, room: Rect, colour: egui::Color32) {
    let rect = Rect::from_center_size(pos2(room.center().x, room.center().y), vec2(15.0, 17.0));
    draw(painter, Figure::Abdomen, rect, Stroke::new(1.2, colour));
}
