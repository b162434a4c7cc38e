//! The section for the scene's time.

use std::time::Instant;

use egui::{DragValue, Label, Slider, Ui};

use super::controls::words;
use crate::model::{Model, Placed};
use crate::scene::Strategy;
use crate::settings::units::DURATION;
use crate::sim::Tracer;
use crate::style::button;

/// `shown` is the time of the image, s.
pub(super) fn show(ui: &mut Ui, model: &mut Model, shown: Option<f64>, now: Instant) {
    if !model.animated {
        ui.label("Nothing in this scene moves.");
        return;
    }
    ui.horizontal(|ui| {
        let word = if model.clock.is_playing() { "Pause" } else { "Play" };
        if button(ui, word, "Let the scene's time pass (P)") {
            model.clock.play(!model.clock.is_playing(), now);
            model.touch(now);
        }
        // The last input may be long ago.
        let running = shown.filter(|_| model.clock.runs());
        let mut seconds = running.unwrap_or_else(|| model.clock.at(now));
        let time = DragValue::new(&mut seconds).speed(0.02).fixed_decimals(2).suffix(" s");
        let time = time.custom_parser(|text| DURATION.finite(text).ok());
        if ui.add(time).on_hover_text("The scene's time: drag or type").changed() {
            model.clock.seek(seconds, now);
            model.touch(now);
        }
    });
    let mut speed = model.clock.speed();
    let slider =
        Slider::new(&mut speed, 0.05..=4.0).logarithmic(true).max_decimals(2).text("speed");
    let tip = "Seconds of the scene per second";
    if ui.add(slider).on_hover_text(tip).changed() {
        model.clock.set_speed(speed, now);
        model.touch(now);
    }
    let tracer = model.settings.tracer;
    // Meshes that one selector switches have one strategy.
    let mut shown: Vec<&Option<String>> = Vec::new();
    for (index, strategy) in model.settings.strategies.iter_mut().enumerate() {
        let switch = &model.meshes[index].switch;
        if let Some(strategy) = strategy
            && !(switch.is_some() && shown.contains(&switch))
        {
            shown.push(switch);
            let together = |other: &&Placed| switch.is_some() && other.switch == *switch;
            let meshes = || {
                let own = std::slice::from_ref(&model.meshes[index]);
                own.iter().chain(model.meshes[index + 1..].iter().filter(together))
            };
            let shares = meshes().all(|mesh| mesh.shares_topology);
            ui.horizontal(|ui| {
                let possible = |s: &Strategy| match s {
                    Strategy::Selector => tracer == Tracer::Bvh,
                    s => shares || !s.needs_shared_topology(),
                };
                words(ui, &format!("strategy {index}"), strategy, possible)
                    .on_hover_text("Way in which the device follows the shapes");
                let names: Vec<_> = meshes().map(|mesh| mesh.name.as_str()).collect();
                ui.add(Label::new(names.join(", ")).truncate());
            });
        }
    }
}
