//! Two images side by side: one that is held, and the one that goes on.

use std::time::Instant;

use egui::{Rect, Ui, pos2, vec2};

use super::bmode;
use super::calipers;
use super::framing::Framing;
use super::model::Model;
use super::model::sheet::Mark;
use super::picture::Frame;
use super::place::Place;
use super::tools::Tools;

/// An image that is held, with the marks that are on it.
struct Held {
    frame: Frame,
    marks: Vec<Mark>,
}

/// The held image and its side.
#[derive(Default)]
pub(super) struct Dual {
    held: Option<Held>,
    /// True where it is held on the right.
    right: bool,
}

impl Dual {
    /// Holds an image with its marks: the first one on the left, the next one where the live image was, and so on in
    /// turn, as on scanners.
    fn hold(&mut self, frame: &Frame, marks: &[Mark]) {
        self.right = self.is_on() && !self.right;
        let own = |mark: &&Mark| mark.of == frame.moment();
        let marks = marks.iter().filter(own).cloned().collect();
        self.held = Some(Held { frame: frame.clone(), marks });
    }

    /// Returns whether an image is held.
    pub(super) fn is_on(&self) -> bool {
        self.held.is_some()
    }

    /// The held image.
    pub(super) fn frame(&self) -> Option<&Frame> {
        self.held.as_ref().map(|held| &held.frame)
    }

    /// Takes an image in the held one's place that shows the same, made finer at rest.
    pub(super) fn refine(&mut self, frame: &Frame) {
        if let Some(held) = &mut self.held
            && frame.grade.at_rest
            && frame.moment() == held.frame.moment()
        {
            held.frame = frame.clone();
        }
    }

    /// Shows one image alone.
    pub(super) fn end(&mut self) {
        *self = Self::default();
    }

    /// The room of the image that goes on, and of the one that is held, within `area`.
    pub(super) fn rooms(&self, area: Rect) -> [Rect; 2] {
        if !self.is_on() {
            return [area, Rect::NOTHING];
        }
        let (left, right) = area.split_left_right_at_fraction(0.5);
        match self.right {
            true => [left, right],
            false => [right, left],
        }
    }

    /// Draws what is around the held image, its marks, and, unless `bare`, the button that ends it; returns its place.
    pub(super) fn show(
        &mut self,
        ui: &mut Ui,
        area: Rect,
        bare: bool,
        model: &Model,
        framing: &Framing,
    ) -> Option<Place> {
        let held = self.held.as_ref()?;
        let place = bmode::show(ui, area, &held.frame, true, model, framing)?;
        calipers::show_held(ui, &held.marks, &place);
        if !bare {
            let corner = pos2(area.right() - 82.0, area.top() + 9.0);
            let room = Rect::from_min_size(corner, vec2(22.0, 18.0));
            let button = ui.put(room, egui::Button::new("x").small());
            if button.on_hover_text("One image again (Shift+Y)").clicked() {
                self.end();
            }
        }
        Some(place)
    }
}

/// Holds the image that is shown beside the one that goes on, live.
pub(super) fn hold(model: &mut Model, dual: &mut Dual, tools: &Tools, now: Instant) {
    let Some(frame) = tools.cine.shown() else { return };
    dual.hold(frame, model.sheet.marks());
    // The marks are on the held image now.
    model.sheet.retire();
    if model.frozen {
        model.freeze(false, now);
    }
}

#[cfg(test)]
mod tests {
    use egui::{Rect, pos2};

    use super::Dual;

    #[test]
    fn one_image_has_all_of_the_room() {
        let area = Rect::from_min_max(pos2(0.0, 0.0), pos2(600.0, 400.0));
        assert_eq!(Dual::default().rooms(area)[0], area);
    }
}
