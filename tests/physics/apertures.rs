//! Comparison with real apertures: the point-spread widths of `tools/oracle/table.json`, made by PyMUST.

use std::f64::consts::{LN_2, PI, TAU};

use insonify::probe::ProbeKind;
use insonify::scene::Scene;
use serde_json::Value;

use crate::physics::check::{Bench, Check, Curve, Outcome, Physics, Plot};
use crate::physics::full_wave::{number, table};
use crate::physics::profile::width;
use crate::physics::render::Frame;
use crate::physics::resolution::{FWHM, gaussian_beam, points};

/// Speed of sound, mm/us.
const SPEED: f64 = 1.54;

/// T35.
pub fn points_are_as_wide_as_through_real_apertures() -> Check {
    Check {
        row: "T35",
        name: "points_are_as_wide_as_through_real_apertures",
        claim: "PyMUST (Garcia 2022) sums over the elements of unapodised apertures, each with its \
            directivity, for an L11-5v and a P4-2v. The same sum over frequencies and elements by \
            quadrature here gives its widths within 1 %. Ours are Gaussian beams of waist 0.6 lambda F#, \
            those of an apodised aperture: 1.0 lambda F# two-way at the focus against 0.886 of the \
            monochromatic rectangle and 0.93 to 0.98 with directivity and the pulse's bandwidth. So ours \
            must exceed PyMUST's by the ratio of the two closed forms, 2 to 9 %; within 2 %. Pulses are \
            given the length of the quadrature's; 3 % for the split over samples.",
        planted: "An aperture a tenth smaller on our side.",
        run: widths,
    }
}

/// An array of the outside simulator; lengths mm.
struct Array {
    frequency: f64,
    /// Pulse-echo fractional bandwidth.
    bandwidth: f64,
    elements: u32,
    pitch: f64,
    element: f64,
    /// F-number of the receive aperture; none: the whole array and a sector scan.
    f_number: Option<f64>,
}

impl Array {
    fn new(table: &Value) -> Self {
        let f_number = number(&table["f_number"]);
        Self {
            frequency: number(&table["frequency"]),
            bandwidth: number(&table["bandwidth_percent"]) / 100.0,
            elements: number(&table["elements"]) as u32,
            pitch: number(&table["pitch"]),
            element: number(&table["element_width"]),
            f_number: (f_number > 0.0).then_some(f_number),
        }
    }

    fn wavelength(&self) -> f64 {
        SPEED / self.frequency
    }

    /// F-number at `depth`.
    fn f_number(&self, depth: f64) -> f64 {
        let whole = depth / (f64::from(self.elements) * self.pitch);
        self.f_number.unwrap_or(whole)
    }

    /// Spectrum of the echo: one wavelength of transmitted sine, and the generalised normal window of
    /// the transducer, there and back.
    fn spectrum(&self, f: f64) -> f64 {
        let sinc = |x: f64| {
            if x == 0.0 { 1.0 } else { (PI * x).sin() / (PI * x) }
        };
        let sine = (sinc(f / self.frequency - 1.0) - sinc(f / self.frequency + 1.0)).abs();
        let p = 126f64.ln() / (2.0 / self.bandwidth).ln();
        let half = self.bandwidth * self.frequency / 2.0 / LN_2.powf(1.0 / p);
        sine * (-((f - self.frequency).abs() / half).powf(p)).exp()
    }

    /// Sum over the elements within `aperture` mm of the middle, delayed to focus at `focus`, at a point: one way,
    /// without the carrier over `focus`.
    fn one_way(&self, f: f64, [x, z]: [f64; 2], focus: f64, aperture: f64) -> [f64; 2] {
        let mut sum = [0.0; 2];
        for e in 0..self.elements {
            let at = (f64::from(e) - f64::from(self.elements - 1) / 2.0) * self.pitch;
            if at.abs() > aperture {
                continue;
            }
            let r = (x - at).hypot(z);
            let sine = (x - at) / r;
            let u = PI * self.element * sine * f / SPEED;
            let piston = if u == 0.0 { 1.0 } else { u.sin() / u };
            let directivity = piston * (1.0 - sine * sine).sqrt() / r.sqrt();
            let (sin, cos) = (TAU * f / SPEED * (r - (at.hypot(focus) - focus))).sin_cos();
            sum = [sum[0] + directivity * cos, sum[1] + directivity * sin];
        }
        sum
    }

    /// Envelope over depth of a point at `depth`, `aside` of the axis, transmit by `firing` elements
    /// focused at `focus`; at steps of a fiftieth of a wavelength about the point.
    fn envelope(&self, depth: f64, aside: f64, focus: f64, firing: f64) -> Vec<f64> {
        let at = match self.f_number {
            Some(_) => [aside, depth],
            None => [depth * (aside / depth).sin(), depth * (aside / depth).cos()],
        };
        let receive = depth / (2.0 * self.f_number(depth)) + 1e-9;
        let mut echo = [[0.0; 2]; 121];
        for i in 0..41 {
            let f = self.frequency * (0.3 + 0.04 * f64::from(i));
            let [a, b] = self.one_way(f, at, focus, firing / 2.0 * self.pitch);
            let [c, d] = self.one_way(f, at, depth, receive);
            let s = self.spectrum(f);
            let [re, im] = [s * (a * c - b * d), s * (a * d + b * c)];
            for (j, sum) in echo.iter_mut().enumerate() {
                let along = depth + (j as f64 - 60.0) / 50.0 * self.wavelength();
                let (sin, cos) = (2.0 * TAU * f / SPEED * along).sin_cos();
                sum[0] += re * cos + im * sin;
                sum[1] += im * cos - re * sin;
            }
        }
        echo.iter().map(|v| v[0].hypot(v[1])).collect()
    }

