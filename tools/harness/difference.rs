//! `difference`: the finest level of the blend's pyramid.

use super::display;
use super::inputs::Random;
use super::{Case, Check, Element, Input, Job, Size, Subject, sizes};
use crate::reference::pyramid;
use insonify::sim::stages;

pub const SUBJECT: Subject = Subject {
    tolerance: "2e-7: two roundings of numbers up to 1",
    job,
    size: |job, name| match name {
        "level" => 12 * display::pixels(&job.one("frame")),
        _ => sizes::of_frame(job, name),
    },
    check,
    plant: |job, outputs| {
        job.edit(outputs, "level", |level: &mut [f32]| {
            let at = level.iter().position(|v| v.abs() > 0.1 && v.abs() < 0.9);
            level[at.expect("most are between")] *= 1.0001;
        });
    },
    ..Subject::of(&stages::DIFFERENCE)
};

fn job(case: Case, size: Size) -> Job {
    let frame = display::image(case, size);
    let pixels = display::pixels(&frame);
    let mut random = Random(9);
    let simulated: Vec<u32> = (0..pixels)
        .map(|_| match random.word() % 512 {
            grey @ 0..=255 => 0xff00_0000 | (grey * 0x0001_0101),
            _ => 0,
        })
        .collect();
    let mut background = random.floats(pixels, 0.0, 1.0);
    let mask: Vec<[f32; 2]> = (0..pixels)
        .map(|_| match random.word() % 4 {
            0 => [0.0, 0.0],
            1 => [0.0, 1.0],
            2 => [1.0, 1.0],
            _ => [random.within(0.0, 1.0) as f32, 1.0],
        })
        .collect();
    if case == Case::NotFinite {
        background[pixels / 2..][..40].fill(f32::NAN);
        background[pixels / 3..][..40].fill(f32::INFINITY);
    }
    Job {
        inputs: vec![
            Input::words("frame", &[frame]),
            Input::words("pixels", &simulated),
            Input::floats("background", &background),
            Input::floats("mask", mask.as_flattened()),
            Input::output("level", Element::Float, 3 * pixels),
        ],
        push: Vec::new(),
    }
}

fn check(job: &Job, outputs: &[Vec<u8>]) -> Vec<Check> {
    let simulated: Vec<u32> = job.get("pixels");
    let background: Vec<f32> = job.get("background");
    let mask: Vec<[f32; 2]> = job.get("mask");
    let expected: Vec<[f64; 3]> = (0..display::pixels(&job.one("frame")))
        .map(|i| pyramid::difference(simulated[i], background[i], mask[i]))
        .collect();
    let got: Vec<f32> = job.after(outputs, "level");
    let expected = expected.as_flattened();
    vec![Check::close("level", &got, expected, |_| 2e-7)]
}
