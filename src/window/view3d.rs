//! The 3D view: anatomy, probe and fan, pictured by the simulation; the pointer moves the camera.

mod compass;
mod fan;
mod tissues;

use std::time::{Duration, Instant};

use egui::{
    Align2, Context, CursorIcon, FontId, Id, Key, PointerButton, Rect, Response, Sense, Stroke, Ui,
    pos2, vec2,
};
use glam::{DVec2, DVec3};

pub(super) use fan::outline;

use super::hold;
use super::look::{Look, Pictured};
use super::model::{Camera, Model, Ray};
use super::panel::{Desk, Dock, Panel, Row};
use super::style::{self, button};

/// Least useful width of the view, points.
const LEAST: f32 = 240.0;
/// The view's share of the room that it has with the image, until the user drags the edge between them.
pub(super) const USUAL: f32 = 0.38;
/// Distance of the pointer from that edge within which it is taken, points.
const GRIP: f32 = 4.0;
/// Points of a wheel's turn that move the camera a step nearer.
const NOTCH: f64 = 50.0;
/// Longest time of a picture while the camera moves, ms; a slower one is made coarser.
const SWIFT: f64 = 60.0;
/// Greatest share of an image's budget for a picture while probe or anatomy move.
const SHARE: f64 = 0.2;
/// Least pixels of the picture for each of the panel's, along an edge.
const COARSEST: f64 = 0.2;
/// Factor by which times of pictures vary without a lasting reason.
const STEADY: f64 = 1.5;
/// Time without movement after which everything counts as at rest.
const REST: Duration = Duration::from_millis(160);

/// Its row in the list of panels.
pub(super) const ROW: Row = Row {
    name: "3D",
    tip: "Anatomy, probe and fan from outside",
    key: Some((Key::V, "V")),
    dock: Dock::Beside,
    has_button: true,
};

/// The 3D view.
pub(super) struct View3dPanel {
    /// Where it was drawn last, if it was.
    pub(super) place: Option<Place>,
    /// True while the list of tissues is open.
    tissues: bool,
    /// Time until which something counts as moving: the camera, or probe and anatomy.
    moving: [Option<Instant>; 2],
    /// Time for an image while something moves, ms.
    budget_ms: f64,
    /// Last seen revision of the model.
    revision: u64,
    /// Estimated time of a pixel on the device, ms.
    pixel_ms: f64,
    /// Where a right click asks what is seen there, and its ray.
    pub(super) asked: Option<(egui::Pos2, Ray)>,
    /// The probe in the pointer's hand.
    hold: hold::State,
}

impl Default for View3dPanel {
    fn default() -> Self {
        Self {
            place: None,
            tissues: false,
            moving: [None; 2],
            budget_ms: SWIFT,
            revision: 0,
            pixel_ms: 0.0,
            asked: None,
            hold: hold::State::default(),
        }
    }
}

impl View3dPanel {
    /// Learns the time of a pixel from a finished picture.
    pub(super) fn learn(&mut self, pictured: &Pictured) {
        let [width, height] = pictured.look.sight.size.map(f64::from);
        self.took(pictured.ms / (width * height));
    }

    /// Notes the time of a pixel, ms, only where it is far from the estimate: otherwise, at rest, pictures would
    /// be made again and again, at changing resolutions.
    fn took(&mut self, pixel_ms: f64) {
        let near = self.pixel_ms / STEADY..self.pixel_ms * STEADY;
        if !near.contains(&pixel_ms) {
            self.pixel_ms = pixel_ms;
        }
    }

    /// Notes the time for an image while something moves, ms.
    pub(super) fn pace(&mut self, budget_ms: f64) {
        self.budget_ms = budget_ms;
    }

