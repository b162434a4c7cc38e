//! `aperture`: losses by the part of the aperture that they lie in front of.

use super::inputs::{Random, frame, rows, scanlines};
use super::{Case, Check, Input, Job, Size, Subject, trace};
use crate::reference::aperture;
use insonify::sim::layout::{APERTURE_BANDS, Frame, Row};
use insonify::sim::stages;

pub const SUBJECT: Subject = Subject {
    tolerance: "5e-5 nepers: losses of up to 46 round at 4e-6 in each of 48 bands; a ray that falls between two \
                scanlines, or lines that lose alike but for rounding, may be either: one target in 50",
    job,
    check,
    plant: |job, outputs| {
        // Targets hear as the scanline beside them.
        job.edit(outputs, "apertures", |nodes: &mut [[f32; 2]]| {
            (1..nodes.len()).for_each(|at| nodes[at - 1][0] = nodes[at][0]);
        });
    },
    ..Subject::of(&stages::APERTURE)
};

/// Losses of main paths: little ones that all lines share, those of a few organs, and shadows of bones.
pub(super) fn losses(frame: &Frame) -> Vec<f64> {
    let nodes = APERTURE_BANDS + 1;
    let mut random = Random(31);
    let mut lost = vec![0.0; trace::nodes(frame)];
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
                lost[aperture::place(frame, layer * frame.scanlines + l, node)] = sum;
            }
        }
    }
    lost
}

fn job(case: Case, size: Size) -> Job {
    let frame = frame(case, size);
    let mut lost = losses(&frame);
    if case == Case::NotFinite {
        lost[aperture::place(&frame, 2, 20)] = f64::INFINITY;
        lost[aperture::place(&frame, 2, 21)] = f64::INFINITY;
    }
    let table: Vec<[f32; 2]> = lost.iter().map(|&lost| [0.0, lost as f32]).collect();
    let given = vec![
        Input::words("frame", &[frame]),
        Input::floats("rows", bytemuck::cast_slice(&rows(&frame))),
        scanlines(&frame),
        Input::floats("apertures", table.as_flattened()),
    ];
    Job::of(&stages::APERTURE, given, Vec::new())
}

fn check(job: &Job, outputs: &[Vec<u8>]) -> Vec<Check> {
    let frame: Frame = job.one("frame");
    let rows: Vec<Row> = job.get("rows");
    let (before, after): (Vec<[f32; 2]>, Vec<[f32; 2]>) =
        (job.get("apertures"), job.after(outputs, "apertures"));
    let lost: Vec<f64> = before.iter().map(|node| node[1].into()).collect();
    let twin = aperture::aperture(&frame, &rows, &lost);
    // What is no number spoils the rays that it lies on, and no more; by infinities they are left with nothing.
    let spoilt = |x: f64| x.is_nan() || x.abs() >= 60.0;
    let close = |got: f32, expected: f64| {
        let got = f64::from(got);
        (got - expected).abs() < 5e-5 || spoilt(got) || spoilt(expected)
    };
    let wrong = after.iter().zip(&twin).filter(|(got, twin)| !close(got[0], **twin)).count();
    let spoiled = after.iter().filter(|node| spoilt(node[0].into())).count();
    let unlike = twin.iter().filter(|gain| gain.abs() > 0.01).count();
    let losses =
        |nodes: &[[f32; 2]]| nodes.iter().map(|node| node[1].to_bits()).collect::<Vec<_>>();
    vec![
        Check::count("factors", twin.len(), wrong, twin.len() / 50),
        Check::equal("losses", &losses(&after), &losses(&before)),
        Check::count("targets without a factor", twin.len(), spoiled, twin.len() / 4),
        Check::count(
            "lines that all lose alike",
            1,
            usize::from(unlike == 0 && twin.len() > 2000),
            0,
        ),
    ]
}
