//! `trace`: paths, their surface echoes and their segments.

use super::check::relative_norm;
use super::inputs::{Random, frame, lines, rows, scanlines};
use super::worlds;
use super::{Case, Check, Extent, Input, Job, Size, Subject};
use crate::reference::aperture::Passed;
use crate::reference::{Segment, origin, trace};
use insonify::sim::layout::{
    self, APERTURE_BANDS, Aperture, Counters, FLAG_APERTURE, FLAG_COHERENT, FLAG_COINCIDENT,
    FLAG_FACE_REFLECTION, FLAG_FOOTPRINT, FLAG_MASKED, FLAG_ROUGH_TRANSMISSION, FLAG_SOBOL,
    FLAG_WAVEFRONT, FLAG_WORLD_TEXTURE, Frame, SAMPLING_MAIN_PATH, SAMPLING_PLAIN,
    SAMPLING_SHARED_PRIMARY, START_WORDS,
};
use insonify::sim::rounds::Rounds;
use insonify::sim::stages;

/// Number of workers: so few that each takes several pieces of work, and that there are several groups of lines.
const WORKERS: u32 = 64;

pub const SUBJECT: Subject = Subject {
    tolerance: "every segment has its twin within 2e-3 mm, 2e-3 us, 2e-4 rad and 1e-3 of its weight: \
                4e-6 mm at the first surface, times up to ten per curved bounce, three of them; the \
                echoes' norm within 0.2 %, since most are first bounces, 1e-5 us or 2e-4 rad of the \
                carrier off; one path in 400 may decide otherwise (a grazing ray, a triangle's \
                edge), which changes up to four segments",
    job,
    extent: Some(|job| {
        let frame: Frame = job.one("frame");
        let [begin, count]: [u32; 2] = bytemuck::pod_read_unaligned(&job.push);
        Extent::Rounds(rounds(job, &frame).of(&frame, begin..begin + count, &mut 0))
    }),
    check,
    plant: |job, outputs| {
        // 0.2 % too strong, and only the first stretch of each line.
        let capacity = job.one::<Frame>("frame").segment_capacity as usize;
        let counts: Vec<u32> = job.after(outputs, "segment_count");
        job.edit(outputs, "segments", |segments: &mut [layout::Segment]| {
            let lines = segments.chunks_mut(capacity).zip(counts);
            for (line, _) in lines.filter(|(_, count)| *count > 0) {
                line[0].lateral_weight[3] *= 1.002;
            }
        });
    },
    ..Subject::of(&stages::TRACE[0])
};

/// The dispatches for the paths in a job's push constants.
pub fn rounds(job: &Job, frame: &Frame) -> Rounds {
    let paths = match job.push.as_slice().try_into() {
        Ok(push) => bytemuck::cast::<[u8; 8], [u32; 2]>(push)[1],
        // The job of another kernel, whose push constants are different.
        Err(_) => frame.paths,
    };
    // Main paths that begin alike, too, in several groups.
    Rounds::new(frame, paths, WORKERS).within(WORKERS.into())
}

