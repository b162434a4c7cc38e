//! `fuse`: the mixed image.

use super::display;
use super::inputs::Random;
use super::{Case, Check, Input, Job, Size, Subject, sizes};
use crate::reference::fuse;
use insonify::sim::layout::{BLEND_LINEAR, BLEND_MULTIBAND, BLEND_SMOOTH, Fusion};
use insonify::sim::stages;

/// Distance from the middle between two grey levels within which either level is correct: single precision of
/// numbers to 255.
const ROUNDING: f64 = 1e-4;

pub const SUBJECT: Subject = Subject {
    tolerance: "the twin's grey level; 1e-4 from the middle between two levels (single precision) either",
    job,
    check,
    plant: |job, outputs| {
        job.edit(outputs, "fused", |fused: &mut [u32]| {
            let inside = fused.iter_mut().find(|p| (0xff10_1010..0xffe0_e0e0).contains(*p));
            *inside.expect("most greys are between") += 0x0001_0101;
        });
    },
    size: |job, name| match name {
        "change" if job.one::<Fusion>("fusion").blend != BLEND_MULTIBAND => 0,
        "change" => 4 * display::pixels(&job.one("frame")),
        _ => sizes::of_frame(job, name),
    },
    ..Subject::of(&stages::FUSE)
};

fn job(case: Case, size: Size) -> Job {
    let frame = display::image(case, size);
    let pixels = display::pixels(&frame);
    let fusion = Fusion {
        blur: 32,
        blend: match case {
            Case::Odd => BLEND_SMOOTH,
            Case::Modes => BLEND_MULTIBAND,
            _ => BLEND_LINEAR,
        },
        ..Fusion::default()
    };
    let mut random = Random(8);
    let simulated: Vec<u32> = (0..pixels)
        .map(|_| match random.word() % 1024 {
            grey @ 0..=255 => 0xff00_0000 | (grey * 0x0001_0101),
            256..=511 => 0,
            other => 0xff00_0000 | (other % 256 * 0x0001_0101),
        })
        .collect();
    let mut background = random.floats(pixels, 0.0, 1.0);
    let sums: Vec<[f32; 2]> = (0..pixels)
        .map(|_| {
            let weight = random.within(1.0, 1024.0).floor() as f32;
            match random.word() % 4 {
                0 => [0.0, weight],
                1 => [weight, weight],
                _ => [weight * random.within(0.0, 1.0) as f32, weight],
            }
        })
        .collect();
    let change = random.floats(pixels, -0.6, 0.6);
    if case == Case::NotFinite {
        background[pixels / 2] = f32::NAN;
        background[pixels / 3] = f32::INFINITY;
    }
    let given = vec![
        Input::words("frame", &[frame]),
        Input::words("fusion", &[fusion]),
        Input::words("pixels", &simulated),
        Input::floats("background", &background),
        Input::floats("sums", sums.as_flattened()),
        Input::floats("change", &change),
    ];
    Job::of(&stages::FUSE, given, Vec::new())
}

fn check(job: &Job, outputs: &[Vec<u8>]) -> Vec<Check> {
    let fusion: Fusion = job.one("fusion");
    let simulated: Vec<u32> = job.get("pixels");
    let background: Vec<f32> = job.get("background");
    let sums: Vec<[f32; 2]> = job.get("sums");
    let change: Vec<f32> = job.get("change");
    let got: Vec<u32> = job.after(outputs, "fused");
    let right = |i: usize| {
        if simulated[i] >> 24 == 0 {
            return got[i] == 0;
        }
        // A frame that is not blended by bands has dumped none.
        let added = change.get(i).copied().unwrap_or(0.0);
        let level = fuse::level(&fusion, simulated[i], background[i], sums[i], added);
        let level = level.unwrap_or(0.0);
        let greys = [level - ROUNDING, level + ROUNDING].map(|v| (v.max(0.0) + 0.5).floor() as u32);
        greys.iter().any(|g| got[i] == 0xff00_0000 | (g.min(&255) * 0x0001_0101))
    };
    let wrong = (0..simulated.len().min(got.len())).filter(|&i| !right(i)).count();
    vec![
        Check::count("pixels", simulated.len(), wrong, 0),
        Check::equal("image size", &[got.len()], &[simulated.len()]),
    ]
}
