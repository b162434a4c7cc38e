//! `expect`: the expected power of the scatterers' echoes.

use super::inputs::{Random, rows, scanlines};
use super::scatter::{held, scene, segments, spoil};
use super::{Case, Check, Input, Job, Size, Subject, worlds};
use crate::reference::expect;
use insonify::sim::layout::{self, FLAG_VOXEL, Frame, POWER_UNITS};
use insonify::sim::stages;

pub const SUBJECT: Subject = Subject {
    tolerance: "2e-4 of a sample's power: exponentials of some 10 good to 3e-6, places to 1e-5 of a sample, \
                of which a segment's end cuts off as much of the strongest power around; and a unit of 2^-58 \
                for each of up to 64 segments, whose powers are rounded down",
    job,
    check,
    plant: |job, outputs| {
        job.edit(outputs, "expected", |sums: &mut [[u32; 4]]| {
            // 0.01 dB more in the loudest sample.
            let found = sums.iter_mut().max_by_key(|sum| sum[1]).expect("some");
            found[1] += found[1] / 400;
        });
    },
    ..Subject::of(&stages::EXPECT)
};

fn job(case: Case, size: Size) -> Job {
    let job = scene(case, size);
    let mut frame: Frame = job.one("frame");
    if case == Case::Odd {
        frame.flags |= FLAG_VOXEL;
    }
    let (mut slots, counts, apertures) = segments(&job, &frame);
    if case == Case::NotFinite {
        spoil(&mut slots, &counts, frame.segment_capacity as usize);
    }
    let speckle = (frame.samples * frame.layers) as usize;
    let given = ["tissues", "instances"].map(|name| job.input(name).clone());
    let mut given = given.to_vec();
    given.extend([
        Input::words("frame", &[frame]),
        Input::floats("rows", bytemuck::cast_slice(&rows(&frame))),
        Input::words("segments", &slots),
        Input::words("segment_count", &counts),
        scanlines(&frame),
        apertures,
        Input::floats("speckle", &Random(21).floats(speckle, 0.01, 0.02)),
    ]);
    Job::of(&stages::EXPECT, given, Vec::new())
}

fn check(job: &Job, outputs: &[Vec<u8>]) -> Vec<Check> {
    let owned = worlds::owned(job);
    let world = owned.world();
    let slots: Vec<layout::Segment> = job.get("segments");
    let segments = held(&slots, &job.get::<u32>("segment_count"), &owned.frame);
    let expected = expect::expect(&world, &segments, &job.get::<f32>("speckle"));
    let got: Vec<[u32; 4]> = job.after(outputs, "expected");
    let samples = owned.frame.samples as usize;
    let mut checks = vec![Check::equal("samples", &[got.len()], &[expected.len()])];
    for part in 0..2 {
        let name = ["direct", "reflected"][part];
        let power = |sum: &[u32; 4]| {
            let units = u64::from(sum[2 * part]) | u64::from(sum[2 * part + 1]) << 32;
            (units as f64 / f64::from(POWER_UNITS)) as f32
        };
        let twin: Vec<f64> = expected.iter().map(|powers| powers[part]).collect();
        // A segment that ends within a sample by rounding gives some of its power to the neighbour.
        let loudest = |at: usize| {
            let line = at / samples * samples;
            let near = (at.max(line + 1) - 1)..(at + 2).min(line + samples);
            twin[near].iter().copied().fold(0.0, f64::max)
        };
        let allowed: Vec<f64> =
            (0..twin.len()).map(|at| 2e-4 * loudest(at) + 64.0 / f64::from(POWER_UNITS)).collect();
        let got: Vec<f32> = got.iter().map(power).collect();
        checks.push(Check::close(name, &got, &twin, |at| allowed[at]));
        let heard = twin.iter().filter(|power| **power > 0.0).count();
        let silent = usize::from(heard == 0 && twin.len() > 2000);
        checks.push(Check::count("anything heard", 1, silent, part));
    }
    checks
}
