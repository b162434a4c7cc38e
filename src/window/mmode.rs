//! The M-mode strip below the image, and its line in the image.

use std::time::Instant;

use egui::{
    Align2, Color32, ColorImage, Context, DragValue, FontId, Key, Rect, Sense, Stroke,
    TextureHandle, TextureOptions, Ui, pos2, vec2,
};
use glam::DVec2;
use serde_json::json;

use super::captures::SavedStrip;
use super::model::Model;
use super::model::mmode::{Aim, ROWS, Strip, nearest_line};
use super::panel::{Desk, Dock, OpenPanels, Panel, Row};
use super::picture::Frame;
use super::place::Place;
use super::spans::{self, Spans};
use super::style;
use crate::probe::Probe;

/// Its row in the list of panels.
pub(super) const ROW: Row = Row {
    name: "M-mode",
    tip: "One scanline against time",
    key: Some((Key::M, "M")),
    dock: Dock::Below { height: 208.0, alone: false },
    has_button: true,
};

/// Widest raster, pixels.
const WIDEST: usize = 1024;

/// Columns per second of the scene below which a heart's valves look like stairs: those of a slow scanner.
const FEW: f64 = 200.0;

/// The state of the panel.
pub(super) struct MmodePanel {
    /// Seconds across the strip.
    window: f64,
    /// What is measured.
    spans: Spans,
    /// The line of the last strip.
    aim: Option<Aim>,
    /// The strip on the device, and its content: revision, seconds across, pixels across.
    texture: Option<(TextureHandle, (u64, f64, usize))>,
}

impl Default for MmodePanel {
    fn default() -> Self {
        Self { window: 2.0, spans: Spans::default(), aim: None, texture: None }
    }
}

/// The strip on the screen with its measurements, to be saved.
pub(super) fn saved(model: &Model, panel: &MmodePanel) -> Option<SavedStrip> {
    let strip = model.mmode.as_ref()?;
    let (end, mm) = (strip.newest()?, strip.length()?);
    let line = match strip.line() {
        Aim::Scanline(line) => json!({ "scanline": line }),
        Aim::Free(ends) => json!({ "free_mm": ends.map(|end| end.to_array()) }),
    };
    let measurements = panel.spans.lettered().map(|(letter, span)| {
        json!({
            "letter": letter,
            "from_s_mm": span.from,
            "to_s_mm": span.to,
            "seconds": span.seconds(),
            "mm": span.height(),
            "per_minute": span.per_minute(),
            "mm_per_s": span.slope(),
        })
    });
    let facts = json!({
        "line": line,
        "begin_s": end - panel.window,
        "end_s": end,
        "length_mm": mm,
        "columns": strip.columns_in(end, panel.window),
        "measurements": measurements.collect::<Vec<_>>(),
    });
    let levels = strip.raster(end, panel.window, WIDEST);
    Some(SavedStrip { name: "mmode", size: [WIDEST as u32, ROWS as u32], levels, facts })
}

impl Panel for MmodePanel {
    fn row(&self) -> &'static Row {
        &ROW
    }

    fn is_open(&self, model: &Model, _open: &OpenPanels) -> bool {
        model.mmode.is_some()
    }

    fn toggle(&self, model: &mut Model, _open: &mut OpenPanels, now: Instant) {
        model.mmode = match model.mmode {
            Some(_) => None,
            None => {
                let middle = Aim::Scanline(model.settings.probe.scanlines / 2);
                Some(Strip::new(self.aim.unwrap_or(middle)))
            }
        };
        model.touch(now);
    }

    fn follow(&mut self, _ctx: &Context, desk: &mut Desk<'_>) {
        let Some(strip) = &desk.model.mmode else {
            self.texture = None;
            return;
        };
        self.aim = Some(strip.line());
        // Of a strip that begins anew nothing is measured.
        if strip.newest().is_none() {
            self.spans.clear();
        }
    }

    fn show(&mut self, ui: &mut Ui, desk: &mut Desk<'_>) {
        let panel = self;
        let model = &mut *desk.model;
        let (probe, frozen) = (model.settings.probe.clone(), model.frozen);
        let speed = model.clock.speed();
        let animated = model.animated;
        let Some(strip) = &mut model.mmode else {
            return;
        };
        ui.horizontal_top(|ui| {
            ui.vertical(|ui| {
                ui.set_width(168.0);
                ui.strong("M-mode");
                ui.add_enabled_ui(!frozen, |ui| line(ui, strip, &probe));
                width(ui, panel);
                egui::ScrollArea::vertical().show(ui, |ui| {
                    measured(ui, panel);
                    remarks(ui, strip, animated, speed, panel);
                });
            });
            ui.separator();
            let (area, response) = ui.allocate_exact_size(ui.available_size(), Sense::drag());
            let inner = Rect::from_min_max(area.min, area.max - vec2(44.0, 18.0));
            let end = strip.newest().unwrap_or(panel.window).max(panel.window);
            draw(ui, strip, panel, inner, end);
            let Some(depth) = strip.length() else { return };
            depths(ui, inner, depth);
            spans::seconds(ui, inner, panel.window, end);
            let at = |[seconds, mm]: [f64; 2]| {
                let x = 1.0 - ((end - seconds) / panel.window) as f32;
                inner.min + inner.size() * vec2(x, (mm / depth) as f32)
            };
            let under = |point: egui::Pos2| {
                let share = (inner.clamp(point) - inner.min) / inner.size();
                let seconds = end - panel.window * f64::from(1.0 - share.x);
                [seconds, depth * f64::from(share.y)]
            };
            panel.spans.drag(ui, &response, under);
            response.on_hover_text("Drag from one point to another to measure time and depth");
            panel.spans.show(ui, inner, at);
        });
    }

    fn leave(&mut self) {
        *self = Self::default();
    }

    fn lose(&mut self) {
        *self = Self::default();
    }
}

