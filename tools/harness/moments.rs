//! `moments`: mean and mean square of levels across the scanlines.

use super::inputs::{Random, frame, rows, samples};
use super::{Case, Check, Input, Job, Size, Subject};
use crate::reference::enhance::{self, Chain};
use insonify::sim::layout::{Frame, Row};
use insonify::sim::push;
use insonify::sim::stages;

pub const SUBJECT: Subject = Subject {
    tolerance: "2e-6: 33 levels up to 1, each with a weight good to 2e-7, over the sum of these weights",
    job,
    check,
    plant: |job, outputs| {
        // One scanline beside.
        let samples = job.one::<Frame>("frame").samples as usize;
        job.edit(outputs, "moments", |moments: &mut [f32]| moments.rotate_right(2 * samples));
    },
    ..Subject::of(&stages::ENHANCE[0])
};

/// The display chain in a case.
pub(super) fn chain(case: Case) -> Chain {
    let (neighbourhood, speckle_reduction, edge_enhancement) = match case {
        Case::Random => (1.0, 0.7, 0.5),
        // Narrower than a scanline.
        Case::One => (0.25, 1.0, 0.0),
        // Farther than kernels reach.
        Case::Modes => (4.0, 1.0, 4.0),
        _ => (1.5, 0.0, 1.0),
    };
    // 5.57 dB of 60.
    let speckle = (5.57f64 / 60.0).powi(2);
    Chain { neighbourhood, speckle_reduction, edge_enhancement, speckle }
}

fn job(case: Case, size: Size) -> Job {
    let frame = frame(case, size);
    let given = vec![
        Input::words("frame", &[frame]),
        Input::floats("rows", bytemuck::cast_slice(&rows(&frame))),
        Input::floats("log_image", &Random(21).floats(samples(&frame), 0.0, 1.0)),
    ];
    let push = push::Moments { neighbourhood: chain(case).neighbourhood as f32 };
    Job::of(&stages::ENHANCE[0], given, bytemuck::bytes_of(&push).to_vec())
}

fn check(job: &Job, outputs: &[Vec<u8>]) -> Vec<Check> {
    let push: push::Moments = bytemuck::pod_read_unaligned(&job.push);
    let chain = Chain { neighbourhood: push.neighbourhood.into(), ..chain(Case::Random) };
    let rows: Vec<Row> = job.get("rows");
    let expected = enhance::moments(&job.one("frame"), &rows, &job.get::<f32>("log_image"), &chain);
    let got: Vec<f32> = job.after(outputs, "moments");
    vec![Check::close("moments", &got, expected.as_flattened(), |_| 2e-6)]
}
