//! `origin`: media at the start of each line.

use super::inputs::{frame, scanlines};
use super::worlds;
use super::{Case, Check, Input, Job, Size, Subject};
use crate::reference::origin;
use crate::reference::straight::Start;
use insonify::sim::layout::{Counters, FLAG_COINCIDENT, FLAG_MASKED, KIND_LINEAR, START_WORDS};
use insonify::sim::placement;
use insonify::sim::stages;

pub const SUBJECT: Subject = Subject {
    tolerance: "media exact: no line of these worlds runs along a surface or starts within 1e-3 mm of one, \
                unless exactly on it; the way to the mask within 1e-3 mm (a hundred of them round at 8e-6, a surface \
                met obliquely multiplies that) and the weight within 1e-4 (0.05 Np/mm over as much)",
    job,
    check,
    plant: |job, outputs| {
        job.edit(outputs, "stacks", |stacks: &mut [u32]| {
            let middle = stacks.len() / (2 * START_WORDS) * START_WORDS;
            stacks[middle + 1] ^= 1;
        });
    },
    ..Subject::of(&stages::ORIGIN)
};

fn job(case: Case, size: Size) -> Job {
    let mut frame = frame(case, size);
    // In the middle of the organs, so that lines start inside different ones.
    let deep = glam::DAffine3::from_translation(glam::DVec3::new(2.0, 0.5, 27.0));
    if case != Case::Empty {
        frame.world_from_probe = placement::matrix_rows(&deep);
        frame.probe_from_world = placement::matrix_rows(&deep.inverse());
    }
    if case == Case::NotFinite {
        frame.world_from_probe[1][3] = f32::NAN;
    }
    if case == Case::Modes {
        frame.flags |= FLAG_COINCIDENT;
    }
    let mut world = worlds::world(case);
    // Each reaches farther on one side of the lines' starts: of equals the line says which is the outer one. Some lines start in
    // one or none of these.
    if matches!(case, Case::Odd | Case::Random) {
        for (x, z, radius, priority) in [
            (10.1, 31.0, 14.3, 7),
            (11.3, 22.0, 13.1, 7),
            (2.1, 33.0, 26.9, 8),
            (2.1, 20.0, 23.2, 9),
        ] {
            let at = glam::DAffine3::from_translation(glam::DVec3::new(x, 0.4, z));
            world.place(insonify::scene::shapes::sphere(radius, 2), at, 1, priority);
        }
    }
    // A body on whose flat skin the face lies exactly: these lines have their starts in one plane.
    if frame.kind == KIND_LINEAR {
        let at = glam::DAffine3::from_translation(glam::DVec3::new(-12.0, 0.5, 31.0));
        world.place(insonify::scene::shapes::cuboid([30.0, 30.0, 8.0]), at, 1, 10);
    }
    // What some lines start in and others meet, in front of other organs or behind them.
    let masks: &[usize] = match case {
        Case::Odd => &[2, 4],
        Case::Modes => &[1],
        _ => &[],
    };
    for &mask in masks {
        frame.flags |= FLAG_MASKED;
        world.mask(mask);
    }
    let mut inputs = vec![Input::words("frame", &[frame])];
    inputs.extend(world.inputs());
    inputs.push(Input::words("tissues", &worlds::tissues()));
    inputs.push(scanlines(&frame));
    Job::of(&stages::ORIGIN, inputs, Vec::new())
}

fn check(job: &Job, outputs: &[Vec<u8>]) -> Vec<Check> {
    let owned = worlds::owned(job);
    let (expected, overflow) = origin::origin(&owned.world());
    let got: Vec<Start> =
        job.after::<[u32; START_WORDS]>(outputs, "stacks").iter().map(origin::unpack).collect();
    let media = |starts: &[Start]| -> Vec<Vec<u32>> {
        let each = |s: &Start| [&s.media.0[..], &[s.interactions]].concat();
        starts.iter().map(each).collect()
    };
    let part = |part: fn(&Start) -> f64| -> [Vec<f64>; 2] {
        [&got, &expected].map(|starts| starts.iter().map(part).collect())
    };
    let [travelled, along] = part(|s| s.travelled);
    let [weights, left] = part(|s| s.weight);
    let single = |values: Vec<f64>| -> Vec<f32> { values.iter().map(|&v| v as f32).collect() };
    let counters: Vec<Counters> = job.after(outputs, "counters");
    vec![
        Check::equal("media and interfaces", &media(&got), &media(&expected)),
        Check::close("distance", &single(travelled), &along, |_| 1e-3),
        Check::close("weight", &single(weights), &left, |_| 1e-4),
        Check::equal("overflow", &[counters[0].stack_overflow], &[overflow]),
    ]
}
