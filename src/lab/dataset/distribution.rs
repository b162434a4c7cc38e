//! Distributions of a number, by their quantiles.

use std::f64::consts::FRAC_1_SQRT_2;

/// Half the width of the interval in which [`quantile_of_normal`] searches, standard deviations: beyond it lies no
/// number that 52 bits can draw.
const FARTHEST: f64 = 9.0;

/// The distribution of a number, or of a place in a list.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Distribution {
    /// Even between two numbers.
    Uniform([f64; 2]),
    /// Even in the logarithm, between two numbers above 0.
    LogUniform([f64; 2]),
    /// Normal, cut off at limits: what lies beyond them is drawn again.
    Normal {
        /// Mean of the whole distribution.
        mean: f64,
        /// Standard deviation of the whole distribution.
        deviation: f64,
        /// Least and largest number.
        limits: [f64; 2],
    },
    /// Places from 0 on, by shares that add up to 1: for each place the sum of the shares up to it.
    Place(Vec<f64>),
}

impl Distribution {
    /// The number below which the share `u` of all numbers lies; 0 < u < 1.
    pub fn quantile(&self, u: f64) -> f64 {
        match self {
            Self::Uniform([low, high]) => (low + u * (high - low)).clamp(*low, *high),
            Self::LogUniform([low, high]) => {
                let (a, b) = (libm::log(*low), libm::log(*high));
                libm::exp(a + u * (b - a)).clamp(*low, *high)
            }
            Self::Normal { mean, deviation, limits: [low, high] } => {
                let [a, b] = [low, high].map(|limit| share_below((limit - mean) / deviation));
                let z = quantile_of_normal(a + u * (b - a));
                (mean + deviation * z).clamp(*low, *high)
            }
            Self::Place(sums) => {
                sums.iter().take_while(|sum| u >= **sum).count().min(sums.len() - 1) as f64
            }
        }
    }

    /// Share of a normal distribution that lies within its limits; 1 for the others.
    pub fn kept(&self) -> f64 {
        match self {
            Self::Normal { mean, deviation, limits } => {
                let [a, b] = limits.map(|limit| share_below((limit - mean) / deviation));
                b - a
            }
            _ => 1.0,
        }
    }
}

/// Share of the standard normal distribution below `z`.
pub(super) fn share_below(z: f64) -> f64 {
    0.5 * libm::erfc(-z * FRAC_1_SQRT_2)
}

/// The number below which the share `u` of the standard normal distribution lies, by halving.
pub(super) fn quantile_of_normal(u: f64) -> f64 {
    let (mut low, mut high) = (-FARTHEST, FARTHEST);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if share_below(middle) < u {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn quantiles_of_the_normal_distribution_are_those_of_tables() {
        // Abramowitz and Stegun, table 26.5.
        for (u, z) in
            [(0.5, 0.0), (0.975, 1.959_963_985), (0.025, -1.959_963_985), (0.999, 3.090_232_306)]
        {
            assert_relative_eq!(quantile_of_normal(u), z, epsilon = 1e-8);
            assert_relative_eq!(share_below(z), u, epsilon = 1e-9);
        }
    }

    #[test]
    fn quantiles_grow_from_one_end_to_the_other() {
        let cut = Distribution::Normal { mean: 1.0, deviation: 2.0, limits: [0.0, 4.0] };
        for (of, ends, middle) in [
            (Distribution::Uniform([-2.0, 6.0]), [-2.0, 6.0], 2.0),
            (Distribution::LogUniform([0.01, 100.0]), [0.01, 100.0], 1.0),
            // Half of what lies between -0.5 and 1.5 deviations: 0.308538 + 0.624655 / 2 = 0.620866 below.
            (cut, [0.0, 4.0], 1.0 + 2.0 * 0.307_754),
        ] {
            assert_relative_eq!(of.quantile(1e-15), ends[0], epsilon = 1e-6);
            assert_relative_eq!(of.quantile(1.0 - 1e-15), ends[1], epsilon = 1e-6);
            assert_relative_eq!(of.quantile(0.5), middle, max_relative = 1e-3);
            let all: Vec<f64> = (1..100).map(|i| of.quantile(f64::from(i) / 100.0)).collect();
            assert!(all.windows(2).all(|w| w[0] < w[1]), "{of:?}");
        }
        let place = Distribution::Place(vec![0.25, 0.25, 1.0]);
        let places = [0.1, 0.2499, 0.25, 0.9].map(|u| place.quantile(u));
        assert_eq!(places, [0.0, 0.0, 2.0, 2.0], "a share of 0 is never drawn");
    }
}
