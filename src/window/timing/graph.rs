//! The graph of frame times: a bar per frame, stacked by stage.

use egui::{Align2, Color32, FontId, Pos2, Rect, Sense, Stroke, Ui, vec2};

use super::super::statistics::{REMEMBERED, Sample, Times};
use super::super::style;
use super::{HEIGHT, colour, written};
use insonify_base::statistics::Statistics;

/// Usual limit of a live image, ms: 30 frames per second.
const LIVE: f64 = 1e3 / 30.0;

/// Least and greatest width of the graph, points.
const WIDTHS: [f32; 2] = [200.0, 480.0];

/// Draws bars from the left, oldest first: stages from below, then the rest of the frame beside the device;
/// the line is at 1/30 s.
pub(super) fn show(ui: &mut Ui, times: &Times) {
    let size = vec2(ui.available_width().clamp(WIDTHS[0], WIDTHS[1]), HEIGHT - 58.0);
    let (area, response) = ui.allocate_exact_size(size, Sense::hover());
    let painter = ui.painter_at(area);
    painter.rect_filled(area, 2.0, style::BACK);
    let names = times.stages();
    // The first frame, which includes compiling kernels, would leave nothing of the others to see.
    let usual = Statistics::of(times.samples().map(Sample::whole)).p95;
    let most = usual.max(LIVE) * 1.1;
    let height = |ms: f64| area.height() * (ms / most) as f32;
    let width = area.width() / REMEMBERED as f32;
    for (at, sample) in times.samples().enumerate() {
        let left = area.left() + at as f32 * width;
        let mut base = area.bottom();
        let mut bar = |ms: f64, colour| {
            let top = base - height(ms);
            let right = left + width.max(1.0);
            let bar = Rect::from_min_max(Pos2::new(left, top), Pos2::new(right, base));
            painter.rect_filled(bar, 0.0, colour);
            base = top;
        };
        for (name, ms) in &sample.stages {
            bar(*ms, colour(&names, name));
        }
        bar((sample.wall - sample.device()).max(0.0), Color32::from_gray(70));
    }
    let line = area.bottom() - height(LIVE);
    let stroke = Stroke::new(1.0, Color32::from_gray(150));
    painter.hline(area.x_range(), line, stroke);
    let font = FontId::proportional(10.0);
    let label = format!("{most:.0} ms");
    let at = area.left_top() + vec2(3.0, 1.0);
    painter.text(at, Align2::LEFT_TOP, label, font, style::TEXT);
    let pointed = response.hover_pos().and_then(|pointer| {
        let at = (pointer.x - area.left()) / width;
        times.samples().nth(at as usize)
    });
    if let Some(sample) = pointed {
        response.on_hover_ui_at_pointer(|ui| details(ui, &names, sample));
    }
}

/// Draws the times of one frame.
fn details(ui: &mut Ui, names: &[String], sample: &Sample) {
    egui::Grid::new("frame").num_columns(2).show(ui, |ui| {
        for name in names {
            ui.colored_label(colour(names, name), name);
            ui.monospace(written(sample.stage(name).unwrap_or(f64::NAN)));
            ui.end_row();
        }
        for (name, ms) in
            [("device", sample.device()), ("frame", sample.wall), ("latency", sample.latency)]
        {
            ui.label(name);
            ui.monospace(format!("{} ms", written(ms)));
            ui.end_row();
        }
    });
}
