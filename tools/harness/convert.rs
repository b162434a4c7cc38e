//! `convert`: scan conversion of mask and volume.

use super::display;
use super::inputs::{Random, samples};
use super::{Case, Check, Input, Job, Size, Subject};
use crate::reference::convert;
use insonify::sim::layout::Frame;
use insonify::sim::stages;

/// Largest difference of levels, as in `display`: white noise, positions exact to about 1e-6 of the image.
const LEVEL: f64 = 2e-3;

pub const SUBJECT: Subject = Subject {
    tolerance: "within 2e-3 of the twin (white noise: a position error of 2e-3 samples, 1e-6 of the \
                image), and within 1e-4 mm of the sector's edge either side will do",
    job,
    check,
    plant: |job, outputs| {
        job.edit(outputs, "background", |background: &mut [f32]| {
            let inside = background.iter_mut().find(|v| **v > 0.1);
            *inside.expect("most are inside") += 0.003;
        });
    },
    ..Subject::of(&stages::CONVERT)
};

fn job(case: Case, size: Size) -> Job {
    let frame = display::image(case, size);
    let mut prescan = Random(5).floats(2 * samples(&frame), 0.0, 1.0);
    if case == Case::NotFinite {
        prescan[700] = f32::NAN;
        prescan[901] = f32::INFINITY;
    }
    let _pixels = display::pixels(&frame);
    let given = vec![Input::words("frame", &[frame]), Input::floats("prescan", &prescan)];
    Job::of(&stages::CONVERT, given, Vec::new())
}

fn check(job: &Job, outputs: &[Vec<u8>]) -> Vec<Check> {
    let frame: Frame = job.one("frame");
    let converted = convert::convert(&frame, &job.get::<f32>("prescan"));
    let mask: Vec<[f32; 2]> = job.after(outputs, "mask");
    let background: Vec<f32> = job.after(outputs, "background");
    let allowed = |i: usize| match display::near_edge(&frame, i) {
        true => 1.0,
        false => LEVEL,
    };
    // Beside a value that is not finite any result is allowed: its weight may be 0, and 0 times infinity is NaN.
    let finite = |v: f64, got: f32| if v.is_finite() { v } else { f64::from(got) };
    let expected = |which: usize, got: &[f32]| -> Vec<f64> {
        let values = converted.iter().zip(got);
        let value = |(v, &got): (&Option<[f64; 2]>, &f32)| finite(v.map_or(0.0, |v| v[which]), got);
        values.map(value).collect()
    };
    let masks: Vec<f32> = mask.iter().map(|m| m[0]).collect();
    let weights: Vec<f32> = mask.iter().map(|m| m[1]).collect();
    let inside: Vec<f64> = converted.iter().map(|v| f64::from(u8::from(v.is_some()))).collect();
    vec![
        Check::close("mask", &masks, &expected(0, &masks), allowed),
        Check::close("weight", &weights, &inside, |i| {
            f64::from(u8::from(display::near_edge(&frame, i)))
        }),
        Check::close("background", &background, &expected(1, &background), allowed),
    ]
}
