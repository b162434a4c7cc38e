//! Twin of `convert`: scan conversion of the mask and of the acquired volume.

use super::display::{places, sample};
use insonify::sim::layout::Frame;

/// Mask and grey level of each pixel, row by row; none outside the sector. `prescan` holds both per
/// sample of the scanlines.
pub fn convert(frame: &Frame, prescan: &[f32]) -> Vec<Option<[f64; 2]>> {
    let (pairs, _) = prescan.as_chunks::<2>();
    let [mask, grey] = [0, 1].map(|i| pairs.iter().map(|p| p[i]).collect::<Vec<f32>>());
    let at =
        |[column, row]: [f64; 2]| [&mask, &grey].map(|values| sample(frame, values, column, row));
    places(frame).into_iter().map(|p| p.map(at)).collect()
}
