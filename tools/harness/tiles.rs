//! `tiles`: which of both images the tiles show.

use super::blur::box_of;
use super::display;
use super::inputs::Random;
use super::{Case, Check, Input, Job, Size, Subject};
use crate::reference::tiles;
use insonify::sim::layout::{
    Frame, Fusion, MASK_BLOCK, TILE_ACQUIRED, TILE_BLURRED, TILE_SIMULATED, TILE_WHOLE,
};
use insonify::sim::stages;

const BOTH: u32 = TILE_ACQUIRED | TILE_SIMULATED;

pub const SUBJECT: Subject = Subject {
    tolerance: "no tile lacks what one of its pixels needs; at most one in four has both images and needs one",
    job,
    check,
    plant: |job, outputs| {
        let [across, down] = job.one::<Frame>("frame").tiles().map(|n| n as usize);
        job.edit(outputs, "tiles", |tiles: &mut [u32]| {
            tiles[down / 2 * across + across / 2] &= !BOTH
        });
    },
    ..Subject::of(&stages::TILES)
};

/// Tiles of an image with bits chosen at random, among `bits`.
pub(super) fn random(frame: &Frame, bits: &[u32], random: &mut Random) -> Vec<u32> {
    let [across, down] = frame.tiles();
    (0..across * down).map(|_| bits[random.word() as usize % bits.len()]).collect()
}

fn job(case: Case, size: Size) -> Job {
    let frame = display::image(case, size);
    let fusion = Fusion { blur: box_of(case), ..Fusion::default() };
    let blocks = frame.samples.div_ceil(MASK_BLOCK);
    // A masking mesh that reaches from one side to the middle, at the middle depths.
    let place = |n: u32, count: u32| f64::from(n) / f64::from(count);
    let block = |line: u32, block: u32| {
        let [across, deep] = [place(line, frame.scanlines), place(block, blocks)];
        let border = (deep - 0.5).abs() - 0.2;
        match (across < 0.5, border) {
            (true, ..=-0.1) => TILE_SIMULATED,
            (true, ..0.1) => BOTH,
            _ => TILE_ACQUIRED,
        }
    };
    let lines = 0..frame.scanlines;
    let mask_blocks: Vec<u32> =
        lines.flat_map(|line| (0..blocks).map(move |b| block(line, b))).collect();
    let given = vec![
        Input::words("frame", &[frame]),
        Input::words("fusion", &[fusion]),
        Input::words("mask_blocks", &mask_blocks),
    ];
    let complete = u32::from(case == Case::NotFinite);
    Job::of(&stages::TILES, given, bytemuck::bytes_of(&complete).to_vec())
}

fn check(job: &Job, outputs: &[Vec<u8>]) -> Vec<Check> {
    let (frame, fusion): (Frame, Fusion) = (job.one("frame"), job.one("fusion"));
    let got: Vec<u32> = job.after(outputs, "tiles");
    if job.push.iter().any(|&b| b != 0) {
        let all = BOTH | TILE_BLURRED | TILE_WHOLE;
        return vec![Check::equal("tiles", &got, &vec![all; got.len()])];
    }
    let least = tiles::seen(&frame, &fusion, &job.get::<u32>("mask_blocks"));
    let shown: Vec<u32> = got.iter().map(|tile| tile & BOTH).collect();
    let lacking = least.iter().zip(&shown).filter(|(least, shown)| *least & !*shown != 0).count();
    let needless =
        least.iter().zip(&shown).filter(|(least, shown)| **shown == BOTH && **least != BOTH);
    let blurred: Vec<bool> = got.iter().map(|tile| tile & TILE_BLURRED != 0).collect();
    vec![
        Check::equal("tiles", &[got.len()], &[least.len()]),
        Check::count("tiles that lack an image", got.len(), lacking, 0),
        Check::count("tiles with both needlessly", got.len(), needless.count(), got.len() / 4),
        Check::equal("blurred", &blurred, &tiles::blurred(&frame, &fusion, &shown)),
        Check::equal("whole", &[got.iter().any(|tile| tile & TILE_WHOLE != 0)], &[false]),
    ]
}