    /// Axial and lateral widths of a point.
    fn widths(&self, depth: f64, focus: f64, firing: f64) -> [f64; 2] {
        let axial = width(&self.envelope(depth, 0.0, focus, firing)) / 50.0 * self.wavelength();
        let step = self.wavelength() * self.f_number(depth) / 25.0;
        let peak = |i: i32| {
            let envelope = self.envelope(depth, f64::from(i) * step, focus, firing);
            envelope.into_iter().fold(0.0, f64::max)
        };
        let half: Vec<f64> = (0..40).map(peak).collect();
        let profile: Vec<f64> = half[1..].iter().rev().chain(&half).copied().collect();
        [axial, width(&profile) * step]
    }

    /// Our probe for comparison: Gaussian beams of its F-number, a Gaussian pulse of length `axial`.
    fn scene(&self, depth: f64, focus: f64, axial: f64, f_number: f64) -> Scene {
        let mut scene = points(161, 4.0, &[[0.0, 0.0, depth]]);
        let probe = &mut scene.probe;
        if self.f_number.is_none() {
            let field_of_view = 8.0 * self.wavelength() * self.f_number(depth) / depth;
            probe.kind = ProbeKind::Phased { field_of_view };
        }
        probe.samples = 2048;
        probe.frequency = self.frequency;
        // Length and bandwidth of a Gaussian, both at half amplitude: 4 ln 2 / pi cycles.
        probe.bandwidth = 4.0 * LN_2 / PI * SPEED / 2.0 / (axial * self.frequency);
        probe.focus = focus;
        probe.f_number_transmit = f_number;
        probe.f_number_receive = f_number;
        scene
    }
}

/// An error that changes every width, and by how much: wavelengths of another speed of sound.
const SLOW: &str = "wavelengths in water of 20 degrees, 1480 m/s";
const SLOWER: f64 = 1480.0 / 1540.0;

/// Axial and lateral widths of the point at `depth` in a frame, mm.
fn measured(scene: &Scene, frame: &Frame, depth: f64) -> [f64; 2] {
    let pitch = scene.probe.sample_pitch();
    let k = (depth / pitch).round() as usize;
    let axial = width(&frame.envelope(80)[k - 30..k + 30]) * pitch;
    let peak = |l: usize| {
        let near = &frame.envelope(l)[k - 30..k + 30];
        near.iter().copied().fold(0.0, f64::max)
    };
    let profile: Vec<f64> = (0..161).map(peak).collect();
    [axial, width(&profile) * scene.probe.line_pitch(depth)]
}

fn widths(bench: &Bench, physics: Physics) -> Outcome {
    let table = table();
    let mut out = Outcome::default();
    for which in ["linear", "phased"] {
        let array = Array::new(&table[which]);
        let (mut exact, mut pymust, mut ours) = (vec![], vec![], vec![]);
        for row in table[which]["points"].as_array().expect("a list") {
            let [depth, focus] = [&row["depth"], &row["focus"]].map(number);
            let theirs = [&row["axial"], &row["lateral"]].map(number);
            let point = format!("{which}, point at {depth}, focus at {focus} mm");
            let quadrature = bench
                .memo
                .once(&point, true, || array.widths(depth, focus, number(&row["elements"])));
            for (i, way) in ["axial", "lateral"].into_iter().enumerate() {
                let what = format!("quadrature: {point}: {way} width, mm");
                out.compare(what, quadrature[i], theirs[i], 0.01 * theirs[i])
                    .unlike(SLOW, SLOWER * quadrature[i]);
            }
            let f_number = array.f_number(depth);
            let gaussian = |f: f64| {
                let scale = array.wavelength() / 0.22;
                // The beams' closed form is written for another wavelength: lengths scale with it.
                let transmit = scale * gaussian_beam(f, focus / scale, depth / scale);
                let receive = 0.6 * array.wavelength() * f;
                FWHM / (transmit.powi(-2) + receive.powi(-2)).sqrt()
            };
            let smaller = match physics {
                Physics::Right => 1.0,
                Physics::Planted => 1.1,
            };
            let scene = array.scene(depth, focus, quadrature[0], smaller * f_number);
            let lateral = theirs[1] * gaussian(f_number) / quadrature[1];
            for (name, render) in &bench.renderers {
                let got = measured(&scene, &render(&scene), depth);
                let what = format!("{name}: {point}: axial width, mm");
                out.compare(what, got[0], theirs[0], 0.03 * theirs[0])
                    .unlike(SLOW, SLOWER * got[0]);
                let what = format!("{name}: {point}: lateral width, mm");
                out.compare(what, got[1], lateral, 0.02 * lateral);
                if *name == "bvh" && focus == depth {
                    ours.push([depth, got[1]]);
                }
            }
            if focus == depth {
                exact.push([depth, quadrature[1]]);
                pymust.push([depth, theirs[1]]);
            }
        }
        out.plots.push(Plot::linear(
            format!("Lateral width at the focus, {which} array"),
            ["depth, mm", "width at half maximum, mm"],
            vec![
                Curve::line("unapodised aperture by quadrature", exact),
                Curve::dots("PyMUST", pymust),
                Curve::dots("bvh: Gaussian beams", ours),
            ],
        ));
    }
    out
}
