//! Badges over the image: the tracker is lost, the probe's trajectory is being recorded.

use std::time::{Duration, Instant};

use egui::{
    Align2, Area, Color32, FontId, Frame, Id, LayerId, Order, Rect, RichText, ScrollArea, Sense,
    Ui, vec2,
};

use super::inputs::Inputs;
use super::model::{Model, age};
use super::panel::Common;
use super::style;
use crate::igtl::TrackerState;

/// Room for the texts on both sides, points.
const TEXTS: f32 = 300.0;

/// Draws the warning that the tracker is lost: the probe is not at its tool's place. A click takes it away until the tracker
/// is lost again.
pub(super) fn show(ui: &Ui, inputs: &mut Inputs) {
    let Some(TrackerState::Lost(pose)) = inputs.report.as_ref().map(|report| &report.tracked)
    else {
        return;
    };
    if inputs.dismissed == Some(pose.number) {
        return;
    }
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
    let response = ui.interact(badge, Id::new("tracker lost"), Sense::click());
    if response.on_hover_text("Click to take this away until the tracker is lost again").clicked() {
        inputs.dismissed = Some(pose.number);
    }
}

/// Draws the work that the next image waits for, over the gallery, which stands in the middle at the first start.
pub(super) fn preparing(ui: &Ui, what: &str) {
    let painter = ui.ctx().layer_painter(LayerId::new(Order::Foreground, Id::new("preparing")));
    let area = ui.max_rect();
    let words = painter.layout_no_wrap(what.to_owned(), FontId::proportional(14.0), style::TEXT);
    let badge =
        Rect::from_center_size(area.center_top() + vec2(0.0, 74.0), words.size() + vec2(20.0, 8.0));
    painter.rect_filled(badge, 4.0, Color32::from_black_alpha(210));
    let at = Align2::CENTER_CENTER.align_size_within_rect(words.size(), badge);
    painter.galley(at.min, words, style::TEXT);
}

/// Draws a red sign beside the word for live or frozen while the probe's trajectory is being recorded.
pub(super) fn recording(ui: &Ui, model: &Model, now: Instant) {
    let Some(recorder) = &model.trajectory.recorder else {
        return;
    };
    let (painter, area) = (ui.painter(), ui.max_rect());
    let text = format!("REC {:.0} s", recorder.seconds(now).floor());
    let font = FontId::proportional(15.0);
    let corner = area.right_top() + vec2(-76.0, 8.0);
    let words = painter.text(corner, Align2::RIGHT_TOP, text, font, style::RED);
    painter.circle_filled(words.left_center() - vec2(11.0, 0.0), 5.0, style::RED);
    // The seconds count on while nothing else is drawn.
    ui.ctx().request_repaint_after(Duration::from_secs(1));
}

/// Draws the reason why the scene's files, which have changed, cannot be used, at the image's lower edge.
pub(super) fn stale(ui: &Ui, problem: Option<&str>) {
    let Some(problem) = problem else { return };
    let what = "The scene's files have changed and cannot be used; the image goes on as it was:";
    badge(ui, "stale", what, problem);
}

/// Draws what is not possible, and why, at the image's lower edge.
pub(super) fn badge(ui: &Ui, id: &str, what: &str, why: &str) {
    let area = ui.max_rect();
    Area::new(Id::new(id))
        .pivot(Align2::CENTER_BOTTOM)
        .fixed_pos(area.center_bottom() - vec2(0.0, 60.0))
        .constrain_to(area)
        .show(ui.ctx(), |ui| {
            Frame::popup(ui.style()).show(ui, |ui| {
                ui.set_max_width(440.0);
                ui.label(what);
                ui.label(RichText::new(why).color(style::WARN));
            });
        });
}

/// Lists what is suspicious about the scene, where that is wanted.
pub(super) fn warnings(ctx: &egui::Context, common: &mut Common) {
    let Common { warnings, warned, .. } = common;
    style::window("Warnings", 64.0).open(warned).show(ctx, |ui| {
        ui.set_max_width(460.0);
        ScrollArea::vertical().max_height(300.0).show(ui, |ui| {
            for warning in warnings.iter() {
                ui.label(RichText::new(warning).color(style::WARN));
            }
        });
    });
}

#[cfg(test)]
mod tests {
    use egui::{CentralPanel, Context, RawInput, Shape, Window};

    use super::*;

    /// Number of the shape with this text, in the order in which they are drawn, and where it lies.
    fn text(shapes: &[egui::epaint::ClippedShape], wanted: &str) -> Option<(usize, Rect)> {
        shapes.iter().enumerate().find_map(|(n, clipped)| match &clipped.shape {
            Shape::Text(text) if text.galley.text() == wanted => {
                Some((n, text.visual_bounding_rect()))
            }
            _ => None,
        })
    }

    #[test]
    fn what_the_first_image_waits_for_is_read_over_the_gallery() {
        let context = Context::default();
        let screen = Rect::from_min_size(egui::Pos2::ZERO, vec2(640.0, 400.0));
        let mut shapes = Vec::new();
        // Windows are measured in the first pass.
        for _ in 0..3 {
            let input = RawInput { screen_rect: Some(screen), ..RawInput::default() };
            let mut drawn = context.run_ui(input, |ui| {
                CentralPanel::default().show(ui, |ui| preparing(ui, "compiling"));
                let middle = Window::new("gallery").anchor(Align2::CENTER_CENTER, [0.0, 0.0]);
                middle.show(ui.ctx(), |ui| {
                    ui.allocate_space(vec2(600.0, 340.0));
                    ui.label("scenes");
                });
            });
            drawn.textures_delta.clear();
            shapes = std::mem::take(&mut drawn.shapes);
        }
        let (above, badge) = text(&shapes, "compiling").expect("it is drawn");
        let (below, _) = text(&shapes, "scenes").expect("the gallery is drawn");
        assert!(above > below && screen.contains_rect(badge), "{above} {below} {badge}");
    }
}
