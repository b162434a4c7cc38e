//! The point-spread function in frames.

use std::f64::consts::{LN_2, PI, SQRT_2};

use insonify::scene::Scene;
use insonify::settings::ScatterMode;

use crate::common::moments::decibel;
use crate::physics::check::{Bench, Check, Curve, Outcome, Physics, Plot};
use crate::physics::profile::width;
use crate::physics::render::{Frame, Renderer};
use crate::physics::scenes::{add_point, linear, silent};

/// Gaussian: full width at half maximum over sigma.
pub const FWHM: f64 = 2.354_82;
/// Wavelength of 7 MHz at 1540 m/s, mm.
const WAVELENGTH: f64 = 0.22;

/// A silent medium with the machine's speed of sound.
pub fn points(lines: u32, width: f64, at: &[[f64; 3]]) -> Scene {
    let mut scene = linear(lines, width, silent(1.540, 1.600, 0.0));
    for &p in at {
        add_point(&mut scene, p, 0.1);
    }
    scene
}

/// Check T6.
pub fn a_point_is_as_long_as_its_pulse() -> Check {
    Check {
        row: "T6",
        name: "a_point_is_as_long_as_its_pulse",
        claim: "A Gaussian pulse with the two-way -6 dB bandwidth B f0 lasts sigma_t = sqrt(2 ln 2) / \
            (pi B f0), in depth c / 2 times that: the echo of a point is 2.355 sigma_z long at half its \
            height, 0.162 mm at 7 MHz and 60 %. Points on and between samples; the split over two \
            samples widens by f (1 - f) of a squared sample about the mean that the kernel corrects, \
            hence 3 % at twice the samples and 8 % at the sample pitch of the Table I preset.",
        planted: "A sixth more bandwidth.",
        run: axial_widths,
    }
}

/// Envelope around a point `shift` samples below the sample nearest 30 mm: places relative to the
/// point, mm, and magnitudes.
fn pulse((_, render): &Renderer, samples: u32, shift: f64, bandwidth: f64) -> Vec<[f64; 2]> {
    let mut scene = points(1, 1.0, &[]);
    scene.probe.samples = samples;
    scene.probe.bandwidth = bandwidth;
    let pitch = 100.0 / f64::from(samples);
    let k = (30.0 / pitch).round();
    add_point(&mut scene, [0.0, 0.0, (k + shift) * pitch], 0.1);
    let envelope = render(&scene).envelope(0);
    (k as usize - 40..k as usize + 40)
        .map(|i| [(i as f64 - k - shift) * pitch, envelope[i]])
        .collect()
}

fn axial_widths(bench: &Bench, physics: Physics) -> Outcome {
    let mut out = Outcome::default();
    let sigma = 1.540 / 2.0 * (2.0 * LN_2).sqrt() / (PI * 0.6 * 7.0);
    let bandwidth = match physics {
        Physics::Right => 0.6,
        Physics::Planted => 0.7,
    };
    for renderer in &bench.renderers {
        for (samples, share) in [(4096, 0.03), (2048, 0.08)] {
            for shift in [0.0, 0.25, 0.5] {
                let pulse = pulse(renderer, samples, shift, bandwidth);
                let heights: Vec<f64> = pulse.iter().map(|p| p[1]).collect();
                out.compare(
                    format!("{}: {samples} samples, point {shift} off one: length, mm", renderer.0),
                    width(&heights) * 100.0 / f64::from(samples),
                    FWHM * sigma,
                    share * FWHM * sigma,
                );
            }
        }
    }
    out.plots.push(pulse_plot(pulse(&bench.renderers[1], 4096, 0.25, bandwidth), sigma));
    out
}

fn pulse_plot(pulse: Vec<[f64; 2]>, sigma: f64) -> Plot {
    let gaussian = |z: f64| (-z * z / (2.0 * sigma * sigma)).exp();
    // The level of points is tested elsewhere.
    let scale = pulse.iter().map(|p| p[1]).fold(0.0, f64::max);
    let near = |p: &&[f64; 2]| p[0].abs() < 0.4;
    let shown = pulse.iter().filter(near).map(|p| [p[0], p[1] / scale]);
    let closed = (-80..=80).map(|i| f64::from(i) * 0.005);
    Plot::linear(
        "Echo of a point",
        ["depth from the point, mm", "envelope"],
        vec![
            Curve::line("exp(-z^2 / 2 sigma_z^2)", closed.map(|z| [z, gaussian(z)]).collect()),
            Curve::dots("bvh, 4096 samples", shown.collect()),
        ],
    )
}

/// Sigma of a one-way Gaussian beam: waist 0.6 lambda F# at `focus`.
pub fn gaussian_beam(f_number: f64, focus: f64, z: f64) -> f64 {
    let waist = 0.6 * WAVELENGTH * f_number;
    let rayleigh = 2.0 * PI * waist * waist / WAVELENGTH;
    waist * (1.0 + ((z - focus) / rayleigh).powi(2)).sqrt()
}

