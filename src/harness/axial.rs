//! `axial`: the pulse's envelope along each line.

use std::mem::size_of;

use super::inputs::{Random, frame, samples};
use super::{Case, Check, Element, Extent, Input, Job, Size, Subject};
use crate::reference::axial;
use crate::sim::layout::Frame;

pub const SUBJECT: Subject = Subject {
    name: "axial",
    stems: &["axial"],
    tolerance: "2e-6 of the kernel's sum times the largest sample: each tap is good to 2e-7 (exp), \
                and 65 terms round at 6e-8 each",
    job,
    sizes: |job| {
        let values = 8 * samples(&job.one("frame"));
        vec![size_of::<Frame>(), values, values]
    },
    extent: |job| {
        let frame: Frame = job.one("frame");
        Extent::Threads([frame.samples, frame.scanlines, 1])
    },
    check,
    plant: |job, outputs| {
        // One sample too far to the right.
        job.edit(outputs, "iq", |iq: &mut [f32]| iq.rotate_right(2));
    },
};

fn job(case: Case, size: Size) -> Job {
    let frame = frame(case, size);
    let mut lateral = Random(2).floats(2 * samples(&frame), -1.0, 1.0);
    if case == Case::NotFinite {
        lateral[20] = f32::NAN;
        lateral[401] = f32::INFINITY;
        lateral[801] = f32::NEG_INFINITY;
    }
    Job {
        inputs: vec![
            Input::words("frame", &[frame]),
            Input::floats("lateral", &lateral),
            Input::output("iq", Element::Float, lateral.len()),
        ],
        push: Vec::new(),
    }
}

fn check(job: &Job, outputs: &[Vec<u8>]) -> Vec<Check> {
    let frame: Frame = job.one("frame");
    let lateral: Vec<f32> = job.get("lateral");
    let expected = axial::axial(&frame, &lateral);
    let got: Vec<f32> = job.after(outputs, "iq");
    // The sum of a Gaussian's taps, and at least the middle one.
    let sum = (f64::from(frame.axial_sigma) * std::f64::consts::TAU.sqrt()).max(1.0);
    let finite = lateral.iter().filter(|v| v.is_finite());
    let largest = f64::from(finite.fold(0.0_f32, |m, v| m.max(v.abs())));
    vec![Check::close("iq", &got, &expected, |_| {
        2e-6 * sum * largest
    })]
}
