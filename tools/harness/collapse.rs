//! `collapse`: one level of the blend's pyramid added to the result of the coarser ones.

use super::inputs::Random;
use super::reduce::{level, noise, size_of_level};
use super::{Case, Check, Element, Extent, Input, Job, Size, Subject};
use crate::reference::pyramid;
use insonify::sim::stages;

pub const SUBJECT: Subject = Subject {
    tolerance: "3e-6: quotients of sums of nine terms, the upper sum nowhere above the lower in magnitude; \
                single precision",
    job,
    size: |job, name| {
        let [fine, coarse] = sizes(job).map(|n| n[0] * n[1]);
        match name {
            "fine" => 12 * fine,
            "coarse" => 12 * coarse,
            "coarse_change" => 4 * coarse,
            _ => 4 * fine,
        }
    },
    extent: Some(|job| {
        let [fine, _] = sizes(job);
        Extent::threads(fine[0] as u32, fine[1] as u32)
    }),
    check,
    plant: |job, outputs| {
        job.edit(outputs, "change", |change: &mut [f32]| {
            let middle = change.len() / 2;
            let at = change[middle..].iter().position(|v| v.abs() > 0.01);
            change[middle + at.expect("most are more")] += 1e-4;
        });
    },
    ..Subject::of(&stages::COLLAPSE)
};

/// Pixels along x and y of the level and of the next coarser one; 0 if there is none.
fn sizes(job: &Job) -> [[usize; 2]; 2] {
    let [width, height, coarsest]: [u32; 3] = bytemuck::pod_read_unaligned(&job.push);
    let fine = [width, height].map(|n| n as usize);
    let coarse = match coarsest {
        0 => fine.map(|n| n.div_ceil(2)),
        _ => [0, 0],
    };
    [fine, coarse]
}

fn job(case: Case, size: Size) -> Job {
    let size = size_of_level(case, size);
    let coarsest = u32::from(matches!(case, Case::NotFinite | Case::Empty));
    let mut random = Random(13);
    let mut fine = noise(&mut random, size);
    let coarse = match coarsest {
        0 => noise(&mut random, size.map(|n| n.div_ceil(2))),
        _ => Vec::new(),
    };
    let mut blended = random.floats(coarse.len(), -1.0, 1.0);
    if case == Case::NotFinite {
        fine[700][0] = f32::NAN;
        fine[9000][1] = f32::INFINITY;
    } else if let Some(first) = blended.first_mut() {
        *first = 0.5;
    }
    let push = [size[0], size[1], coarsest];
    Job {
        inputs: vec![
            Input::floats("fine", fine.as_flattened()),
            Input::floats("coarse", coarse.as_flattened()),
            Input::floats("coarse_change", &blended),
            Input::output("change", Element::Float, (size[0] * size[1]) as usize),
        ],
        push: bytemuck::bytes_of(&push).to_vec(),
    }
}

fn check(job: &Job, outputs: &[Vec<u8>]) -> Vec<Check> {
    let [fine_size, coarse_size] = sizes(job);
    let fine: Vec<[f32; 3]> = job.get("fine");
    let coarse: Vec<[f32; 3]> = job.get("coarse");
    let blended: Vec<f32> = job.get("coarse_change");
    let blended: Vec<f64> = blended.into_iter().map(f64::from).collect();
    let fine = level(fine_size, &fine);
    let coarse = level(coarse_size, &coarse);
    let next = (!coarse.sums.is_empty()).then_some((&coarse, &blended[..]));
    let expected = pyramid::collapse(&fine, next);
    let got: Vec<f32> = job.after(outputs, "change");
    vec![Check::close("change", &got, &expected, |_| 3e-6)]
}
