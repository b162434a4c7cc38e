//! `label`: the anatomy along the scanlines.

use super::inputs::{scanlines, straight_frame};
use super::worlds;
use super::{Case, Check, Input, Job, Size, Subject};
use crate::reference::label::label;
use insonify::sim::layout::NONE;
use insonify::sim::stages;

/// Distance from a crossing, mm, within which a sample may be on either side.
const EDGE: f64 = 1e-3;

pub const SUBJECT: Subject = Subject {
    tolerance: "exact but within 1e-3 mm of a crossing, where the label before it will do, too",
    job,
    check,
    plant: |job, outputs| {
        job.edit(outputs, "labels", |labels: &mut [u32]| {
            let at = labels.iter().position(|label| *label != NONE).expect("samples");
            labels[at] += 1;
        });
    },
    ..Subject::of(&stages::LABEL)
};

fn job(case: Case, size: Size) -> Job {
    let frame = straight_frame(case, size);
    let mut inputs = vec![Input::words("frame", &[frame])];
    inputs.extend(worlds::world(case).inputs());
    inputs.push(scanlines(&frame));
    Job::of(&stages::LABEL, inputs, Vec::new())
}

fn check(job: &Job, outputs: &[Vec<u8>]) -> Vec<Check> {
    let owned = worlds::owned(job);
    let (world, frame) = (owned.world(), owned.frame);
    let got: Vec<[u32; 2]> = job.after(outputs, "labels");
    let lines = label(&world);
    let (mut wrong, mut near) = (0, 0);
    for (i, found) in got.iter().enumerate() {
        let line = &lines[i / frame.samples as usize];
        let distance = f64::from(i as u32 % frame.samples) * f64::from(frame.sample_pitch);
        let label =
            |distance: f64| [line.at(distance).unwrap_or(NONE), line.tissue(&world, distance)];
        let either = line.crossings.iter().any(|c| (c.t - distance).abs() < EDGE);
        near += usize::from(either);
        let beside = [distance - EDGE, distance + EDGE].map(label);
        let right = *found == label(distance) || (either && beside.contains(found));
        wrong += usize::from(!right);
    }
    vec![
        Check::count("labels", got.len(), wrong, 0),
        // Not more samples than lie so close by chance are left out; otherwise the comparison would allow any result.
        Check::count("samples at a crossing", got.len(), near, got.len() / 50),
    ]
}
