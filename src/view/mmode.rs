//! The M-mode strip below the image, and its scanline in the image.

use egui::{
    Align2, Color32, ColorImage, DragValue, FontId, PointerButton, Rect, Sense, Stroke,
    TextureHandle, TextureOptions, Ui, pos2, vec2,
};

use super::bmode::Place;
use super::engine::Frame;
use super::model::Model;
use super::model::mmode::{ROWS, Span, Strip, nearest_line};
use super::style;

/// Height of the panel, points.
pub(super) const HEIGHT: f32 = 208.0;

/// Widest raster, pixels.
const WIDEST: usize = 1024;

/// Choices for the width of the strip, s.
const WINDOWS: [f64; 5] = [1.0, 2.0, 4.0, 8.0, 16.0];

/// Number of columns below which a strip is too coarse to be read.
const FEW: usize = 40;

/// The state of the panel.
pub(super) struct Panel {
    /// Seconds across the strip.
    window: f64,
    /// The measurement, if any.
    span: Option<Span>,
    /// The strip on the device, and its content: revision, seconds across, pixels across.
    texture: Option<(TextureHandle, (u64, f64, usize))>,
}

impl Default for Panel {
    fn default() -> Self {
        Self { window: 2.0, span: None, texture: None }
    }
}

impl Panel {
    /// Releases the strip's texture: the next strip begins anew.
    pub(super) fn close(&mut self) {
        self.texture = None;
    }
}

/// Opens the strip on the image's middle scanline, or closes it.
pub(super) fn toggle(model: &mut Model, now: std::time::Instant) {
    model.mmode = match model.mmode {
        Some(_) => None,
        None => Some(Strip::new(model.settings.probe.scanlines / 2)),
    };
    model.touch(now);
}

/// Draws the strip and its controls into the panel below the image.
pub(super) fn show(ui: &mut Ui, model: &mut Model, panel: &mut Panel) {
    let (scanlines, frozen) = (model.settings.probe.scanlines, model.frozen);
    let animated = model.animated;
    let Some(strip) = &mut model.mmode else {
        return;
    };
    ui.horizontal_top(|ui| {
        ui.vertical(|ui| {
            ui.set_width(168.0);
            ui.strong("M-mode");
            ui.add_enabled_ui(!frozen, |ui| line(ui, strip, scanlines));
            width(ui, panel);
            measured(ui, panel.span);
            remarks(ui, strip, animated, panel);
        });
        ui.separator();
        let (area, response) = ui.allocate_exact_size(ui.available_size(), Sense::drag());
        let inner = Rect::from_min_max(area.min, area.max - vec2(44.0, 18.0));
        let end = strip.newest().unwrap_or(panel.window).max(panel.window);
        draw(ui, strip, panel, inner, end);
        let Some(depth) = strip.depth() else { return };
        rulers(ui, inner, depth, panel.window, end);
        let at = |[seconds, mm]: [f64; 2]| {
            let x = 1.0 - ((end - seconds) / panel.window) as f32;
            inner.min + inner.size() * vec2(x, (mm / depth) as f32)
        };
        let under = |point: egui::Pos2| {
            let share = (inner.clamp(point) - inner.min) / inner.size();
            let seconds = end - panel.window * f64::from(1.0 - share.x);
            [seconds, depth * f64::from(share.y)]
        };
        if response.drag_started_by(PointerButton::Primary) {
            let origin = ui.input(|i| i.pointer.press_origin());
            panel.span = origin.map(under).map(|from| Span { from, to: from });
        }
        if let (Some(span), Some(point)) = (&mut panel.span, response.interact_pointer_pos()) {
            span.to = under(point);
        }
        response.on_hover_text("Drag from one point to another to measure time and depth");
        if let Some(span) = &panel.span {
            let line = Stroke::new(1.5, style::ACCENT);
            let painter = ui.painter_at(inner);
            painter.line_segment([at(span.from), at(span.to)], line);
            for end in [span.from, span.to] {
                painter.circle_stroke(at(end), 4.0, line);
            }
        }
    });
}

fn line(ui: &mut Ui, strip: &mut Strip, scanlines: u32) {
    ui.horizontal(|ui| {
        ui.label("Line");
        let mut line = strip.line() + 1;
        let drag = DragValue::new(&mut line).range(1..=scanlines).speed(0.3);
        let tip = "Scanline that is drawn; its mark in the image can be dragged, too";
        ui.add(drag).on_hover_text(tip);
        strip.aim(line - 1);
    });
}

