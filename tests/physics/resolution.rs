//! The point-spread function as frames show it.

use insonify::scene::Scene;

use crate::profile::width;
use crate::render::{Frame, Renderer, renderers};
use crate::scenes::{add_point, linear, silent};

/// Gaussian: full width at half maximum over sigma.
const FWHM: f64 = 2.354_82;
/// Wavelength of 7 MHz at 1540 m/s, mm.
const WAVELENGTH: f64 = 0.22;

/// A silent medium with the machine's speed of sound.
fn points(lines: u32, width: f64, at: &[[f64; 3]]) -> Scene {
    let mut scene = linear(lines, width, silent(1.540, 1.600, 0.0));
    for &p in at {
        add_point(&mut scene, p, 0.1);
    }
    scene
}

/// One value per scanline at sample `k`.
fn across(frame: &Frame, k: usize) -> Vec<f64> {
    frame.iq.iter().map(|l| l[k][0].hypot(l[k][1])).collect()
}

/// Axial width, mm, of points on and between samples at about 30 mm.
fn axial_width((_, render): &Renderer, samples: u32, shift: f64, bandwidth: f64) -> f64 {
    let mut scene = points(1, 1.0, &[]);
    scene.probe.samples = samples;
    scene.probe.bandwidth = bandwidth;
    let pitch = 100.0 / f64::from(samples);
    let k = (30.0 / pitch).round();
    add_point(&mut scene, [0.0, 0.0, (k + shift) * pitch], 0.1);
    let envelope = render(&scene).envelope(0);
    width(&envelope[k as usize - 40..k as usize + 40]) * pitch
}

// sigma_t = sqrt(2 ln 2) / (pi B f0), in depth c / 2 times that: 0.162 mm at 7 MHz and 60 %.
// The split widens by f (1 - f) of a squared sample about the mean that the kernel corrects:
// 3 % at twice the samples, 8 % at the sample pitch of the Table I preset.
#[test]
fn a_point_is_as_long_as_its_pulse() {
    let sigma =
        1.540 / 2.0 * (2.0 * std::f64::consts::LN_2).sqrt() / (std::f64::consts::PI * 0.6 * 7.0);
    assert!((FWHM * sigma - 0.162).abs() < 0.0005);
    for renderer in &renderers() {
        let name = renderer.0;
        for (samples, bound) in [(4096, 0.03), (2048, 0.08)] {
            for shift in [0.0, 0.25, 0.5] {
                let ratio = axial_width(renderer, samples, shift, 0.6) / (FWHM * sigma);
                assert!(
                    (ratio - 1.0).abs() < bound,
                    "{name} {samples} {shift}: {ratio}"
                );
            }
        }
        let wrong = axial_width(renderer, 4096, 0.25, 0.65) / (FWHM * sigma);
        assert!(
            (wrong - 1.0).abs() > 0.03,
            "{name}: a twelfth of the bandwidth is noticed"
        );
    }
}

/// Sigma of a one-way Gaussian beam: waist 0.6 lambda F# at `focus`.
fn gaussian_beam(f_number: f64, focus: f64, z: f64) -> f64 {
    let waist = 0.6 * WAVELENGTH * f_number;
    let rayleigh = 2.0 * std::f64::consts::PI * waist * waist / WAVELENGTH;
    waist * (1.0 + ((z - focus) / rayleigh).powi(2)).sqrt()
}

// Transmit focused at 50 mm with F# 2, receive focused everywhere with F# 2; 5 % as the image
// samples depth, and the beam's width changes over a pulse.
#[test]
fn a_point_is_as_wide_as_the_beam_at_its_depth() {
    for (name, render) in renderers() {
        for z in [30.0, 50.0, 70.0] {
            let frame = render(&points(161, 4.0, &[[0.0, 0.0, z]]));
            let got = width(&across(&frame, (z * 20.48).round() as usize)) * 4.0 / 161.0;
            let [transmit, receive] = [gaussian_beam(2.0, 50.0, z), 0.6 * WAVELENGTH * 2.0];
            let sigma = 1.0 / (transmit.powi(-2) + receive.powi(-2)).sqrt();
            let ratio = got / (FWHM * sigma);
            assert!((ratio - 1.0).abs() < 0.05, "{name} {z}: {ratio}");
            let without_transmit = got / (FWHM * receive);
            assert!(
                z != 50.0 || (without_transmit - 1.0).abs() > 0.05,
                "one-way beams are noticed"
            );
        }
    }
}

// One-way waist 0.6 lambda F# with F# = 60 / 6, two-way 1 / sqrt 2 of it.
#[test]
fn a_slice_is_as_thick_as_the_lens_makes_it() {
    // Lines ten millimetres apart: each sees its own points only, one at every depth.
    let (step, lines) = (0.2, 39);
    let depths = [40.0, 60.0, 80.0];
    let mut scene = points(lines, 10.0 * f64::from(lines), &[]);
    scene.probe.elevation_layers = 9;
    scene.probe.slice_thickness = 8.0;
    for l in 0..lines {
        let x = scene.probe.ray(l, 4).0.x;
        let y = step * (f64::from(l) - 19.0);
        for z in depths {
            add_point(&mut scene, [x, y, z], 0.1);
        }
    }
    for (name, render) in renderers() {
        let frame = render(&scene);
        for z in depths {
            let k = (z * 20.48).round() as usize;
            let peak = |l| {
                frame.envelope(l)[k - 40..k + 40]
                    .iter()
                    .copied()
                    .fold(0.0, f64::max)
            };
            let profile: Vec<f64> = (0..lines as usize).map(peak).collect();
            let sigma = gaussian_beam(10.0, 60.0, z) / std::f64::consts::SQRT_2;
            let ratio = width(&profile) * step / (FWHM * sigma);
            assert!((ratio - 1.0).abs() < 0.05, "{name} {z}: {ratio}");
            let one_way = ratio / std::f64::consts::SQRT_2;
            assert!((one_way - 1.0).abs() > 0.05, "one-way slices are noticed");
        }
    }
}
