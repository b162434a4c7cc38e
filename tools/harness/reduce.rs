//! `reduce`: a level of the blend's pyramid from the one below.

use super::inputs::Random;
use super::{Case, Check, Element, Extent, Input, Job, Size, Subject};
use crate::reference::pyramid::{self, Level};
use insonify::sim::stages;

pub const SUBJECT: Subject = Subject {
    tolerance: "2e-6: 25 roundings of sums up to 1",
    job,
    size: |job, name| {
        let [fine, coarse] = sizes(&job.push);
        12 * if name == "fine" { fine } else { coarse }.iter().product::<usize>()
    },
    extent: Some(|job| {
        let [_, coarse] = sizes(&job.push);
        Extent::threads(coarse[0] as u32, coarse[1] as u32)
    }),
    check,
    plant: |job, outputs| {
        // A column too far to the right.
        job.edit(outputs, "coarse", |coarse: &mut [f32]| {
            coarse.rotate_right(3);
        });
    },
    ..Subject::of(&stages::REDUCE)
};

/// Pixels of the two levels along x and y.
fn sizes(push: &[u8]) -> [[usize; 2]; 2] {
    let size: [u32; 2] = bytemuck::pod_read_unaligned(&push[..8]);
    let fine = size.map(|n| n as usize);
    [fine, fine.map(|n| n.div_ceil(2))]
}

/// Pixels along x and y of a level.
pub(super) fn size_of_level(case: Case, size: Size) -> [u32; 2] {
    match (case, size) {
        (Case::Random, Size::Standard) => [1024, 768],
        (Case::Empty, _) => [0, 7],
        (Case::One, _) => [1, 1],
        (Case::Odd, _) => [333, 211],
        (Case::Modes, _) => [2, 301],
        _ => [200, 160],
    }
}

/// A level of noise; half of it has no weight, and a strip is not simulated.
pub(super) fn noise(random: &mut Random, size: [u32; 2]) -> Vec<[f32; 3]> {
    let pixels = (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| (x, y)));
    pixels
        .map(|(x, y)| {
            let sector = match random.word() % 4 {
                0 => random.within(0.0, 1.0),
                _ if x > 2 * y => 0.0,
                _ => 1.0,
            };
            let inside = match random.word() % 3 {
                _ if y % 64 > 50 => 0.0,
                0 => random.within(0.0, sector),
                _ => sector,
            };
            [random.within(-inside, inside), inside, sector].map(|v| v as f32)
        })
        .collect()
}

/// A level in the form of the twin.
pub(super) fn level(size: [usize; 2], sums: &[[f32; 3]]) -> Level {
    Level { size, sums: sums.iter().map(|s| s.map(f64::from)).collect() }
}

fn job(case: Case, size: Size) -> Job {
    let size = size_of_level(case, size);
    let mut fine = noise(&mut Random(12), size);
    if case == Case::NotFinite {
        fine[700][0] = f32::NAN;
        fine[9000][1] = f32::INFINITY;
    }
    let coarse: u32 = size.map(|n| n.div_ceil(2)).iter().product();
    Job {
        inputs: vec![
            Input::floats("fine", fine.as_flattened()),
            Input::output("coarse", Element::Float, 3 * coarse as usize),
        ],
        push: bytemuck::bytes_of(&size).to_vec(),
    }
}

fn check(job: &Job, outputs: &[Vec<u8>]) -> Vec<Check> {
    let [size, _] = sizes(&job.push);
    let fine: Vec<[f32; 3]> = job.get("fine");
    let twin = pyramid::reduce(&level(size, &fine));
    let got: Vec<f32> = job.after(outputs, "coarse");
    let expected = twin.sums.as_flattened();
    vec![Check::close("coarse", &got, expected, |_| 2e-6)]
}
