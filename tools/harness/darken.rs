//! `darken`: the acquired volume along the scanlines behind the simulated anatomy.

use super::inputs::{Random, frame, lines, samples};
use super::shadow::unpack;
use super::{Case, Check, Input, Job, Size, Subject};
use super::{aperture, trace};
use crate::reference::darken;
use insonify::sim::layout::{Aperture, FAR_PIECE, FLAG_APERTURE, Frame, MAX_PIECES};
use insonify::sim::stages;

pub const SUBJECT: Subject = Subject {
    tolerance: "2e-6: exponential and logarithm to 3e-7 each, over a range of 60 dB",
    job,
    check,
    plant: |job, outputs| {
        job.edit(outputs, "shaded", |shaded: &mut [f32]| {
            let at = (1..shaded.len()).step_by(2).find(|&i| shaded[i] > 0.1 && shaded[i] < 0.9);
            shaded[at.expect("most are between")] += 1e-4;
        });
    },
    ..Subject::of(&stages::DARKEN)
};

fn job(case: Case, size: Size) -> Job {
    let mut frame = frame(case, size);
    if case == Case::Random {
        frame.flags |= FLAG_APERTURE;
    }
    let mut random = Random(14);
    let mut pieces = Vec::new();
    for _ in 0..lines(&frame) {
        // As many pieces as there is room for, or few; several that begin at one place; the level of no sound.
        let count = match random.word() % 4 {
            0 => MAX_PIECES - 1,
            _ => 1 + random.word() as usize % 6,
        };
        let mut line = [[0.0_f32; 4]; MAX_PIECES];
        let mut begin = 0.0;
        for (i, piece) in line.iter_mut().enumerate() {
            let level = match random.word() % 9 {
                0 => -200.0,
                _ => random.within(-3.0, 1.0) as f32,
            };
            *piece = match i < count {
                true => [begin, level, random.within(-0.002, 0.004) as f32, 0.0],
                false => [FAR_PIECE, 0.0, 0.0, 0.0],
            };
            if !random.word().is_multiple_of(5) {
                begin += random.within(0.0, f64::from(frame.samples) / 8.0) as f32;
            }
        }
        pieces.extend(line);
    }
    if case == Case::NotFinite {
        pieces[0][1] = f32::NEG_INFINITY;
        pieces[MAX_PIECES][1] = f32::INFINITY;
    }
    let mut prescan = random.floats(2 * samples(&frame), 0.0, 1.0);
    for pair in prescan.as_chunks_mut::<2>().0.iter_mut().step_by(7) {
        pair[1] = 0.0;
    }
    if case == Case::NotFinite {
        prescan[301] = f32::NAN;
    }
    let given = vec![
        Input::words("frame", &[frame]),
        Input::floats("pieces", pieces.as_flattened()),
        Input::floats("prescan", &prescan),
        Input { name: "shades", ..trace::apertures(&frame, &aperture::passed(&frame)) },
    ];
    Job::of(&stages::DARKEN, given, Vec::new())
}

fn check(job: &Job, outputs: &[Vec<u8>]) -> Vec<Check> {
    let frame: Frame = job.one("frame");
    let lines = unpack(&job.get::<[f32; 4]>("pieces"));
    let prescan: Vec<[f32; 2]> = job.get("prescan");
    let shades: Vec<Aperture> = job.get("shades");
    let got: Vec<f32> = job.after(outputs, "shaded");
    let mut expected = Vec::new();
    for l in 0..frame.scanlines {
        for k in 0..frame.samples {
            let [mask, grey] = prescan[(l * frame.samples + k) as usize];
            let left = darken::transmitted(&frame, &lines, &shades, l, k);
            expected.extend([mask.into(), darken::level_behind(&frame, grey, left)]);
        }
    }
    vec![Check::close("shaded", &got, &expected, |_| 2e-6)]
}
