//! Image formation.

use egui::{Slider, SliderClamping, Ui};

use super::controls::{count, grid, number, number_or};
use crate::view::catalogue;
use crate::view::model::Settings;

pub(super) fn show(ui: &mut Ui, settings: &mut Settings) {
    let i = &mut settings.imaging;
    grid(ui, "image", |ui| {
        number(ui, "imaging.gain", "Gain", &mut i.gain, -20.0..=60.0);
        let range = &mut i.dynamic_range;
        number(ui, "imaging.dynamic_range", "Dynamic range", range, 20.0..=100.0);
        number(ui, "imaging.grey_gamma", "Grey map", &mut i.grey_gamma, 0.4..=2.5);
    });
    ui.collapsing("Time gain", |ui| time_gain(ui, settings));
    let i = &mut settings.imaging;
    ui.collapsing("Noise and resolution", |ui| {
        grid(ui, "resolution", |ui| {
            let off = (f64::NEG_INFINITY, "off");
            number_or(ui, "imaging.noise", "Noise", &mut i.noise, -160.0..=-60.0, off);
            for (name, scale) in
                ["PSF axial", "PSF lateral", "PSF elevation"].iter().zip(&mut i.psf_scale)
            {
                number(ui, "imaging.psf_scale", name, scale, 0.25..=4.0);
            }
            let height = &mut i.image_height;
            count(ui, "imaging.image_height", "Height", height, 200..=2000);
        });
    });
}

/// Eight sliders one below the other, the face on top, as on a scanner's panel.
fn time_gain(ui: &mut Ui, settings: &mut Settings) {
    let (depth, i) = (settings.probe.depth, &mut settings.imaging);
    let entry = catalogue::entry("imaging.tgc_sliders");
    grid(ui, "time gain", |ui| {
        let attenuation = &mut i.tgc_attenuation;
        number(ui, "imaging.tgc_attenuation", "Attenuation", attenuation, 0.0..=2.0);
        number(ui, "imaging.tgc_limit", "Limit", &mut i.tgc_limit, 0.0..=120.0);
        let spacing = depth / (i.tgc_sliders.len() - 1) as f64;
        for (at, level) in i.tgc_sliders.iter_mut().enumerate() {
            ui.label(format!("{:.0} mm", at as f64 * spacing));
            let slider = Slider::new(level, -20.0..=20.0)
                .clamping(SliderClamping::Never)
                .max_decimals(1)
                .suffix(" dB");
            ui.add(slider).on_hover_text(&entry.meaning);
            *level = level.clamp(entry.range[0], entry.range[1]);
            ui.end_row();
        }
    });
    if ui.button("Level").on_hover_text("All eight sliders to 0 dB").clicked() {
        i.tgc_sliders = [0.0; 8];
    }
}
