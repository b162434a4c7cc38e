//! The timing panel.

use egui::{Color32, Pos2, Rect, Sense, Stroke, Ui, vec2};

use super::engine::Frame;
use super::state::State;
use super::statistics::{REMEMBERED, Sample, Times};
use super::style;
use crate::statistics::Statistics;

/// Height of the panel, points.
pub(super) const HEIGHT: f32 = 212.0;

/// Median, 99th percentile.
fn pair(values: &[f64]) -> [String; 2] {
    let found = Statistics::of(values.iter().copied());
    [found.median, found.p99].map(|ms| match ms.is_nan() {
        true => "-".into(),
        false => format!("{ms:.1}"),
    })
}

pub(super) fn show(ui: &mut Ui, statistics: &Times, frame: Option<&Frame>, state: &State) {
    ui.horizontal_top(|ui| {
        ui.vertical(|ui| {
            ui.strong("Device time by stage, ms");
            stages(ui, statistics);
        });
        ui.separator();
        ui.vertical(|ui| {
            ui.strong("Frames and latency");
            totals(ui, statistics, frame, state);
        });
        ui.separator();
        ui.vertical(|ui| {
            ui.strong(format!("Last {REMEMBERED} frames, ms"));
            graph(ui, statistics);
        });
    });
}

fn stages(ui: &mut Ui, statistics: &Times) {
    let names = statistics.stages();
    // Two columns of stages: a fused frame has more than the panel is high.
    ui.horizontal_top(|ui| {
        for (column, names) in names.chunks(8).enumerate() {
            egui::Grid::new(("stages", column))
                .num_columns(3)
                .show(ui, |ui| {
                    for head in ["", "median", "p99"] {
                        ui.small(head);
                    }
                    ui.end_row();
                    for name in names {
                        ui.label(name);
                        for cell in pair(&statistics.stage(name)) {
                            ui.monospace(cell);
                        }
                        ui.end_row();
                    }
                });
        }
    });
}

fn totals(ui: &mut Ui, statistics: &Times, frame: Option<&Frame>, state: &State) {
    let wall = statistics.of(|s| s.wall);
    let device = statistics.of(Sample::device);
    egui::Grid::new("totals").num_columns(3).show(ui, |ui| {
        for (name, tip, values) in [
            ("device", "All stages of a frame on the device", &device),
            ("frame", "From taking an order to the finished image", &wall),
            (
                "structures",
                "What the processor takes to bring acceleration structures up to date",
                &statistics.of(|s| s.update),
            ),
            (
                "latency",
                "From the input, or the reading of the clock, to the image handed to the screen",
                &statistics.of(|s| s.latency),
            ),
            (
                "3D view",
                "A picture of the 3D view on the device",
                &statistics.survey(),
            ),
            (
                "interface",
                "A frame of this window, from the start of drawing to the screen",
                &statistics.interface(),
            ),
        ] {
            ui.label(name).on_hover_text(tip);
            for cell in pair(values) {
                ui.monospace(cell);
            }
            ui.end_row();
        }
    });
    if !wall.is_empty() {
        let median = Statistics::of(wall).median;
        ui.label(format!("{:.1} frames per second", 1e3 / median));
    }
    if let Some(frame) = frame {
        let mib = |bytes: u64| bytes as f64 / f64::from(1 << 20);
        ui.label(format!(
            "memory {:.0} MiB, most {:.0}; anatomy {:.0}",
            mib(frame.memory.current),
            mib(frame.memory.peak),
            mib(frame.world_bytes)
        ));
    }
    ui.small(&state.device);
}

/// A bar per frame, from the left; the line is at 1/30 s.
fn graph(ui: &mut Ui, statistics: &Times) {
    let size = vec2(
        ui.available_width().min(480.0),
        ui.available_height().min(HEIGHT - 40.0),
    );
    let (area, _) = ui.allocate_exact_size(size, Sense::hover());
    let painter = ui.painter_at(area);
    painter.rect_filled(area, 2.0, style::BACK);
    let values = statistics.of(|s| s.wall);
    let most = values.iter().copied().fold(1e3 / 30.0, f64::max) * 1.1;
    let height = |ms: f64| area.height() * (ms / most) as f32;
    let width = area.width() / REMEMBERED as f32;
    for (at, ms) in values.iter().enumerate() {
        let left = area.left() + at as f32 * width;
        let top = Pos2::new(left, area.bottom() - height(*ms));
        let bar = Rect::from_min_max(top, Pos2::new(left + width.max(1.0), area.bottom()));
        painter.rect_filled(bar, 0.0, style::ACCENT);
    }
    let line = area.bottom() - height(1e3 / 30.0);
    painter.hline(
        area.x_range(),
        line,
        Stroke::new(1.0, Color32::from_gray(110)),
    );
    let label = format!("{most:.0}");
    let font = egui::FontId::proportional(10.0);
    painter.text(
        area.left_top(),
        egui::Align2::LEFT_TOP,
        label,
        font,
        style::FAINT,
    );
}
