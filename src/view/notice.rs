//! The warning over the image that the tracker is lost.

use egui::{Align2, Color32, FontId, Rect, Ui, vec2};

use super::inputs::Inputs;
use super::model::age;
use super::style;
use crate::igtl::TrackerState;

/// Room for the texts on both sides, points.
const TEXTS: f32 = 300.0;

/// Draws the warning that the tracker is lost: the probe is not at its tool's place.
pub(super) fn show(ui: &Ui, inputs: &Inputs) {
    let Some(TrackerState::Lost(pose)) = inputs.report.as_ref().map(|report| &report.tracked)
    else {
        return;
    };
    let (since, _) = age(pose.arrived.elapsed());
    let text = format!("TRACKER LOST: {}, {since} ago", pose.device.text());
    let (painter, area) = (ui.painter(), ui.max_rect());
    let font = FontId::proportional(14.0);
    let words = painter.layout_no_wrap(text, font, Color32::BLACK);
    let size = words.size() + vec2(20.0, 8.0);
    // Between title and state, in the margin over the image; below them where there is no room.
    let top = if area.width() > size.x + 2.0 * TEXTS { 14.0 } else { 60.0 };
    let centre = area.center_top() + vec2(0.0, top + size.y / 2.0);
    let badge = Rect::from_center_size(centre, size);
    painter.rect_filled(badge, 4.0, style::WARN);
    let at = Align2::CENTER_CENTER.align_size_within_rect(words.size(), badge);
    painter.galley(at.min, words, Color32::BLACK);
}
