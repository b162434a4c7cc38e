//! The image with marked acquired pixels, with the tissues in colours, or with what flows, and its legend.

use egui::{Align2, Color32, FontId, Rect, pos2, vec2};

use super::model::Model;
use super::model::real::COLOUR;
use super::picture::Frame;
use super::style;
use crate::gpu::Image;
use crate::scene::palette;

/// Distance of the legends from the upper edge, below the texts there, points.
const LEGEND: f32 = 64.0;

/// The image of a frame to be shown.
pub(super) fn image<'f>(frame: &'f Frame, model: &Model) -> &'f Image {
    let coloured = frame.coloured.as_ref().filter(|_| model.colour.is_some());
    let painted = frame.painted.as_ref().filter(|_| model.layer.shown);
    let tinted = frame.tinted.as_ref().filter(|_| model.real.shown);
    coloured.map(|coloured| &coloured.image).or(painted).or(tinted).unwrap_or(&frame.image)
}

/// Draws the colours of the tissues of meshes and background below each other at the upper right of `area`.
pub(super) fn tissues(painter: &egui::Painter, area: Rect, frame: &Frame, model: &Model) {
    if !model.layer.shown || frame.painted.is_none() {
        return;
    }
    let used = |index: &usize| {
        *index == model.background || model.meshes.iter().any(|m| m.tissue == *index)
    };
    let mut y = area.top() + LEGEND;
    for index in (0..frame.settings.tissues.len()).filter(used) {
        let name = &frame.settings.tissues[index].name;
        let at = pos2(area.right() - 12.0, y);
        let font = FontId::proportional(12.0);
        let place = painter.text(at, Align2::RIGHT_CENTER, name, font, style::TEXT);
        let [r, g, b] = palette::look(name, index).0;
        let swatch = Rect::from_min_size(pos2(place.left() - 20.0, y - 5.0), vec2(15.0, 10.0));
        painter.rect_filled(swatch, 2.0, Color32::from_rgb(r, g, b));
        y += 16.0;
        // As many as have room.
        if y > area.bottom() {
            break;
        }
    }
}

/// Grey level of the legend's samples.
const GREY: u8 = 110;

/// Draws the meaning of the colours at the upper right of `area`; where nothing is coloured, the reason.
pub(super) fn legend(painter: &egui::Painter, area: Rect, frame: &Frame, model: &Model) {
    if !model.real.shown || model.layer.shown {
        return;
    }
    let font = FontId::proportional(12.0);
    let mut right = area.right() - 12.0;
    let y = area.top() + LEGEND;
    // From the right, below the texts there.
    let text = |x: f32, words: &str| {
        let at = pos2(x, y);
        painter.text(at, Align2::RIGHT_CENTER, words, font.clone(), style::TEXT)
    };
    if frame.tinted.is_none() {
        let words = match frame.settings.fusion {
            Some(_) => "no pixel is acquired",
            None => "all pixels are simulated: there is no acquired volume",
        };
        text(right, words);
        return;
    }
    let [r, g, b] = COLOUR;
    let share = model.real.opacity as f32;
    let over = |grey: u8| {
        let mix = |c: u8| (f32::from(grey) + share * (f32::from(c) - f32::from(grey))) as u8;
        Color32::from_rgb(mix(r), mix(g), mix(b))
    };
    for (colour, words) in [(Color32::from_gray(GREY), "simulated"), (over(GREY), "acquired")] {
        let place = text(right, words);
        let swatch = pos2(place.left() - 20.0, y - 5.0);
        painter.rect_filled(Rect::from_min_size(swatch, vec2(15.0, 10.0)), 2.0, colour);
        right = swatch.x - 10.0;
    }
}
