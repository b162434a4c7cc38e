//! Reflectance of a curved interface averaged over the width of the beam.
//!
//! A ray stands for a beam. If a surface curves by kappa along the plane of incidence, a ray xi
//! beside it meets the surface at sin i' = sin i + kappa xi (exact for a cylinder), and beyond 1 it
//! misses. If xi is normal with standard deviation sigma, sin i' is normal with kappa sigma.

use super::acoustics::{Fluid, reflection};

/// Non-negative nodes of the Gauss-Legendre rule of 8 points, and their weights.
const RULE: [[f64; 2]; 4] = [
    [0.183_434_642_495_649_8, 0.362_683_783_378_362],
    [0.525_532_409_916_329, 0.313_706_645_877_887_3],
    [0.796_666_477_413_626_7, 0.222_381_034_453_374_5],
    [0.960_289_856_497_536_3, 0.101_228_536_290_376_3],
];

/// Standard normal distribution function at `x`: Abramowitz and Stegun 7.1.26, within 1e-7.
fn normal_mass(x: f64) -> f64 {
    let z = x.abs() / std::f64::consts::SQRT_2;
    let t = 1.0 / (1.0 + 0.327_591_1 * z);
    let series = [1.061_405_429, -1.453_152_027, 1.421_413_741, -0.284_496_736, 0.254_829_592];
    let tail = 0.5 * series.iter().fold(0.0, |sum, a| (sum + a) * t) * (-z * z).exp();
    if x < 0.0 { tail } else { 1.0 - tail }
}

/// Mean intensity reflectance at incidence `cos_i`; `width` is curvature times the standard deviation of the
/// beam, dimensionless.
pub fn reflectance(before: Fluid, after: Fluid, cos_i: f64, width: f64) -> f64 {
    let at = |cos_i: f64| reflection(before, after, cos_i).powi(2);
    if width.partial_cmp(&1e-4) != Some(std::cmp::Ordering::Greater) {
        return at(cos_i);
    }
    let centre = (1.0 - cos_i * cos_i).max(0.0).sqrt();
    let critical = (before.speed / after.speed).min(1.0);
    let between =
        |a: f64, b: f64| normal_mass((b - centre) / width) - normal_mass((a - centre) / width);
    let totally = between(critical, 1.0) + between(-1.0, -critical);
    // Below the critical angle, with s = critical sin(phi), which makes the steep integrand at the edge smooth.
    let angle = |s: f64| (s / critical).clamp(-1.0, 1.0).asin();
    let (from, to) = (angle(centre - 4.0 * width), angle(centre + 4.0 * width));
    let (mut sum, mut norm) = (0.0, 0.0);
    for [node, weight] in RULE.iter().flat_map(|&[x, w]| [[x, w], [-x, w]]) {
        let phi = 0.5 * (from + to) + 0.5 * (to - from) * node;
        let s = critical * phi.sin();
        let off = (s - centre) / width;
        let mass = weight * phi.cos() * (-0.5 * off * off).exp();
        sum += mass * at((1.0 - s * s).max(0.0).sqrt());
        norm += mass;
    }
    let below = if norm > 0.0 { between(-critical, critical).max(0.0) * sum / norm } else { 0.0 };
    (totally + below).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fluid(speed: f64, density: f64) -> Fluid {
        Fluid { speed, impedance: speed * density }
    }

    /// The mean over rays beside each other, computed one by one.
    fn by_rays(before: Fluid, after: Fluid, centre: f64, width: f64) -> f64 {
        let (mut sum, mut norm) = (0.0, 0.0);
        for i in 0..200_000 {
            let x = -8.0 + 16.0 * (f64::from(i) + 0.5) / 200_000.0;
            let s: f64 = centre + width * x;
            let mass = (-0.5 * x * x).exp();
            norm += mass;
            if s.abs() < 1.0 {
                sum += mass * reflection(before, after, (1.0 - s * s).sqrt()).powi(2);
            }
        }
        sum / norm
    }

    // Eight points on a Gaussian of eight deviations: measured within 1 % and 2e-4.
    #[test]
    fn the_mean_is_that_of_many_rays() {
        let pairs = [
            (fluid(1.578, 1.06), fluid(1.575, 1.05)),
            (fluid(1.540, 1.06), fluid(1.578, 1.05)),
            (fluid(1.440, 0.92), fluid(3.515, 1.9)),
            (fluid(1.540, 1.06), fluid(0.343, 0.0012)),
        ];
        for (before, after) in pairs {
            for centre in [0.0, 0.3, 0.7, 0.95, 0.99] {
                for width in [0.01, 0.1, 0.33, 1.0] {
                    let cos = f64::sqrt(1.0 - centre * centre);
                    let found = reflectance(before, after, cos, width);
                    let truth = by_rays(before, after, centre, width);
                    assert!(
                        (found - truth).abs() < 0.01 * truth + 2e-4,
                        "{before:?} {after:?} {centre} {width}: {found} {truth}"
                    );
                }
            }
        }
    }

    #[test]
    fn a_flat_surface_reflects_as_its_ray_does() {
        let (before, after) = (fluid(1.44, 0.92), fluid(1.58, 1.06));
        for cos in [1.0, 0.7, 0.2] {
            let r = reflection(before, after, cos).powi(2);
            assert_eq!(reflectance(before, after, cos, 0.0), r);
            assert!((reflectance(before, after, cos, 2e-4) - r).abs() < 1e-3);
        }
    }
}
