//! Twin of `tiles`: which of both images the pixels of each tile show.

use std::ops::Range;

use super::display;
use insonify::sim::layout::{Frame, Fusion, MASK_BLOCK, TILE, TILE_ACQUIRED, TILE_SIMULATED};

/// Index of the tile of pixel (i, j).
pub fn of_pixel(frame: &Frame, i: u32, j: u32) -> usize {
    (j / TILE * frame.tiles()[0] + i / TILE) as usize
}

/// Pixels of tile `index` along an axis of `size` pixels, and those that the boxes around them reach.
fn reached(fusion: &Fusion, index: u32, size: u32) -> Range<u32> {
    let reach = fusion.blur / 2;
    (index * TILE).saturating_sub(reach)..((index + 1) * TILE + reach).min(size)
}

/// Bits of each tile, row by row: those of the blocks of mask that its pixels read, or pixels that boxes around them
/// reach.
pub fn seen(frame: &Frame, fusion: &Fusion, mask_blocks: &[u32]) -> Vec<u32> {
    let blocks = frame.samples.div_ceil(MASK_BLOCK);
    let of_pixel = |place: Option<[f64; 2]>| {
        let [column, row] = place?;
        let both = |v: f64, n: u32| {
            let v = v.clamp(0.0, f64::from(n) - 1.0);
            [v.floor() as u32, v.ceil() as u32]
        };
        let lines = both(column, frame.scanlines).into_iter();
        let has = lines.flat_map(|l| both(row, frame.samples).map(|k| l * blocks + k / MASK_BLOCK));
        Some(has.fold(0, |seen, block| seen | mask_blocks[block as usize]))
    };
    let pixels: Vec<u32> =
        display::places(frame).into_iter().map(|p| of_pixel(p).unwrap_or(0)).collect();
    let [across, down] = frame.tiles();
    let mut out = Vec::new();
    for y in 0..down {
        for x in 0..across {
            let rows = reached(fusion, y, frame.image_height);
            let columns = reached(fusion, x, frame.image_width);
            let places = rows.flat_map(|j| columns.clone().map(move |i| j * frame.image_width + i));
            out.push(places.fold(0, |seen, at| seen | pixels[at as usize]));
        }
    }
    out
}

/// The tiles that boxes around pixels of tiles with both images reach, of tiles that show `seen`.
pub fn blurred(frame: &Frame, fusion: &Fusion, seen: &[u32]) -> Vec<bool> {
    let [across, down] = frame.tiles();
    let mut out = vec![false; seen.len()];
    for (at, _) in
        seen.iter().enumerate().filter(|(_, seen)| **seen == TILE_ACQUIRED | TILE_SIMULATED)
    {
        let (x, y) = (at as u32 % across, at as u32 / across);
        let of = |pixels: Range<u32>, count: u32| {
            pixels.start / TILE..pixels.end.div_ceil(TILE).min(count)
        };
        for row in of(reached(fusion, y, frame.image_height), down) {
            for column in of(reached(fusion, x, frame.image_width), across) {
                out[(row * across + column) as usize] = true;
            }
        }
    }
    out
}
