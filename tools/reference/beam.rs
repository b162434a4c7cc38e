//! Twin of `beam`: accumulators as amplitudes, of surfaces and scatterers smoothed laterally, weakened where the probe has
//! lost contact, with electronic noise.

use super::random::{gaussian, pcg4d};
use insonify::sim::layout::{Frame, KIND_PHASED, Row};

/// Width, in scanlines, below which a lateral kernel does not smooth.
const NARROWEST: f64 = 0.05;

/// Complex baseband lines: index 2 (l K + k) + {0: real, 1: imaginary}.
///
/// `points` may be empty where there are none. `contact` has the coupled share of each line's transmit aperture, then the sums, from 0 on, of what is
/// not coupled of the elements before each.
pub fn beam(
    frame: &Frame,
    rows: &[Row],
    [surface, volume, points]: [&[i32]; 3],
    contact: &[f32],
) -> Vec<f64> {
    let mut out = Vec::with_capacity(surface.len());
    for l in 0..frame.scanlines {
        for k in 0..frame.samples {
            let row = &rows[k as usize];
            let words = pcg4d([frame.first_line + l, k, frame.frame_index, frame.seed]);
            let of_surfaces = weights(row.lateral_lines.into());
            let of_scatterers = weights(row.strip_lines.into());
            let coupling = coupling(frame, row, contact, l);
            for part in 0..2 {
                let at = |j: i64| {
                    let line = i64::from(l) + j;
                    let inside = (0..i64::from(frame.scanlines)).contains(&line);
                    let sample = line * i64::from(frame.samples) + i64::from(k);
                    inside.then(|| (2 * sample + part) as usize)
                };
                let mut sums = Sums::default();
                for (j, &w) in (-(of_surfaces.len() as i64 / 2)..).zip(&of_surfaces) {
                    if let Some(i) = at(j) {
                        sums.weight += w;
                        sums.surface += w * f64::from(surface[i]) * f64::from(row.surface_undo);
                    }
                }
                for (j, &w) in (-(of_scatterers.len() as i64 / 2)..).zip(&of_scatterers) {
                    sums.full += w * w;
                    if let Some(i) = at(j) {
                        sums.here += w * w;
                        sums.volume += w * f64::from(volume[i]) * f64::from(row.volume_undo);
                    }
                }
                let own = at(0).expect("the scanline itself is inside");
                let point = points.get(own).map_or(0.0, |&v| f64::from(v));
                let scatterers = sums.volume * (sums.full / sums.here).sqrt();
                let noise = f64::from(frame.noise) * gaussian(words[part as usize]);
                let echoes =
                    sums.surface / sums.weight + scatterers + point * f64::from(row.volume_undo);
                out.push(echoes * coupling + noise);
            }
        }
    }
    out
}

/// Number of (l, k) at which some accumulator is at the fixed-point limit.
pub fn saturated(accumulators: [&[i32]; 3]) -> u32 {
    let full = |v: &[i32], i: usize| v.iter().skip(i).take(2).any(|x| x.unsigned_abs() >= 1 << 30);
    let pairs = (0..accumulators[0].len()).step_by(2);
    pairs.filter(|&i| accumulators.iter().any(|v| full(v, i))).count() as u32
}

/// The factor on the echoes of line `l` of the frame: coupled share of the transmit aperture times that of the receive
/// aperture, element by element.
pub(super) fn coupling(frame: &Frame, row: &Row, contact: &[f32], l: u32) -> f64 {
    let (l, lines) = (frame.first_line + l, frame.face_lines());
    let (transmit, air) = contact.split_at(lines as usize);
    let count = f64::from(lines);
    let middle = match frame.kind {
        KIND_PHASED => count / 2.0,
        _ => f64::from(l) + 0.5,
    };
    let reach = f64::from(row.receive_reach);
    let (left, right) = ((middle - reach).max(0.0), (middle + reach).min(count));
    let elements = air.windows(2).enumerate().map(|(i, sums)| {
        let i = i as f64;
        let used = (right.min(i + 1.0) - left.max(i)).max(0.0);
        used * (1.0 - (f64::from(sums[1]) - f64::from(sums[0])))
    });
    f64::from(transmit[l as usize]) * elements.sum::<f64>() / (right - left)
}

#[derive(Default)]
struct Sums {
    surface: f64,
    volume: f64,
    weight: f64,
    here: f64,
    full: f64,
}

