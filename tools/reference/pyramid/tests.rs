use super::*;

/// Odd, even, prime, a row, a pixel.
const SIZES: [[usize; 2]; 5] = [[64, 48], [37, 29], [61, 1], [5, 83], [1, 1]];

/// Grey levels without any smoothness.
fn grey(x: usize, y: usize, seed: u32) -> f64 {
    let n = (x as u32).wrapping_mul(0x9e37_79b9) ^ (y as u32).wrapping_mul(0x85eb_ca6b) ^ seed;
    let n = (n ^ (n >> 15)).wrapping_mul(0x2c1b_3c6d);
    f64::from(n >> 16) / 65535.0
}

/// The finest level of the difference `d`, simulated to the share `inside` (0..1), visible in `sector`.
fn level(
    size: [usize; 2],
    d: impl Fn(usize, usize) -> f64,
    inside: impl Fn(usize, usize) -> f64,
    sector: impl Fn(usize, usize) -> bool,
) -> Level {
    let mut sums = Vec::new();
    for y in 0..size[1] {
        for x in 0..size[0] {
            let seen = f64::from(u8::from(sector(x, y)));
            let inside = seen * inside(x, y);
            sums.push([inside * d(x, y), inside, seen]);
        }
    }
    Level { size, sums }
}

/// A sector like a fan, and half of it.
fn fan(x: usize, y: usize) -> bool {
    (x as f64 - 20.0).abs() < 3.0 + 0.6 * y as f64
}

fn half(x: usize, y: usize) -> f64 {
    f64::from(u8::from(x + y / 3 < 21))
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |m, v| v.abs().max(m))
}

#[test]
fn equal_images_stay_and_a_mask_of_one_kind_shows_its_image() {
    for size in SIZES {
        for levels in 0..8 {
            let same = blend(level(size, |_, _| 0.0, half, fan), levels);
            assert_eq!(largest(&same), 0.0, "{size:?} {levels}");
            let d = |x, y| grey(x, y, 1) - grey(x, y, 2);
            let none = blend(level(size, d, |_, _| 0.0, fan), levels);
            assert_eq!(largest(&none), 0.0, "{size:?} {levels}: nothing is simulated");
            let all = level(size, d, |_, _| 1.0, fan);
            let given = blend(all.clone(), levels);
            // Beside the sector nothing is shown.
            let error = |factor: f64| {
                let seen = given.iter().zip(&all.sums).filter(|(_, s)| s[2] > 0.0);
                let errors: Vec<f64> = seen.map(|(v, s)| factor * v - s[0]).collect();
                largest(&errors)
            };
            // Eight levels of f64 sums.
            assert!(error(1.0) < 1e-14, "{size:?} {levels}");
            assert!(size == [1, 1] || error(0.999) > 1e-4, "{size:?} {levels}");
        }
    }
}

/// Mass, mean and variance of the places at which a mask of one dimension rises, pixels.
fn ramp_moments(values: impl Fn(usize) -> f64, count: usize) -> [f64; 3] {
    let rises = (1..count).map(|i| (i as f64 - 0.5, values(i) - values(i - 1)));
    let mass: f64 = rises.clone().map(|r| r.1).sum();
    let mean = rises.clone().map(|r| r.0 * r.1).sum::<f64>();
    let square = rises.map(|r| (r.0 - mean).powi(2) * r.1).sum();
    [mass, mean, square]
}

// The generating kernel's sums over every second pixel have moments up to the third that do not depend on
// the choice of pixels, as it is a fourth power of (1 + z). So each level adds 4^l to the variance, on the way down and
// again on the way up, wherever the border lies among the coarse pixels.
#[test]
fn constant_images_meet_along_a_ramp_of_known_width() {
    let size = [601, 3];
    for levels in 0..6 {
        for border in 300..308 {
            let inside = |x, _| f64::from(u8::from(x < border));
            let given = blend(level(size, |_, _| -1.0, inside, |_, _| true), levels);
            let moments = ramp_moments(|i| given[601 + i], 601);
            let expected = [1.0, border as f64 - 0.5, 2.0 * (4f64.powi(levels as i32) - 1.0) / 3.0];
            for (found, expected) in moments.iter().zip(expected) {
                assert!(
                    (found - expected).abs() < 1e-8 * expected.max(1.0),
                    "{levels} {border}: {moments:?}"
                );
            }
            let deepest = 2.0 * (4f64.powi(levels as i32 + 1) - 1.0) / 3.0;
            assert!((moments[2] - deepest).abs() > 1.0, "a level more is noticed");
        }
    }
}

#[test]
fn nothing_bleeds_in_from_beside_the_sector_or_from_beside_the_mask() {
    for size in SIZES {
        // Values beside sector and mask that would show at once.
        let wild = |x, y| {
            if fan(x, y) && half(x, y) > 0.0 { 0.25 } else { 1e6 }
        };
        let spoilt = level(size, wild, half, fan);
        let given = blend(spoilt.clone(), 5);
        for ((v, sums), n) in given.iter().zip(&spoilt.sums).zip(0..) {
            let seen = sums[2] > 0.0;
            assert!(!seen || (-1e-12..0.25 + 1e-12).contains(v), "{size:?} {n}: {v}");
        }
    }
}