/// Check T7.
pub fn a_point_is_as_wide_as_the_beam_at_its_depth() -> Check {
    Check {
        row: "T7",
        name: "a_point_is_as_wide_as_the_beam_at_its_depth",
        claim: "Transmit and receive are Gaussian beams (waist 0.6 lambda F#, Rayleigh length \
            2 pi waist^2 / lambda) and the echo their product: 1 / sigma^2 = 1 / sigma_tx^2 + \
            1 / sigma_rx^2, with transmit focused at 50 mm and receive everywhere, both at F# 2. 5 %, as \
            the image samples depth and the beam's width changes over a pulse. Beside scatterers on a voxel grid points \
            are as wide and as loud as beside those of a lattice, within 2 % and 0.2 dB.",
        planted: "The width of the receive beam alone.",
        run: lateral_widths,
    }
}

/// Two-way lateral full width at half maximum, mm.
fn lateral(z: f64) -> f64 {
    let [transmit, receive] = [gaussian_beam(2.0, 50.0, z), 0.6 * WAVELENGTH * 2.0];
    FWHM / (transmit.powi(-2) + receive.powi(-2)).sqrt()
}

/// One value per scanline at sample `k`.
fn across(frame: &Frame, k: usize) -> Vec<f64> {
    frame.iq.iter().map(|l| l[k][0].hypot(l[k][1])).collect()
}

fn lateral_widths(bench: &Bench, physics: Physics) -> Outcome {
    let mut out = Outcome::default();
    let depths = [30.0, 40.0, 46.0, 48.0, 50.0, 52.0, 54.0, 60.0, 70.0];
    let scene = points(161, 4.0, &depths.map(|z| [0.0, 0.0, z]));
    let mut curves = vec![Curve::line(
        "product of two Gaussian beams",
        (60..=150).map(|i| f64::from(i) * 0.5).map(|z| [z, lateral(z)]).collect(),
    )];
    for (name, render) in &bench.renderers {
        let frame = render(&scene);
        let mut dots = vec![];
        for z in depths {
            let got = width(&across(&frame, (z * 20.48).round() as usize)) * 4.0 / 161.0;
            let expected = match physics {
                Physics::Right => lateral(z),
                Physics::Planted => FWHM * 0.6 * WAVELENGTH * 2.0,
            };
            let what = format!("{name}: width at {z} mm, mm");
            out.compare(what, got, expected, 0.05 * expected)
                .unlike("the transmit beam alone", FWHM * gaussian_beam(2.0, 50.0, z));
            dots.push([z, got]);
        }
        curves.push(Curve::dots(*name, dots));
        let mut gridded = scene.clone();
        gridded.simulation.scatter_mode = ScatterMode::Voxel;
        let on_grid = render(&gridded);
        for z in [30.0_f64, 50.0, 70.0] {
            let [grid, lattice] =
                [&on_grid, &frame].map(|frame| across(frame, (z * 20.48).round() as usize));
            let what = format!("{name}: width at {z} mm on a voxel grid, of that on a lattice");
            out.compare(what, width(&grid) / width(&lattice), 1.0, 0.02)
                .unlike("a point that is smoothed once more", SQRT_2);
            let loudest = |v: &[f64]| v.iter().copied().fold(0.0, f64::max);
            let what = format!("{name}: level at {z} mm on a voxel grid, dB re that on a lattice");
            out.compare(what, decibel((loudest(&grid) / loudest(&lattice)).powi(2)), 0.0, 0.2)
                .unlike("a point that is smoothed once more", 8.0);
        }
    }
    let axes = ["depth, mm", "lateral width at half maximum, mm"];
    out.plots.push(Plot::linear("Lateral width over depth", axes, curves));
    out
}

/// Check T8.
pub fn a_slice_is_as_thick_as_the_lens_makes_it() -> Check {
    Check {
        row: "T8",
        name: "a_slice_is_as_thick_as_the_lens_makes_it",
        claim: "The elevational lens (focus 60 mm, height 6 mm) acts on the way down and back: a \
            Gaussian beam with waist 0.6 lambda F#, over sqrt 2. 5 %, as nine layers over 8 mm sample \
            the slice.",
        planted: "The width of one way.",
        run: slice_widths,
    }
}

/// Two-way elevational full width at half maximum, mm.
fn elevation(z: f64) -> f64 {
    FWHM * gaussian_beam(10.0, 60.0, z) / SQRT_2
}

fn slice_widths(bench: &Bench, physics: Physics) -> Outcome {
    // Scanlines ten millimetres apart: each sees its own points only, one at every depth.
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
    let mut out = Outcome::default();
    let mut curves = vec![Curve::line(
        "Gaussian beam of the lens, twice",
        (70..=170).map(|i| f64::from(i) * 0.5).map(|z| [z, elevation(z)]).collect(),
    )];
    for (name, render) in &bench.renderers {
        let frame = render(&scene);
        let mut dots = vec![];
        for z in depths {
            let k = (z * 20.48).round() as usize;
            let peak = |l| {
                let near = &frame.envelope(l)[k - 40..k + 40];
                near.iter().copied().fold(0.0, f64::max)
            };
            let profile: Vec<f64> = (0..lines as usize).map(peak).collect();
            let got = width(&profile) * step;
            let expected = match physics {
                Physics::Right => elevation(z),
                Physics::Planted => elevation(z) * SQRT_2,
            };
            let what = format!("{name}: thickness at {z} mm, mm");
            out.compare(what, got, expected, 0.05 * expected);
            dots.push([z, got]);
        }
        curves.push(Curve::dots(*name, dots));
    }
    let axes = ["depth, mm", "slice thickness at half maximum, mm"];
    out.plots.push(Plot::linear("Slice thickness over depth", axes, curves));
    out
}
