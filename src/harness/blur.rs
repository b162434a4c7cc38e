//! `blur`: box sums of the converted mask, down its columns.

use std::mem::size_of;

use super::display;
use super::inputs::Random;
use super::{Case, Check, Element, Extent, Input, Job, Size, Subject};
use crate::reference::blur;
use crate::sim::layout::{BLUR_SUMS, Frame, Fusion};

pub const SUBJECT: Subject = Subject {
    name: "blur",
    stems: &["blur"],
    tolerance: "6e-8 n^2 for a box of n pixels: n roundings of a 24-bit sum up to n",
    job,
    sizes: |job| {
        let pairs = 8 * display::pixels(&job.one("frame"));
        vec![size_of::<Frame>(), size_of::<Fusion>(), pairs, pairs]
    },
    extent: |job| {
        let [width, height] = blur::dimensions(&job.one("frame"), turned(job));
        Extent::Threads([width, height.div_ceil(BLUR_SUMS), 1])
    },
    check,
    plant: |job, outputs| {
        job.edit(outputs, "sums", |sums: &mut [f32]| {
            sums[sums.len() / 2] += 1e-3;
        });
    },
};

/// Whether the source has rows and columns exchanged.
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
    Job {
        inputs: vec![
            Input::words("frame", &[frame]),
            Input::words("fusion", &[fusion]),
            Input::floats("mask", &source),
            Input::output("sums", Element::Float, 2 * pixels),
        ],
        push: bytemuck::bytes_of(&turned).to_vec(),
    }
}

fn check(job: &Job, outputs: &[Vec<u8>]) -> Vec<Check> {
    let fusion: Fusion = job.one("fusion");
    let mask: Vec<f32> = job.get("mask");
    let sums = blur::blur(&job.one("frame"), &fusion, &mask, turned(job));
    let got: Vec<f32> = job.after(outputs, "sums");
    let allowed = 6e-8 * f64::from(fusion.blur).powi(2);
    vec![Check::close("sums", &got, sums.as_flattened(), |_| allowed)]
}