    /// Pixels of the picture for each of the panel's, along an edge: fewer while something moves
    /// and the device is slow, more where it is quick, against jagged outlines.
    fn detail(&self, pixels: f64, now: Instant) -> f64 {
        let moves = |until: Option<Instant>| until.is_some_and(|until| now < until);
        let ms = pixels * self.pixel_ms;
        let (budget, fine) = match self.moving.map(moves) {
            [true, false] => (SWIFT, SWIFT / 4.0),
            [_, true] => (SHARE * self.budget_ms, SHARE * self.budget_ms / 4.0),
            [false, false] => (f64::INFINITY, 4.0 * SWIFT),
        };
        if ms > 0.0 && 4.0 * ms < fine {
            return 2.0;
        }
        let steps = [1.0, 0.5, 1.0 / 3.0, 0.25];
        let quick = |detail: &f64| ms * detail * detail <= budget;
        steps.into_iter().find(quick).unwrap_or(COARSEST)
    }

    /// Notes whether something has moved; draws again at rest, when pictures are fine again.
    fn watch(&mut self, ui: &Ui, model: &Model, eye_moved: bool) {
        let now = Instant::now();
        let changed = std::mem::replace(&mut self.revision, model.revision()) != model.revision();
        let moved = [eye_moved, changed || model.clock.runs()];
        for (until, moved) in self.moving.iter_mut().zip(moved) {
            if moved {
                *until = Some(now + REST);
            }
            let left = until.map(|until| until.saturating_duration_since(now));
            match left {
                None => {}
                Some(Duration::ZERO) => *until = None,
                Some(left) => ui.ctx().request_repaint_after(left),
            }
        }
    }
}

/// Place of the view on the screen.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    /// The whole view, points.
    pub(super) rect: Rect,
}

impl Place {
    /// The largest place within this one that has the shape of a picture, which was made for a panel that may have had
    /// another.
    pub(super) fn of(&self, pictured: &Pictured) -> Self {
        let [width, height] = pictured.look.sight.size.map(|pixels| pixels as f32);
        let scale = (self.rect.width() / width).min(self.rect.height() / height);
        let size = vec2(width, height) * scale;
        // A panel is whole points, its picture whole pixels: less than that is no other shape.
        let same = (self.rect.size() - size).abs().max_elem() < 2.0;
        match same {
            true => *self,
            false => Self { rect: Rect::from_center_size(self.rect.center(), size) },
        }
    }

    fn panel(&self) -> DVec2 {
        DVec2::new(self.rect.width().into(), self.rect.height().into())
    }

    /// Screen position of a point of the world, with `camera`.
    pub(super) fn project(&self, camera: &Camera, point: DVec3) -> Option<egui::Pos2> {
        let at = camera.project(self.panel(), point)?;
        Some(self.rect.min + vec2(at.x as f32, at.y as f32))
    }

    /// The ray through a screen position, with `camera`.
    pub(super) fn ray(&self, camera: &Camera, at: egui::Pos2) -> Ray {
        let off = at - self.rect.min;
        camera.ray(self.panel(), DVec2::new(off.x.into(), off.y.into()))
    }

    /// The view of the anatomy to be pictured here; `scale`: pixels per point.
    pub(super) fn look(&self, model: &Model, state: &View3dPanel, scale: f32) -> Look {
        let pixels = self.panel() * f64::from(scale);
        let detail = state.detail(pixels.x * pixels.y, Instant::now());
        let size = (pixels * detail).round().max(DVec2::ONE);
        let mut sight = model.view3d.sight([size.x as u32, size.y as u32]);
        sight.cut = model.view3d.cuts(&model.pose);
        Look { sight, camera: model.view3d.camera }
    }
}

/// Width of the view in a room of `width` points of which it is to have `share`; none where both parts would be too
/// narrow.
pub(super) fn width(width: f32, share: f32) -> Option<f32> {
    let most = (width - LEAST).floor();
    (most >= LEAST).then(|| (width * share).floor().clamp(LEAST, most))
}

