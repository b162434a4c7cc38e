//! Twin of `moments` and `enhance`: speckle reduction and edge enhancement of the log-compressed scanlines.

use insonify::sim::layout::{Frame, Row};

/// The settings of the display chain, as the kernels are given them.
#[derive(Clone, Copy, Debug)]
pub struct Chain {
    /// Deviation of the neighbourhood over that of the point-spread function.
    pub neighbourhood: f64,
    /// 0 to 1.
    pub speckle_reduction: f64,
    /// 0: none.
    pub edge_enhancement: f64,
    /// Variance of fully developed speckle, squared levels.
    pub speckle: f64,
}

/// The mean of `value` at distances up to three deviations, by a Gaussian; of those in `range` alone.
fn mean<const N: usize>(
    sigma: f64,
    most: i64,
    middle: i64,
    range: i64,
    value: impl Fn(usize) -> [f64; N],
) -> [f64; N] {
    let reach = if sigma < 0.05 { 0 } else { ((3.0 * sigma).ceil() as i64).min(most) };
    let (mut sums, mut weights) = ([0.0; N], 0.0);
    for j in (-reach..=reach).filter(|j| (0..range).contains(&(middle + j))) {
        let weight = match j {
            0 => 1.0,
            _ => (-0.5 * (j * j) as f64 / (sigma * sigma).max(0.0025)).exp(),
        };
        weights += weight;
        let values = value((middle + j) as usize);
        sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += weight * value);
    }
    sums.map(|sum| sum / weights)
}

/// Mean and mean square across the scanlines, by scanline and sample.
pub fn moments(frame: &Frame, rows: &[Row], log_image: &[f32], chain: &Chain) -> Vec<[f64; 2]> {
    let (scanlines, samples) = (frame.scanlines as usize, frame.samples as usize);
    let at = |l: usize, k: usize| {
        let sigma = chain.neighbourhood * f64::from(rows[k].lateral_lines);
        mean(sigma, 16, l as i64, scanlines as i64, |line| {
            let level = f64::from(log_image[line * samples + k]);
            [level, level * level]
        })
    };
    (0..scanlines).flat_map(|l| (0..samples).map(move |k| at(l, k))).collect()
}

/// Mean and variance of the neighbourhood of each sample, from the moments across the scanlines.
pub fn neighbourhoods(frame: &Frame, moments: &[[f32; 2]], chain: &Chain) -> Vec<[f64; 2]> {
    let samples = frame.samples as usize;
    let sigma = chain.neighbourhood * f64::from(frame.axial_sigma);
    let lines = moments.chunks(samples.max(1));
    let found = lines.flat_map(|line| {
        (0..samples).map(move |k| {
            let [m, square] = mean(sigma, 32, k as i64, samples as i64, |k| line[k].map(f64::from));
            [m, (square - m * m).max(1e-12)]
        })
    });
    found.collect()
}

/// A level from its neighbourhood's mean and variance.
pub fn enhanced([mean, variance]: [f64; 2], level: f64, chain: &Chain) -> f64 {
    let smoothed = chain.speckle_reduction * (chain.speckle / variance).min(1.0);
    let differs = (1.0 + chain.edge_enhancement) * (1.0 - smoothed) * (level - mean);
    (mean + differs).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const CHAIN: Chain =
        Chain { neighbourhood: 1.0, speckle_reduction: 0.0, edge_enhancement: 1.0, speckle: 0.01 };

    fn image(level: impl Fn(usize, usize) -> f64) -> (Frame, Vec<Row>, Vec<f32>) {
        let frame = Frame { scanlines: 21, samples: 60, axial_sigma: 3.0, ..Frame::default() };
        let rows = vec![Row { lateral_lines: 2.0, ..Row::default() }; 60];
        let levels = (0..21).flat_map(|l| (0..60).map(move |k| (l, k)));
        let levels = levels.map(|(l, k)| level(l, k) as f32).collect();
        (frame, rows, levels)
    }

    fn run(chain: &Chain, level: impl Fn(usize, usize) -> f64) -> Vec<f64> {
        let (frame, rows, levels) = image(level);
        let moments = moments(&frame, &rows, &levels, chain);
        let moments: Vec<[f32; 2]> = moments.iter().map(|m| m.map(|x| x as f32)).collect();
        let around = neighbourhoods(&frame, &moments, chain);
        let levels = around.iter().zip(&levels);
        levels.map(|(around, &level)| enhanced(*around, level.into(), chain)).collect()
    }

    #[test]
    fn what_is_flat_stays_and_a_step_overshoots_by_half_of_itself_at_its_edge() {
        for chain in [CHAIN, Chain { speckle_reduction: 1.0, ..CHAIN }] {
            let flat = run(&chain, |_, _| 0.4);
            assert!(flat.iter().all(|level| (level - 0.4).abs() < 1e-6), "{chain:?}");
        }
        // The mean half a sample behind a step of h is h (1/2 + Gaussian density at 0 / 2), of a deviation of 3.
        let stepped = run(&CHAIN, |_, k| if k < 30 { 0.4 } else { 0.5 });
        let density = 1.0 / (3.0 * std::f64::consts::TAU.sqrt());
        let overshoot = 0.1 * (0.5 - density / 2.0);
        let at = 10 * 60;
        assert!((stepped[at + 30] - 0.5 - overshoot).abs() < 2e-4, "{}", stepped[at + 30]);
        assert!((stepped[at + 29] - 0.4 + overshoot).abs() < 2e-4);
        let across = run(&CHAIN, |l, _| if l < 11 { 0.4 } else { 0.5 });
        let density = 1.0 / (2.0 * std::f64::consts::TAU.sqrt());
        let overshoot = 0.1 * (0.5 - density / 2.0);
        assert!((across[11 * 60 + 30] - 0.5 - overshoot).abs() < 5e-4, "{}", across[11 * 60 + 30]);
    }

    #[test]
    fn what_varies_less_than_speckle_becomes_the_mean_and_a_border_stays() {
        let reduced = Chain { speckle_reduction: 1.0, edge_enhancement: 0.0, ..CHAIN };
        // Variance 0.0025, below that of speckle.
        let ripple = run(&reduced, |_, k| 0.4 + 0.05 * f64::from(1 - 2 * (k as i32 & 1)));
        assert!((ripple[10 * 60 + 30] - 0.4).abs() < 1e-3, "{}", ripple[10 * 60 + 30]);
        // At the edge of a step of h the variance is h^2 / 4.
        let stepped = run(&reduced, |_, k| if k < 30 { 0.1 } else { 0.9 });
        let left = 1.0 - 0.01 / 0.16;
        let density = 1.0 / (3.0 * std::f64::consts::TAU.sqrt());
        let mean = 0.1 + 0.8 * (0.5 + density / 2.0);
        let expected = mean + left * (0.9 - mean);
        assert!((stepped[10 * 60 + 30] - expected).abs() < 3e-3, "{}", stepped[10 * 60 + 30]);
    }
}
