//! Scan conversion alone on the device.

use insonify::probe::{Probe, ProbeKind};
use insonify::scene::Scene;
use insonify::sim::{layout, tables};

use crate::common::signal::scene;
use crate::physics::check::{Bench, Check, Outcome, Physics, Picture};
use crate::physics::stages::{Stages, every_kind};

/// Smooth brightness over depth (mm) and position across the face (-1/2 .. 1/2): curved so strongly that half a
/// sample (0.01-0.03 mm) and half a scanline change it by more than the 1e-3 allowed, and so little that bilinear
/// interpolation errs by less than 3e-4.
fn brightness(probe: &Probe, depth: f64, across: f64) -> f64 {
    let sample = probe.sample_pitch();
    0.5 + 0.25 * (depth * 0.05 / sample).sin() + 0.2 * (across * 12.0).cos()
}

struct Conversion {
    /// Number of pixels outside the sector that are not transparent black.
    spilt: f64,
    /// Share of pixels that no value within 1e-3 of the exact one explains.
    wrong: f64,
    /// Area of the opaque pixels, mm^2.
    area: f64,
}

/// Compares pixels with the exact brightness, moved by `shift` samples and scanlines.
fn compare(scene: &Scene, frame: &layout::Frame, pixels: &[u32], shift: [f64; 2]) -> Conversion {
    let probe = &scene.probe;
    let pitch = f64::from(frame.pixel_pitch);
    let lines = f64::from(probe.scanlines);
    let (mut inside, mut spilt, mut checked, mut wrong) = (0u32, 0u32, 0u32, 0u32);
    for j in 0..frame.image_height {
        for i in 0..frame.image_width {
            let pixel = pixels[(j * frame.image_width + i) as usize];
            if pixel >> 24 == 0 {
                spilt += u32::from(pixel != 0);
                continue;
            }
            inside += 1;
            let x = f64::from(frame.image_left) + (f64::from(i) + 0.5) * pitch;
            let z = f64::from(frame.image_top) + (f64::from(j) + 0.5) * pitch;
            let (depth, across) = match probe.kind {
                ProbeKind::Convex { radius, field_of_view } => {
                    (x.hypot(z + radius) - radius, x.atan2(z + radius) / field_of_view)
                }
                ProbeKind::Phased { field_of_view } => (x.hypot(z), x.atan2(z) / field_of_view),
                ProbeKind::Linear { width } => (z, x / width),
            };
            // The outer half scanlines and the last sample are clamped, not interpolated.
            let (column, row) = ((across + 0.5) * lines - 0.5, depth / probe.sample_pitch());
            if column < 0.0 || column > lines - 1.0 || row > f64::from(probe.samples - 1) {
                continue;
            }
            checked += 1;
            let v = brightness(
                probe,
                depth + shift[0] * probe.sample_pitch(),
                across + shift[1] / lines,
            );
            let grey = |v: f64| (v * 255.0 + 0.5).floor() as u32;
            let level = pixel & 0xff;
            wrong += u32::from(level < grey(v - 1e-3) || level > grey(v + 1e-3));
        }
    }
    Conversion {
        spilt: f64::from(spilt),
        wrong: f64::from(wrong) / f64::from(checked),
        area: f64::from(inside) * pitch * pitch,
    }
}

/// Check T28.
pub fn scan_conversion_is_exact_for_every_probe() -> Check {
    Check {
        row: "T28",
        name: "scan_conversion_is_exact_for_every_probe",
        claim: "A smooth function of depth and angle, sampled on the lines, comes out within 1e-3 of \
            its exact value at every pixel (and the half grey level that rounding makes); what is opaque \
            has the sector's area within 0.5 %, as pixels at its edge count whole or not at all; the \
            rest is transparent black.",
        planted: "Half a line aside.",
        run: conversion,
    }
}

fn conversion(bench: &Bench, physics: Physics) -> Outcome {
    let stages = Stages::new(&bench.device);
    let mut out = Outcome::default();
    for (name, probe) in every_kind() {
        let scene = scene(probe);
        let probe = &scene.probe;
        let frame = tables::frame(&scene, 0);
        let log: Vec<f32> = (0..probe.scanlines)
            .flat_map(|l| (0..probe.samples).map(move |k| (l, k)))
            .map(|(l, k)| {
                let across = (f64::from(l) + 0.5) / f64::from(probe.scanlines) - 0.5;
                brightness(probe, f64::from(k) * probe.sample_pitch(), across) as f32
            })
            .collect();
        let grey: Vec<u32> = (0..256).collect();
        let pixels = stages.display(&frame, &log, &grey);
        let shift = match physics {
            Physics::Right => [0.0, 0.0],
            Physics::Planted => [0.0, 0.5],
        };
        let got = compare(&scene, &frame, &pixels, shift);
        out.compare(format!("{name}: share of wrong pixels"), got.wrong, 0.0, 0.0);
        let outside = pixels.len() as f64 - got.area / f64::from(frame.pixel_pitch).powi(2);
        // A linear array's sector is all of the picture.
        if outside >= 1.0 {
            out.compare(format!("{name}: coloured pixels outside"), got.spilt, 0.0, 0.0)
                .unlike("a picture without a sector", outside);
        }
        // The same comparison notices half a sample: the function is steep enough.
        let deeper = compare(&scene, &frame, &pixels, [0.5, shift[1]]);
        out.compare(
            format!("{name}: share of pixels that tell half a sample, at least a fifth"),
            deeper.wrong.min(0.2),
            0.2,
            0.0,
        )
        .unlike("a function too flat to tell", 0.0);
        let area = match probe.kind {
            ProbeKind::Convex { radius, field_of_view } => {
                field_of_view / 2.0 * ((radius + probe.depth).powi(2) - radius * radius)
            }
            ProbeKind::Phased { field_of_view } => field_of_view / 2.0 * probe.depth.powi(2),
            ProbeKind::Linear { width } => width * probe.depth,
        };
        out.compare(format!("{name}: area, mm^2"), got.area, area, 0.005 * area)
            .unlike("pixels half a percent larger", 1.005 * 1.005 * area);
        let white = |&p: &u32| if p >> 24 == 0 { 255 } else { (p & 0xff) as u8 };
        out.pictures.push(Picture {
            title: format!("{name}: the function, converted"),
            width: frame.image_width,
            grey: pixels.iter().map(white).collect(),
        });
    }
    out
}
