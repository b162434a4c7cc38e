//! The cine bar: freeze, and the loop of the last images.

use std::time::Instant;

use egui::{Align, CornerRadius, Layout, Rect, Response, Sense, Shape, Stroke, Ui, pos2, vec2};

use super::captures::Format;
use super::model::{Cine, Model};
use super::picture::Frame;
use super::style::{self, button};
use super::tools::Tools;

/// Height of the bar, points.
pub(super) const HEIGHT: f32 = 36.0;
/// Room for speed and marks beside the track, points.
const WIDE: f32 = 366.0;
/// Speeds at which a loop can be played.
const SPEEDS: [f64; 4] = [0.25, 0.5, 1.0, 2.0];

/// Draws the bar into the rest of a row.
pub(super) fn show(ui: &mut Ui, model: &mut Model, tools: &mut Tools, now: Instant) {
    let cine = &mut tools.cine;
    let word = if model.frozen { "Live" } else { "Freeze" };
    let tip = "Stop or start the image and the scene's time (Space)";
    let button = egui::Button::new(word).selected(model.frozen);
    if ui.add(button).on_hover_text(tip).clicked() {
        model.freeze(!model.frozen, now);
    }
    if cine.is_empty() {
        return;
    }
    if !model.frozen {
        let span = cine.time_between(0, cine.len() - 1).as_secs_f64();
        let text = format!("loop: {} images, {span:.1} s", cine.len());
        let tip = "What was imaged last, to be looked through after Freeze";
        ui.colored_label(style::FAINT, text).on_hover_text(tip);
        return;
    }
    player(ui, cine, &mut tools.format, now);
}

fn player(ui: &mut Ui, cine: &mut Cine<Frame>, format: &mut Format, now: Instant) {
    let (word, tip) = match cine.is_playing() {
        true => ("⏸", "Stop the loop (Enter)"),
        false => ("▶", "Play the loop (Enter)"),
    };
    if button(ui, word, tip) {
        cine.play(!cine.is_playing(), now);
    }
    if button(ui, "<", "One image back (,)") {
        cine.step(-1);
    }
    if button(ui, ">", "One image on (.)") {
        cine.step(1);
    }
    let is_wide = ui.available_width() > WIDE;
    ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
        if is_wide {
            choose(ui, cine, format);
            speed(ui, cine, now);
            let here = cine.cursor();
            if button(ui, "]", "The loop that plays and is saved ends with this image") {
                cine.mark_last(here);
            }
            if button(ui, "[", "The loop that plays and is saved begins with this image") {
                cine.mark_first(here);
            }
        }
        let (cursor, last) = (cine.cursor(), cine.len() - 1);
        let back = cine.time_between(cursor, last).as_secs_f64();
        // Zero has no sign.
        let text = format!("{} / {}   {:.2} s", cursor + 1, cine.len(), 0.0 - back);
        // A fixed width, the greatest, so that the track stands still.
        ui.add_sized(vec2(118.0, 18.0), egui::Label::new(text))
            .on_hover_text("Image of the loop; time before the newest");
        track(ui, cine);
    });
}

fn speed(ui: &mut Ui, cine: &mut Cine<Frame>, now: Instant) {
    let mut speed = cine.speed();
    style::choice(ui, "speed", 58.0, &mut speed, &SPEEDS, |speed| format!("x {speed}"))
        .on_hover_text("How fast the loop plays; 1 is the pace at which it was imaged");
    if speed != cine.speed() {
        cine.set_speed(speed, now);
    }
}

/// Bytes of the marked part of the loop as DICOM, which is not compressed.
fn uncompressed(cine: &Cine<Frame>) -> u64 {
    let (mut count, mut most, mut values) = (0, 0, 1);
    for (frame, _) in cine.marked() {
        let [width, height, _] = frame.image.extent();
        count += 1;
        most = most.max(u64::from(width) * u64::from(height));
        if frame.coloured.is_some() {
            values = 3;
        }
    }
    count * most * values
}

fn choose(ui: &mut Ui, cine: &Cine<Frame>, format: &mut Format) {
    let name = |format| match format {
        Format::Gif => "GIF".to_owned(),
        Format::Mp4 => "MP4".to_owned(),
        Format::Sequence => "PNGs".to_owned(),
        Format::Dicom => "DICOM".to_owned(),
    };
    let mega = uncompressed(cine).div_ceil(1_000_000);
    let tip = format!(
        "How a clip is saved (F3): an animated GIF, an MP4 film (the program ffmpeg makes it), a folder of PNG \
               files, or DICOM (uncompressed: {mega} MB of what is marked); with DICOM chosen, a still (F2) is saved as DICOM \
               beside its PNG, too"
    );
    let all = [Format::Gif, Format::Mp4, Format::Sequence, Format::Dicom];
    style::choice(ui, "format", 56.0, format, &all, name).on_hover_text(tip);
}

/// The track: one place per image; a drag looks through them.
fn track(ui: &mut Ui, cine: &mut Cine<Frame>) {
    let size = vec2(ui.available_width().max(40.0), HEIGHT - 12.0);
    let (rect, response) = ui.allocate_exact_size(size, Sense::click_and_drag());
    let bar = rect.shrink2(vec2(6.0, 8.0));
    scrub(&response, bar, cine);
    let last = cine.len() - 1;
    let x = |index: usize| {
        let share = index as f32 / last.max(1) as f32;
        bar.left() + share * bar.width()
    };
    let painter = ui.painter();
    painter.rect_filled(bar, CornerRadius::same(2), style::BACK);
    let [first, end] = cine.marks().map(x);
    let part = Rect::from_x_y_ranges(first..=end, bar.y_range());
    let dim = style::ACCENT.gamma_multiply(0.35);
    painter.rect_filled(part, CornerRadius::same(2), dim);
    for (at, inward) in [(first, 5.0), (end, -5.0)] {
        let top = pos2(at, bar.top() - 4.0);
        let corners = vec![top, top + vec2(inward, 0.0), pos2(at, bar.bottom())];
        painter.add(Shape::convex_polygon(corners, style::ACCENT, Stroke::NONE));
    }
    let at = x(cine.cursor());
    let line = Stroke::new(2.0, style::TEXT);
    painter.vline(at, bar.y_range().expand(5.0), line);
    response.on_hover_text("Drag to look through the loop; , and . step by one image");
}

fn scrub(response: &Response, bar: Rect, cine: &mut Cine<Frame>) {
    let held = response.is_pointer_button_down_on() || response.clicked();
    if let (true, Some(at)) = (held, response.interact_pointer_pos()) {
        let share = ((at.x - bar.left()) / bar.width()).clamp(0.0, 1.0);
        let index = (share * (cine.len() - 1) as f32).round() as usize;
        if index != cine.cursor() || cine.is_playing() {
            cine.seek(index);
        }
    }
}
