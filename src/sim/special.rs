//! Special functions of the calibration, by series whose terms all have one sign.

use std::f64::consts::{FRAC_2_SQRT_PI, PI};

/// Error function; absolute error below 1e-14.
pub fn erf(x: f64) -> f64 {
    if x.abs() > 6.0 {
        return x.signum();
    }
    // Abramowitz and Stegun 7.1.6: 2/sqrt(pi) exp(-x^2) sum 2^n x^(2n+1) / (2n+1)!!
    let (mut term, mut sum, mut n) = (x, x, 0.0);
    while term.abs() > 1e-17 * sum.abs() {
        n += 1.0;
        term *= 2.0 * x * x / (2.0 * n + 1.0);
        sum += term;
    }
    FRAC_2_SQRT_PI * (-x * x).exp() * sum
}

/// Dawson's integral exp(-x^2) int_0^x exp(t^2) dt; relative error below 2e-8.
pub fn dawson(x: f64) -> f64 {
    if x.abs() > 6.0 {
        // Asymptotic series in y = 1/(2x^2); the first term left out is 135135 y^7 < 1.4e-8.
        let y = (2.0 * x * x).recip();
        let series = 1.0
            + y * (1.0
                + 3.0 * y * (1.0 + 5.0 * y * (1.0 + 7.0 * y * (1.0 + 9.0 * y * (1.0 + 11.0 * y)))));
        return series / (2.0 * x);
    }
    // int_0^x exp(t^2) dt = sum x^(2n+1) / (n! (2n+1))
    let (mut power, mut sum, mut n) = (x, x, 0.0);
    while power.abs() > 1e-17 * sum.abs() {
        n += 1.0;
        power *= x * x / n;
        sum += power / (2.0 * n + 1.0);
    }
    (-x * x).exp() * sum
}

/// Normalised sinc sin(pi x) / (pi x).
pub fn sinc(x: f64) -> f64 {
    if x.abs() < 1e-9 { 1.0 } else { (PI * x).sin() / (PI * x) }
}

/// |E exp(i k q)| for a half-normal q of scale `tau`: exp(-a^2/2) |1 + i erfi(a/sqrt 2)| with
/// a = k tau; written with Dawson's integral so that it does not overflow.
pub fn half_normal_coherence(phase_per_mm: f64, tau: f64) -> f64 {
    let a = phase_per_mm * tau;
    let imaginary = FRAC_2_SQRT_PI * dawson(a / std::f64::consts::SQRT_2);
    (-a * a / 2.0).exp().hypot(imaginary)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn erf_equals_tabulated_values() {
        // Abramowitz and Stegun, table 7.1.
        for (x, y) in [
            (0.0, 0.0),
            (0.5, 0.520_499_877_8),
            (1.0, 0.842_700_792_9),
            (2.0, 0.995_322_265_0),
            (-1.0, -0.842_700_792_9),
            (7.0, 1.0),
        ] {
            assert!((erf(x) - y).abs() < 1e-9, "erf({x}) = {}", erf(x));
        }
    }

    #[test]
    fn dawson_equals_tabulated_values_and_joins_its_asymptote() {
        // Abramowitz and Stegun, table 7.5.
        for (x, y) in [(0.5, 0.424_436_384), (1.0, 0.538_079_507), (2.0, 0.301_340_389)] {
            assert!((dawson(x) - y).abs() < 1e-8, "D({x}) = {}", dawson(x));
        }
        let (below, above) = (dawson(6.0 - 1e-9), dawson(6.0 + 1e-9));
        assert!((below / above - 1.0).abs() < 1e-6, "{below} {above}");
    }

    #[test]
    fn coherence_at_seven_megahertz() {
        let k = 4.0 * PI * 7.0 / 1.54;
        for (tau, gamma) in [(0.0, 1.0), (0.02, 0.80), (0.05, 0.34), (0.1, 0.14), (0.3, 0.05)] {
            let got = half_normal_coherence(k, tau);
            assert!((got - gamma).abs() < 0.006, "tau {tau}: {got}");
        }
        // By quadrature of the density sqrt(2/pi)/tau exp(-q^2/2 tau^2).
        let (tau, n) = (0.05, 20_000);
        let (mut re, mut im) = (0.0, 0.0);
        for i in 0..n {
            let q = 8.0 * tau * (f64::from(i) + 0.5) / f64::from(n);
            let p = (-q * q / (2.0 * tau * tau)).exp();
            re += p * (k * q).cos();
            im += p * (k * q).sin();
        }
        let scale = 8.0 * tau / f64::from(n) * (2.0 / PI).sqrt() / tau;
        let quadrature = re.hypot(im) * scale;
        assert!((half_normal_coherence(k, tau) - quadrature).abs() < 1e-6);
    }
}
