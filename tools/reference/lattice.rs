//! Lattices of scatterers, as coarse as speckle allows: the levels in use, and the content of a cell.

use std::f32::consts::SQRT_2;

use glam::{DVec3, I64Vec3};

use super::random::{pcg3d, pcg4d, unit};
use insonify::sim::layout::{ALL_LEVELS, LATTICE_LEVELS, LEVEL_FADE, LEVELS_PER_OCTAVE, Tissue};

/// Cell edges of six successive levels: sixth roots of 1, 2, 4, 8, 16 and 32.
const EDGES: [f32; 6] = [1.0, 1.122_462, 1.259_921, SQRT_2, 1.587_401_1, 1.781_797_4];
/// Cell volumes of two successive levels.
const VOLUMES: [f32; 2] = [1.0, SQRT_2];

/// The scatterer of one cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scatterer {
    /// Position within the cell, each in [0, 1).
    pub offset: DVec3,
    /// Amplitude before the low-frequency texture.
    pub amplitude: f64,
}

/// One level of a tissue's lattices.
#[derive(Clone, Copy, Debug)]
pub struct Level {
    /// Edge of a cell, mm.
    pub edge: f64,
    /// Share of the cells that hold a scatterer.
    pub presence: f64,
    amplitude: f64,
    key: [u32; 3],
}

impl Level {
    /// Level `number` of `tissue`, where the finest has cells of `cell` mm.
    ///
    /// Scatterers have one amplitude and either sign. With `density` of them per cell of the finest
    /// level they have the fourth moment of the tissue's own scatterers. A coarser level has equally many as long as
    /// its cells can hold them; beyond that every cell is full, and scatterers are fewer and louder. The power per
    /// volume is the same.
    pub fn new(tissue: &Tissue, cell: f32, number: u32) -> Self {
        let volume = f64::from(VOLUMES[number as usize % 2] * (1u32 << (number / 2)) as f32);
        let presence = (f64::from(tissue.density) * volume).min(1.0);
        let [x, y, z, _] = pcg4d([tissue.seed, number, 0, 0]);
        Self {
            edge: edge(cell, number),
            presence,
            amplitude: f64::from(tissue.amplitude) * (volume / presence).sqrt(),
            key: [x, y, z],
        }
    }

    /// The same level with the scatterers of a generation of what flows; number 0 has those of what does not.
    pub fn of_generation(self, number: u32) -> Self {
        // 2^32 over the golden ratio: lattices of successive numbers lie far from each other.
        let shift = number.wrapping_mul(0x9e37_79b9);
        Self { key: self.key.map(|key| key.wrapping_add(shift)), ..self }
    }

    /// The scatterer in `cell`, if there is one.
    pub fn scatterer(&self, cell: I64Vec3) -> Option<Scatterer> {
        let at = [cell.x, cell.y, cell.z];
        let words = pcg3d(std::array::from_fn(|i| (at[i] as u32).wrapping_add(self.key[i])));
        // The low bytes: unit() uses the upper 24 bits, so presence and sign do not bias the position.
        let presence = (words[0] & 255) << 8 | (words[1] & 255);
        let present = presence < ((self.presence * 65_536.0).round() as u32).max(1);
        let sign = if words[2] & 1 == 0 { 1.0 } else { -1.0 };
        present.then(|| Scatterer {
            offset: DVec3::from(words.map(unit)),
            amplitude: sign * self.amplitude,
        })
    }
}

/// Edge of a cell of level `number`, mm, rounded as in the kernels.
pub fn edge(cell: f32, number: u32) -> f64 {
    f64::from(cell * EDGES[number as usize % 6] * (1u32 << (number / 6)) as f32)
}

