//! `blur`: box sums of the converted mask, down its columns.

use super::display;
use super::inputs::Random;
use super::{Case, Check, Extent, Input, Job, Size, Subject, UNWRITTEN, tiles};
use crate::reference::{blur, tiles as twin};
use insonify::sim::layout::{Frame, Fusion, TILE_ACQUIRED, TILE_BLURRED, TILE_SIMULATED};
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
            let middle = sums.len() / 2;
            let made = sums[middle..].iter_mut().find(|sum| sum.is_finite());
            *made.expect("some tiles are blurred") += 1e-3;
        });
    },
    ..Subject::of(&stages::BLUR)
};

/// Bits of the tiles in which sums are made.
fn wanted(job: &Job) -> u32 {
    if turned(job) { TILE_ACQUIRED | TILE_SIMULATED } else { TILE_BLURRED }
}

/// True if the source has rows and columns exchanged.
fn turned(job: &Job) -> bool {
    job.push.iter().any(|&b| b != 0)
}

/// The edge of the box in a case, pixels.
pub(super) fn box_of(case: Case) -> u32 {
    match case {
        Case::One => 1,
        Case::Odd => 7,
        // Wider than the image.
        Case::Modes => 401,
        _ => 32,
    }
}

fn job(case: Case, size: Size) -> Job {
    let frame = display::image(case, size);
    let fusion = Fusion { blur: box_of(case), ..Fusion::default() };
    let pixels = display::pixels(&frame);
    let mut source = Random(6).floats(2 * pixels, 0.0, 1.0);
    if case == Case::NotFinite {
        source[3 * pixels / 2] = f32::NAN;
        source[pixels / 2] = f32::INFINITY;
    }
    let mixed = TILE_ACQUIRED | TILE_SIMULATED;
    let bits: &[u32] = match case {
        Case::One => &[TILE_BLURRED | mixed],
        _ => &[0, TILE_BLURRED | TILE_ACQUIRED, TILE_BLURRED | mixed, TILE_SIMULATED],
    };
    let kinds = tiles::random(&frame, bits, &mut Random(9));
    let turned = u32::from(matches!(case, Case::Odd | Case::NotFinite | Case::Random));
    let given = vec![
        Input::words("frame", &[frame]),
        Input::words("fusion", &[fusion]),
        Input::floats("mask", &source),
        Input::words("tiles", &kinds),
    ];
    Job::of(&stages::BLUR, given, bytemuck::bytes_of(&turned).to_vec())
}

fn check(job: &Job, outputs: &[Vec<u8>]) -> Vec<Check> {
    let (frame, fusion): (Frame, Fusion) = (job.one("frame"), job.one("fusion"));
    let mask: Vec<f32> = job.get("mask");
    let mut sums = blur::blur(&frame, &fusion, &mask, turned(job));
    let mut got: Vec<[f32; 2]> = job.after(outputs, "sums");
    let kinds: Vec<u32> = job.get("tiles");
    let [_, height] = blur::dimensions(&frame, turned(job));
    let mut touched = 0;
    for (at, (sum, got)) in sums.iter_mut().zip(&mut got).enumerate() {
        // The source's column and row.
        let [x, y] = [at as u32 / height, at as u32 % height];
        let [i, j] = if turned(job) { [y, x] } else { [x, y] };
        if kinds[twin::of_pixel(&frame, i, j)] & wanted(job) != wanted(job) {
            touched += usize::from(got.map(f32::to_bits) != [UNWRITTEN; 2]);
            (*sum, *got) = ([0.0; 2], [0.0; 2]);
        }
    }
    let allowed = 6e-8 * f64::from(fusion.blur).powi(2);
    vec![
        Check::close("sums", got.as_flattened(), sums.as_flattened(), |_| allowed),
        Check::count("sums beside what is blurred", got.len(), touched, 0),
    ]
}
