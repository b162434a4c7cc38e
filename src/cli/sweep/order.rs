//! In which order images are shown.

use insonify::reference::random::pcg4d;

/// Which image stands at each place: as made, or in an order drawn by `seed` (Fisher and Yates).
pub fn order(count: usize, seed: Option<u32>) -> Vec<usize> {
    let mut order: Vec<usize> = (0..count).collect();
    let Some(seed) = seed else {
        return order;
    };
    for last in (1..count).rev() {
        let [word, ..] = pcg4d([seed, last as u32, 0, 0]);
        // The upper half of the product: uniform in 0..=last up to one part in 2^32.
        let other = (u64::from(word) * (last as u64 + 1)) >> 32;
        order.swap(last, other as usize);
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_seed_draws_a_permutation_and_draws_it_again() {
        assert_eq!(order(4, None), [0, 1, 2, 3]);
        let first = order(23, Some(7));
        assert_eq!(first, order(23, Some(7)));
        assert_ne!(first, order(23, Some(8)));
        let mut sorted = first.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, (0..23).collect::<Vec<_>>());
    }

    /// Every image is as often at every place: chi-squared over 25 pairs, 16 degrees of freedom, of
    /// which 39.25 is exceeded once in a thousand.
    #[test]
    fn every_image_comes_to_every_place() {
        let runs = 5000;
        let mut counts = [[0u32; 5]; 5];
        for seed in 0..runs {
            for (place, image) in order(5, Some(seed)).into_iter().enumerate() {
                counts[place][image] += 1;
            }
        }
        let expected = f64::from(runs) / 5.0;
        let cells = counts.iter().flatten();
        let chi: f64 = cells
            .map(|&n| (f64::from(n) - expected).powi(2) / expected)
            .sum();
        assert!(chi < 39.25, "{chi}: {counts:?}");
    }
}
