//! Random fields fixed to a tissue: voxels of the paper's grid, and the low-frequency texture.

use glam::{DVec3, I64Vec3};

use super::random::{gaussian, pcg4d, unit};
use insonify::sim::layout::Tissue;

/// Standard deviation of the two octaves before they are scaled: ((26/35)^3 / 3 * 5/4)^(1/2).
const DEVIATION: f64 = 0.413_29;

/// The scatterer of one voxel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Voxel {
    /// Place of its echo within the sample, [0, 1).
    pub jitter: f64,
    /// Amplitude before the low-frequency texture.
    pub amplitude: f64,
}

fn words(cell: I64Vec3, seed: u32) -> [u32; 4] {
    pcg4d([cell.x as u32, cell.y as u32, cell.z as u32, seed])
}

/// The scatterer of voxel `cell` in `tissue`, if there is one.
pub fn voxel(tissue: &Tissue, cell: I64Vec3) -> Option<Voxel> {
    let [x, y, z, w] = words(cell, tissue.seed);
    // The low bytes: unit() uses the upper 24 bits, so presence does not bias the jitter.
    let presence = (x & 255) << 16 | (y & 255) << 8 | (z & 255);
    let present = f64::from(presence) / 16_777_216.0 < f64::from(tissue.presence);
    present.then(|| Voxel {
        jitter: unit(x),
        amplitude: f64::from(tissue.mean) + f64::from(tissue.sigma) * gaussian(w),
    })
}

/// Factor of the tissue's low-frequency texture at `p`, texture space, mm.
pub fn factor(tissue: &Tissue, p: DVec3) -> f64 {
    let depth = f64::from(tissue.texture_depth);
    if depth == 0.0 {
        return 1.0;
    }
    1.0 + depth * low_frequency(p / f64::from(tissue.texture_length), tissue.seed)
}

/// Two octaves of value noise with unit variance; `p` in units of the texture length.
pub fn low_frequency(p: DVec3, seed: u32) -> f64 {
    (value_noise(p, seed) + value_noise(2.0 * p + 17.0, seed) / 2.0) / DEVIATION
}

/// Word of a lattice point: its coordinates folded into one word that is then mixed (the constants of
/// C. Wellons' lowbias32).
fn hash(cell: I64Vec3, seed: u32) -> u32 {
    let folded = [
        (cell.x as u32).wrapping_mul(0x8da6_b343).wrapping_add(seed),
        (cell.y as u32).wrapping_mul(0xd816_3841),
        (cell.z as u32).wrapping_mul(0xcb1a_b31f),
    ];
    let x = folded[0] ^ folded[1] ^ folded[2];
    let x = (x ^ x >> 16).wrapping_mul(0x7feb_352d);
    let x = (x ^ x >> 15).wrapping_mul(0x846c_a68b);
    x ^ x >> 16
}

fn value_noise(p: DVec3, seed: u32) -> f64 {
    let base = p.floor();
    let f = p - base;
    let weight = f * f * (3.0 - 2.0 * f);
    let cell = base.as_i64vec3();
    let mut sum = 0.0;
    for corner in 0..8 {
        let step = I64Vec3::new(corner & 1, corner >> 1 & 1, corner >> 2);
        let side = |w: f64, s: i64| if s == 1 { w } else { 1.0 - w };
        let w = side(weight.x, step.x) * side(weight.y, step.y) * side(weight.z, step.z);
        sum += w * (2.0 * unit(hash(cell + step, seed)) - 1.0);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    // Value noise at lattice corners is uniform in (-1, 1); over 60^3 cells at random places the
    // sampled variance is good to about 1 %.
    #[test]
    fn the_texture_has_zero_mean_and_unit_variance() {
        let n = 200_000;
        let (mut sum, mut squares) = (0.0, 0.0);
        for i in 0..n {
            let w = pcg4d([i, 1, 2, 3]);
            let p = 60.0 * DVec3::new(unit(w[0]), unit(w[1]), unit(w[2]));
            let v = low_frequency(p, 11);
            sum += v;
            squares += v * v;
        }
        let mean = sum / f64::from(n);
        let variance = squares / f64::from(n) - mean * mean;
        assert!(mean.abs() < 0.02, "{mean}");
        assert!((variance - 1.0).abs() < 0.03, "{variance}");
    }

    #[test]
    fn voxels_hold_scatterers_as_often_and_as_strong_as_the_tissue_says() {
        let tissue = Tissue { presence: 0.3, mean: 2.0, sigma: 0.5, seed: 9, ..Tissue::default() };
        let n = 100_000_i64;
        let cell = |i: i64| I64Vec3::new(i % 50 - 25, i / 50 % 50 - 25, i / 2500 - 20);
        let found: Vec<Voxel> = (0..n).filter_map(|i| voxel(&tissue, cell(i))).collect();
        let count = found.len() as f64;
        let spread = (0.3 * 0.7 * n as f64).sqrt();
        assert!((count - 0.3 * n as f64).abs() < 4.0 * spread);
        let mean = |f: &dyn Fn(&Voxel) -> f64| found.iter().map(f).sum::<f64>() / count;
        assert!((mean(&|s| s.amplitude) - 2.0).abs() < 4.0 * 0.5 / count.sqrt());
        assert!((mean(&|s| (s.amplitude - 2.0).powi(2)) - 0.25).abs() < 4.0 * 0.36 / count.sqrt());
        // Presence must not pull the jitter from its mean 1/2 (deviation 0.2887).
        assert!((mean(&|s| s.jitter) - 0.5).abs() < 4.0 * 0.289 / count.sqrt());
    }
}
