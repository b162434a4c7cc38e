//! Comparison of a kernel's numbers with its twin's.

/// The worst of many comparisons of one quantity.
#[derive(Clone, Debug, PartialEq)]
pub struct Check {
    /// The quantity.
    pub what: &'static str,
    /// Comparisons made.
    pub count: usize,
    /// The largest difference relative to its tolerance; infinite where one value is NaN
    /// and the other is not.
    pub error: f64,
    /// The tolerance there.
    pub allowed: f64,
    /// The index of that place.
    pub at: usize,
}

impl Check {
    /// True if nothing exceeds its tolerance.
    pub fn passed(&self) -> bool {
        self.error <= self.allowed
    }

    /// Compares element by element; `allowed` is the tolerance at an index. Two NaNs are equal, and
    /// so are infinities of the same sign.
    pub fn close(
        what: &'static str,
        got: &[f32],
        expected: &[f64],
        allowed: impl Fn(usize) -> f64,
    ) -> Self {
        let errors = got.iter().zip(expected).map(|(&got, &expected)| {
            let got = f64::from(got);
            match (got - expected).abs() {
                _ if got == expected || (got.is_nan() && expected.is_nan()) => 0.0,
                error if error.is_nan() => f64::INFINITY,
                error => error,
            }
        });
        Self::of_same_length(what, got.len(), expected.len(), errors, allowed)
    }

    /// Compares whole numbers exactly.
    pub fn equal<T: PartialEq>(what: &'static str, got: &[T], expected: &[T]) -> Self {
        let errors = got.iter().zip(expected).map(|(a, b)| f64::from(a != b));
        Self::of_same_length(what, got.len(), expected.len(), errors, |_| 0.0)
    }

    /// A number of `differing` things out of `of`; at most `allowed` may differ.
    pub fn count(what: &'static str, of: usize, differing: usize, allowed: usize) -> Self {
        Self { what, count: of, error: differing as f64, allowed: allowed as f64, at: 0 }
    }

    /// The check of one error.
    pub fn one(what: &'static str, error: f64, allowed: f64) -> Self {
        let error = if error.is_nan() { f64::INFINITY } else { error };
        Self { what, count: 1, error, allowed, at: 0 }
    }

    fn of_same_length(
        what: &'static str,
        got: usize,
        expected: usize,
        errors: impl Iterator<Item = f64>,
        allowed: impl Fn(usize) -> f64,
    ) -> Self {
        let mut worst = Self { what, count: expected, error: 0.0, allowed: 0.0, at: 0 };
        if got != expected {
            worst.error = f64::INFINITY;
            return worst;
        }
        let mut ratio = -1.0;
        for (at, error) in errors.enumerate() {
            let allowed = allowed(at);
            // 0 / 0 is agreement where none is allowed to differ.
            let here = if error == 0.0 { 0.0 } else { error / allowed };
            if here > ratio {
                ratio = here;
                worst = Self { error, allowed, at, ..worst };
            }
        }
        worst
    }
}

impl std::fmt::Display for Check {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let verdict = if self.passed() { "ok" } else { "WRONG" };
        write!(
            f,
            "{:<24} {:>8} compared, worst {:.3e} of {:.3e} allowed at {}: {verdict}",
            self.what, self.count, self.error, self.allowed, self.at
        )
    }
}

/// Euclidean norm of the difference relative to that of `expected`; 0 when both are all zero.
pub fn relative_norm(got: &[f64], expected: &[f64]) -> f64 {
    let norm = |v: &mut dyn Iterator<Item = f64>| v.map(|x| x * x).sum::<f64>().sqrt();
    let difference = norm(&mut got.iter().zip(expected).map(|(a, b)| a - b));
    if difference == 0.0 {
        return 0.0;
    }
    difference / norm(&mut expected.iter().copied())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_beyond_the_tolerance_lengths_and_nan_are_caught() {
        let close = |got: &[f32], expected: &[f64]| Check::close("x", got, expected, |_| 1e-3);
        assert!(close(&[1.0, 2.0005], &[1.0, 2.0]).passed());
        let worst = close(&[1.0, 2.002, 3.0], &[1.0, 2.0, 3.0]);
        assert!(!worst.passed() && worst.at == 1);
        assert!(!close(&[1.0], &[1.0, 2.0]).passed());
        assert!(!close(&[f32::NAN], &[1.0]).passed());
        assert!(!close(&[1.0], &[f64::NAN]).passed());
        assert!(close(&[f32::NAN, f32::INFINITY], &[f64::NAN, f64::INFINITY]).passed());
        assert!(!close(&[f32::INFINITY], &[f64::NEG_INFINITY]).passed());
        assert!(!close(&[f32::INFINITY], &[1.0]).passed());
        assert!(close(&[], &[]).passed());
        assert!(!Check::equal("x", &[1, 2], &[1, 3]).passed());
        assert!(!Check::one("x", f64::NAN, 1.0).passed());
    }

    #[test]
    fn norms_are_relative() {
        assert_eq!(relative_norm(&[0.0; 3], &[0.0; 3]), 0.0);
        assert!((relative_norm(&[3.0, 4.5], &[3.0, 4.0]) - 0.1).abs() < 1e-12);
        assert!(relative_norm(&[1.0], &[0.0]).is_infinite());
        assert!(relative_norm(&[f64::NAN], &[1.0]).is_nan());
    }
}