fn width(ui: &mut Ui, panel: &mut Panel) {
    ui.horizontal(|ui| {
        ui.label("Width");
        style::choice(ui, ("width", 60.0), &mut panel.window, &WINDOWS, |s| format!("{s} s"))
            .on_hover_text("Time across the strip, s");
    });
}

fn remarks(ui: &mut Ui, strip: &Strip, animated: bool, panel: &Panel) {
    let end = strip.newest().unwrap_or_default();
    if !animated {
        ui.small("Nothing in this scene moves: time is that of the images.");
    } else if end > panel.window && strip.columns_in(end, panel.window) < FEW {
        let text = "Few images in this time: slow the animation down for a finer strip.";
        ui.small(egui::RichText::new(text).color(style::WARN));
    }
}

fn measured(ui: &mut Ui, span: Option<Span>) {
    let Some(span) = span else {
        ui.small("Drag in the strip to measure.");
        return;
    };
    let number = |value: Option<f64>, unit: &str| match value {
        Some(value) => format!("{value:.0} {unit}"),
        None => format!("- {unit}"),
    };
    ui.monospace(format!("{:.0} ms", span.seconds() * 1e3));
    ui.monospace(format!("{:.1} mm", span.millimetres()));
    ui.monospace(number(span.per_minute(), "/min"));
    ui.monospace(number(span.speed(), "mm/s"));
}

fn draw(ui: &Ui, strip: &Strip, panel: &mut Panel, inner: Rect, end: f64) {
    let pixels = inner.width() * ui.ctx().pixels_per_point();
    let width = (pixels as usize).clamp(16, WIDEST);
    let wanted = (strip.revision(), panel.window, width);
    let drawn = panel.texture.take().filter(|(_, drawn)| *drawn == wanted);
    let (texture, _) = panel.texture.insert(drawn.unwrap_or_else(|| {
        let raster = strip.raster(end, panel.window, width);
        let image = ColorImage::from_gray([width, ROWS], &raster);
        let made = (ui.ctx()).load_texture("M-mode", image, TextureOptions::LINEAR);
        (made, wanted)
    }));
    let all = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
    ui.painter().image(texture.id(), inner, all, Color32::WHITE);
}

/// Draws the rulers: depth at the right, seconds below.
fn rulers(ui: &Ui, inner: Rect, depth: f64, window: f64, end: f64) {
    let font = FontId::proportional(10.0);
    for share in [0.0, 0.5, 1.0] {
        let y = inner.top() + inner.height() * share as f32;
        let text = format!("{:.0} mm", depth * share);
        let align = [Align2::LEFT_TOP, Align2::LEFT_CENTER, Align2::LEFT_BOTTOM];
        let at = pos2(inner.right() + 6.0, y);
        let align = align[(2.0 * share) as usize];
        (ui.painter()).text(at, align, text, font.clone(), style::FAINT);
    }
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

/// Draws the scanline into the image; the mark below it moves it.
pub(super) fn aim(ui: &mut Ui, place: &Place, frame: &Frame, strip: &mut Strip, frozen: bool) {
    let probe = &frame.probe;
    let line = strip.line().min(probe.scanlines - 1);
    let (start, direction) = probe.ray(line, probe.elevation_layers / 2);
    let end = start + direction * probe.depth;
    let ends = [place.at(start.x, start.z), place.at(end.x, end.z)];
    let dashes = egui::Shape::dashed_line(&ends, Stroke::new(1.0, style::ACCENT), 6.0, 6.0);
    ui.painter().extend(dashes);
    // A frozen strip has nothing to show of another scanline.
    if frozen {
        return;
    }
    let mark = Rect::from_center_size(ends[1], vec2(16.0, 16.0));
    let response = ui.interact(mark, ui.id().with("M-mode line"), Sense::drag());
    let colour = match response.hovered() || response.dragged() {
        true => style::TEXT,
        false => style::ACCENT,
    };
    ui.painter().circle_filled(ends[1], 5.0, colour);
    if let (true, Some(point)) = (response.dragged(), response.interact_pointer_pos()) {
        let [lateral, depth] = place.mm(point).to_array();
        strip.aim(nearest_line(probe, lateral, depth));
    }
    response.on_hover_text("The line of the M-mode strip: drag it");
}
