//! What a rough surface sends straight back, by angle of incidence: the mean over its small mirrors.

use std::f64::consts::PI;

use super::layout::{LOBE_ANGLES, LOBE_REACH};

/// Roughness exponent from which on a surface is a perfect mirror.
pub const MIRROR: f64 = 1e9;

/// A surface's entry per angle of incidence: `cos = 1 - LOBE_REACH j / (LOBE_ANGLES - 1)`.
pub type Lobe = [[f32; 4]; LOBE_ANGLES];

/// Steps in tilt and in azimuth of the sum over small mirrors.
const STEPS: [u32; 2] = [32, 24];
/// Tilts that are summed up, over the deviation of the tilts in each direction.
const FARTHEST: f64 = 5.0;
/// Mean share below which nothing is sent back.
const LEAST_MEAN: f64 = 1e-30;

/// What small mirrors send back of sound that comes under one angle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Mean {
    /// Mean of their shares of the amplitude.
    pub share: f64,
    /// Root of the mean square of their shares.
    pub root: f64,
    /// Cosine of the angle at which they reflect, weighted by the share.
    pub cosine: f64,
    /// Standard deviation of that cosine.
    pub deviation: f64,
}

/// The mean over mirrors whose normals have the density cos^roughness about the surface's, of sound that comes under the angle
/// of this cosine. A mirror met at the cosine c sends back `max(2 c^2 - 1, 0)^specularity`; mirrors that are met from
/// behind, or throw sound into the surface, do not count.
pub fn mean(roughness: f64, specularity: f64, cosine: f64) -> Mean {
    average(roughness, specularity, cosine, STEPS)
}

fn average(roughness: f64, specularity: f64, cosine: f64, [tilts, turns]: [u32; 2]) -> Mean {
    let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
    let farthest = (FARTHEST / (roughness + 1.0).sqrt()).min(PI / 2.0);
    let [mut mass, mut share, mut square, mut first, mut second] = [0.0; 5];
    for i in 0..tilts {
        let tilt = farthest * (f64::from(i) + 0.5) / f64::from(tilts);
        let weight = tilt.cos().powf(roughness) * tilt.sin();
        for j in 0..turns {
            // Half a turn: the other half is its mirror image.
            let turn = PI * (f64::from(j) + 0.5) / f64::from(turns);
            let c = cosine * tilt.cos() + sine * tilt.sin() * turn.cos();
            // The cosine between what is sent on and the surface's normal.
            if c <= 0.0 || 2.0 * c * tilt.cos() <= cosine {
                continue;
            }
            let facing = 2.0 * c * c - 1.0;
            let sent = if facing > 0.0 { facing.powf(specularity) } else { 0.0 };
            mass += weight;
            share += weight * sent;
            square += weight * sent * sent;
            first += weight * sent * c;
            second += weight * sent * c * c;
        }
    }
    if share <= LEAST_MEAN * mass || mass == 0.0 {
        return Mean { cosine, ..Mean::default() };
    }
    let middle = first / share;
    Mean {
        share: share / mass,
        root: (square / mass).sqrt(),
        cosine: middle,
        deviation: (second / share - middle * middle).max(0.0).sqrt(),
    }
}

/// Lobes of surfaces; those of surfaces that are equally rough and specular are found once.
#[derive(Default)]
pub struct Lobes {
    known: Vec<([f64; 2], Lobe)>,
}

impl Lobes {
    /// The entries of a surface; zero for a mirror, which has none.
    pub fn of(&mut self, roughness: f64, specularity: f64) -> Lobe {
        let key = [roughness, specularity];
        if roughness >= MIRROR {
            return Lobe::default();
        }
        if let Some((_, lobe)) = self.known.iter().find(|(known, _)| *known == key) {
            return *lobe;
        }
        let step = f64::from(LOBE_REACH) / (LOBE_ANGLES - 1) as f64;
        let lobe = std::array::from_fn(|j| {
            let mean = mean(roughness, specularity, 1.0 - step * j as f64);
            let nepers = |share: f64| share.max(LEAST_MEAN).ln() as f32;
            let aside = 3.0_f64.sqrt() * mean.deviation;
            [nepers(mean.share), nepers(mean.root), mean.cosine as f32, aside as f32]
        });
        self.known.push((key, lobe));
        lobe
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;

    use super::*;

    #[test]
    fn a_narrow_lobe_is_the_gaussian_closed_form() {
        // Tilts of variance 1 / s in each direction, shares exp(-2 n_s angle^2): a product of Gaussians.
        let (roughness, specularity): (f64, f64) = (4000.0, 3.0);
        for degrees in [0.0, 2.0, 5.0_f64] {
            let angle = degrees.to_radians();
            let narrowed = |n: f64| {
                let wide = 1.0 + 4.0 * n / roughness;
                (-2.0 * n * angle * angle / wide).exp() / wide
            };
            let found = mean(roughness, specularity, angle.cos());
            assert_relative_eq!(found.share, narrowed(specularity), max_relative = 2e-3);
            assert_relative_eq!(
                found.root,
                narrowed(2.0 * specularity).sqrt(),
                max_relative = 2e-3
            );
            assert_relative_eq!(found.cosine, angle.cos(), max_relative = 1e-3);
        }
    }

    #[test]
    fn mirrors_that_send_back_alike_send_all() {
        let found = mean(100.0, 0.0, 1.0);
        assert_relative_eq!(found.share, 1.0, epsilon = 1e-9);
        assert_relative_eq!(found.root, 1.0, epsilon = 1e-9);
        // The mean of cos^s about itself is (s + 1) / (s + 2).
        assert_relative_eq!(found.cosine, 101.0 / 102.0, max_relative = 1e-4);
        // Half of the mirrors are met within 45 degrees where their middle is.
        assert_relative_eq!(mean(1000.0, 0.0, 0.5_f64.sqrt()).share, 0.5, epsilon = 0.03);
    }

    #[test]
    fn few_mirrors_stand_for_many() {
        for (roughness, specularity) in
            [(20.0, 1.0), (60.0, 3.0), (100.0, 0.0), (1000.0, 2.0), (1000.0, 30.0)]
        {
            for cosine in [1.0, 0.97, 0.9, 0.8] {
                let many = average(roughness, specularity, cosine, [512, 512]);
                let found = mean(roughness, specularity, cosine);
                let close = |a: f64, b: f64| (a - b).abs() < 5e-3 * b + 1e-4;
                assert!(close(found.share, many.share), "{roughness} {specularity} {cosine}");
                assert!(close(found.root, many.root), "{roughness} {specularity} {cosine}");
                assert!(close(found.cosine, many.cosine), "{roughness} {specularity} {cosine}");
            }
        }
    }

    #[test]
    fn entries_lie_evenly_in_the_cosine_and_a_mirror_has_none() {
        let mut lobes = Lobes::default();
        let lobe = lobes.of(1000.0, 2.0);
        let last = mean(1000.0, 2.0, 1.0 - f64::from(LOBE_REACH));
        assert_relative_eq!(
            f64::from(lobe[LOBE_ANGLES - 1][0]),
            last.share.max(LEAST_MEAN).ln(),
            max_relative = 1e-6
        );
        assert_eq!(lobe, lobes.of(1000.0, 2.0));
        assert_ne!(lobe, lobes.of(1000.0, 3.0));
        assert_ne!(lobe, lobes.of(100.0, 2.0));
        assert_eq!(lobes.of(MIRROR, 2.0), Lobe::default());
        assert_eq!(lobes.known.len(), 3);
    }
}
