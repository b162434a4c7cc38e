//! The image with its marks, as it is saved: at its own size, with what a scanner writes around it, the measurements beside it
//! and nothing that is pressed, whatever the window looks like.

use std::sync::Arc;

use egui::{Context, Pos2, RawInput, Rect, Ui, UiBuilder, Vec2, pos2, vec2};

use super::model::Model;
use super::model::sheet::{Sheet, What};
use super::picture::Frame;
use super::place::{self, Place};
use super::state::State;
use super::{bmode, body, calipers, ecg, mmode, real, spectrum, style};
use crate::gpu::{Device, GpuError, InterfaceFrame, PlacedImage, Screenshot, picture};
use crate::settings::Exam;

/// Width of the column of measurements, points.
const TABLE: f32 = 250.0;
/// Height of the electrocardiogram below the image, points.
const TRACE: f32 = 56.0;
/// Height of an image, pixels, above which texts and marks grow with it.
const USUAL: f32 = 800.0;

/// The parts of a picture, points.
struct Parts {
    /// The image with what is written around it, and the one that is held beside it.
    images: Rect,
    /// The measurements.
    table: Rect,
    whole: Vec2,
}

impl Parts {
    /// Room for images of `texels` points.
    fn of(texels: Vec2, dual: bool, measured: bool, trace: bool) -> Self {
        let one = place::around(texels);
        let images = vec2(one.x * if dual { 2.0 } else { 1.0 }, one.y);
        let images = Rect::from_min_size(Pos2::ZERO, images);
        let low = images.bottom() + if trace { TRACE } else { 0.0 };
        let right = images.right() + if measured { TABLE } else { 0.0 };
        let table = Rect::from_min_max(pos2(images.right(), 0.0), pos2(right, low));
        Self { images, table, whole: vec2(right, low) }
    }
}

/// The picture of an image with its marks, and of the one that is held beside it.
///
/// # Errors
/// Those of [`picture`].
pub(super) fn marked(
    device: &Arc<Device>,
    model: &mut Model,
    state: &mut State,
    frame: &Frame,
) -> Result<Screenshot, GpuError> {
    let [width, height, _] = frame.image.extent().map(|texels| texels as f32);
    let scale = (height / USUAL).max(1.0);
    let kind = model.settings.imaging.exam;
    let is_measured = model.sheet.marks().iter().any(|m| matches!(m.what, What::Caliper(_)));
    let beats = kind == Exam::Cardiac && model.beat.is_some();
    let parts = Parts::of(vec2(width, height) / scale, state.dual.is_on(), is_measured, beats);
    // An image that leaves no room beside it on this device is made smaller.
    let most = device.limits().max_image_2d as f32;
    let scale = scale.min(most / parts.whole.max_elem());
    let size = (parts.whole * scale).ceil().min(Vec2::splat(most));
    let context = Context::default();
    style::apply(&context);
    context.set_pixels_per_point(scale);
    let (mut own, mut held) = (None, None);
    let mut output = egui::FullOutput::default();
    // Texts have their sizes from the second time on.
    for _ in 0..2 {
        let screen_rect = Some(Rect::from_min_size(Pos2::ZERO, parts.whole));
        output.append(context.run_ui(RawInput { screen_rect, ..RawInput::default() }, |ui| {
            (own, held) = draw(ui, &parts, model, state, frame);
        }));
    }
    let primitives = context.tessellate(output.shapes, scale);
    let images = [
        own.zip(Some(real::image(frame, model))),
        held.zip(state.dual.frame().map(|frame| real::image(frame, model))),
    ];
    let placed: Vec<PlacedImage> = (images.iter().flatten())
        .map(|(place, image)| {
            let sides = |r: Rect| {
                let r = r * scale;
                [r.left(), r.top(), r.right(), r.bottom()]
            };
            let (to, within) = (sides(place.rect), sides(place.room));
            PlacedImage { image, to, within, flipped: place.flipped }
        })
        .collect();
    let interface = InterfaceFrame {
        pixels_per_point: scale,
        primitives: &primitives,
        textures: output.textures_delta,
    };
    picture(device, [size.x as u32, size.y as u32], &placed, interface)
}

/// Draws everything but the images; returns their places.
fn draw(
    ui: &mut Ui,
    parts: &Parts,
    model: &mut Model,
    state: &mut State,
    frame: &Frame,
) -> (Option<Place>, Option<Place>) {
    let kind = model.settings.imaging.exam;
    let mut sheet = Sheet::default();
    sheet.put(model.sheet.all().clone());
    let mut within = ui.new_child(UiBuilder::new().max_rect(parts.images));
    let ui = &mut within;
    let [room, beside] = state.dual.rooms(parts.images);
    let held = state.dual.show(ui, beside, true, model, &state.framing);
    let own = bmode::show(ui, room, frame, false, model, &state.framing);
    if let Some(place) = &own {
        calipers::show(ui, &mut sheet, place, frame, kind, false, true);
        if let Some(mark) = &mut model.body {
            body::show(ui, mark, true);
        }
        if let Some(strip) = &mut model.mmode {
            mmode::aim(ui, place, frame, strip, true);
        }
        if model.spectrum.is_some() {
            spectrum::mark(ui, place, &frame.probe, &model.settings.spectral);
        }
    }
    let below = Rect::from_min_max(parts.images.min, pos2(parts.images.right(), parts.whole.y));
    let below = ui.new_child(UiBuilder::new().max_rect(below));
    let newest = state.common.tools.cine.newest().map(|newest| newest.seconds);
    if let (Some(place), Exam::Cardiac) = (&own, kind) {
        ecg::show(&below, place, frame, newest, model.beat);
    }
    let column = ui.new_child(UiBuilder::new().max_rect(parts.table));
    calipers::table(&column, &mut sheet, kind, frame, true);
    (own, held)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_image_has_its_own_size_and_everything_else_lies_beside_it() {
        for texels in [vec2(1053.0, 800.0), vec2(120.0, 90.0), vec2(300.0, 800.0)] {
            let alone = Parts::of(texels, false, false, false);
            assert_eq!(alone.whole, alone.images.size());
            let all = Parts::of(texels, true, true, true);
            assert_eq!(all.images.size(), alone.images.size() * vec2(2.0, 1.0));
            assert_eq!(all.table.left(), all.images.right());
            assert_eq!(all.whole, all.images.size() + vec2(TABLE, TRACE));
        }
    }
}
