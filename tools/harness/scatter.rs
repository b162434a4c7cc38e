//! `scatter`: echoes of scatterers and points along segments.

use super::check::relative_norm;
use super::inputs::{Random, lines, made, rows, scanlines};
use super::{Case, Check, Extent, Input, Job, Size, Subject, trace, worlds};
use crate::reference::aperture::Passed;
use crate::reference::{Segment, origin, scatter};
use insonify::sim::layout::{self, Aperture, Counters, FLAG_VOXEL, Frame};
use insonify::sim::tables::with_spheres;
use insonify::sim::{push, stages};

/// Samples beyond the first window, in one case; no multiple of a bin or a slot.
const BEYOND: u32 = 211;

/// The kernel for worlds in which something flows.
pub const FLOWING: Subject = Subject { name: "scatter_flowing", job, ..RIGID };

/// The kernel for worlds with deforming tissue.
pub const DEFORMING: Subject = Subject {
    name: "scatter_deforming",
    job: |case, size| job_of(stiff(scene(case, size), |i| i.flow = 0), case),
    ..RIGID
};

/// The kernel for worlds without deforming tissue.
pub const RIGID: Subject = Subject {
    name: "scatter_rigid",
    tolerance: "norm within 0.2 %: distances of 100 mm round at 8e-6 mm, 3e-4 rad of the carrier, and \
                a scatterer at the edge of the beam may count or not, and one of those at the ends of the \
                slab, which are 3.2e-5 mm of its height; in voxel mode 3 %, since 1e-4 \
                of the samples fall on the other side of a voxel's face",
    job: |case, size| {
        job_of(stiff(scene(case, size), |i| (i.field, i.flow) = (layout::NONE, 0)), case)
    },
    // As for a device that would be idle: several groups share a scanline.
    extent: Some(|job| Extent::Once(stages::scatter::extent(&job.one("frame"), u32::MAX))),
    check,
    plant: |job, outputs| {
        // Everything one sample too late.
        job.edit(outputs, "volume_echoes", |echoes: &mut [i32]| {
            echoes.rotate_right(2);
        });
    },
    ..Subject::of(&stages::SCATTER)
};

/// Segments found by the twin of `trace`, in the device's slots, with the table of what main paths lose.
pub(super) fn segments(job: &Job, frame: &Frame) -> (Vec<layout::Segment>, Vec<u32>, Input) {
    let mut owned = worlds::owned(job);
    let nodes = trace::nodes(frame);
    // Branches as if apertures changed nothing.
    owned.apertures = vec![Aperture::default(); nodes];
    let mut world = owned.world();
    let rows = rows(frame);
    world.rows = &rows;
    let (stacks, _) = origin::origin(&world);
    let traced = crate::reference::trace::trace(&world, &stacks);
    let capacity = frame.segment_capacity as usize;
    let mut slots = vec![layout::Segment::default(); lines(frame) * capacity];
    let mut counts = Vec::new();
    for (slot, found) in slots.chunks_mut(capacity).zip(&traced.segments) {
        for (slot, segment) in slot.iter_mut().zip(found) {
            *slot = layout::Segment::from(segment);
        }
        counts.push(found.len().min(capacity) as u32);
    }
    let none = vec![Passed::default(); nodes];
    let passed = if traced.passed.is_empty() { none } else { traced.passed };
    (slots, counts, trace::apertures(frame, &passed))
}

fn job(case: Case, size: Size) -> Job {
    job_of(scene(case, size), case)
}

/// The world of a case. Its tissues are finite: here it is the segments that are not.
pub(super) fn scene(case: Case, size: Size) -> Job {
    let case = match case {
        Case::NotFinite => Case::Random,
        case => case,
    };
    let mut job = Job { inputs: trace::scene(case, size), push: Vec::new() };
    if case == Case::Modes {
        // Enough samples to reach into a second window.
        let mut frame: Frame = job.one("frame");
        frame.samples = layout::SCATTER_WINDOW + BEYOND;
        frame.end_sample = frame.samples;
        frame.sample_pitch = frame.depth / frame.samples as f32;
        job.inputs[0] = Input::words("frame", &[frame]);
    }
    job
}

/// The same world without what `still` takes from its instances.
fn stiff(mut job: Job, still: impl Fn(&mut layout::Instance)) -> Job {
    let mut instances: Vec<layout::Instance> = job.get("instances");
    instances.iter_mut().for_each(still);
    let at = job.index("instances");
    job.inputs[at] = Input::words("instances", &instances);
    job
}

