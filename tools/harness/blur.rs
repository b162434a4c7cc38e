//! `blur`: box sums of the converted mask, down its columns.

use super::display;
use super::inputs::Random;
use super::{Case, Check, Extent, Input, Job, Size, Subject};
use crate::reference::blur;
use insonify::sim::layout::{Frame, Fusion};
use insonify::sim::stages;

pub const SUBJECT: Subject = Subject {
    tolerance: "6e-8 n^2 for a box of n pixels: n roundings of a 24-bit sum up to n",
    job,
    extent: Some(|job| {
        let frame: Frame = job.one("frame");
        let size = [frame.image_width, frame.image_height];
        Extent::Once(stages::blur::extent(size, turned(job)))
    }),
    check,
    plant: |job, outputs| {
        job.edit(outputs, "sums", |sums: &mut [f32]| {
            sums[sums.len() / 2] += 1e-3;
        });
    },
    ..Subject::of(&stages::BLUR)
};

/// True if the source has rows and columns exchanged.
fn turned(job: &Job) -> bool {
    job.push.iter().any(|&b| b != 0)
}

fn job(case: Case, size: Size) -> Job {
    let frame = display::image(case, size);
    let fusion = Fusion {
        blur: match case {
            Case::One => 1,
            Case::Odd => 7,
            // Wider than the image.
            Case::Modes => 401,
            _ => 32,
        },
        ..Fusion::default()
    };
    let pixels = display::pixels(&frame);
    let mut source = Random(6).floats(2 * pixels, 0.0, 1.0);
    if case == Case::NotFinite {
        source[3 * pixels / 2] = f32::NAN;
        source[pixels / 2] = f32::INFINITY;
    }
    let turned = u32::from(matches!(case, Case::Odd | Case::NotFinite | Case::Random));
    let given = vec![
        Input::words("frame", &[frame]),
        Input::words("fusion", &[fusion]),
        Input::floats("mask", &source),
    ];
    Job::of(&stages::BLUR, given, bytemuck::bytes_of(&turned).to_vec())
}

fn check(job: &Job, outputs: &[Vec<u8>]) -> Vec<Check> {
    let fusion: Fusion = job.one("fusion");
    let mask: Vec<f32> = job.get("mask");
    let sums = blur::blur(&job.one("frame"), &fusion, &mask, turned(job));
    let got: Vec<f32> = job.after(outputs, "sums");
    let allowed = 6e-8 * f64::from(fusion.blur).powi(2);
    vec![Check::close("sums", &got, sums.as_flattened(), |_| allowed)]
}
