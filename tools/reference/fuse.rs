//! Twin of `fuse`: the acquired image and the simulated one, mixed by the blurred mask.

use insonify::sim::layout::{BLEND_MULTIBAND, BLEND_SMOOTH, Fusion};

/// Weight of the acquired image from the box sums of mask and weight.
pub fn weight(fusion: &Fusion, [mask, weight]: [f32; 2]) -> f64 {
    let m = if mask >= weight { 1.0 } else { f64::from(mask) / f64::from(weight) };
    if fusion.blend == BLEND_SMOOTH { m * m * (3.0 - 2.0 * m) } else { m }
}

/// Grey level 0..=255 before rounding of one pixel inside the sector; none for NaN.
/// `change` is the value that blending by bands adds to the acquired image.
pub fn level(
    fusion: &Fusion,
    simulated: u32,
    background: f32,
    sums: [f32; 2],
    change: f32,
) -> Option<f64> {
    let v = if fusion.blend == BLEND_MULTIBAND {
        255.0 * (f64::from(background) + f64::from(change))
    } else {
        let m = weight(fusion, sums);
        m * f64::from(background) * 255.0 + (1.0 - m) * f64::from(simulated & 0xff)
    };
    (!v.is_nan()).then(|| v.clamp(0.0, 255.0))
}
