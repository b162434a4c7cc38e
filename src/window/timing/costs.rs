//! Costs of following moving meshes, and the use of the device's memory.

use egui::{ScrollArea, Ui};

use super::super::model::Model;
use super::super::picture::Frame;
use super::super::statistics::Times;
use super::{HEIGHT, pair};
use crate::scene::Strategy;

/// The strategies of meshes that change their shape, each once, in the order of the meshes.
pub(crate) fn strategies(all: &[Option<Strategy>]) -> String {
    let mut names: Vec<String> = Vec::new();
    for name in all.iter().flatten().map(Strategy::to_string) {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    match names.is_empty() {
        true => "placement alone".into(),
        false => names.join(", "),
    }
}

/// Draws the costs by strategy, as far as the last frames have used several, and the meshes that change.
pub(super) fn structures(ui: &mut Ui, times: &Times, model: &Model) {
    let scroll = ScrollArea::vertical().max_height(HEIGHT - 54.0);
    scroll.auto_shrink([true, false]).show(ui, |ui| {
        let mut seen: Vec<&str> = times.samples().map(|s| s.strategy.as_str()).collect();
        seen.dedup();
        seen.sort_unstable();
        seen.dedup();
        egui::Grid::new("strategies").num_columns(4).spacing([8.0, 2.0]).show(ui, |ui| {
            for (head, tip) in [
                ("strategy", "How the device followed what changes its shape"),
                ("frames", "Of the last ones"),
                (
                    "device, ms",
                    "Builds, refits and interpolation of a frame: median, 99th percentile",
                ),
                (
                    "processor, ms",
                    "What the processor took to record them, and to build: median, 99th percentile",
                ),
            ] {
                ui.strong(head).on_hover_text(tip);
            }
            ui.end_row();
            for name in seen {
                let of = || times.samples().filter(|s| s.strategy == name);
                let device: Vec<f64> = of().filter_map(|s| s.stage("update")).collect();
                let processor: Vec<f64> = of().map(|s| s.update).collect();
                ui.label(name);
                ui.monospace(processor.len().to_string());
                for values in [device, processor] {
                    ui.monospace(pair(&values).join("  "));
                }
                ui.end_row();
            }
        });
        ui.separator();
        meshes(ui, model);
    });
}

fn meshes(ui: &mut Ui, model: &Model) {
    let strategies = model.settings.strategies.iter();
    let changing = model.meshes.iter().zip(strategies);
    let changing: Vec<_> = changing.filter_map(|(m, s)| Some((m, (*s)?))).collect();
    if changing.is_empty() {
        ui.label("No mesh changes its shape.");
        return;
    }
    egui::Grid::new("meshes").num_columns(4).spacing([8.0, 2.0]).show(ui, |ui| {
        for head in ["mesh", "strategy", "shapes", "triangles"] {
            ui.strong(head);
        }
        ui.end_row();
        for (mesh, strategy) in changing {
            ui.label(&mesh.name);
            ui.label(strategy.to_string());
            ui.monospace(mesh.keyframes.to_string());
            ui.monospace(mesh.triangles.to_string());
            ui.end_row();
        }
    });
}

/// Draws the memory by kind; `heap` is the size of the device's own, bytes.
pub(super) fn memory(ui: &mut Ui, frame: Option<&Frame>, heap: u64) {
    let Some(frame) = frame else {
        return;
    };
    let (all, scene) = (frame.memory.current, frame.scene_memory);
    let known = scene.total() + frame.image_bytes;
    egui::Grid::new("memory").num_columns(3).spacing([8.0, 1.0]).show(ui, |ui| {
        for (name, tip, bytes) in [
            ("geometry", "Vertices, normals and triangles of all shapes", scene.geometry),
            ("structures", "What rays walk", scene.structures),
            ("fields", "Where deforming tissue has gone", scene.fields),
            ("volume", "The acquired volume", scene.volume),
            ("images", "Those on the screen and in the loop", frame.image_bytes),
            (
                "frame, interface",
                "Buffers of a frame, of the interface, and of transfers",
                all.saturating_sub(known),
            ),
            ("all", "In use now", all),
            ("most", "In use at one time so far", frame.memory.peak),
        ] {
            ui.label(name).on_hover_text(tip);
            ui.monospace(format!("{:8.1} MiB", mebibytes(bytes)));
            let share = 100.0 * bytes as f64 / heap.max(1) as f64;
            ui.monospace(format!("{share:5.2} %"));
            ui.end_row();
        }
    });
    let heap = format!("of the device's {:.1} GiB", mebibytes(heap) / 1024.0);
    ui.label(heap);
}

fn mebibytes(bytes: u64) -> f64 {
    bytes as f64 / f64::from(1 << 20)
}

#[cfg(test)]
mod tests {
    use super::strategies;
    use crate::scene::Strategy;

    #[test]
    fn each_strategy_is_named_once() {
        assert_eq!(strategies(&[None, None]), "placement alone");
        let all = [None, Some(Strategy::Refit), Some(Strategy::Mask), Some(Strategy::Refit)];
        assert_eq!(strategies(&all), "refit, mask");
    }
}