/// Lets the pointer drag the edge between the image and a view of `width` points at the right of `room`; a double click
/// puts it back.
pub(super) fn divide(ui: &Ui, room: Rect, width: f32, share: &mut f32) {
    let edge = room.right() - width;
    let grip = Rect::from_x_y_ranges(edge - GRIP..=edge + GRIP, room.y_range());
    let response = ui.interact(grip, Id::new("divider"), Sense::click_and_drag());
    let response = response.on_hover_and_drag_cursor(CursorIcon::ResizeHorizontal);
    if let Some(at) = response.interact_pointer_pos().filter(|_| response.dragged()) {
        *share = ((room.right() - at.x) / room.width()).clamp(0.0, 1.0);
    }
    if response.double_clicked() {
        *share = USUAL;
    }
    if response.hovered() || response.dragged() {
        ui.painter().vline(edge, room.y_range(), Stroke::new(2.0, style::ACCENT));
    }
}

impl Panel for View3dPanel {
    fn row(&self) -> &'static Row {
        &ROW
    }

    fn follow(&mut self, _ctx: &Context, _desk: &mut Desk<'_>) {
        self.place = None;
    }

    /// Draws everything over the picture, and moves the camera.
    fn show(&mut self, ui: &mut Ui, desk: &mut Desk<'_>) {
        let (model, pictured) = (&mut *desk.model, desk.seen.pictured);
        let place = Place { rect: ui.max_rect() };
        let id = ui.id().with("view3d");
        let response = ui.interact(place.rect, id, Sense::click_and_drag());
        if response.secondary_clicked()
            && let Some(at) = response.interact_pointer_pos()
        {
            self.asked = Some((at, place.ray(&model.view3d.camera, at)));
        }
        let before = model.view3d.camera;
        if !hold::show(ui, &response, &place, model, &mut self.hold) {
            navigate(ui, &response, &place, &mut model.view3d.camera);
        }
        self.watch(ui, model, before != model.view3d.camera);
        let painter = ui.painter_at(place.rect);
        if let Some(pictured) = pictured {
            fan::show(&painter, &place.of(pictured), pictured, &model.view3d.wires);
        } else {
            let (middle, font) = (place.rect.center(), FontId::proportional(14.0));
            let text = "Preparing the 3D view";
            painter.text(middle, Align2::CENTER_CENTER, text, font, style::FAINT);
        }
        let edge = Stroke::new(1.0, egui::Color32::from_gray(48));
        painter.vline(place.rect.left(), place.rect.y_range(), edge);
        let below = place.rect.left_bottom() + vec2(10.0, -8.0);
        let hint = match model.hold.is_some() {
            _ if model.view3d.cut && !model.view3d.cuts(&model.pose) => {
                "looked at along the image plane nothing can be cut: drag to turn"
            }
            true => {
                "skin: press and drag slides, Shift leans, Ctrl+wheel rotates; right drag: turn"
            }
            false => "drag: turn    Shift+drag: move    wheel: nearer, farther",
        };
        let font = FontId::proportional(10.0);
        painter.text(below, Align2::LEFT_BOTTOM, hint, font, style::FAINT);
        compass::show(ui, &place, &mut model.view3d);
        buttons(ui, &place, model, self);
        if self.tissues && !model.examined {
            tissues::show(ui, place.rect, &mut model.view3d.shown);
        }
        self.place = Some(place);
    }
}

fn navigate(ui: &Ui, response: &Response, place: &Place, camera: &mut Camera) {
    let panel = place.panel();
    let delta = response.drag_delta();
    let by = DVec2::new(delta.x.into(), delta.y.into());
    let shift = ui.input(|input| input.modifiers.shift);
    if response.dragged_by(PointerButton::Middle)
        || (shift && response.dragged_by(PointerButton::Primary))
    {
        camera.pan(panel, by);
    } else if response.dragged() {
        camera.orbit(panel, by);
    }
    if response.hovered() {
        let (wheel, pinch) = ui.input(|input| (input.smooth_scroll_delta.y, input.zoom_delta()));
        let wheel = f64::from(wheel) / NOTCH;
        // A pinch to twice the size halves the distance: six steps and a half.
        let pinch = f64::from(pinch).ln() / (1.0f64 / 0.9).ln();
        camera.zoom(wheel + pinch);
    }
}

