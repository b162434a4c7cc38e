use super::super::random::{PURPOSE_NORMAL, PURPOSE_THICKNESS, gaussian, path_random, unit};
use super::*;
use insonify::statistics::standard_errors;

/// (speed mm/us, impedance MRayl).
const FLUIDS: [Fluid; 6] = [
    fluid(1.480, 1.480),  // water
    fluid(1.440, 1.340),  // fat
    fluid(1.580, 1.650),  // muscle
    fluid(1.595, 1.690),  // liver
    fluid(3.515, 6.500),  // bone
    fluid(0.343, 0.0004), // air
];
const PAIRS: [(usize, usize); 6] = [(0, 1), (1, 2), (2, 3), (1, 4), (4, 0), (3, 5)];

const fn fluid(speed: f64, impedance: f64) -> Fluid {
    Fluid { speed, impedance }
}

fn incident(angle: f64) -> DVec3 {
    DVec3::new(angle.sin(), 0.0, angle.cos())
}

/// Largest deviation of `coefficient` from the closed form in angles, over 6 pairs and 0 to 89
/// degrees, where R + T = 1 with T = 4 Z1 Z2 cos i cos t / (Z2 cos i + Z1 cos t)^2 is included.
fn fresnel_error(coefficient: impl Fn(Fluid, Fluid, f64) -> f64) -> f64 {
    let mut worst: f64 = 0.0;
    for (a, b) in PAIRS.map(|(a, b)| (FLUIDS[a], FLUIDS[b])) {
        for degrees in 0..90 {
            let i = f64::from(degrees).to_radians();
            let r = coefficient(a, b, i.cos());
            let sine = b.speed / a.speed * i.sin();
            if sine >= 1.0 {
                worst = worst.max((r - 1.0).abs());
                continue;
            }
            let t = sine.asin();
            let (normal_2, normal_1) = (b.impedance / t.cos(), a.impedance / i.cos());
            worst = worst.max((r - (normal_2 - normal_1) / (normal_2 + normal_1)).abs());
            let transmitted = 4.0 * normal_1 * normal_2 / (normal_1 + normal_2).powi(2);
            worst = worst.max((r * r + transmitted - 1.0).abs());
        }
    }
    worst
}

// f64 throughout: 1e-6 leaves room only for rounding near grazing, not for another formula.
#[test]
fn fresnel_is_the_fluid_closed_form_and_conserves_energy() {
    assert!(fresnel_error(reflection) < 1e-6);
}

#[test]
fn fresnel_with_swapped_impedances_or_without_the_refracted_angle_is_caught() {
    let swapped = |a: Fluid, b: Fluid, c: f64| {
        reflection(fluid(a.speed, b.impedance), fluid(b.speed, a.impedance), c)
    };
    assert!(fresnel_error(swapped) > 1e-3);
    let straight =
        |a: Fluid, b: Fluid, _| (b.impedance - a.impedance) / (b.impedance + a.impedance);
    assert!(fresnel_error(straight) > 1e-3);
}

/// Largest deviation, rad, of the refracted angle from arcsin(c2 / c1 sin i); infinity where total
/// reflection is on the wrong side of its onset.
fn snell_error(refract: impl Fn(Fluid, Fluid, DVec3, DVec3) -> Option<DVec3>) -> f64 {
    let mut worst: f64 = 0.0;
    for (a, b) in PAIRS.map(|(a, b)| (FLUIDS[a], FLUIDS[b])) {
        let onset = (a.speed / b.speed).min(1.0).asin();
        let around = [onset - 1e-6, onset + 1e-6];
        for i in (0..90).map(|d| f64::from(d).to_radians()).chain(around) {
            if i >= std::f64::consts::FRAC_PI_2 {
                continue;
            }
            let sine = b.speed / a.speed * i.sin();
            worst = worst.max(match refract(a, b, incident(i), -DVec3::Z) {
                None if sine >= 1.0 => 0.0,
                Some(d) if sine < 1.0 => (d.x.atan2(d.z) - sine.asin()).abs(),
                _ => f64::INFINITY,
            });
        }
    }
    worst
}

// 1e-5 rad: the error of arcsin within 1e-6 rad of total reflection is still below 1e-7.
#[test]
fn refraction_follows_the_speeds_and_total_reflection_switches_exactly() {
    assert!(snell_error(refract) < 1e-5);
    // Fat to bone: arcsin(1440 / 3515).
    let onset = (1.440f64 / 3.515).asin();
    assert!((onset.to_degrees() - 24.186).abs() < 0.01);
    let (fat, bone) = (FLUIDS[1], FLUIDS[4]);
    assert!(reflection(fat, bone, (onset - 1e-6).cos()) < 1.0);
    assert_eq!(reflection(fat, bone, (onset + 1e-6).cos()), 1.0);
}