/// Frame, tissues, surfaces, the world's six bindings, and its fields.
pub fn scene(case: Case, size: Size) -> Vec<Input> {
    let mut frame = frame(case, size);
    frame.surface_scale = (1 << 20) as f32;
    frame.volume_scale = frame.surface_scale;
    (frame.sampling, frame.flags, frame.paths) = match case {
        Case::Odd => (
            SAMPLING_PLAIN,
            FLAG_FACE_REFLECTION | FLAG_ROUGH_TRANSMISSION | FLAG_MASKED | FLAG_WAVEFRONT,
            7,
        ),
        Case::Modes => (
            SAMPLING_SHARED_PRIMARY,
            FLAG_COINCIDENT | FLAG_COHERENT | FLAG_WORLD_TEXTURE | FLAG_FOOTPRINT | FLAG_SOBOL,
            6,
        ),
        // Main paths of their own.
        Case::One => (SAMPLING_MAIN_PATH, FLAG_ROUGH_TRANSMISSION, 3),
        // One main path of each line for all of them, that loses by the aperture.
        Case::Random => {
            (frame.origin_jitter, frame.emission_lobe) = (0.0, 0.0);
            let flags = FLAG_FOOTPRINT | FLAG_SOBOL | FLAG_WAVEFRONT | FLAG_APERTURE;
            (SAMPLING_MAIN_PATH, flags, 8)
        }
        _ => (SAMPLING_MAIN_PATH, FLAG_FOOTPRINT | FLAG_SOBOL | FLAG_WAVEFRONT, 8),
    };
    let mut tissues = worlds::tissues();
    if case == Case::NotFinite {
        tissues[2].absorption = f32::INFINITY;
    }
    let mut inputs = vec![
        Input::words("frame", &[frame]),
        Input::words("tissues", &tissues),
        Input::floats("surfaces", bytemuck::cast_slice(&worlds::surfaces())),
    ];
    let mut world = worlds::world(case);
    if case == Case::Odd {
        // An organ that others overlap, and a vessel.
        world.mask(1);
        world.mask(4);
    }
    let fields = world.field_input();
    inputs.extend(world.inputs());
    inputs.push(fields);
    inputs
}

/// Nodes of depth of all lines.
pub(super) fn nodes(frame: &Frame) -> usize {
    lines(frame) * (APERTURE_BANDS as usize + 1)
}

/// Factors by the aperture, of any size, beside what main paths have passed.
pub(super) fn apertures(frame: &Frame, passed: &[Passed]) -> Input {
    let gains = Random(17).floats(nodes(frame), -0.7, 0.7);
    let levels = Random(19).floats(nodes(frame), -0.7, 0.0);
    let table: Vec<Aperture> = gains
        .iter()
        .zip(&levels)
        .zip(passed)
        .map(|((&gain, &level), passed)| Aperture {
            gain,
            lost: passed.lost as f32,
            bent: passed.bent as f32,
            level,
        })
        .collect();
    Input::floats("apertures", bytemuck::cast_slice(&table))
}

fn job(case: Case, size: Size) -> Job {
    let mut job = Job { inputs: scene(case, size), push: Vec::new() };
    let frame: Frame = job.one("frame");
    let mut rows = rows(&frame);
    if case == Case::NotFinite {
        for row in &mut rows[50..60] {
            row.surface_gain = f32::NAN;
        }
        rows[40].sigma_elevation = f32::INFINITY;
    }
    let (stacks, _) = origin::origin(&worlds::owned(&job).world());
    job.inputs.extend([
        Input::words("stacks", &origin::pack(&stacks)),
        Input::floats("rows", bytemuck::cast_slice(&rows)),
        scanlines(&frame),
        apertures(&frame, &vec![Passed::default(); nodes(&frame)]),
    ]);
    let push = bytemuck::bytes_of(&[0, frame.paths]).to_vec();
    Job::of(&stages::TRACE[0], job.inputs, push)
}

