//! Twin of `fuse`: the acquired image and the simulated one, mixed by the blurred mask.

use insonify::sim::layout::{BLEND_SMOOTH, Fusion, TILE_ACQUIRED, TILE_SIMULATED};

/// Share of the acquired image in a pixel of `tile`, from the box sums of mask and weight.
pub fn share(fusion: &Fusion, tile: u32, [mask, weight]: [f32; 2]) -> f64 {
    match tile & (TILE_ACQUIRED | TILE_SIMULATED) {
        TILE_ACQUIRED => 1.0,
        TILE_SIMULATED => 0.0,
        _ => {
            let m = if mask >= weight { 1.0 } else { f64::from(mask) / f64::from(weight) };
            if fusion.blend == BLEND_SMOOTH { m * m * (3.0 - 2.0 * m) } else { m }
        }
    }
}

/// Grey level before rounding of one pixel inside the sector, 0..=255; 0 for NaN. An image without a share does not
/// count, whatever it has.
pub fn level(share: f64, acquired: f64, simulated: f64) -> f64 {
    let part = |share: f64, level: f64| if share > 0.0 { share * level } else { 0.0 };
    let v = part(share, acquired) + part(1.0 - share, simulated);
    if v.is_nan() { 0.0 } else { v.clamp(0.0, 255.0) }
}
