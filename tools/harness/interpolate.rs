//! `interpolate`: vectors between keyframes.

use super::inputs::Random;
use super::{Case, Check, Extent, Input, Job, Size, Subject};
use crate::reference::interpolate;
use glam::DVec4;
use insonify::scene::smoothed::pack;
use insonify::sim::layout::{PACKED, SUM, UNIT};
use insonify::sim::push;

pub const SUBJECT: Subject = Subject {
    name: "interpolate",
    pass: None,
    tolerance: "5e-7 of the sum of the magnitudes that are added (four products and three sums, each \
                rounded by 6e-8), over the length that a unit vector had, and 5e-7 for its root and \
                quotient; packed directions within 5e-4 and coherences within 0.009, what their words round",
    job,
    size: |job, _| {
        let push = push(job);
        let read = push.sources.iter().zip(push.weights);
        let read = read.filter(|&(_, weight)| weight != 0.0).map(|(s, _)| *s);
        let end = read.chain([push.target]).max().unwrap_or(0) + push.count;
        4 * (push.stride * end) as usize
    },
    extent: Some(|job| Extent::threads(push(job).count, 1)),
    check,
    plant: |job, outputs| {
        // Rounding of numbers about 1.
        let target = (push(job).stride * push(job).target) as usize;
        job.edit(outputs, "values", |values: &mut [f32]| {
            values[target + 5] += 1e-4;
        });
    },
};

fn push(job: &Job) -> push::Interpolate {
    bytemuck::pod_read_unaligned(&job.push)
}

fn job(case: Case, size: Size) -> Job {
    let count = match (case, size) {
        (Case::Random, Size::Standard) => 460_000,
        (Case::Random, Size::Small) => 5000,
        (Case::Empty, _) => 0,
        (Case::One, _) => 1,
        (Case::Odd, _) => 333,
        (Case::Modes | Case::NotFinite, _) => 200,
    };
    let mut push = push::Interpolate {
        count,
        target: 4 * count,
        sources: [0, count, 2 * count, 3 * count],
        // Catmull-Rom's at a quarter of the interval.
        weights: [-0.070_312_5, 0.867_187_5, 0.226_562_5, -0.023_437_5],
        // Displacements have a fourth float, which is unused.
        stride: match case {
            Case::Random | Case::One => 4,
            Case::Odd => 1,
            _ => 3,
        },
        ..push::Interpolate::default()
    };
    let mut values = Random(31).floats(5 * (push.stride * count) as usize, -1.0, 1.0);
    match case {
        // Linear and packed; the two without weight begin beyond the buffer.
        Case::Odd => {
            let mut random = Random(32);
            values = (0..5 * count)
                .map(|_| {
                    let direction = [(); 3].map(|()| random.within(-1.0, 1.0));
                    f32::from_bits(pack(direction.into(), random.within(0.0, 1.0)))
                })
                .collect();
            push.kind = PACKED;
            push.sources = [1, count, 1 << 28, u32::MAX];
            push.weights = [0.3, 0.7, 0.0, 0.0];
        }
        // In place of a keyframe, of which some vectors are zero and one is as short as can be.
        Case::Modes => {
            push.kind = UNIT;
            push.target = count;
            push.weights = [0.0, 1.0, 0.0, 0.0];
            values[3 * count as usize..][..12].fill(0.0);
            values[3 * count as usize + 4] = 1e-30;
        }
        Case::NotFinite => {
            push.weights[3] = 0.0;
            for (i, bad) in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY].into_iter().enumerate() {
                values[7 * i] = bad;
                values[9 * count as usize..][70 * i] = bad;
            }
        }
        Case::Random | Case::Empty | Case::One => {}
    }
    Job { inputs: vec![Input::floats("values", &values)], push: bytemuck::bytes_of(&push).to_vec() }
}

fn check(job: &Job, outputs: &[Vec<u8>]) -> Vec<Check> {
    let push = push(job);
    let before: Vec<f32> = job.get("values");
    let after: Vec<f32> = job.after(outputs, "values");
    let expected = interpolate::interpolate(&push, &before);
    if push.kind == PACKED {
        return packed(&push, &before, &after, &expected);
    }
    let expected: Vec<f64> = expected.iter().flat_map(|v| v.truncate().to_array()).collect();
    let stride = push.stride as usize;
    let first = stride * push.target as usize;
    let written: Vec<usize> =
        (0..3 * push.count as usize).map(|i| first + stride * (i / 3) + i % 3).collect();
    // What is added up, and how long the sum is.
    let plain = push::Interpolate { kind: SUM, ..push };
    let sums = interpolate::interpolate(&plain, &before);
    let magnitude = |i: usize| {
        let parts = push.sources.iter().zip(push.weights);
        let parts = parts.filter(|&(_, weight)| weight != 0.0);
        parts
            .map(|(&s, w)| f64::from((w * before[stride * (s as usize + i / 3) + i % 3]).abs()))
            .sum::<f64>()
    };
    let allowed = |i: usize| {
        if push.kind == SUM {
            return 5e-7 * magnitude(i);
        }
        let length = sums[i / 3].truncate().length().max(f64::MIN_POSITIVE);
        let vector = 3 * (i / 3);
        let all = (vector..vector + 3).map(magnitude).sum::<f64>();
        5e-7 * (1.0 + all / length)
    };
    let rest = |values: &[f32]| -> Vec<u32> {
        let outside = values.iter().enumerate();
        let outside = outside.filter(|(i, _)| written.binary_search(i).is_err());
        outside.map(|(_, v)| v.to_bits()).collect()
    };
    let made: Vec<f32> = written.iter().map(|&i| after[i]).collect();
    vec![
        Check::close("vectors", &made, &expected, allowed),
        Check::equal("everything else", &rest(&after), &rest(&before)),
    ]
}

/// The same of packed vectors, as the twin unpacks them: their words round directions to 5e-4 rad, coherences to 1/126.
fn packed(
    push: &push::Interpolate,
    before: &[f32],
    after: &[f32],
    expected: &[DVec4],
) -> Vec<Check> {
    let target = push.target as usize;
    let end = target + push.count as usize;
    let alone =
        push::Interpolate { sources: [push.target; 4], weights: [1.0, 0.0, 0.0, 0.0], ..*push };
    let made = interpolate::interpolate(&alone, after);
    let directions = |means: &[DVec4]| -> Vec<f64> {
        means.iter().flat_map(|v| v.truncate().to_array()).collect()
    };
    let coherences = |means: &[DVec4]| -> Vec<f64> { means.iter().map(|v| v.w).collect() };
    let single = |values: Vec<f64>| -> Vec<f32> { values.into_iter().map(|v| v as f32).collect() };
    let bits = |values: &[f32]| values.iter().map(|v| v.to_bits()).collect::<Vec<u32>>();
    let rest = |values: &[f32]| [bits(&values[..target]), bits(&values[end..])];
    vec![
        Check::close("directions", &single(directions(&made)), &directions(expected), |_| 5e-4),
        Check::close("coherences", &single(coherences(&made)), &coherences(expected), |_| 0.009),
        Check::equal("everything else", &rest(after), &rest(before)),
    ]
}
