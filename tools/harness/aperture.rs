//! `aperture`: what lies on the way counts by the part of the aperture that it lies in front of.

use super::inputs::{Random, frame, rows, scanlines};
use super::{Case, Check, Input, Job, Size, Subject, trace};
use crate::reference::aperture::{self, Passed};
use insonify::sim::layout::{APERTURE_BANDS, Aperture, FLAG_MASKED, Frame, Row};
use insonify::sim::stages;

pub const SUBJECT: Subject = Subject {
    tolerance: "5e-5 nepers: losses of up to 46 round at 4e-6 in each of 48 bands; a ray that falls between two \
                scanlines, or lines that lose alike but for rounding, may be either: one target in 50",
    job,
    check,
    plant: |job, outputs| {
        // Targets hear as the scanline beside them.
        job.edit(outputs, "apertures", |nodes: &mut [Aperture]| {
            for at in 1..nodes.len() {
                nodes[at - 1].gain = nodes[at].gain;
                nodes[at - 1].level = nodes[at].level;
            }
        });
    },
    ..Subject::of(&stages::APERTURE)
};

/// Absolute error of a level, nepers: where between two scanlines a ray passes rounds at 1e-5, by which rays that are turned by
/// half a radian miss a target 60 mm away by 3e-4 mm more, and two that meet there a millimetre apart overlap by so much less.
const LEVEL: f64 = 1e-3;

/// Losses and bending of main paths: losses, little ones that all lines share, those of a few organs, and shadows of bones; and surfaces of
/// organs that bend.
pub(super) fn passed(frame: &Frame) -> Vec<Passed> {
    let nodes = APERTURE_BANDS + 1;
    let mut random = Random(31);
    let mut passed = vec![Passed::default(); trace::nodes(frame)];
    for layer in 0..frame.layers {
        let mut within = |low: f64, high: f64| random.within(low, high);
        let organs = [(); 4].map(|()| {
            let begin = within(0.0, 0.6);
            let width = within(0.05, 0.4) * f64::from(frame.scanlines);
            let left = within(-0.1, 0.9) * f64::from(frame.scanlines);
            [left, left + width, begin * 60.0, begin * 60.0 + 12.0, within(0.005, 0.1)]
        });
        for l in 0..frame.scanlines {
            let mut sum = 0.0;
            for node in 1..nodes {
                let inside = |[left, right, top, bottom, _]: &[f64; 5]| {
                    (*left..*right).contains(&f64::from(l))
                        && (*top..*bottom).contains(&f64::from(node))
                };
                // Above it nothing is lost but what everything loses, and alike.
                if node % 3 != 0 {
                    sum += organs.iter().filter(|organ| inside(organ)).map(|o| o[4]).sum::<f64>();
                    sum += if node == 30 && l % 11 < 3 { 12.0 } else { 0.0 };
                }
                sum += 0.02;
                // At their upper faces round organs turn rays the more, the farther from their middles.
                let lens = |[left, right, top, _, power]: &[f64; 5]| {
                    let entered = (top.ceil() as u32) == node;
                    let beside = (2.0 * f64::from(l) - left - right) / (right - left);
                    if entered && beside.abs() < 1.0 { power * beside } else { 0.0 }
                };
                let bent = organs.iter().map(lens).sum::<f64>();
                passed[aperture::place(frame, layer * frame.scanlines + l, node)] =
                    Passed { lost: sum, bent };
            }
        }
    }
    passed
}

fn job(case: Case, size: Size) -> Job {
    let mut frame = frame(case, size);
    let mut passed = passed(&frame);
    if case == Case::Modes {
        // Around masks: some scanlines are not followed, others from somewhere on.
        frame.flags |= FLAG_MASKED;
        for line in 0..frame.scanlines * frame.layers {
            let until = [0, APERTURE_BANDS + 1, line % APERTURE_BANDS][line as usize / 7 % 3];
            for node in 0..until {
                passed[aperture::place(&frame, line, node)].lost = aperture::UNKNOWN;
            }
        }
    }
    if case == Case::NotFinite {
        passed[aperture::place(&frame, 2, 20)].lost = f64::INFINITY;
        passed[aperture::place(&frame, 2, 21)].lost = f64::INFINITY;
        passed[aperture::place(&frame, 4, 25)].bent = f64::NAN;
    }
    let table: Vec<Aperture> = passed
        .iter()
        .map(|p| Aperture { lost: p.lost as f32, bent: p.bent as f32, ..Aperture::default() })
        .collect();
    let given = vec![
        Input::words("frame", &[frame]),
        Input::floats("rows", bytemuck::cast_slice(&rows(&frame))),
        scanlines(&frame),
        Input::floats("apertures", bytemuck::cast_slice(&table)),
    ];
    Job::of(&stages::APERTURE, given, Vec::new())
}

fn check(job: &Job, outputs: &[Vec<u8>]) -> Vec<Check> {
    let frame: Frame = job.one("frame");
    let rows: Vec<Row> = job.get("rows");
    let (before, after): (Vec<Aperture>, Vec<Aperture>) =
        (job.get("apertures"), job.after(outputs, "apertures"));
    let passed: Vec<Passed> = before
        .iter()
        .map(|node| Passed { lost: node.lost.into(), bent: node.bent.into() })
        .collect();
    let twin = aperture::aperture(&frame, &rows, &passed);
    // What is no number spoils the rays that it lies on, and no more; by infinities they are left with nothing.
    let spoilt = |x: f64| x.is_nan() || x.abs() >= 60.0;
    let close = |got: f32, expected: f64, allowed: f64| {
        let got = f64::from(got);
        (got - expected).abs() < allowed || spoilt(got) || spoilt(expected)
    };
    let nodes = || after.iter().zip(&twin);
    let wrong = nodes().filter(|(got, twin)| !close(got.gain, twin.gain, 5e-5)).count();
    let levels = nodes().filter(|(got, twin)| !close(got.level, twin.level, LEVEL)).count();
    let unknown = twin.iter().filter(|found| found.level.is_nan()).count();
    let spoiled = after.iter().filter(|node| spoilt(node.gain.into())).count();
    let unlike = twin.iter().filter(|found| found.gain.abs() > 0.01).count();
    let bent = twin.iter().filter(|found| found.level < -0.01).count();
    let given = |nodes: &[Aperture]| {
        nodes.iter().map(|node| [node.lost.to_bits(), node.bent.to_bits()]).collect::<Vec<_>>()
    };
    let enough = twin.len() > 2000;
    vec![
        Check::count("factors", twin.len(), wrong, twin.len() / 50),
        Check::count("levels", twin.len(), levels, twin.len() / 50),
        Check::equal("what paths pass", &given(&after), &given(&before)),
        Check::count("targets without a factor", twin.len(), spoiled, twin.len() / 4),
        Check::count("targets without a level", twin.len(), unknown, twin.len() / 4),
        Check::count("lines that all lose alike", 1, usize::from(unlike == 0 && enough), 0),
        Check::count("lines that all bend alike", 1, usize::from(bent == 0 && enough), 0),
    ]
}
