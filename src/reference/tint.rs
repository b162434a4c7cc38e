//! Twin of `tint`: a pixel coloured by its share of the acquired image.

use super::fuse;
use crate::sim::layout::{BLEND_MULTIBAND, Fusion};

/// Share of the acquired image in a pixel, 0..=1, from its mask and the box sums of mask and weight.
pub fn share(fusion: &Fusion, mask: f32, sums: [f32; 2]) -> f64 {
    match fusion.blend {
        BLEND_MULTIBAND => f64::from(mask).clamp(0.0, 1.0),
        _ => fuse::weight(fusion, sums),
    }
}

/// Red, green and blue, 0..=255 before rounding, of a pixel of which `share` is acquired, under a
/// `colour` of some opacity, 0..=1.
pub fn colour(pixel: u32, colour: u32, opacity: f32, share: f64) -> [f64; 3] {
    [0, 8, 16].map(|shift| {
        let [grey, hue] = [pixel, colour].map(|word| f64::from((word >> shift) & 0xff));
        grey + f64::from(opacity) * share * (hue - grey)
    })
}
