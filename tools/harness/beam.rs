//! `beam`: accumulators to amplitudes, lateral smoothing, noise.

use super::inputs::{Random, frame, made, narrow, rows, samples};
use super::{Case, Check, Input, Job, Size, Subject};
use crate::reference::beam;
use insonify::sim::layout::{Counters, Frame, Row};
use insonify::sim::stages;

/// Largest magnitude of the random accumulators.
const ECHO: f64 = 5e6;
const NOISE: f32 = 0.02;

pub const SUBJECT: Subject = Subject {
    tolerance: "4e-7 of the largest amplitude (accumulators beyond 2^24 lose bits as f32, 33 terms \
                round at 6e-8 each) and 1e-5 of the noise (logarithm and circle within 3e-7, a root within \
                a few units in the last place, times 5)",
    job,
    check,
    plant: |job, outputs| {
        job.edit(outputs, "lateral", |lateral: &mut [f32]| {
            lateral[101] += 1e-3;
        });
    },
    ..Subject::of(&stages::BEAM)
};

/// Shares of the scanlines, and sums of the elements that are not coupled.
pub(super) fn contact(frame: &Frame, random: &mut Random) -> Vec<f32> {
    let mut contact = random.floats(frame.face_lines() as usize, 0.0, 1.0);
    let mut air = 0.0;
    contact.push(air);
    for coupled in random.floats(frame.face_lines() as usize, 0.0, 1.0) {
        air += coupled.round();
        contact.push(air);
    }
    contact
}

fn job(case: Case, size: Size) -> Job {
    let mut frame = narrow(case, frame(case, size));
    let mut rows = rows(&frame);
    frame.noise = NOISE;
    // Most cases have point targets.
    frame.points = u32::from(case != Case::Odd);
    let mut random = Random(1);
    let mut echoes = || -> Vec<i32> {
        (0..2 * samples(&frame)).map(|_| random.within(-ECHO, ECHO) as i32).collect()
    };
    let (mut surface, volume) = (echoes(), echoes());
    let points = if frame.points > 0 { echoes() } else { vec![0; 2] };
    let contact = contact(&frame, &mut random);
    if case == Case::NotFinite {
        rows[3].surface_undo = f32::NAN;
        rows[5].volume_undo = f32::INFINITY;
        surface[50] = i32::MIN;
        surface[60] = i32::MAX;
    }
    let given = vec![
        Input::words("frame", &[frame]),
        Input::floats("rows", bytemuck::cast_slice(&rows)),
        Input::integers("surface_echoes", &surface),
        Input::integers("volume_echoes", &volume),
        Input::floats("contact", &contact),
        Input::integers("point_echoes", &points),
    ];
    Job::of(&stages::BEAM, given, Vec::new())
}

fn check(job: &Job, outputs: &[Vec<u8>]) -> Vec<Check> {
    let frame: Frame = job.one("frame");
    let rows: Vec<Row> = job.get("rows");
    let accumulators: [Vec<i32>; 3] =
        ["surface_echoes", "volume_echoes", "point_echoes"].map(|name| job.get(name));
    let accumulators = accumulators.each_ref().map(Vec::as_slice);
    let [surface, volume, points] = accumulators;
    // Without points there is no room for their echoes.
    let points = if frame.points > 0 { points } else { &[] };
    let contact: Vec<f32> = job.get("contact");
    let expected = beam::beam(&frame, &rows, [surface, volume, points], &contact);
    let got: Vec<f32> = job.after(outputs, "lateral");
    let counters: Vec<Counters> = job.after(outputs, "counters");
    let largest = |v: &[i32]| f64::from(v.iter().map(|x| x.unsigned_abs()).max().unwrap_or(0));
    let (s, v) = (largest(surface), largest(volume) + largest(points));
    let allowed = |i: usize| {
        let row = &rows[i / 2 % frame.samples as usize];
        let undone = s * f64::from(row.surface_undo) + 3.0 * v * f64::from(row.volume_undo);
        4e-7 * undone.max(0.0) + 1e-5 * f64::from(frame.noise)
    };
    vec![
        Check::close("lateral", &made(&frame, &got), &made(&frame, &expected), allowed),
        Check::equal(
            "saturated",
            &[counters[0].saturated],
            &[beam::saturated([surface, volume, points])],
        ),
    ]
}