fn buttons(ui: &mut Ui, place: &Place, model: &mut Model, state: &mut View3dPanel) {
    let at = place.rect.left_top() + vec2(10.0, 8.0);
    let room = Rect::from_min_max(at, pos2(place.rect.right() - 8.0, at.y + 24.0));
    let pose = model.pose;
    ui.scope_builder(egui::UiBuilder::new().max_rect(room), |ui| {
        ui.horizontal_wrapped(|ui| {
            ui.spacing_mut().item_spacing.x = 4.0;
            ui.toggle_value(&mut state.tissues, "Tissues")
                .on_hover_text("Which tissues are shown, and which as glass");
            ui.toggle_value(&mut model.view3d.cut, "Cut")
                .on_hover_text("Cut away what lies between the eye and the image plane");
            ui.separator();
            if button(ui, "Front", "Look at the image plane as the B-mode image shows it") {
                model.view3d.camera.face(&pose);
            }
            if button(ui, "Along", "Look along the probe into the body") {
                model.view3d.camera.along(&pose);
            }
            if button(ui, "Reset", "Probe and fan from the side, all of them in view") {
                model.view3d.reset(&pose, &model.settings.probe);
            }
            hold::button(ui, model);
        });
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slow_device_is_coarse_while_the_eye_moves_and_a_quick_one_fine() {
        let now = Instant::now();
        let detail = |moving: [bool; 2], ms: f64| {
            let state = View3dPanel {
                moving: moving.map(|moves| moves.then_some(now + REST)),
                pixel_ms: ms / 1e5,
                budget_ms: 100.0,
                ..View3dPanel::default()
            };
            state.detail(1e5, now)
        };
        let (eye, anatomy, rest) = ([true, false], [false, true], [false; 2]);
        assert_eq!(detail(rest, 500.0), 1.0);
        assert_eq!(detail(rest, 50.0), 2.0);
        assert_eq!(detail(rest, 0.0), 1.0, "not measured yet");
        assert_eq!(detail(eye, 5000.0), COARSEST);
        assert_eq!(detail(eye, 500.0), 1.0 / 3.0);
        assert_eq!(detail(eye, 100.0), 0.5);
        assert_eq!(detail(eye, 50.0), 1.0);
        assert_eq!(detail(eye, 1.0), 2.0);
        // A fifth of an image's 100 ms, whether the camera moves or not.
        assert_eq!(detail([true; 2], 60.0), 0.5);
        assert_eq!(detail(anatomy, 20.0), 1.0);
        assert_eq!(detail(anatomy, 60.0), 0.5);
        assert_eq!(detail(anatomy, 500.0), COARSEST);
    }

    #[test]
    fn at_rest_a_picture_stays_as_fine_as_it_is() {
        let now = Instant::now();
        let mut state = View3dPanel::default();
        // About 60 ms, from which on pictures at rest have four times the pixels.
        let details = [59.0, 62.0, 55.0, 70.0, 59.0].map(|ms| {
            state.took(ms / 1e5);
            state.detail(1e5, now)
        });
        assert_eq!(details, [2.0; 5]);
        state.took(200.0 / 1e5);
        assert_eq!(state.detail(1e5, now), 1.0);
    }

    #[test]
    fn the_target_of_the_camera_is_in_the_middle() {
        let place = Place { rect: Rect::from_min_size(pos2(300.0, 20.0), vec2(400.0, 500.0)) };
        let camera = Camera::front(&glam::DAffine3::IDENTITY, DVec3::X, 50.0);
        let seen = place.project(&camera, DVec3::X).expect("in front");
        assert!((seen - place.rect.center()).length() < 1e-3);
    }

    #[test]
    fn there_is_no_view_where_there_is_no_room() {
        assert_eq!(width(479.0, 0.5), None);
        assert_eq!(width(945.0, 0.5), Some(472.0));
        // Neither part becomes too narrow.
        assert_eq!(width(945.0, 0.0), Some(240.0));
        assert_eq!(width(945.0, 1.0), Some(705.0));
    }
}
