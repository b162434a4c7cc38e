//! The timing panel: times of the stages, frame by frame, and the use of the device's memory.

use egui::{Color32, Key, ScrollArea, Ui};

use super::panel::{Desk, DeviceFacts, Dock, Panel, Row, Seen};
use super::picture::Frame;
use super::statistics::{Sample, Times};
use super::style;
use insonify_base::statistics::Statistics;

pub(super) mod costs;
mod graph;

/// Height of the panel, points.
const HEIGHT: f32 = 218.0;

/// Its row in the list of panels.
pub(super) const ROW: Row = Row {
    name: "Timings",
    tip: "Where the time goes",
    key: Some((Key::T, "T")),
    dock: Dock::Below { height: HEIGHT, alone: true },
    has_button: true,
};

/// Width of the totals, points.
const TOTALS: f32 = 200.0;

/// Number of stages in a column.
const ROWS: usize = 8;

/// Page beside the stages.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Page {
    /// Times of each of the last frames.
    #[default]
    Frames,
    /// Costs of following moving meshes.
    Structures,
    /// Use of the device's memory.
    Memory,
}

/// Colours of stages, in the order of a frame; no two neighbours are alike.
const COLOURS: [Color32; 12] = [
    Color32::from_rgb(92, 176, 196),
    Color32::from_rgb(206, 141, 84),
    Color32::from_rgb(126, 168, 92),
    Color32::from_rgb(170, 122, 190),
    Color32::from_rgb(206, 190, 98),
    Color32::from_rgb(98, 128, 202),
    Color32::from_rgb(204, 108, 120),
    Color32::from_rgb(104, 188, 150),
    Color32::from_rgb(150, 140, 128),
    Color32::from_rgb(196, 120, 172),
    Color32::from_rgb(140, 196, 214),
    Color32::from_rgb(228, 174, 138),
];

/// Colour of a stage of a frame.
fn colour(stages: &[String], name: &str) -> Color32 {
    let at = stages.iter().position(|stage| stage == name);
    COLOURS[at.unwrap_or(0) % COLOURS.len()]
}

/// A time as text, in milliseconds.
fn written(ms: f64) -> String {
    match ms.is_nan() {
        true => "-".into(),
        false => format!("{ms:7.1}"),
    }
}

/// Median and 99th percentile as texts.
fn pair(values: &[f64]) -> [String; 2] {
    let found = Statistics::of(values.iter().copied());
    [found.median, found.p99].map(written)
}

/// The timing panel.
#[derive(Default)]
pub(super) struct Timing {
    page: Page,
}

impl Panel for Timing {
    fn row(&self) -> &'static Row {
        &ROW
    }

    fn show(&mut self, ui: &mut Ui, desk: &mut Desk<'_>) {
        let Seen { times, frame, .. } = desk.seen;
        // Clear of the line above.
        ui.add_space(6.0);
        // In a narrow window the rest is reached by scrolling.
        ScrollArea::horizontal().show(ui, |ui| {
            ui.horizontal_top(|ui| {
                ui.vertical(|ui| {
                    ui.strong("Device time by stage, ms")
                        .on_hover_text("Median and 99th percentile of the last frames");
                    stages(ui, times);
                });
                ui.separator();
                ui.vertical(|ui| {
                    ui.set_width(TOTALS);
                    ui.strong("Frames and latency, ms");
                    totals(ui, times, frame, &desk.common.device);
                });
                ui.separator();
                ui.vertical(|ui| {
                    ui.horizontal(|ui| {
                        for (page, name, tip) in [
                            (Page::Frames, "Frames", "Each of the last frames, by stage"),
                            (
                                Page::Structures,
                                "Structures",
                                "What it costs that rays follow what moves",
                            ),
                            (Page::Memory, "Memory", "What lies in the device's memory"),
                        ] {
                            ui.selectable_value(&mut self.page, page, name).on_hover_text(tip);
                        }
                    });
                    match self.page {
                        Page::Frames => graph::show(ui, times),
                        Page::Structures => costs::structures(ui, times, desk.model),
                        Page::Memory => costs::memory(ui, frame, desk.common.device.heap),
                    }
                });
            });
        });
    }
}

fn stages(ui: &mut Ui, times: &Times) {
    let names = times.stages();
    // Two columns of stages: a fused frame has more than the panel is high.
    ui.horizontal_top(|ui| {
        for (column, some) in names.chunks(ROWS).enumerate() {
            egui::Grid::new(("stages", column)).num_columns(3).spacing([10.0, 1.0]).show(
                ui,
                |ui| {
                    for head in ["", "median", "p99"] {
                        ui.small(head);
                    }
                    ui.end_row();
                    for name in some {
                        ui.horizontal(|ui| {
                            let (dot, _) =
                                ui.allocate_exact_size([8.0; 2].into(), egui::Sense::hover());
                            ui.painter().rect_filled(dot, 2.0, colour(&names, name));
                            ui.label(name);
                        });
                        for cell in pair(&times.stage(name)) {
                            ui.monospace(cell);
                        }
                        ui.end_row();
                    }
                },
            );
        }
    });
}

fn totals(ui: &mut Ui, times: &Times, frame: Option<&Frame>, facts: &DeviceFacts) {
    let wall = times.live(|s| s.wall);
    let device = times.of(Sample::device);
    egui::Grid::new("totals").num_columns(3).spacing([10.0, 1.0]).show(ui, |ui| {
        for head in ["", "median", "p99"] {
            ui.small(head);
        }
        ui.end_row();
        for (name, tip, values) in [
            ("device", "All stages of a frame on the device", &device),
            ("frame", "From taking an order to the finished image", &wall),
            (
                "structures",
                "What the processor takes to bring acceleration structures up to date",
                &times.of(|s| s.update),
            ),
            (
                "latency",
                "From the input, or the reading of the clock, to the image handed to the screen",
                &times.live(|s| s.latency),
            ),
            (
                "to full quality",
                "From the last input to the image at the scene's own quality",
                &times.settled(),
            ),
            ("3D view", "A picture of the 3D view on the device", &times.view3d()),
            (
                "interface",
                "A frame of this window, from the start of drawing to the screen",
                &times.interface(),
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
    if let Some(grade) = frame.map(|frame| &frame.grade) {
        let text = format!("{grade}, budget {:.0} ms", grade.budget_ms);
        ui.add(egui::Label::new(text).truncate()).on_hover_text(grade.counts.to_string());
    }
    let device = egui::RichText::new(&facts.name).color(style::FAINT).small();
    ui.add(egui::Label::new(device).truncate()).on_hover_text(&facts.name);
}
