//! Three planes through the acquired volume with the outlines of the meshes, in place of the 3D view:
//! the pointer moves volume or model.

use egui::{
    Align2, Color32, ColorImage, FontId, Painter, PointerButton, Pos2, Rect, Response, Sense,
    Shape, Stroke, TextureHandle, TextureOptions, Ui, pos2, vec2,
};
use glam::{DAffine3, DVec3};

use super::model::registration::{Outline, Plane, Registration};
use super::model::{Model, Settings};
use super::panel::{Desk, Dock, Panel, Row};
use super::style::{self, button};
use crate::scene::Display;

/// Points of a wheel's turn that move the planes on by a pixel.
const NOTCH: f32 = 8.0;
/// Height of the row of buttons above the planes, points.
const BAR: f32 = 30.0;
/// Colour outside the volume.
const OUTSIDE: Color32 = Color32::from_rgb(10, 22, 40);
/// Colours of the outlines of masks, and of other meshes.
const LINES: [Color32; 2] =
    [Color32::from_rgb(255, 200, 60), Color32::from_rgba_premultiplied(22, 46, 52, 60)];

/// Its row in the list of panels.
pub(super) const ROW: Row = Row {
    name: "Planes",
    tip: "Three planes through the acquired volume, in place of the 3D view",
    key: Some((egui::Key::G, "G")),
    dock: Dock::Beside,
    has_button: true,
};

/// The planes.
#[derive(Default)]
pub(super) struct Planes {
    /// Pictures of the three planes, with the inputs that they were made from.
    pictures: [Option<Picture>; 3],
}

/// One plane's picture.
struct Picture {
    of: Key,
    texture: TextureHandle,
    outlines: Vec<Outline>,
}

/// All inputs of a plane's picture.
#[derive(Clone, PartialEq)]
struct Key {
    volume: Option<Display>,
    model: DAffine3,
    seconds: f64,
    middle: DVec3,
    size: [usize; 2],
    pitch: f64,
}

impl Panel for Planes {
    fn row(&self) -> &'static Row {
        &ROW
    }

    fn is_offered(&self, model: &Model) -> bool {
        model.registration.is_some()
    }

    /// Draws the planes, one below the other.
    fn show(&mut self, ui: &mut Ui, desk: &mut Desk<'_>) {
        let Desk { model, common, seen } = desk;
        let now = seen.now;
        let room = ui.max_rect();
        ui.painter_at(room).rect_filled(room, 0.0, style::BACK);
        let Some(mut registration) = model.registration.take() else {
            return;
        };
        let before = model.settings.clone();
        let seconds = model.clock.at(now);
        registration.follow(&model.settings, seconds);
        if buttons(ui, room, &mut registration) {
            common.open.set(&ROW, false);
        }
        let top = room.top() + BAR;
        let height = ((room.bottom() - top) / 3.0).floor();
        for (number, plane) in Plane::ALL.iter().enumerate() {
            let corner = pos2(room.left(), top + number as f32 * height);
            let rect = Rect::from_min_size(corner, vec2(room.width(), height - 1.0));
            let pitch = registration.extent / f64::from(rect.width().min(rect.height()));
            let scale = ui.ctx().pixels_per_point();
            let key = Key {
                volume: model.settings.volume,
                model: model.settings.model,
                seconds,
                middle: registration.middle,
                size: [rect.width(), rect.height()].map(|x| (x * scale).max(1.0) as usize),
                pitch: pitch / f64::from(scale),
            };
            let picture = &mut self.pictures[number];
            if picture.as_ref().is_none_or(|p| p.of != key) {
                *picture = Some(make(ui, plane, &registration, key));
            }
            if let Some(picture) = picture {
                draw(&ui.painter_at(rect), rect, plane, picture, &registration, pitch);
            }
            let response = ui.interact(rect, ui.id().with(plane.name), Sense::click_and_drag());
            act(ui, &response, rect, plane, &mut registration, &mut model.settings, pitch);
        }
        model.registration = Some(registration);
        model.note(&before, now);
    }

    fn leave(&mut self) {
        *self = Self::default();
    }

    fn lose(&mut self) {
        *self = Self::default();
    }
}

