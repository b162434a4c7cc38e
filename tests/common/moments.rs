//! Statistics of speckle.

#![allow(dead_code, reason = "each program of tests uses some of them")]

use std::f64::consts::LN_2;

/// Mean.
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Standard deviation.
pub fn deviation(values: &[f64]) -> f64 {
    let m = mean(values);
    let squares = values.iter().map(|v| (v - m).powi(2)).sum::<f64>();
    (squares / values.len() as f64).sqrt()
}

/// Mean over standard deviation (Burckhardt 1978, IEEE Trans. Sonics Ultrason. 25(1)).
pub fn signal_to_noise(values: &[f64]) -> f64 {
    mean(values) / deviation(values)
}

/// Kurtosis E e^4 / (E e^2)^2 of envelopes e whose squares are given.
pub fn kurtosis(intensities: &[f64]) -> f64 {
    let squares: Vec<f64> = intensities.iter().map(|i| i * i).collect();
    mean(&squares) / mean(intensities).powi(2)
}

/// Power ratio in dB.
pub fn decibel(ratio: f64) -> f64 {
    10.0 * ratio.log10()
}

/// Kolmogorov and Smirnov's largest distance between the distribution of independent intensities
/// and the exponential one of `mean`.
pub fn exponential_distance(intensities: &[f64], mean: f64) -> f64 {
    let mut sorted = intensities.to_vec();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len() as f64;
    let distance = |(i, v): (usize, &f64)| {
        let expected = 1.0 - (-v / mean).exp();
        (expected - i as f64 / n).max((i + 1) as f64 / n - expected)
    };
    sorted.iter().enumerate().map(distance).fold(0.0, f64::max)
}

/// Distance that n samples of the right distribution exceed once in a hundred times, for n above
/// a few dozen: Q(1.628) = 0.01 in Kolmogorov's distribution.
pub fn critical_distance(n: usize) -> f64 {
    1.628 / (n as f64).sqrt()
}

/// Pearson's correlation.
pub fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let (ma, mb) = (mean(a), mean(b));
    let products: Vec<f64> = a.iter().zip(b).map(|(x, y)| (x - ma) * (y - mb)).collect();
    mean(&products) / (deviation(a) * deviation(b))
}

/// Covariance of values `lag` apart along the rows, for lags 0 to `most`, over that at lag 0. The mean is that of
/// all rows.
pub fn autocovariance(rows: &[Vec<f64>], most: usize) -> Vec<f64> {
    let all = rows.concat();
    let m = mean(&all);
    let at = |lag: usize| {
        let pairs = rows.iter().flat_map(|r| r.iter().zip(&r[lag..]));
        let (sum, count) =
            pairs.fold((0.0, 0.0), |(s, c), (a, b)| (s + (a - m) * (b - m), c + 1.0));
        sum / count
    };
    let zero = at(0);
    (0..=most).map(|lag| at(lag) / zero).collect()
}

/// Lag at which an autocovariance has fallen to a half of its first value, linear between lags.
pub fn half_width(covariance: &[f64]) -> f64 {
    let half = covariance[0] / 2.0;
    let after = covariance.iter().position(|c| *c < half).expect("it falls");
    let (above, below) = (covariance[after - 1], covariance[after]);
    (after - 1) as f64 + (above - half) / (above - below)
}

/// The same rows, read across: element i of every row makes row i.
pub fn transposed(rows: &[Vec<f64>]) -> Vec<Vec<f64>> {
    (0..rows[0].len()).map(|i| rows.iter().map(|r| r[i]).collect()).collect()
}

/// Generalised contrast-to-noise ratio of two sets of envelopes: one minus the common part of their histograms
/// (Rodriguez-Molares et al. 2020, IEEE TUFFC 67(4)). 64 bins, even on the logarithm.
pub fn gcnr(inside: &[f64], outside: &[f64]) -> f64 {
    let log = |v: f64| v.max(1e-12).ln();
    let all = || inside.iter().chain(outside).map(|&v| log(v));
    let (low, high) =
        all().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    let histogram = |values: &[f64]| {
        let mut bins = [0.0; 64];
        for &v in values {
            let bin = ((log(v) - low) / (high - low) * 64.0) as usize;
            bins[bin.min(63)] += 1.0 / values.len() as f64;
        }
        bins
    };
    let pairs = histogram(inside).into_iter().zip(histogram(outside));
    1.0 - pairs.map(|(a, b)| a.min(b)).sum::<f64>()
}

/// Slope of the straight line closest to the points.
pub fn slope(points: &[[f64; 2]]) -> f64 {
    let column = |i: usize| points.iter().map(|p| p[i]).collect::<Vec<f64>>();
    let (x, y) = (column(0), column(1));
    correlation(&x, &y) * deviation(&y) / deviation(&x)
}

/// Full width at half maximum over sigma of a Gaussian.
pub fn gaussian_fwhm() -> f64 {
    (8.0 * LN_2).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The n intensities whose distribution is closest to the exponential one.
    fn quantiles(n: u32) -> Vec<f64> {
        let at = |i| -((f64::from(i) + 0.5) / f64::from(n)).ln();
        (0..n).map(at).collect()
    }

    // Quadrature of the singular logarithm by 1e5 midpoints: 1e-3 in the fourth moment.
    #[test]
    fn rayleigh_moments() {
        let i = quantiles(100_000);
        let e: Vec<f64> = i.iter().map(|v| v.sqrt()).collect();
        let pi = std::f64::consts::PI;
        assert!((signal_to_noise(&e) - (pi / (4.0 - pi)).sqrt()).abs() < 1e-3);
        assert!((kurtosis(&i) - 2.0).abs() < 1e-3);
        assert!(exponential_distance(&i, 1.0) < 1e-5);
        // F differs most from that of a mean 10 % larger by 0.1 / e, to first order.
        let shifted = exponential_distance(&i, 1.1);
        assert!((shifted - 0.035).abs() < 0.002, "{shifted}");
    }

    // Two exponential distributions of means 1 and c cross once: the overlap in closed form. The
    // histogram's bins blur the crossing: 0.01.
    #[test]
    fn overlap_of_two_exponential_distributions() {
        let outside: Vec<f64> = quantiles(20_000).iter().map(|v| v.sqrt()).collect();
        let inside: Vec<f64> = outside.iter().map(|v| v / 2.0).collect();
        let c: f64 = 0.25;
        let expected = c.powf(c / (1.0 - c)) - c.powf(1.0 / (1.0 - c));
        assert!((gcnr(&inside, &outside) - expected).abs() < 0.01);
        let dark: Vec<f64> = outside.iter().map(|v| v * 1e-6).collect();
        assert!(gcnr(&dark, &outside) > 0.999);
    }

    #[test]
    fn slopes_and_correlations() {
        let line: Vec<[f64; 2]> =
            (0..9).map(|i| [f64::from(i), 3.0 - 2.0 * f64::from(i)]).collect();
        assert!((slope(&line) + 2.0).abs() < 1e-12);
        let rows = vec![vec![1.0, -1.0, 1.0, -1.0]; 3];
        assert_eq!(autocovariance(&rows, 2), [1.0, -1.0, 1.0]);
        assert_eq!(transposed(&[vec![1.0, 2.0], vec![3.0, 4.0]])[1], [2.0, 4.0]);
    }
}