fn line(ui: &mut Ui, strip: &mut Strip, probe: &Probe) {
    ui.horizontal(|ui| {
        let free = matches!(strip.line(), Aim::Free(_));
        if ui.selectable_label(!free, "Line").clicked() && free {
            let [from, to] = strip.line().ends(probe);
            let middle = from.midpoint(to);
            strip.aim(Aim::Scanline(nearest_line(probe, middle.x, middle.y)));
        }
        if let Aim::Scanline(line) = strip.line() {
            let mut number = line + 1;
            let drag = DragValue::new(&mut number).range(1..=probe.scanlines).speed(0.3);
            let tip = "Scanline that is drawn; its mark in the image can be dragged, too";
            ui.add(drag).on_hover_text(tip);
            strip.aim(Aim::Scanline(number - 1));
        }
        let tip = "Anatomical M-mode: along any line, whose ends are dragged in the image. It is taken from the \
                   images, so that it has as many columns as there are images.";
        if ui.selectable_label(free, "Free").on_hover_text(tip).clicked() && !free {
            strip.aim(Aim::Free(strip.line().ends(probe)));
        }
    });
}

fn width(ui: &mut Ui, panel: &mut MmodePanel) {
    ui.horizontal(|ui| {
        ui.label("Width");
        spans::width(ui, &mut panel.window);
    });
}

fn remarks(ui: &mut Ui, strip: &Strip, animated: bool, speed: f64, panel: &MmodePanel) {
    let end = strip.newest().unwrap_or_default();
    if !animated {
        ui.small("Nothing in this scene moves: time is that of the images.");
        return;
    }
    let columns = strip.columns_in(end, panel.window) as f64;
    let covered = panel.window.min(strip.span());
    if covered <= 0.0 {
        return;
    }
    let rate = columns / covered;
    ui.small(format!("{rate:.0} columns per second"));
    if end > panel.window && rate < FEW {
        let slower = speed * (rate / FEW).max(0.01);
        let text =
            format!("Slow the animation down for a finer strip: {slower:.2}x gives {FEW:.0}.");
        ui.small(egui::RichText::new(text).color(style::WARN));
    }
}

fn measured(ui: &mut Ui, panel: &mut MmodePanel) {
    if panel.spans.is_empty() {
        ui.small("Drag in the strip to measure.");
        return;
    }
    for (letter, span) in panel.spans.lettered() {
        ui.monospace(format!("{letter} {:.1} mm  {:.0} ms", span.height(), span.seconds() * 1e3));
        if let (Some(rate), Some(speed)) = (span.per_minute(), span.slope()) {
            ui.monospace(format!("  {rate:.0} /min  {speed:.0} mm/s"));
        }
    }
    if ui.small_button("Clear").on_hover_text("Remove the measurements of the strip").clicked() {
        panel.spans.clear();
    }
}

fn draw(ui: &Ui, strip: &Strip, panel: &mut MmodePanel, inner: Rect, end: f64) {
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

/// Draws the ruler of depths at the right.
fn depths(ui: &Ui, inner: Rect, depth: f64) {
    let font = FontId::proportional(10.0);
    for share in [0.0, 0.5, 1.0] {
        let y = inner.top() + inner.height() * share as f32;
        let text = format!("{:.0} mm", depth * share);
        let align = [Align2::LEFT_TOP, Align2::LEFT_CENTER, Align2::LEFT_BOTTOM];
        let at = pos2(inner.right() + 6.0, y);
        let align = align[(2.0 * share) as usize];
        (ui.painter()).text(at, align, text, font.clone(), style::FAINT);
    }
}

/// Draws the line into the image; marks at its ends move it.
pub(super) fn aim(ui: &mut Ui, place: &Place, frame: &Frame, strip: &mut Strip, frozen: bool) {
    let probe = &frame.probe;
    let ends = strip.line().ends(probe);
    let points = ends.map(|end| place.at(end.x, end.y));
    let dashes = egui::Shape::dashed_line(&points, Stroke::new(1.0, style::ACCENT), 6.0, 6.0);
    ui.painter().extend(dashes);
    // A frozen strip has nothing to show of another line.
    if frozen {
        return;
    }
    for (i, point) in points.into_iter().enumerate() {
        let free = matches!(strip.line(), Aim::Free(_));
        // A scanline begins at the face.
        if i == 0 && !free {
            continue;
        }
        let mark = Rect::from_center_size(point, vec2(16.0, 16.0));
        let response = ui.interact(mark, ui.id().with(("M-mode line", i)), Sense::drag());
        let colour = match response.hovered() || response.dragged() {
            true => style::TEXT,
            false => style::ACCENT,
        };
        ui.painter().circle_filled(point, 5.0, colour);
        if let (true, Some(under)) = (response.dragged(), response.interact_pointer_pos()) {
            let mm = place.mm(under);
            strip.aim(match free {
                false => Aim::Scanline(nearest_line(probe, mm.x, mm.y)),
                true => {
                    let mut ends = ends;
                    ends[i] = DVec2::new(mm.x, mm.y);
                    Aim::Free(ends)
                }
            });
        }
        response.on_hover_text("The line of the M-mode strip: drag it");
    }
}
