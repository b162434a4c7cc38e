//! The toolbar: a column of buttons at the left edge.

use std::f32::consts::FRAC_PI_4;

use egui::{
    Align2, Color32, FontId, Id, Painter, Rect, Sense, Shape, Stroke, StrokeKind, Ui, pos2, vec2,
};

use super::body;
use super::calipers::{cross, dots};
use super::model;
use super::model::body::BodyMark;
use super::model::calipers::CaliperKind;
use super::model::sheet::{Sheet, Tool};
use super::tools::Tools;
use crate::settings::Exam;

/// Height of a button with the gap below it, points; where there is little room, and otherwise.
const PITCH: [f32; 2] = [26.0, 30.0];
/// Height below which there is little room, points.
const LITTLE: f32 = 420.0;

/// Height of the texts above the image, points.
const TEXTS: f32 = 44.0;

/// Draws a sign into its room in a colour.
type Icon = fn(&Painter, Rect, Color32);

/// The tools of the pointer: sign and meaning.
const TOOLS: [(Tool, &str, Icon); 5] = [
    (Tool::Measure(CaliperKind::Distance), "Distance in mm: two clicks, or drag (L)", |p, r, c| {
        dots(p, &[r.left_bottom(), r.right_top()], c);
        cross(p, r.left_bottom(), c);
        cross(p, r.right_top(), c);
    }),
    (
        Tool::Measure(CaliperKind::Ellipse),
        "Ellipse, its circumference and area: the ends of one axis, then the width (O)",
        |p, r, c| {
            let radius = vec2(r.width() * 0.62, r.height() * 0.42);
            let line = Stroke::new(1.5, c);
            p.add(egui::epaint::EllipseShape::stroke(r.center(), radius, line));
        },
    ),
    (
        Tool::Measure(CaliperKind::Angle),
        "Angle in degrees: a point on one arm, the vertex, a point on the other (K)",
        |p, r, c| {
            let line = Stroke::new(1.5, c);
            p.line_segment([r.left_bottom(), r.right_top()], line);
            p.line_segment([r.left_bottom(), r.right_bottom()], line);
        },
    ),
    (
        Tool::Measure(CaliperKind::Trace),
        "Trace, its circumference and area: draw it, or click along it and then on its beginning (J)",
        |p, r, c| {
            let side = |x: f32, y: f32| r.center() + vec2(x * r.width(), y * r.height());
            let outline =
                [(-0.6, 0.1), (-0.2, -0.5), (0.5, -0.4), (0.6, 0.3), (0.0, 0.5), (-0.6, 0.1)];
            dots(p, &outline.map(|(x, y)| side(x, y)), c);
        },
    ),
    (Tool::Note, "Text: click to place it, or drag away from what it points at (N)", |p, r, c| {
        let font = FontId::proportional(17.0);
        p.text(r.center(), Align2::CENTER_CENTER, "T", font, c);
    }),
];

fn bin(p: &Painter, r: Rect, c: Color32) {
    let line = Stroke::new(1.5, c);
    p.line_segment([r.left_top(), r.right_bottom()], line);
    p.line_segment([r.right_top(), r.left_bottom()], line);
}

fn camera(p: &Painter, r: Rect, c: Color32) {
    let line = Stroke::new(1.5, c);
    p.rect_stroke(r.expand2(vec2(2.0, 0.0)), 2.0, line, StrokeKind::Middle);
    p.circle_stroke(r.center(), 3.2, line);
}

fn film(p: &Painter, r: Rect, c: Color32) {
    let line = Stroke::new(1.5, c);
    let frame = r.expand2(vec2(2.0, 0.0));
    p.rect_stroke(frame, 1.0, line, StrokeKind::Middle);
    let side = vec2(r.height() * 0.3, 0.0).length();
    let turned = |k: f32| {
        let angle = k * 8.0 / 3.0 * FRAC_PI_4;
        r.center() + side * egui::Vec2::angled(angle)
    };
    let corners = vec![turned(0.0), turned(1.0), turned(2.0)];
    p.add(Shape::convex_polygon(corners, c, Stroke::NONE));
}