#[test]
fn refraction_by_impedance_or_by_the_inverse_ratio_is_caught() {
    let of_impedance = |f: Fluid| fluid(f.impedance, f.impedance);
    assert!(snell_error(|a, b, d, m| refract(of_impedance(a), of_impedance(b), d, m)) > 1e-2);
    assert!(snell_error(|a, b, d, m| refract(b, a, d, m)) > 1e-2);
}

#[test]
fn directions_stay_unit_and_in_the_plane_of_incidence() {
    let m = DVec3::new(0.3, -0.5, -0.8).normalize();
    for n in 0..500 {
        let w = path_random(n, 0, 99, 1);
        let d = power_cosine(-m, 0.0, [unit(w[0]), unit(w[1])]);
        let r = mirror(d, m);
        assert!((r.length() - 1.0).abs() < 1e-12 && (r.dot(m) + d.dot(m)).abs() < 1e-12);
        if let Some(t) = refract(FLUIDS[0], FLUIDS[2], d, m) {
            assert!((t.length() - 1.0).abs() < 1e-12 && t.dot(m) < 0.0);
            assert!(t.dot(d.cross(m)).abs() < 1e-12);
        }
    }
}

fn cosines(roughness: f64) -> Vec<f64> {
    let n = DVec3::new(-0.4, 0.7, -0.2).normalize();
    let draw = |i| {
        let w = path_random(i, 1, PURPOSE_NORMAL, 5);
        power_cosine(n, roughness, [unit(w[0]), unit(w[1])])
    };
    let normals: Vec<DVec3> = (0..200_000).map(draw).collect();
    assert!(normals.iter().all(|m| (m.length() - 1.0).abs() < 1e-12));
    normals.iter().map(|m| m.dot(n)).collect()
}

// 4 standard errors of 200 000 draws with a fixed seed.
#[test]
fn roughness_lobe_has_its_mean_cosine_and_its_echo_lobe() {
    for s in [0.0, 1.0, 10.0, 100.0, 1e4] {
        let cos = cosines(s);
        assert!(standard_errors(&cos, (s + 1.0) / (s + 2.0)) < 4.0, "s = {s}");
        // Exponent s against 2 s + 1: half the tilt's variance must be told apart.
        assert!(standard_errors(&cos, (2.0 * s + 2.0) / (2.0 * s + 3.0)) > 4.0, "s = {s}");
        for n_s in [1.0, 4.0] {
            // At normal incidence the mirrored ray is 2 theta off: midpoint quadrature over cos.
            let steps = 200_000;
            let x = |i: i32| (f64::from(i) + 0.5) / f64::from(steps);
            let echo = |c: f64| (2.0 * c * c - 1.0).max(0.0).powf(n_s);
            let mean = (0..steps).map(|i| echo(x(i).powf(1.0 / (s + 1.0)))).sum::<f64>()
                / f64::from(steps);
            let samples: Vec<f64> = cos.iter().map(|&c| echo(c)).collect();
            assert!(standard_errors(&samples, mean) < 4.0, "s = {s}, n = {n_s}");
            if n_s == 1.0 && (s == 1.0 || s == 10.0) {
                // s = 1: integral over c in [1/sqrt 2, 1] of 2 c (2 c^2 - 1) = 1/4.
                let known = if s == 1.0 { 0.25 } else { 0.6957 };
                assert!((mean - known).abs() < 1e-4, "quadrature {mean}");
            }
        }
    }
}

#[test]
fn thickness_is_half_normal() {
    let tau = 0.3;
    let draw = |n| tau * gaussian(path_random(n, 2, PURPOSE_THICKNESS, 7)[0]).abs();
    let q: Vec<f64> = (0..200_000).map(draw).collect();
    let pi = std::f64::consts::PI;
    assert!(standard_errors(&q, tau * (2.0 / pi).sqrt()) < 4.0);
    let squared: Vec<f64> = q.iter().map(|x| x * x).collect();
    assert!(
        standard_errors(&squared, tau * tau) < 4.0,
        "variance tau^2 (1 - 2/pi) about that mean"
    );
    assert!(standard_errors(&q, 0.0) > 4.0, "a full normal is caught");
}
