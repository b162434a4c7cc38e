//! Twin of `detect`: time-gain compensation, envelope, log compression.

use insonify::sim::layout::{Frame, Row};

/// Displayed level of each sample, 0..=1: index l K + k.
pub fn detect(frame: &Frame, rows: &[Row], iq: &[f32]) -> Vec<f64> {
    let level = |(i, v): (usize, &[f32])| {
        let row = &rows[i % frame.samples as usize];
        let envelope = f64::from(v[0]).hypot(v[1].into()) * f64::from(row.tgc);
        // hypot(infinity, NaN) is infinity in IEEE 754; a NaN part is an error and shows black.
        if envelope.is_nan() || v.iter().any(|x| x.is_nan()) {
            return 0.0;
        }
        let decibels = 20.0 * (envelope.max(1e-20) * f64::from(frame.inverse_reference)).log10();
        (1.0 + decibels * f64::from(frame.inverse_range)).clamp(0.0, 1.0)
    };
    iq.chunks_exact(2).enumerate().map(level).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_are_decibels_over_the_range_and_never_nan() {
        let frame = Frame {
            scanlines: 1,
            samples: 7,
            inverse_reference: 10.0,
            inverse_range: 1.0 / 60.0,
            ..Frame::default()
        };
        let row = Row { tgc: 2.0, ..Row::default() };
        // Reference 0.1, gain 2: (0.03, 0.04) is an envelope of exactly the reference.
        let (inf, nan) = (f32::INFINITY, f32::NAN);
        let iq = [0.03, 0.04, 3e-4, -4e-4, 0.0, 0.0, 9.0, 0.0, inf, 0.0, nan, inf, 3e-5, 4e-5];
        let expected = [1.0, 1.0 / 3.0, 0.0, 1.0, 1.0, 0.0, 0.0];
        // inverse_range is rounded to f32: 6e-8 of at most 60 dB.
        for (got, expected) in detect(&frame, &[row; 7], &iq).iter().zip(expected) {
            assert!((got - expected).abs() < 1e-6, "{got} {expected}");
        }
    }
}
