//! Arrays in words of 16 bits: half the bytes.

use half::f16;

/// Exponent of the largest magnitude that is stored: half precision ends at 65504, just below 2^16.
const HIGHEST: i32 = 14;

/// The power of two that stored numbers are to be multiplied by: the largest magnitude is stored as 2^14 to 2^15, and
/// numbers down to 2^-28 of it with eleven bits (IEEE 754, binary16), which is 169 dB.
pub(super) fn scale(values: &[f32]) -> f32 {
    let largest = values.iter().map(|v| v.abs()).filter(|v| v.is_finite()).fold(0.0, f32::max);
    if largest < f32::MIN_POSITIVE {
        return 1.0;
    }
    let exponent = (largest.to_bits() >> 23) as i32 - 127;
    2.0_f32.powi((exponent - HIGHEST).max(-126))
}

/// The bytes of numbers in half precision, divided by their scale.
pub(super) fn halves(values: &[f32]) -> Vec<u8> {
    let scale = scale(values);
    values.iter().flat_map(|v| f16::from_f32(v / scale).to_le_bytes()).collect()
}

/// The bytes of whole numbers in 16 bits; none where one is beyond them.
pub(super) fn shorts(values: &[i32]) -> Option<Vec<u8>> {
    let short: Option<Vec<i16>> = values.iter().map(|v| i16::try_from(*v).ok()).collect();
    Some(short?.into_iter().flat_map(i16::to_le_bytes).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(bytes: &[u8]) -> Vec<f32> {
        bytes.chunks_exact(2).map(|b| f16::from_le_bytes([b[0], b[1]]).to_f32()).collect()
    }

    #[test]
    fn eleven_bits_are_kept_over_160_db_whatever_the_unit() {
        for unit in [1e-30_f32, 1e-6, 1.0, 3e7, 1e30] {
            let values: Vec<f32> =
                (0..=160).map(|db| unit * 10_f32.powf(-(db as f32) / 20.0)).collect();
            let scale = scale(&values);
            assert_eq!(scale.to_bits() & 0x7f_ffff, 0, "a power of two");
            for (stored, value) in read(&halves(&values)).iter().zip(&values) {
                let off = (stored * scale / value - 1.0).abs();
                assert!(off <= 1.0 / 2048.0, "{value}: off by {off}");
            }
        }
    }

    #[test]
    fn nothing_is_nothing_and_zero_is_zero() {
        let values = [0.0, f32::NAN, -0.0];
        assert_eq!(scale(&values), 1.0);
        let stored = read(&halves(&values));
        assert!(stored[0] == 0.0 && stored[1].is_nan() && stored[2] == 0.0);
        assert_eq!(halves(&[]), Vec::<u8>::new());
    }

    #[test]
    fn indices_beyond_16_bits_are_not_cut() {
        assert_eq!(shorts(&[-1, 300]), Some(vec![0xff, 0xff, 0x2c, 0x01]));
        assert_eq!(shorts(&[40_000]), None);
    }
}
