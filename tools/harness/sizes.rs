//! Sizes of the bindings of a job.

use insonify::sim::layout::{Frame, Instance, Segment};
use insonify::sim::pass::Sizes;
use insonify::sim::stages;

use super::{Job, Role, trace, worlds};

/// Bytes that a frame's kernel needs of the binding `name`: those that its stage states, or as much of the
/// anatomy as the instances need.
pub fn of_frame(job: &Job, name: &str) -> usize {
    match stages::array(name) {
        Some(array) if array.entries.is_some() => array.bytes(&sizes(job)) as usize,
        _ => worlds::size(job, name),
    }
}

fn sizes(job: &Job) -> Sizes {
    let frame: Frame = job.optional("frame").first().copied().unwrap_or_default();
    let instances: Vec<Instance> = job.optional("instances");
    // Only of bindings that the kernel reads: the others are undefined before it has written them.
    let is_read = job.inputs.iter().any(|i| i.name == "segments" && i.role == Role::Read);
    let segments: Vec<Segment> = if is_read { job.get("segments") } else { Vec::new() };
    let used = instances.iter().map(|i| i.tissue).chain(segments.iter().map(|s| s.tissue));
    let rounds = trace::rounds(job, &frame);
    Sizes {
        frame,
        tissues: u64::from(used.fold(frame.background, u32::max)) + 1,
        main_paths: rounds.main_paths(),
        interactions: rounds.interactions(),
    }
}
