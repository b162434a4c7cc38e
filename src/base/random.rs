//! Counter-based random numbers: pcg4d (Jarzynski and Olano, JCGT 9(3), 2020).

use std::f64::consts::TAU;

/// Four words hashed into four.
pub fn pcg4d(v: [u32; 4]) -> [u32; 4] {
    let mix = |v: &mut [u32; 4]| {
        for [to, a, b] in [[0, 1, 3], [1, 2, 0], [2, 0, 1], [3, 1, 2]] {
            v[to] = v[to].wrapping_add(v[a].wrapping_mul(v[b]));
        }
    };
    let mut v = v.map(|x| x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223));
    mix(&mut v);
    v = v.map(|x| x ^ (x >> 16));
    mix(&mut v);
    v
}

/// Uniform in [0, 1) with 24 bits.
pub fn unit(bits: u32) -> f64 {
    f64::from(bits >> 8) / 16_777_216.0
}

/// Standard normal from one word: Box and Muller on two 16-bit uniforms, the first in (0, 1).
pub fn gaussian(bits: u32) -> f64 {
    let u = (f64::from(bits >> 16) + 0.5) / 65_536.0;
    let v = f64::from(bits & 0xffff) / 65_536.0;
    (-2.0 * u.ln()).sqrt() * (TAU * v).cos()
}

/// Uniform in (0, 1) with 52 bits, from two words: never 0 and never 1.
pub fn inner(words: [u32; 2]) -> f64 {
    let bits = (u64::from(words[0]) << 20) | u64::from(words[1] >> 12);
    (bits as f64 + 0.5) / (1u64 << 52) as f64
}

/// A permutation of `count` things, drawn by `seed` (Fisher and Yates). Each `stream` draws an order of its own.
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
    use crate::statistics::standard_errors;

    // 4 standard errors: chance 6e-5 per moment, and the seeds are fixed.
    #[test]
    fn moments_of_uniform_and_normal_numbers() {
        for word in 0..4 {
            let bits: Vec<u32> = (0..100_000).map(|n| pcg4d([n, 3, 17, 1])[word]).collect();
            let u: Vec<f64> = bits.iter().map(|&b| unit(b)).collect();
            let g: Vec<f64> = bits.iter().map(|&b| gaussian(b)).collect();
            let power = |x: &[f64], k| x.iter().map(|v| v.powi(k)).collect::<Vec<_>>();
            assert!(u.iter().all(|&x| (0.0..1.0).contains(&x)));
            assert!(standard_errors(&u, 0.5) < 4.0);
            assert!(standard_errors(&power(&u, 2), 1.0 / 3.0) < 4.0);
            assert!(standard_errors(&g, 0.0) < 4.0);
            assert!(standard_errors(&power(&g, 2), 1.0) < 4.0);
            assert!(standard_errors(&power(&g, 4), 3.0) < 4.0);
            // The test must be able to fail: a shift by 2 % of a deviation is seen.
            assert!(standard_errors(&g, 0.02) > 4.0);
        }
    }

    #[test]
    fn one_word_equals_the_value_worked_out_by_hand() {
        // Worked through with the shader's definition in arbitrary-precision integers.
        let a = 1_013_904_223_u32;
        let step = |x: u32, y: u32, z: u32| x.wrapping_add(y.wrapping_mul(z));
        let (x, y, z, w) = (a, a, a, a);
        let x = step(x, y, w);
        let y = step(y, z, x);
        let z = step(z, x, y);
        let w = step(w, y, z);
        let [x, y, z, w] = [x, y, z, w].map(|v| v ^ (v >> 16));
        let x = step(x, y, w);
        let y = step(y, z, x);
        let z = step(z, x, y);
        let w = step(w, y, z);
        assert_eq!(pcg4d([0; 4]), [x, y, z, w]);
    }

    #[test]
    fn numbers_inside_the_unit_interval_are_uniform_and_never_reach_its_ends() {
        assert!(inner([0, 0]) > 0.0 && inner([u32::MAX, u32::MAX]) < 1.0);
        let u: Vec<f64> = (0..100_000)
            .map(|n| {
                let [a, b, ..] = pcg4d([n, 3, 17, 1]);
                inner([a, b])
            })
            .collect();
        assert!(standard_errors(&u, 0.5) < 4.0);
        assert!(standard_errors(&u.iter().map(|v| v * v).collect::<Vec<_>>(), 1.0 / 3.0) < 4.0);
        assert!(standard_errors(&u, 0.51) > 4.0);
    }

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
