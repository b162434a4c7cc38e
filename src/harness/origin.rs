//! `origin`: media at the start of each line.

use std::mem::size_of;

use super::inputs::{frame, lines};
use super::worlds;
use super::{Case, Check, Element, Extent, Input, Job, Size, Subject};
use crate::reference::origin;
use crate::sim::layout::{Counters, FLAG_COINCIDENT, Frame, MAX_STACK};
use crate::sim::placement;

pub const SUBJECT: Subject = Subject {
    name: "origin",
    stems: &["origin_bvh", "origin_count", "origin_query"],
    tolerance: "exact: no line of these worlds starts within 1e-3 mm of a surface or runs along one",
    job,
    sizes: |job| {
        let mut sizes = vec![size_of::<Frame>()];
        sizes.extend(worlds::sizes(job));
        let stacks = 4 * (MAX_STACK + 1) * lines(&job.one("frame"));
        sizes.extend([stacks, size_of::<Counters>()]);
        sizes
    },
    extent: |job| Extent::Threads([lines(&job.one("frame")) as u32, 1, 1]),
    check,
    plant: |job, outputs| {
        job.edit(outputs, "stacks", |stacks: &mut [u32]| {
            let middle = stacks.len() / (2 * (MAX_STACK + 1)) * (MAX_STACK + 1);
            stacks[middle + 1] ^= 1;
        });
    },
};

fn job(case: Case, size: Size) -> Job {
    let mut frame = frame(case, size);
    // In the middle of the organs, so that lines start inside different ones.
    let deep = glam::DAffine3::from_translation(glam::DVec3::new(2.0, 0.5, 27.0));
    if case != Case::Empty {
        frame.world_from_probe = placement::rows(&deep);
        frame.probe_from_world = placement::rows(&deep.inverse());
    }
    if case == Case::NotFinite {
        frame.world_from_probe[1][3] = f32::NAN;
    }
    if case == Case::Modes {
        frame.flags |= FLAG_COINCIDENT;
    }
    let mut inputs = vec![Input::words("frame", &[frame])];
    inputs.extend(worlds::world(case).inputs());
    let stacks = (MAX_STACK + 1) * lines(&frame);
    inputs.push(Input::output("stacks", Element::Word, stacks));
    inputs.push(Input::sum(
        "counters",
        Element::Word,
        size_of::<Counters>() / 4,
    ));
    Job {
        inputs,
        push: Vec::new(),
    }
}

fn check(job: &Job, outputs: &[Vec<u8>]) -> Vec<Check> {
    let owned = worlds::owned(job);
    let (expected, overflow) = origin::origin(&owned.world());
    let got: Vec<Vec<u32>> = job
        .after::<[u32; MAX_STACK + 1]>(outputs, "stacks")
        .iter()
        .map(|s| s[1..].iter().copied().take(s[0] as usize).collect())
        .collect();
    let expected: Vec<Vec<u32>> = expected.into_iter().map(|s| s.0).collect();
    let counters: Vec<Counters> = job.after(outputs, "counters");
    vec![
        Check::equal("stacks", &got, &expected),
        Check::equal("overflow", &[counters[0].stack_overflow], &[overflow]),
    ]
}
