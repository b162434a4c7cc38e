//! Samples in the formats of others: zea and UFF.

use super::plan::{Array, Plan};
use super::studio::Made;
use crate::exchange::{Format, Frames};

/// The file of a sample, of which it is the one frame.
pub(super) fn bytes(plan: &Plan, made: &Made, format: Format) -> Vec<u8> {
    let scene = &plan.scenes[made.sample.scene];
    let title = if plan.title.is_empty() { "insonify" } else { &plan.title };
    let asked = |array: Array, values: &Option<Vec<f32>>| match plan.arrays.contains(&array) {
        true => values.clone().expect("the plan asks for it"),
        false => Vec::new(),
    };
    let iq = match format {
        Format::Zea => asked(Array::Iq, &made.iq),
        Format::Uff => made.iq.clone().expect("always made for UFF"),
    };
    let frames = Frames {
        about: format!("{title}, sample {} of `{}`", made.sample.number, scene.name),
        subject: scene.anatomy.clone(),
        probe: made.settings.probe.clone(),
        size: made.image.dimensions().into(),
        corner: made.corner,
        pixel: made.pixel,
        classes: plan.classes.clone(),
        poses: vec![made.world_from_probe],
        times: vec![made.sample.time],
        images: made.image.as_raw().clone(),
        segmentation: made.segmentation.clone(),
        labels: made.labels.clone(),
        envelope: asked(Array::Envelope, &made.envelope),
        iq,
        rf: asked(Array::Rf, &made.rf),
    };
    frames.bytes(format)
}
