//! Widths and places of peaks.

/// Full width at half maximum of the peak of positive, evenly spaced samples, in samples. Crossings
/// are found on the cubic through the four samples around them of the logarithm: exact for a Gaussian.
pub fn width(samples: &[f64]) -> f64 {
    let log: Vec<f64> = samples.iter().map(|v| v.max(1e-300).ln()).collect();
    let top = (0..log.len()).max_by(|&a, &b| log[a].total_cmp(&log[b])).expect("samples");
    // Vertex of the parabola through the three highest.
    let [a, b, c] = [log[top - 1], log[top], log[top + 1]];
    let shift = 0.5 * (a - c) / (a - 2.0 * b + c);
    let level = b - 0.25 * (a - c) * shift - std::f64::consts::LN_2;
    let right = (top..log.len() - 1).find(|&i| log[i + 1] < level).expect("falls to half");
    let left = (1..=top).rev().find(|&i| log[i - 1] < level).expect("rises from half");
    crossing(&log, right, level) - crossing(&log, left - 1, level)
}

/// Place between i and i + 1 where the cubic through samples i - 1 to i + 2 takes `level`.
fn crossing(log: &[f64], i: usize, level: f64) -> f64 {
    let at = |x: f64| {
        let node = |j: usize| j as f64 - 1.0;
        let term = |j: usize| {
            let others = (0..4).filter(|&m| m != j);
            let product: f64 = others.map(|m| (x - node(m)) / (node(j) - node(m))).product();
            log[i + j - 1] * product
        };
        (0..4).map(term).sum::<f64>()
    };
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if (at(middle) > level) == (at(low) > level) {
            low = middle;
        } else {
            high = middle;
        }
    }
    i as f64 + low
}

/// Centre of power within `reach` samples of the strongest sample in `range`.
pub fn centre(samples: &[f64], range: std::ops::Range<usize>, reach: usize) -> f64 {
    let top = range.max_by(|&a, &b| samples[a].total_cmp(&samples[b])).expect("a range");
    let around = top.saturating_sub(reach)..=(top + reach).min(samples.len() - 1);
    let power: f64 = around.clone().map(|i| samples[i].powi(2)).sum();
    around.map(|i| i as f64 * samples[i].powi(2)).sum::<f64>() / power
}

#[test]
fn the_width_of_a_gaussian_is_exact() {
    let samples: Vec<f64> =
        (0..60).map(|i| (-(f64::from(i) - 29.3).powi(2) / (2.0 * 16.0)).exp()).collect();
    // 2 sqrt(2 ln 2) sigma; the bound is bisection and rounding.
    let expected = (8.0 * std::f64::consts::LN_2).sqrt() * 4.0;
    assert!((width(&samples) - expected).abs() < 1e-9);
    assert!((centre(&samples, 0..60, 29) - 29.3).abs() < 1e-9);
}