fn halves(p: &Painter, r: Rect, c: Color32) {
    let (left, right) = r.expand2(vec2(3.0, 1.0)).split_left_right_at_fraction(0.5);
    p.rect_filled(left.shrink(1.0), 1.0, c);
    p.rect_stroke(right.shrink(1.0), 1.0, Stroke::new(1.2, c), StrokeKind::Middle);
}

/// Height of the toolbar in an area so high, points.
fn height(area: f32) -> f32 {
    pitch(area) * (TOOLS.len() as f32 + 5.0) + 6.0
}

fn pitch(area: f32) -> f32 {
    PITCH[usize::from(area > LITTLE)]
}

/// Upper edge of the toolbar in the area of the images: what stands at the left keeps above it.
pub(super) fn top(area: Rect) -> f32 {
    area.bottom() - 8.0 - height(area.height())
}

/// Draws the toolbar into the lower left corner, unless it would cover the texts above the image: keys do the same. Returns
/// whether the image is to be held beside the live one.
pub(super) fn show(
    ui: &mut Ui,
    tools: &mut Tools,
    sheet: &mut Sheet,
    mark: &mut Option<BodyMark>,
    exam: Exam,
    dual: bool,
) -> bool {
    let area = ui.max_rect();
    if top(area) < area.top() + TEXTS {
        return false;
    }
    let has_marks = !sheet.marks().is_empty();
    let pitch = pitch(area.height());
    let mut at = pos2(area.left() + 8.0, top(area));
    let mut next = |gap: f32| {
        let rect = Rect::from_min_size(at, vec2(30.0, pitch - 2.0));
        at.y += pitch + gap;
        rect
    };
    let has_image = !tools.cine.is_empty();
    let tip = "Hold this image beside the live one; again: the other side (Y)";
    let held = button(ui, next(0.0), dual, has_image, tip, halves);
    let tip = "Body mark: a figure with the probe; again for the next figure, at last for none";
    if button(ui, next(0.0), mark.is_some(), true, tip, body::sign) {
        *mark = model::body::next(*mark, exam);
    }
    for (tool, tip, icon) in TOOLS {
        if button(ui, next(0.0), sheet.tool() == Some(tool), true, tip, icon) {
            sheet.toggle(tool);
        }
    }
    let tip = "Remove all measurements and texts; Undo brings them back";
    if button(ui, next(6.0), false, has_marks, tip, bin) {
        sheet.clear();
    }
    let tip = "Save this image: PNG and sidecar (F2)";
    if button(ui, next(0.0), false, has_image, tip, camera) {
        tools.want_still();
    }
    let tip = "Save the loop between its marks as a clip (F3)";
    if button(ui, next(0.0), false, has_image, tip, film) {
        tools.want_clip();
    }
    held
}

fn button(ui: &mut Ui, rect: Rect, on: bool, enabled: bool, tip: &str, icon: Icon) -> bool {
    let sense = if enabled { Sense::click() } else { Sense::hover() };
    let response = ui.interact(rect, Id::new(tip), sense);
    let visuals = match enabled {
        true => ui.style().interact_selectable(&response, on),
        false => ui.visuals().widgets.noninteractive,
    };
    let (painter, room) = (ui.painter(), rect.shrink2(vec2(9.0, 8.0)));
    let (fill, colour) = match enabled {
        true => (visuals.weak_bg_fill, visuals.text_color()),
        false => (Color32::TRANSPARENT, Color32::from_gray(70)),
    };
    painter.rect(rect, 4.0, fill, visuals.bg_stroke, StrokeKind::Inside);
    icon(painter, room, colour);
    response.on_hover_text(tip).clicked()
}
