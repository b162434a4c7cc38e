//! The section for fusion with an acquired volume, and for the marking of acquired pixels.

use std::time::Instant;

use egui::{Slider, Ui};

use super::controls::group;
use crate::model::Model;
use crate::settings::{Fusion, Group};

pub(super) fn show(ui: &mut Ui, model: &mut Model, now: Instant) {
    let Some(fusion) = &mut model.settings.fusion else {
        return;
    };
    group(ui, Fusion::TABLE, fusion);
    let mut real = model.real;
    ui.checkbox(&mut real.shown, "Which pixels are real").on_hover_text(
        "Colours what of the image comes from the acquired volume; mixed pixels by their share \
             of it (B). Saved images are not coloured.",
    );
    if real.shown {
        let slider = Slider::new(&mut real.opacity, 0.05..=1.0).max_decimals(2).text("opacity");
        ui.add(slider).on_hover_text(
            "Of the colour over a pixel that is all acquired; 1 hides its grey level",
        );
    }
    if real != model.real {
        model.real = real;
        model.touch(now);
    }
}
