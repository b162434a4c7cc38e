//! Twin of `blur`: box sums along one axis of the image.

use crate::sim::layout::{Frame, Fusion};

/// Sums over the box of pairs of values per pixel, along columns where `down`. Beyond the image's
/// edge its outermost pixels count on.
pub fn blur(frame: &Frame, fusion: &Fusion, source: &[f32], down: bool) -> Vec<[f64; 2]> {
    let (width, height) = (i64::from(frame.image_width), i64::from(frame.image_height));
    let (pairs, _) = source.as_chunks::<2>();
    let before = i64::from(fusion.blur) / 2;
    let mut out = Vec::new();
    for y in 0..height {
        for x in 0..width {
            let taps = -before..i64::from(fusion.blur) - before;
            let values = taps.map(|tap| match down {
                true => pairs[((y + tap).clamp(0, height - 1) * width + x) as usize],
                false => pairs[(y * width + (x + tap).clamp(0, width - 1)) as usize],
            });
            out.push(values.fold([0.0; 2], |sum, v| {
                [sum[0] + f64::from(v[0]), sum[1] + f64::from(v[1])]
            }));
        }
    }
    out
}
