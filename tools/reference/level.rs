//! Twin of `level`: expected power of the echoes, and the share of it that was reflected on its way.

use super::beam::{coupling, weights};
use insonify::sim::layout::{AXIAL_REACH, Frame, LEAST_POWER, Row};

/// Level, dB, and share of each sample, [L][K], from the powers of the scatterers and the samples of IQ that surfaces make:
/// all, and those that came straight.
pub fn level(
    frame: &Frame,
    rows: &[Row],
    contact: &[f32],
    powers: &[[f64; 2]],
    [all, direct]: [&[[f32; 2]]; 2],
) -> Vec<[f64; 2]> {
    let sigma = f64::from(frame.axial_sigma);
    let reach = ((4.0 * sigma).ceil() as i64).min(i64::from(AXIAL_REACH));
    let tap = |j: i64| (-((j * j) as f64) / (2.0 * sigma * sigma)).exp().powi(2);
    let whole: f64 = (-reach..=reach).map(tap).sum();
    let samples = i64::from(frame.samples);
    // The powers of neighbouring lines, as `beam` weighs their amplitudes.
    let across = |l: u32, k: i64, part: usize| {
        let weights = weights(rows[k as usize].strip_lines.into());
        let first = i64::from(l) - weights.len() as i64 / 2;
        let (mut sum, mut whole) = (0.0, 0.0);
        for (line, w) in (first..).zip(weights) {
            if (0..i64::from(frame.scanlines)).contains(&line) {
                sum += w * w * powers[(line * samples + k) as usize][part];
                whole += w * w;
            }
        }
        sum / whole
    };
    let mut out = Vec::with_capacity(powers.len());
    for l in 0..frame.scanlines {
        let line = (l * frame.samples) as usize;
        for k in 0..samples {
            let coupled = coupling(frame, &rows[k as usize], contact, l).powi(2);
            let speckle: [f64; 2] = std::array::from_fn(|part| {
                let near = (-reach..=reach).filter(|j| (0..samples).contains(&(k + j)));
                let sum: f64 = near.map(|j| tap(j) * across(l, k + j, part)).sum();
                coupled * sum / whole
            });
            let at = line + k as usize;
            let [all, direct] = [all[at], direct[at]].map(|iq| iq.map(f64::from));
            let power = |iq: [f64; 2]| iq[0] * iq[0] + iq[1] * iq[1];
            let rest = power([all[0] - direct[0], all[1] - direct[1]]);
            let (straight, reflected) = (speckle[0] + power(direct), speckle[1] + rest);
            let sum = straight + reflected;
            let expected = speckle[0] + speckle[1] + power(all);
            let share = if sum > 0.0 { reflected / sum } else { 0.0 };
            out.push([10.0 * expected.max(f64::from(LEAST_POWER)).log10(), share]);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    // Two surfaces' echoes of amplitude 3 and, reflected before, 1 in opposite phase, on speckle of power 4, half
    // coupled: the power is that of 2 and a quarter of 4; of 9 + 1 + 1 as they are alone, one is reflected.
    #[test]
    fn powers_add_and_amplitudes_interfere() {
        let frame = Frame { scanlines: 1, samples: 9, axial_sigma: 0.1, ..Frame::default() };
        let rows = [Row { receive_reach: 1.0, ..Row::default() }; 9];
        let found = level(
            &frame,
            &rows,
            &[0.5, 0.0, 0.0],
            &[[4.0, 0.0]; 9],
            [&[[2.0, 0.0]; 9], &[[3.0, 0.0]; 9]],
        );
        let [level, share] = found[4];
        assert!((level - 10.0 * 5.0_f64.log10()).abs() < 1e-12, "{level}");
        assert!((share - 1.0 / 11.0).abs() < 1e-12, "{share}");
    }

    // A line between one of power 1 and one of power 0 has what the beam over all three makes of them.
    #[test]
    fn neighbouring_lines_have_parts_of_each_others_powers() {
        let frame = Frame { scanlines: 3, samples: 1, axial_sigma: 0.1, ..Frame::default() };
        let rows = [Row { receive_reach: 1.0, strip_lines: 0.4, ..Row::default() }];
        let contact = [1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0];
        let silent = [[0.0; 2]; 3];
        let found =
            level(&frame, &rows, &contact, &[[1.0, 0.0], [0.5, 0.0], [0.0, 0.0]], [&silent; 2]);
        let w = (-1.0 / 0.16_f64).exp();
        let powers =
            [(1.0 + 0.5 * w) / (1.0 + w), (0.5 + w) / (1.0 + 2.0 * w), 0.5 * w / (1.0 + w)];
        for ([level, _], power) in found.into_iter().zip(powers) {
            // The deviation is given in single precision.
            assert!((level - 10.0 * power.log10()).abs() < 1e-4, "{level} {power}");
        }
    }
}
