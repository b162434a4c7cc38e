//! The section for image formation.

use egui::{Slider, SliderClamping, Ui};

use super::controls::{explained, group_with, typed};
use crate::model::Settings;
use crate::settings::{Group, Imaging};
use crate::style::button;

pub(super) fn show(ui: &mut Ui, settings: &mut Settings) {
    let depth = settings.probe.depth;
    group_with(ui, Imaging::TABLE, &mut settings.imaging, &mut |ui, facts, imaging| {
        if facts.key != "tgc_sliders" {
            return false;
        }
        // One below the other, the face on top, as on a scanner's panel.
        let spacing = depth / (imaging.tgc_sliders.len() - 1) as f64;
        for (at, level) in imaging.tgc_sliders.iter_mut().enumerate() {
            ui.label(format!("{:.0} mm", at as f64 * spacing));
            let [low, high] = facts.usual;
            let slider = Slider::new(level, low..=high)
                .clamping(SliderClamping::Never)
                .max_decimals(1)
                .suffix(" dB")
                .custom_parser(|text| typed(facts, text));
            explained(ui.add(slider), Imaging::TABLE, facts);
            *level = level.clamp(facts.range[0], facts.range[1]);
            ui.end_row();
        }
        if button(ui, "Level", "All eight sliders to 0 dB") {
            imaging.tgc_sliders = [0.0; 8];
        }
        ui.end_row();
        true
    });
}
