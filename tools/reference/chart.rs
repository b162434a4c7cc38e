//! Twin of `chart`: labels from the scanlines to the pixels.

use super::display::places;
use insonify::sim::layout::{Frame, Label, NONE};

/// A pixel's label.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Charted {
    /// True tissue and instance, and those that are seen.
    pub indices: [u32; 4],
    /// Place, loss, movement, contact, level, reverberation.
    pub quantities: [f64; 10],
    /// Incidence; none where the pixel holds no surface.
    pub incidence: Option<f64>,
}

fn quantities(label: &Label) -> [f64; 10] {
    let [x, y, z, loss] = label.place_loss;
    let [a, b, c, _] = label.moved_incidence;
    [x, y, z, loss, a, b, c, label.contact, label.level, label.reverberation].map(f64::from)
}

fn indices(label: &Label) -> [u32; 4] {
    [label.true_tissue, label.true_instance, label.tissue, label.instance]
}

/// The label of each pixel, row by row; none outside the sector.
pub fn chart(frame: &Frame, labels: &[Label]) -> Vec<Option<Charted>> {
    places(frame).into_iter().map(|place| place.map(|at| pixel(frame, labels, at))).collect()
}

/// The label of a pixel at a column and a row of the scanlines.
pub fn pixel(frame: &Frame, labels: &[Label], [column, row]: [f64; 2]) -> Charted {
    let last = [frame.scanlines, frame.samples].map(|n| f64::from(n) - 1.0);
    let (column, row) = (column.clamp(0.0, last[0]), row.clamp(0.0, last[1]));
    let at = |l: f64, k: f64| &labels[l as usize * frame.samples as usize + k as usize];
    let round = |v: f64, last: f64| (v + 0.5).floor().min(last);
    let (l, k) = (round(column, last[0]), round(row, last[1]));
    let nearest = at(l, k);
    let mut sum = [0.0; 10];
    let mut whole = true;
    let next = |v: f64, last: f64| (v.floor() + 1.0).min(last);
    for (l, wl) in [(column.floor(), 1.0 - column.fract()), (next(column, last[0]), column.fract())]
    {
        for (k, wk) in [(row.floor(), 1.0 - row.fract()), (next(row, last[1]), row.fract())] {
            let corner = at(l, k);
            whole &= indices(corner)[2..] == indices(nearest)[2..];
            let values = quantities(corner);
            sum.iter_mut().zip(values).for_each(|(sum, value)| *sum += wl * wk * value);
        }
    }
    let beside = (0.5 * f64::from(frame.pixel_pitch) / f64::from(frame.sample_pitch)).max(0.5);
    let surfaces = (0..frame.samples)
        .map(f64::from)
        .filter(|k| (k - row).abs() <= beside && at(l, *k).moved_incidence[3] >= 0.0);
    let incidence = surfaces
        .min_by(|a, b| (a - row).abs().total_cmp(&(b - row).abs()))
        .map(|k| f64::from(at(l, k).moved_incidence[3]));
    Charted {
        indices: indices(nearest),
        quantities: if whole { sum } else { quantities(nearest) },
        incidence,
    }
}

/// The label of a pixel outside the sector.
pub const OUTSIDE: Charted = Charted { indices: [NONE; 4], quantities: [0.0; 10], incidence: None };
