//! `tint`: the mixed image with its acquired pixels coloured.

use std::mem::size_of;

use super::display;
use super::inputs::Random;
use super::{Case, Check, Element, Input, Job, Size, Subject};
use crate::reference::tint;
use crate::sim::layout::{BLEND_LINEAR, BLEND_MULTIBAND, BLEND_SMOOTH, Frame, Fusion};

/// Distance from the middle between two levels at which either will do: single precision of numbers to
/// 255.
const ROUNDING: f64 = 1e-4;

pub const SUBJECT: Subject = Subject {
    name: "tint",
    stems: &["tint"],
    tolerance: "the twin's level; 1e-4 from the middle between two levels (single precision) either",
    job,
    sizes: |job| {
        let pixels = display::pixels(&job.one("frame"));
        vec![
            size_of::<Frame>(),
            size_of::<Fusion>(),
            4 * pixels,
            8 * pixels,
            8 * pixels,
            4 * pixels,
        ]
    },
    extent: display::per_pixel,
    check,
    plant: |job, outputs| {
        job.edit(outputs, "tinted", |tinted: &mut [u32]| {
            let inside = tinted.iter_mut().find(|p| (**p >> 8) & 0xff < 0xff && **p > 0);
            *inside.expect("most are not white") += 0x0000_0100;
        });
    },
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
    let mut random = Random(9);
    let fused: Vec<u32> = (0..pixels)
        .map(|_| match random.word() % 512 {
            grey @ 0..=255 => 0xff00_0000 | (grey * 0x0001_0101),
            _ => 0,
        })
        .collect();
    let pairs = |random: &mut Random| -> Vec<[f32; 2]> {
        (0..pixels)
            .map(|_| {
                let weight = random.within(1.0, 1024.0).floor() as f32;
                match random.word() % 4 {
                    0 => [0.0, weight],
                    1 => [weight, weight],
                    _ => [weight * random.within(0.0, 1.0) as f32, weight],
                }
            })
            .collect()
    };
    let sums = pairs(&mut random);
    // Scan conversion may leave it a rounding above 1.
    let mask = random.floats(2 * pixels, 0.0, 1.000_001);
    let opacity: f32 = match case {
        Case::One => 1.0,
        Case::Empty => 0.0,
        _ => 0.35,
    };
    let mut push = opacity.to_ne_bytes().to_vec();
    push.extend(0x0040_a0e8_u32.to_ne_bytes());
    Job {
        inputs: vec![
            Input::words("frame", &[frame]),
            Input::words("fusion", &[fusion]),
            Input::words("fused", &fused),
            Input::floats("mask", &mask),
            Input::floats("sums", sums.as_flattened()),
            Input::output("tinted", Element::Word, pixels),
        ],
        push,
    }
}

fn check(job: &Job, outputs: &[Vec<u8>]) -> Vec<Check> {
    let fusion: Fusion = job.one("fusion");
    let fused: Vec<u32> = job.get("fused");
    let mask: Vec<[f32; 2]> = job.get("mask");
    let sums: Vec<[f32; 2]> = job.get("sums");
    let got: Vec<u32> = job.after(outputs, "tinted");
    let word = |at: usize| <[u8; 4]>::try_from(&job.push[at..at + 4]).expect("four bytes");
    let (opacity, colour) = (f32::from_ne_bytes(word(0)), u32::from_ne_bytes(word(4)));
    let right = |i: usize| {
        if fused[i] >> 24 == 0 {
            return got[i] == 0;
        }
        let share = tint::share(&fusion, mask[i][0], sums[i]);
        let levels = tint::colour(fused[i], colour, opacity, share);
        let bytes = got[i].to_le_bytes();
        bytes[3] == 0xff
            && levels.iter().zip(bytes).all(|(level, byte)| {
                let either = [level - ROUNDING, level + ROUNDING].map(|v| (v + 0.5).floor());
                either.contains(&f64::from(byte))
            })
    };
    let wrong = (0..fused.len().min(got.len())).filter(|&i| !right(i)).count();
    vec![
        Check::count("pixels", fused.len(), wrong, 0),
        Check::equal("image size", &[got.len()], &[fused.len()]),
    ]
}