/// Draws the buttons; returns whether the planes are to be closed.
fn buttons(ui: &mut Ui, room: Rect, registration: &mut Registration) -> bool {
    let mut closes = false;
    let at = room.left_top() + vec2(10.0, 6.0);
    let line = Rect::from_min_max(at, pos2(room.right() - 8.0, at.y + 22.0));
    ui.scope_builder(egui::UiBuilder::new().max_rect(line), |ui| {
        ui.horizontal(|ui| {
            if button(ui, "To the mask", "Let the planes meet in the middle of the masks") {
                registration.centre();
            }
            closes = button(ui, "Close", "Back to the 3D view");
            let hint = "drag: move  Shift: turn  Ctrl: scale  right: meeting point  wheel: through";
            let hint = egui::RichText::new(hint).size(10.0).color(style::FAINT);
            // A view wider than its panel would lie over the image.
            ui.add(egui::Label::new(hint).truncate());
        });
    });
    closes
}

/// Makes a plane's picture: samples the volume and cuts the meshes.
fn make(ui: &Ui, plane: &Plane, registration: &Registration, key: Key) -> Picture {
    let levels = registration.slice(plane, key.size, key.pitch);
    let colours = levels.into_iter().map(|level| level.map_or(OUTSIDE, Color32::from_gray));
    let image = ColorImage::new(key.size, colours.collect());
    let texture = ui.ctx().load_texture(plane.name, image, TextureOptions::NEAREST);
    let reach = key.pitch * key.size[0].max(key.size[1]) as f64;
    Picture { texture, outlines: registration.outlines(plane, reach), of: key }
}

fn draw(
    painter: &Painter,
    rect: Rect,
    plane: &Plane,
    picture: &Picture,
    registration: &Registration,
    pitch: f64,
) {
    let whole = Rect::from_min_max(Pos2::ZERO, pos2(1.0, 1.0));
    painter.image(picture.texture.id(), rect, whole, Color32::WHITE);
    let middle = rect.center();
    let place = |p: [f64; 2]| middle + vec2((p[0] / pitch) as f32, (p[1] / pitch) as f32);
    let scene = registration.scene();
    // Masks over the other meshes.
    for masks in [false, true] {
        let colour = LINES[usize::from(!masks)];
        for outline in picture.outlines.iter().filter(|o| scene.is_mask(o.instance) == masks) {
            let pieces = outline.pieces.iter().map(|piece| piece.map(place));
            let stroke = Stroke::new(if masks { 1.5 } else { 1.0 }, colour);
            painter.extend(pieces.map(|ends| Shape::line_segment(ends, stroke)));
        }
    }
    let cross = Stroke::new(1.0, style::ACCENT.gamma_multiply(0.5));
    painter.hline(rect.x_range(), middle.y, cross);
    painter.vline(middle.x, rect.y_range(), cross);
    let font = FontId::proportional(11.0);
    let corner = rect.left_top() + vec2(8.0, 4.0);
    painter.text(corner, Align2::LEFT_TOP, plane.name, font, style::TEXT);
    painter.hline(rect.x_range(), rect.bottom(), Stroke::new(1.0, Color32::from_gray(48)));
}

/// Handles the pointer in a plane.
fn act(
    ui: &Ui,
    response: &Response,
    rect: Rect,
    plane: &Plane,
    registration: &mut Registration,
    settings: &mut Settings,
    pitch: f64,
) {
    let [right, down] = plane.axes;
    let in_plane = |v: egui::Vec2| (right * f64::from(v.x) + down * f64::from(v.y)) * pitch;
    let middle = rect.center();
    let pointer = response.interact_pointer_pos();
    if let Some(at) = pointer.filter(|_| response.is_pointer_button_down_on()) {
        let by = response.drag_delta();
        let modifiers = ui.input(|input| input.modifiers);
        let [before, after] = [at - by - middle, at - middle];
        if ui.input(|input| input.pointer.button_down(PointerButton::Secondary)) {
            registration.middle += in_plane(after);
        } else if by != egui::Vec2::ZERO && response.dragged_by(PointerButton::Primary) {
            if modifiers.shift {
                let angle = f64::from(after.angle() - before.angle());
                registration.turn(settings, plane.normal(), angle);
            } else if modifiers.command {
                // Away from the middle is larger; near it every point would be a large factor.
                let lengths = [after, before].map(|v| f64::from(v.length().max(20.0)));
                registration.scale(settings, lengths[0] / lengths[1]);
            } else {
                registration.shift(settings, in_plane(by));
            }
        }
    }
    if response.hovered() {
        let (wheel, zoom) = ui.input(|input| (input.smooth_scroll_delta.y, input.zoom_delta()));
        if zoom != 1.0 {
            registration.zoom(f64::from(zoom).recip());
        } else if wheel != 0.0 {
            registration.middle += plane.normal() * f64::from(wheel / NOTCH) * pitch;
        }
    }
}
