//! How the image lies in its pane: enlarged, moved, turned over.

use egui::{Id, PointerButton, Rect, Ui, Vec2, vec2};

use super::place::Place;

/// Largest enlargement over the image that fits into its pane.
const MOST: f32 = 12.0;
/// Points of a wheel's turn that enlarge by a factor of e.
const NOTCH: f32 = 300.0;

/// The part of the image that is seen, and its sides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Framing {
    /// Enlargement over the image that fits into the pane, 1 and more.
    zoom: f32,
    /// What of the image lies in the middle of the pane, as shares of its width and height on the screen.
    middle: Vec2,
    /// Left and right, up and down are exchanged.
    pub(super) flipped: [bool; 2],
}

impl Default for Framing {
    fn default() -> Self {
        Self { zoom: 1.0, middle: vec2(0.5, 0.5), flipped: [false; 2] }
    }
}

impl Framing {
    /// Shows the whole image again, with its sides as they are.
    pub(super) fn whole(&mut self) {
        *self = Self { flipped: self.flipped, ..Self::default() };
    }

    /// Exchanges left and right (0) or up and down (1); what is seen stays.
    pub(super) fn flip(&mut self, axis: usize) {
        self.flipped[axis] = !self.flipped[axis];
        self.middle[axis] = 1.0 - self.middle[axis];
    }

    /// Enlargement over the image that fits into the pane.
    pub(super) fn zoom(&self) -> f32 {
        self.zoom
    }

    /// The place of the whole image, of which the part in `room` is seen. `fit` is its size where all of it is seen.
    pub(super) fn of(&self, room: Rect, fit: Vec2) -> Rect {
        let size = fit * self.zoom;
        let mut min = room.min;
        for axis in 0..2 {
            min[axis] = match size[axis] <= room.size()[axis] {
                // Beside the middle line, below the texts.
                true if axis == 0 => room.center().x - size.x / 2.0,
                true => room.min.y,
                false => room.center()[axis] - self.middle[axis] * size[axis],
            };
        }
        Rect::from_min_size(min, size)
    }

    /// Makes `seen`, a place of the whole image, the next one, as far as it leaves no gap in `room`.
    fn take(&mut self, room: Rect, seen: Rect) {
        for axis in 0..2 {
            let size = seen.size()[axis].max(1.0);
            let half = (room.size()[axis] / (2.0 * size)).min(0.5);
            let middle = (room.center()[axis] - seen.min[axis]) / size;
            self.middle[axis] = middle.clamp(half, 1.0 - half);
        }
    }

    /// Enlarges by a factor; what lies at a point of the screen stays there.
    fn enlarge(&mut self, room: Rect, rect: Rect, at: egui::Pos2, factor: f32) {
        let zoom = (self.zoom * factor).clamp(1.0, MOST);
        let factor = zoom / self.zoom;
        self.zoom = zoom;
        let min = at + (rect.min - at) * factor;
        self.take(room, Rect::from_min_size(min, rect.size() * factor));
    }

    /// Follows the pointer over the image: the wheel enlarges, the middle and the right button move.
    pub(super) fn follow(&mut self, ui: &Ui, place: &Place) {
        let Some(response) = ui.ctx().read_response(Id::new("image")) else { return };
        let before = *self;
        let (wheel, pinch) = ui.input(|input| (input.smooth_scroll_delta.y, input.zoom_delta()));
        let factor = (wheel / NOTCH).exp() * pinch;
        if let Some(at) = response.hover_pos().filter(|_| factor != 1.0) {
            self.enlarge(place.room, place.rect, at, factor);
        }
        let moves = [PointerButton::Middle, PointerButton::Secondary];
        if moves.into_iter().any(|button| response.dragged_by(button)) {
            self.take(place.room, place.rect.translate(response.drag_delta()));
        }
        if *self != before {
            ui.ctx().request_repaint();
        }
    }
}

#[cfg(test)]
mod tests {
    use egui::{Rect, Vec2, pos2, vec2};

    use super::Framing;

    const FIT: Vec2 = Vec2::new(300.0, 400.0);

    fn room() -> Rect {
        Rect::from_min_size(pos2(50.0, 60.0), vec2(500.0, 400.0))
    }

    /// The share of the image at a point of the screen.
    fn share(framing: &Framing, at: egui::Pos2) -> Vec2 {
        let rect = framing.of(room(), FIT);
        (at - rect.min) / rect.size()
    }

    #[test]
    fn what_is_under_the_pointer_stays_there() {
        let mut framing = Framing::default();
        assert_eq!(framing.of(room(), FIT), Rect::from_min_size(pos2(150.0, 60.0), FIT));
        // Where the image fills the pane in both directions.
        framing.enlarge(room(), framing.of(room(), FIT), pos2(300.0, 260.0), 3.0);
        let at = pos2(180.0, 333.0);
        let before = share(&framing, at);
        framing.enlarge(room(), framing.of(room(), FIT), at, 1.7);
        assert!((share(&framing, at) - before).length() < 1e-4);
        assert!((framing.zoom() - 5.1).abs() < 1e-4);
        // At most so far, and back to the whole.
        framing.enlarge(room(), framing.of(room(), FIT), at, 1e6);
        assert_eq!(framing.zoom(), 12.0);
        framing.enlarge(room(), framing.of(room(), FIT), at, 1e-6);
        assert_eq!(framing, Framing::default());
    }

    #[test]
    fn the_image_cannot_be_moved_out_of_its_pane() {
        let mut framing = Framing::default();
        framing.enlarge(room(), framing.of(room(), FIT), room().center(), 4.0);
        for by in [vec2(1e4, 1e4), vec2(-1e4, -1e4), vec2(1e4, -1e4)] {
            let rect = framing.of(room(), FIT).translate(by);
            framing.take(room(), rect);
            assert!(framing.of(room(), FIT).expand(0.01).contains_rect(room()), "{by}");
        }
        let before = framing.of(room(), FIT);
        framing.take(room(), before.translate(vec2(-12.0, 30.0)));
        let moved = framing.of(room(), FIT).min - before.min;
        assert!((moved - vec2(-12.0, 0.0)).length() < 0.01 || moved.y > 0.0, "{moved}");
    }

    #[test]
    fn turned_over_the_same_part_is_seen() {
        let mut framing = Framing::default();
        framing.enlarge(room(), framing.of(room(), FIT), pos2(200.0, 100.0), 4.0);
        let before = share(&framing, room().center());
        framing.flip(0);
        let after = share(&framing, room().center());
        assert!((after - vec2(1.0 - before.x, before.y)).length() < 1e-4);
        framing.flip(0);
        assert!((share(&framing, room().center()) - before).length() < 1e-4);
        framing.flip(1);
        framing.whole();
        assert_eq!(framing, Framing { flipped: [false, true], ..Framing::default() });
    }
}