fn job_of(mut job: Job, case: Case) -> Job {
    let mut frame: Frame = job.one("frame");
    let mut random = Random(9);
    // Short wires: most segments are far from most of them.
    let wires = if case == Case::Empty { 0 } else { 10 };
    let points: Vec<[f32; 4]> = (0..wires)
        .flat_map(|_| {
            let mut within = |low, high| random.within(low, high) as f32;
            let [x, z] = [within(-15.0, 15.0), within(2.0, 58.0)];
            [(); 4].map(|()| [x, within(-3.0, 3.0), z, within(0.5, 2.0)])
        })
        .collect();
    frame.points = points.len() as u32;
    let points = with_spheres(points);
    if case == Case::Odd {
        frame.flags |= FLAG_VOXEL;
    }
    if case == Case::NotFinite {
        // That of a gate: a bin's scatterers before it are heard in it.
        frame.first_sample = layout::SCATTER_BIN + 3;
        frame.end_sample = 3 * layout::SCATTER_BIN + 5;
    }
    job.inputs[0] = Input::words("frame", &[frame]);
    let (mut segments, counts, apertures) = segments(&job, &frame);
    if case == Case::NotFinite {
        spoil(&mut segments, &counts, frame.segment_capacity as usize);
    }
    let given = ["frame", "tissues", "instances", "fields"].map(|name| job.input(name).clone());
    let mut given = given.to_vec();
    given.extend([
        Input::floats("rows", bytemuck::cast_slice(&rows(&frame))),
        Input::floats("points", points.as_flattened()),
        Input::words("segments", &segments),
        Input::words("segment_count", &counts),
        scanlines(&frame),
        apertures,
    ]);
    Job::of(&stages::SCATTER, given, bytemuck::bytes_of(&heard(case)).to_vec())
}

/// What a case hears: all of it as an image does, or as a pulse of a packet, or of that alone what flows.
fn heard(case: Case) -> push::Scatter {
    use insonify::sim::layout::{PART_FLOWING, PART_PULSE, PART_STILL};
    match case {
        Case::NotFinite => {
            push::Scatter { part: PART_STILL | PART_FLOWING | PART_PULSE, time: 2e-3 }
        }
        _ => push::Scatter::IMAGE,
    }
}

fn push(job: &Job) -> push::Scatter {
    bytemuck::pod_read_unaligned(&job.push)
}

/// One bad number in the first segment of each of nine lines.
pub(super) fn spoil(segments: &mut [layout::Segment], counts: &[u32], capacity: usize) {
    let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
    let firsts = (0..counts.len()).filter(|&line| counts[line] > 0);
    for (i, line) in firsts.take(9).enumerate() {
        let segment = &mut segments[line * capacity];
        match i / 3 {
            0 => segment.origin_length[i % 3] = bad[i % 3],
            1 => segment.origin_length[3] = bad[i % 3],
            _ => segment.direction_time[3] = bad[i % 3],
        }
    }
}

/// The segments in the device's slots.
pub(super) fn held(segments: &[layout::Segment], counts: &[u32], frame: &Frame) -> Vec<Segment> {
    let lines = segments.chunks(frame.segment_capacity as usize).zip(counts);
    let held = lines.flat_map(|(slots, &count)| slots.iter().take(count as usize));
    held.map(Segment::from).collect()
}

fn check(job: &Job, outputs: &[Vec<u8>]) -> Vec<Check> {
    let owned = worlds::owned(job);
    let world = owned.world();
    let frame = world.frame;
    let segments: Vec<layout::Segment> = job.get("segments");
    let counts: Vec<u32> = job.get("segment_count");
    let held = held(&segments, &counts, frame);
    let heard = push(job);
    let (twin, points) = (scatter::scatter(&world, &held, heard), scatter::points(&world, &held));
    let [echoes, point_echoes] = ["volume_echoes", "point_echoes"].map(|name| {
        let echoes: Vec<i32> = job.after(outputs, name);
        let echoes: Vec<f64> = echoes.into_iter().map(f64::from).collect();
        // Point targets are all heard.
        if name == "volume_echoes" { made(frame, &echoes) } else { echoes }
    });
    // A cell whose middle lies within 8e-6 mm of either end of the layer's slab may count or not: that share
    // of the scatterers, and of their power.
    let at_an_end = 4.0 * 8e-6 / (2.0 * f64::from(frame.elevation_reach));
    let allowed =
        if frame.flags & FLAG_VOXEL == 0 { (2e-3_f64.powi(2) + at_an_end).sqrt() } else { 3e-2 };
    let [fixed, point_fixed] =
        [&twin, &points].map(|twin| twin.fixed.iter().map(|&x| x as f64).collect::<Vec<f64>>());
    let fixed = made(frame, &fixed);
    // Without points there is no room for their echoes.
    let point_fixed = if frame.points > 0 { &point_fixed[..] } else { &[] };
    let counters: Counters = job.after(outputs, "counters")[0];
    let beyond = |echoes: &[f64]| {
        let lines = echoes.chunks(2 * frame.samples.max(1) as usize);
        let late = lines.flat_map(|line| line.iter().skip(2 * layout::SCATTER_WINDOW as usize));
        late.copied().collect::<Vec<f64>>()
    };
    let [late, late_fixed] = [&echoes, &fixed].map(|echoes| beyond(echoes));
    let late_points = beyond(point_fixed);
    let heard = late_fixed.is_empty() || late_fixed.iter().chain(&late_points).any(|&e| e != 0.0);
    let saturated = twin.saturated + points.saturated;
    let echoed = twin.deposits.iter().any(|&n| n > 0) as u32;
    vec![
        Check::one("echo norm", relative_norm(&echoes, &fixed), allowed),
        Check::one("beyond a window, norm", relative_norm(&late, &late_fixed), allowed),
        Check::equal("anything beyond it", &[heard], &[true]),
        Check::one(
            "points, norm",
            relative_norm(&point_echoes[..point_fixed.len()], point_fixed),
            2e-3,
        ),
        Check::equal("saturated", &[counters.saturated], &[saturated]),
        Check::equal("echoes at all", &[u32::from(echoes.iter().any(|&e| e != 0.0))], &[echoed]),
    ]
}