/// Gaussian weights of the lines -n..=n.
pub(super) fn weights(sigma: f64) -> Vec<f64> {
    if sigma < NARROWEST {
        return vec![1.0];
    }
    let reach = (3.0 * sigma).ceil().min(16.0) as i32;
    (-reach..=reach).map(|j| (-f64::from(j * j) / (2.0 * sigma * sigma)).exp()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(scanlines: u32, samples: u32) -> Frame {
        Frame { scanlines, samples, ..Frame::default() }
    }

    fn rows(samples: usize, lateral_lines: f32) -> Vec<Row> {
        let row = Row {
            surface_undo: 0.5,
            volume_undo: 0.25,
            lateral_lines,
            strip_lines: lateral_lines,
            receive_reach: 1.0,
            ..Row::default()
        };
        vec![row; samples]
    }

    /// The table of a face with all elements coupled.
    fn joined(frame: &Frame) -> Vec<f32> {
        let lines = frame.scanlines as usize;
        [vec![1.0; lines], vec![0.0; lines + 1]].concat()
    }

    // The last three of eight elements are in air; apertures are three elements wide, on transmit and on
    // receive, and two at the edges of the face.
    #[test]
    fn lines_lose_what_sends_and_what_receives() {
        let (frame, mut rows) = (frame(8, 1), rows(1, 0.0));
        rows[0].receive_reach = 1.5;
        let share = [1.0, 1.0, 1.0, 1.0, 2.0 / 3.0, 1.0 / 3.0, 0.0, 0.0];
        let sums = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0_f32];
        let mut contact: Vec<f32> = share.map(|s| s as f32).to_vec();
        contact.extend(sums);
        let out = beam(&frame, &rows, [&[200; 16], &[0; 16], &[]], &contact);
        for (l, share) in share.into_iter().enumerate() {
            let expected = 100.0 * share * share;
            // Shares are given in single precision.
            assert!((out[2 * l] - expected).abs() < 1e-4, "{l}: {}", out[2 * l]);
        }
    }

    // Closed forms in f64; 1e-12 is rounding.
    #[test]
    fn a_uniform_wall_stays_uniform_to_the_edges_and_points_stay_unsmoothed() {
        let (frame, rows) = (frame(40, 2), rows(2, 1.7));
        let surface = vec![100; 160];
        let mut points = vec![0; 160];
        points[80] = 8;
        let out = beam(&frame, &rows, [&surface, &[0; 160], &points], &joined(&frame));
        for (i, v) in out.iter().enumerate() {
            let expected = if i == 80 { 52.0 } else { 50.0 };
            assert!((v - expected).abs() < 1e-12, "{i}: {v}");
        }
    }

    #[test]
    fn a_surface_impulse_becomes_a_normalised_gaussian() {
        let (frame, rows) = (frame(41, 1), rows(1, 2.0));
        let mut surface = vec![0; 82];
        surface[2 * 20] = 1000;
        let out = beam(&frame, &rows, [&surface, &[0; 82], &[]], &joined(&frame));
        let sum: f64 = out.iter().sum();
        assert!((sum - 500.0).abs() < 1e-9);
        let ratio = (out[2 * 22] / out[2 * 20]).ln();
        assert!((ratio + 0.5).abs() < 1e-12, "exp(-(2/2)^2 / 2)");
        assert_eq!(out[2 * 27], 0.0, "cut at three sigmas");
    }

    #[test]
    fn scatterers_keep_their_power_at_the_edges() {
        let frame = frame(200, 1);
        let rows = rows(1, 2.0);
        // Independent lines: power at the edge equals the middle's, over many draws.
        let (mut edge, mut middle) = (0.0, 0.0);
        for draw in 0..4000 {
            let noise = |i: u32| (1000.0 * gaussian(pcg4d([i, draw, 0, 0])[0])) as i32;
            let volume: Vec<i32> = (0..400).map(noise).collect();
            let out = beam(&frame, &rows, [&[0; 400], &volume, &[]], &joined(&frame));
            edge += out[0].powi(2) + out[1].powi(2);
            middle += out[200].powi(2) + out[201].powi(2);
        }
        // Each is a mean of 8000 squares: relative deviation sqrt(2 / 8000) = 1.6 %, of the ratio
        // 2.2 %; four of those.
        assert!((edge / middle - 1.0).abs() < 0.09, "{}", edge / middle);
    }

    #[test]
    fn noise_has_its_level_and_differs_by_frame() {
        let mut frame = frame(100, 100);
        frame.noise = 0.3;
        let rows = rows(100, 0.0);
        let zero = vec![0; 20_000];
        let first = beam(&frame, &rows, [&zero, &zero, &[]], &joined(&frame));
        let power = first.iter().map(|x| x * x).sum::<f64>() / 20_000.0;
        assert!((power / 0.09 - 1.0).abs() < 0.04, "4 standard errors of 20 000 squares");
        frame.frame_index = 1;
        assert_ne!(first, beam(&frame, &rows, [&zero, &zero, &[]], &joined(&frame)));
    }

    #[test]
    fn saturation_is_counted_per_sample() {
        let full = 1 << 30;
        assert_eq!(saturated([&[full, -full, 0, 0], &[0, 0, 0, full - 1], &[]]), 1);
        assert_eq!(saturated([&[0; 4], &[i32::MIN, 0, 0, 0], &[]]), 1);
        assert_eq!(saturated([&[0; 4], &[i32::MIN, 0, 0, 0], &[0, 0, full, 0]]), 2);
    }
}
