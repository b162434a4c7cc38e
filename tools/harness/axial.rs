//! `axial`: the pulse's envelope along each line. Its detection is the subject `detect`.

use super::inputs::{Random, frame, made, narrow, rows, samples};
use super::{Case, Check, Input, Job, Size, Subject};
use crate::reference::axial;
use insonify::sim::layout::Frame;
use insonify::sim::stages;

pub const SUBJECT: Subject = Subject {
    tolerance: "2e-6 of the kernel's sum times the largest sample: each tap is good to 2e-7 (exp), \
                and 65 terms round at 6e-8 each",
    job,
    check,
    plant: |job, outputs| {
        // One sample too far to the right.
        job.edit(outputs, "iq", |iq: &mut [f32]| iq.rotate_right(2));
    },
    ..Subject::of(&stages::AXIAL)
};

fn job(case: Case, size: Size) -> Job {
    let frame = narrow(case, frame(case, size));
    let mut lateral = Random(2).floats(2 * samples(&frame), -1.0, 1.0);
    if case == Case::NotFinite {
        lateral[20] = f32::NAN;
        lateral[401] = f32::INFINITY;
        lateral[801] = f32::NEG_INFINITY;
    }
    bindings(&frame, &lateral)
}

/// The kernel's bindings.
pub(super) fn bindings(frame: &Frame, lateral: &[f32]) -> Job {
    let given = vec![
        Input::words("frame", &[*frame]),
        Input::floats("rows", bytemuck::cast_slice(&rows(frame))),
        Input::floats("lateral", lateral),
    ];
    Job::of(&stages::AXIAL, given, Vec::new())
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
    let (got, expected) = (made(&frame, &got), made(&frame, &expected));
    vec![Check::close("iq", &got, &expected, |_| 2e-6 * sum * largest)]
}
