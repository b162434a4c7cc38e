//! Twin of `blur`: box sums down the columns of an image.

use insonify::sim::layout::{Frame, Fusion};

/// Width and height of an image of the frame; rows and columns exchanged if `turned`.
pub fn dimensions(frame: &Frame, turned: bool) -> [u32; 2] {
    let [width, height] = [frame.image_width, frame.image_height];
    if turned { [height, width] } else { [width, height] }
}

/// Sums over the box down the columns of an image of pairs of values, with rows and columns exchanged:
/// index x height + y. Beyond the image's edge its outermost pixels are repeated.
pub fn blur(frame: &Frame, fusion: &Fusion, source: &[f32], turned: bool) -> Vec<[f64; 2]> {
    let [width, height] = dimensions(frame, turned).map(i64::from);
    let (pairs, _) = source.as_chunks::<2>();
    let before = i64::from(fusion.blur) / 2;
    let mut out = Vec::new();
    for x in 0..width {
        for y in 0..height {
            let taps = -before..i64::from(fusion.blur) - before;
            let values =
                taps.map(|tap| pairs[((y + tap).clamp(0, height - 1) * width + x) as usize]);
            out.push(
                values
                    .fold([0.0; 2], |sum, v| [sum[0] + f64::from(v[0]), sum[1] + f64::from(v[1])]),
            );
        }
    }
    out
}
