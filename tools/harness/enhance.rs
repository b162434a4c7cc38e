//! `enhance`: speckle reduction and edge enhancement, from the moments of `moments`.

use super::inputs::{Random, frame, samples};
use super::moments::chain;
use super::{Case, Check, Input, Job, Size, Subject};
use crate::reference::enhance::{self, Chain};
use insonify::sim::layout::Frame;
use insonify::sim::{push, stages};

pub const SUBJECT: Subject = Subject {
    tolerance: "the mean is good to 2e-6 and the variance v to 4e-6, which counts by up to s / v^2 for speckle of variance \
                s, or by 1 / s where v is smaller; both times 1 + edge enhancement",
    job,
    check,
    plant: |job, outputs| {
        job.edit(outputs, "log_image", |levels: &mut [f32]| {
            let grey = levels.iter_mut().find(|level| (0.2..0.8).contains(*level));
            *grey.expect("levels spread over the range") += 3e-3;
        });
    },
    ..Subject::of(&stages::ENHANCE[1])
};

fn job(case: Case, size: Size) -> Job {
    let frame = frame(case, size);
    let mut random = Random(22);
    let levels = random.floats(samples(&frame), 0.0, 1.0);
    // Of neighbourhoods with less and with more variance than speckle has.
    let moments: Vec<f32> = (0..samples(&frame))
        .flat_map(|_| {
            let mean = random.within(0.0, 1.0);
            [mean as f32, (mean * mean + random.within(0.0, 0.05)) as f32]
        })
        .collect();
    let given = vec![
        Input::words("frame", &[frame]),
        Input::floats("moments", &moments),
        Input::floats("log_image", &levels),
    ];
    let chain = chain(case);
    let push = push::Enhance {
        neighbourhood: chain.neighbourhood as f32,
        speckle_reduction: chain.speckle_reduction as f32,
        edge_enhancement: chain.edge_enhancement as f32,
        speckle: chain.speckle as f32,
    };
    Job::of(&stages::ENHANCE[1], given, bytemuck::bytes_of(&push).to_vec())
}

fn check(job: &Job, outputs: &[Vec<u8>]) -> Vec<Check> {
    let frame: Frame = job.one("frame");
    let push: push::Enhance = bytemuck::pod_read_unaligned(&job.push);
    let chain = Chain {
        neighbourhood: push.neighbourhood.into(),
        speckle_reduction: push.speckle_reduction.into(),
        edge_enhancement: push.edge_enhancement.into(),
        speckle: push.speckle.into(),
    };
    let around = enhance::neighbourhoods(&frame, &job.get::<[f32; 2]>("moments"), &chain);
    let levels: Vec<f32> = job.get("log_image");
    let both = || around.iter().zip(&levels);
    let expected: Vec<f64> =
        both().map(|(around, &level)| enhance::enhanced(*around, level.into(), &chain)).collect();
    let allowed: Vec<f64> = both()
        .map(|([mean, variance], &level)| {
            let by_variance = chain.speckle_reduction * chain.speckle
                / variance.max(chain.speckle).powi(2)
                * (f64::from(level) - mean).abs();
            (1.0 + chain.edge_enhancement) * (2e-6 + 4e-6 * by_variance)
        })
        .collect();
    let got: Vec<f32> = job.after(outputs, "log_image");
    vec![Check::close("log_image", &got, &expected, |i| allowed[i])]
}
