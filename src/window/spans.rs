//! What strips against time have in common: their width, the ruler below them, measurements that are drawn in them.

use egui::{Align2, FontId, PointerButton, Pos2, Rect, Response, Stroke, Ui, pos2, vec2};

use super::model::span::Span;
use super::style;

/// Choices for the width of a strip, s.
const WIDTHS: [f64; 5] = [1.0, 2.0, 4.0, 8.0, 16.0];

/// Most measurements at a time: one for each letter.
const MOST: usize = 26;

/// The measurements in a strip, oldest first.
#[derive(Default)]
pub(super) struct Spans {
    all: Vec<Span>,
    /// The last of them is being drawn.
    drawing: bool,
}

impl Spans {
    /// All of them with their letters.
    pub(super) fn lettered(&self) -> impl Iterator<Item = (char, &Span)> {
        ('A'..='Z').zip(&self.all)
    }

    /// Returns whether there are none.
    pub(super) fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    /// Removes all.
    pub(super) fn clear(&mut self) {
        self.all.clear();
    }

    /// Lets the pointer draw another one: `under` is what lies at a point of the screen, seconds and mm or mm/s.
    pub(super) fn drag(&mut self, ui: &Ui, response: &Response, under: impl Fn(Pos2) -> [f64; 2]) {
        if response.drag_started_by(PointerButton::Primary) {
            let origin = ui.input(|i| i.pointer.press_origin());
            if let Some(from) = origin.map(&under).filter(|_| self.all.len() < MOST) {
                self.all.push(Span { from, to: from });
                self.drawing = true;
            }
        }
        if let (true, Some(span), Some(point)) =
            (self.drawing, self.all.last_mut(), response.interact_pointer_pos())
        {
            span.to = under(point);
        }
        self.drawing &= !response.drag_stopped();
    }

    /// Draws them: `at` is the point of the screen that shows seconds and mm or mm/s.
    pub(super) fn show(&self, ui: &Ui, inner: Rect, at: impl Fn([f64; 2]) -> Pos2) {
        let (painter, line) = (ui.painter_at(inner), Stroke::new(1.5, style::ACCENT));
        for (letter, span) in self.lettered() {
            let ends = [at(span.from), at(span.to)];
            painter.line_segment(ends, line);
            for end in ends {
                painter.circle_stroke(end, 4.0, line);
            }
            let (place, font) = (ends[1] + vec2(6.0, -6.0), FontId::proportional(12.0));
            painter.text(place, Align2::LEFT_BOTTOM, letter, font, style::ACCENT);
        }
    }
}

/// Draws the choice of a strip's width, s.
pub(super) fn width(ui: &mut Ui, window: &mut f64) {
    style::choice(ui, "width", 60.0, window, &WIDTHS, |s| format!("{s} s"))
        .on_hover_text("Time across the strip, s");
}

/// Draws the ruler of seconds below a strip.
pub(super) fn seconds(ui: &Ui, inner: Rect, window: f64, end: f64) {
    let font = FontId::proportional(10.0);
    let step = window / 8.0;
    let first = ((end - window) / step).ceil() as i64;
    for tick in first..=(end / step).floor() as i64 {
        let x = inner.right() - inner.width() * ((end - tick as f64 * step) / window) as f32;
        let long = tick % 4 == 0;
        let bottom = inner.bottom() + if long { 6.0 } else { 3.0 };
        let line = Stroke::new(1.0, style::FAINT);
        (ui.painter()).line_segment([pos2(x, inner.bottom()), pos2(x, bottom)], line);
        if long {
            let text = format!("{:.1} s", tick as f64 * step);
            let at = pos2(x, bottom);
            (ui.painter()).text(at, Align2::CENTER_TOP, text, font.clone(), style::FAINT);
        }
    }
}
