//! Order statistics of repeated measurements.

use serde::Serialize;

pub mod ranks;

/// Order statistics by nearest rank; NaN without values.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Statistics {
    /// Half of the values are at most this.
    pub median: f64,
    /// 95 of 100 values are at most this.
    pub p95: f64,
    /// 99 of 100 values are at most this.
    pub p99: f64,
}

impl Statistics {
    /// Statistics of `values`.
    pub fn of(values: impl IntoIterator<Item = f64>) -> Self {
        let mut sorted: Vec<f64> = values.into_iter().collect();
        sorted.sort_by(f64::total_cmp);
        let rank = |q: f64| {
            let rank = (sorted.len() as f64 * q).ceil() as usize;
            sorted.get(rank.saturating_sub(1)).copied().unwrap_or(f64::NAN)
        };
        Self { median: rank(0.5), p95: rank(0.95), p99: rank(0.99) }
    }
}

/// Distance of the mean of `samples` from `expected`, in standard errors of that mean.
pub fn standard_errors(samples: &[f64], expected: f64) -> f64 {
    let n = samples.len() as f64;
    let mean = samples.iter().sum::<f64>() / n;
    let variance = samples.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean - expected).abs() / (variance / n).sqrt().max(f64::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_are_values_that_were_measured() {
        let hundred = Statistics::of((1..=100).rev().map(f64::from));
        assert_eq!([hundred.median, hundred.p95, hundred.p99], [50.0, 95.0, 99.0]);
        let three = Statistics::of([3.0, 1.0, 2.0]);
        assert_eq!([three.median, three.p95, three.p99], [2.0, 3.0, 3.0]);
        assert!(Statistics::of([]).median.is_nan());
    }

    #[test]
    fn a_mean_is_as_far_off_as_its_spread_allows() {
        // Variance 4 of 4 samples: a standard error of 1.
        let samples = [1.0, 1.0, 4.0, 4.0].map(|x: f64| (x - 2.5) * 2.0 / 3f64.sqrt());
        for expected in [-3.0, 0.0, 2.0] {
            assert!((standard_errors(&samples, expected) - f64::abs(expected)).abs() < 1e-12);
        }
        assert_eq!(standard_errors(&[2.0; 5], 2.0), 0.0);
    }
}