fn check(job: &Job, outputs: &[Vec<u8>]) -> Vec<Check> {
    let owned = worlds::owned(job);
    let world = owned.world();
    let frame = world.frame;
    let stacks: Vec<_> =
        job.get::<[u32; START_WORDS]>("stacks").iter().map(origin::unpack).collect();
    let twin = trace::trace(&world, &stacks);

    let segments: Vec<layout::Segment> = job.after(outputs, "segments");
    let counts: Vec<u32> = job.after(outputs, "segment_count");
    let (mut missing, mut total) = (0, 0);
    for (line, expected) in twin.segments.iter().enumerate() {
        let first = line * frame.segment_capacity as usize;
        let held = counts[line].min(frame.segment_capacity) as usize;
        let got = segments[first..first + held].iter().map(Segment::from).collect();
        missing += unmatched(got, expected);
        total += expected.len();
    }

    let echoes: Vec<i32> = job.after(outputs, "surface_echoes");
    let echoes: Vec<f64> = echoes.into_iter().map(f64::from).collect();
    let fixed: Vec<f64> = twin.surface.fixed.iter().map(|&x| x as f64).collect();
    let counters: Counters = job.after(outputs, "counters")[0];
    let paths = lines(frame) * frame.paths as usize;
    let spare = 4 * (paths / 400);
    let interactions = counters.interactions.abs_diff(twin.counters.interactions) as usize;
    let table: Vec<Aperture> = job.after(outputs, "apertures");
    // NaN, too, is an error.
    let close = |got: f32, expected: f64, allowed: f64| (f64::from(got) - expected).abs() < allowed;
    let nodes = || table.iter().zip(&twin.passed);
    let lost_otherwise = nodes()
        .filter(|(got, passed)| !close(got.lost, passed.lost, 1e-3 + 1e-3 * passed.lost.abs()))
        .count();
    let bent_otherwise =
        nodes().filter(|(got, passed)| !close(got.bent, passed.bent, BENT)).count();
    let kept = |c: &Counters| [c.paths_lost, c.stack_overflow, c.segments_dropped];
    let limited = counters.strips_limited.abs_diff(twin.counters.strips_limited) as usize;
    vec![
        Check::count("losses", twin.passed.len(), lost_otherwise, twin.passed.len() / 100),
        Check::count("bent rays", twin.passed.len(), bent_otherwise, twin.passed.len() / 100),
        Check::count("strips limited", total, limited, spare),
        Check::count("segments", total, missing, spare),
        Check::one("echo norm", relative_norm(&echoes, &fixed), 2e-3),
        Check::count("interactions", paths, interactions, spare),
        Check::equal("counters", &kept(&counters), &kept(&twin.counters)),
    ]
}

/// The number of segments of both lists without a partner in the other.
fn unmatched(mut got: Vec<Segment>, expected: &[Segment]) -> usize {
    let mut missing = 0;
    for segment in expected {
        match got.iter().position(|s| alike(s, segment)) {
            Some(at) => drop(got.swap_remove(at)),
            None => missing += 1,
        }
    }
    missing + got.len()
}

/// Absolute error of a lens in single precision: of a direction, some 1e-7, over the step with which it is found; mm after
/// 100 mm, its change per mm, and half of the change of that.
const LENS: [f64; 3] = [1e-2, 2e-4, 1e-6];

/// Absolute error of the sine by which rays are bent: of a normal that is averaged, packed in 13 bits an axis.
const BENT: f64 = 1e-3;

/// Absolute error of a strip, mm and mm per mm, for the same reason.
const STRIP: [f64; 2] = [1e-3, 2e-5];

fn alike(a: &Segment, b: &Segment) -> bool {
    let close = |a: f64, b: f64, by: f64| (a - b).abs() <= by || (a.is_nan() && b.is_nan());
    let relative = |a: f64, b: f64| close(a, b, 1e-3 * b.abs());
    let same = (a.tissue, a.instance, a.line, a.handedness);
    same == (b.tissue, b.instance, b.line, b.handedness)
        && (a.origin - b.origin).length() < 2e-3
        && (a.direction - b.direction).length() < 2e-4
        && (a.lateral - b.lateral).length() < 2e-4
        && close(a.length, b.length, 2e-3)
        && close(a.time, b.time, 2e-3)
        && relative(a.weight, b.weight)
        && relative(a.share, b.share)
        && (0..3).all(|i| close(a.spread[i], b.spread[i], 1e-3 * b.spread[i].abs() + 1e-6))
        && a.reflected == b.reflected
        && (0..2).all(|i| close(a.strip[i], b.strip[i], 5e-3 * b.strip[i].abs() + STRIP[i]))
        && (0..3).all(|i| close(a.lens[i], b.lens[i], 5e-3 * b.lens[i].abs() + LENS[i]))
}
