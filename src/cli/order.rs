//! The random order in which images are shown.

use insonify::random::pcg4d;

/// A permutation of `count` images, drawn by `seed` (Fisher and Yates). Each `stream` draws an order of
/// its own.
pub fn order(count: usize, seed: u32, stream: u32) -> Vec<usize> {
    let mut order: Vec<usize> = (0..count).collect();
    for last in (1..count).rev() {
        let [word, ..] = pcg4d([seed, last as u32, stream, 0]);
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
        let first = order(23, 7, 0);
        assert_eq!(first, order(23, 7, 0));
        assert_ne!(first, order(23, 8, 0));
        assert_ne!(first, order(23, 7, 1));
        let mut sorted = first.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, (0..23).collect::<Vec<_>>());
    }

    /// Every image is equally often at every place: chi-squared over 25 pairs, 16 degrees of freedom, with
    /// 39.25 exceeded once in a thousand.
    #[test]
    fn every_image_comes_to_every_place() {
        let runs = 5000;
        let mut counts = [[0u32; 5]; 5];
        for seed in 0..runs {
            for (place, image) in order(5, seed, 0).into_iter().enumerate() {
                counts[place][image] += 1;
            }
        }
        let expected = f64::from(runs) / 5.0;
        let cells = counts.iter().flatten();
        let chi: f64 = cells.map(|&n| (f64::from(n) - expected).powi(2) / expected).sum();
        assert!(chi < 39.25, "{chi}: {counts:?}");
    }
}
