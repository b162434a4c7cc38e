//! `convert`: scan conversion of mask and volume.

use super::display;
use super::inputs::{Random, samples};
use super::{Case, Check, Input, Job, Size, Subject, UNWRITTEN, tiles};
use crate::reference::{convert, tiles as twin};
use insonify::sim::layout::{Frame, TILE_BLURRED, TILE_WHOLE};
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
    let bits: &[u32] =
        if case == Case::One { &[TILE_WHOLE] } else { &[0, TILE_BLURRED, TILE_WHOLE, TILE_WHOLE] };
    let given = vec![
        Input::words("frame", &[frame]),
        Input::words("tiles", &tiles::random(&frame, bits, &mut Random(7))),
        Input::floats("prescan", &prescan),
    ];
    Job::of(&stages::CONVERT, given, Vec::new())
}

fn check(job: &Job, outputs: &[Vec<u8>]) -> Vec<Check> {
    let frame: Frame = job.one("frame");
    let converted = convert::convert(&frame, &job.get::<f32>("prescan"));
    let mut mask: Vec<[f32; 2]> = job.after(outputs, "mask");
    let mut background: Vec<f32> = job.after(outputs, "background");
    let kinds: Vec<u32> = job.get("tiles");
    let mut touched = 0;
    let mut converted: Vec<[f64; 3]> =
        converted.iter().map(|v| v.map_or([0.0; 3], |[mask, grey]| [mask, 1.0, grey])).collect();
    for (at, expected) in converted.iter_mut().enumerate() {
        let [i, j] = [at as u32 % frame.image_width, at as u32 / frame.image_width];
        let tile = kinds[twin::of_pixel(&frame, i, j)];
        if tile & (TILE_BLURRED | TILE_WHOLE) == 0 {
            touched += usize::from(mask[at].map(f32::to_bits) != [UNWRITTEN; 2]);
            (mask[at], *expected) = ([0.0; 2], [0.0; 3]);
        }
        if tile & TILE_WHOLE == 0 {
            touched += usize::from(background[at].to_bits() != UNWRITTEN);
            (background[at], expected[2]) = (0.0, 0.0);
        }
    }
    let allowed = |i: usize| match display::near_edge(&frame, i) {
        true => 1.0,
        false => LEVEL,
    };
    // Beside a value that is not finite any result is allowed: its weight may be 0, and 0 times infinity is NaN.
    let expected = |which: usize, got: &[f32]| -> Vec<f64> {
        let finite = |(v, got): (&[f64; 3], &f32)| match v[which].is_finite() {
            true => v[which],
            false => f64::from(*got),
        };
        converted.iter().zip(got).map(finite).collect()
    };
    let [masks, weights] = [0, 1].map(|which| mask.iter().map(|m| m[which]).collect::<Vec<f32>>());
    vec![
        Check::close("mask", &masks, &expected(0, &masks), allowed),
        Check::close("weight", &weights, &expected(1, &weights), |i| {
            f64::from(u8::from(display::near_edge(&frame, i)))
        }),
        Check::close("background", &background, &expected(2, &background), allowed),
        Check::count("pixels beside what is wanted", masks.len(), touched, 0),
    ]
}