/// Lattice level that a piece of tissue needs, not rounded: the coarser of the level that is dense enough
/// for speckle (`wanted`, of the axial row) and the level that still has eight cells for each of the tissue's own
/// scatterers; coarser by `drowned`, the log2 of the power by which something louder masks it.
pub fn wanted_level(tissue: &Tissue, wanted: f64, drowned: f64) -> f64 {
    if wanted <= f64::from(ALL_LEVELS) {
        return 0.0;
    }
    let own = (1.0 / (8.0 * f64::from(tissue.density))).log2();
    (f64::from(LEVELS_PER_OCTAVE) * (wanted.max(own) + drowned))
        .clamp(0.0, f64::from(LATTICE_LEVELS))
}

/// Share of the power that level `number` carries if level `wanted` is needed: all of it until shortly before the
/// next level, to which it is cross-faded.
pub fn level_power(wanted: f64, number: u32) -> f64 {
    let above = wanted - f64::from(number);
    let fade = f64::from(LEVEL_FADE);
    let rising = ((above + fade) / fade).clamp(0.0, 1.0);
    rising.min(((1.0 - above) / fade).clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tissue(density: f32) -> Tissue {
        Tissue { density, amplitude: 0.7, seed: 9, ..Tissue::default() }
    }

    #[test]
    fn every_level_has_the_power_per_volume_of_the_tissue() {
        for density in [0.02, 0.3, 1.0] {
            for number in [0, 1, 4, 9] {
                let level = Level::new(&tissue(density), 0.3, number);
                let power = level.presence * level.amplitude.powi(2) / level.edge.powi(3);
                let expected = 0.49 / 0.027;
                assert!((power / expected - 1.0).abs() < 1e-5, "{density} {number}");
                // Planted: amplitudes that do not grow with the cells.
                let lost = 0.49 / level.edge.powi(3);
                assert!(number == 0 || lost / expected < 0.75);
            }
        }
    }

    #[test]
    fn cells_hold_scatterers_as_often_as_the_level_says_anywhere_and_of_both_signs() {
        let level = Level::new(&tissue(0.3), 0.25, 0);
        let n = 100_000_i64;
        let cell = |i: i64| I64Vec3::new(i % 50 - 25, i / 50 % 50 - 25, i / 2500 - 20);
        let found: Vec<Scatterer> = (0..n).filter_map(|i| level.scatterer(cell(i))).collect();
        let count = found.len() as f64;
        let spread = (0.3 * 0.7 * n as f64).sqrt();
        assert!((count - 0.3 * n as f64).abs() < 4.0 * spread, "{count}");
        let mean = |f: &dyn Fn(&Scatterer) -> f64| found.iter().map(f).sum::<f64>() / count;
        assert!(mean(&|s| s.amplitude.signum()).abs() < 4.0 / count.sqrt());
        for axis in 0..3 {
            // Uniform: mean 1/2, deviation 0.2887, and nothing of it follows the sign.
            let bound = 4.0 * 0.289 / count.sqrt();
            assert!((mean(&|s| s.offset[axis]) - 0.5).abs() < bound);
            assert!(mean(&|s| (s.offset[axis] - 0.5) * s.amplitude.signum()).abs() < bound);
        }
    }

    #[test]
    fn levels_share_the_power_wherever_one_takes_over() {
        for i in 0..=4800 {
            let wanted = f64::from(i) / 100.0;
            let sum: f64 = (0..=LATTICE_LEVELS).map(|n| level_power(wanted, n)).sum();
            assert!((sum - 1.0).abs() < 1e-12, "{wanted}: {sum}");
        }
        assert_eq!(level_power(3.5, 3), 1.0);
    }

    #[test]
    fn sparse_tissue_keeps_its_scatterers_and_what_is_drowned_needs_fewer() {
        assert_eq!(wanted_level(&tissue(0.3), 2.0, 0.0), 4.0);
        assert_eq!(wanted_level(&tissue(0.3), -3.0, 0.0), 0.0);
        assert_eq!(wanted_level(&tissue(0.3), 2.0, 1.5), 7.0);
        assert_eq!(wanted_level(&tissue(1.0 / 512.0), 2.0, 0.0), 12.0);
        assert_eq!(wanted_level(&tissue(1.0 / 512.0), ALL_LEVELS.into(), 9.0), 0.0);
    }
}
