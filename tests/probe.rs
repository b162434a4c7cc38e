//! The probe's geometry on the CPU, compared with the scanlines and layers that kernels compute from its table.

use glam::DVec3;
use insonify::gpu::{Binding, BufferKind, Device, Kernel, test_device};
use insonify::probe::{Probe, ProbeKind};
use insonify::sim::layout::{Frame, KIND_CONVEX, KIND_LINEAR, KIND_PHASED};
use insonify::sim::shaders::Library;
use insonify::sim::tables;

/// Epsilons of f32 (1.2e-7) by which a line may differ, relative to the radius, width or, for
/// directions, 1: half for a rounded entry of the table, and up to three for an elevation, the quotient
/// of two numbers.
const EPSILONS: f64 = 4.0;

fn frame(probe: &Probe) -> Frame {
    let mut frame = Frame {
        scanlines: probe.scanlines,
        layers: probe.elevation_layers,
        slice_thickness: probe.slice_thickness as f32,
        depth: probe.depth as f32,
        face_height: probe.elevation_height as f32,
        ..Frame::default()
    };
    match probe.kind {
        ProbeKind::Convex { radius, field_of_view } => {
            frame.kind = KIND_CONVEX;
            frame.radius = radius as f32;
            frame.field_of_view = field_of_view as f32;
        }
        ProbeKind::Linear { width } => {
            frame.kind = KIND_LINEAR;
            frame.width = width as f32;
        }
        ProbeKind::Phased { field_of_view } => {
            frame.kind = KIND_PHASED;
            frame.field_of_view = field_of_view as f32;
        }
    }
    frame
}

/// Origin, elevation, direction and lateral axis of every line as the device computes them.
fn lines(device: &std::sync::Arc<Device>, probe: &Probe) -> Vec<[[f32; 4]; 4]> {
    let kernel =
        Kernel::new(device, "geometry", Library::embedded().words("geometry"), &[]).unwrap();
    let count = probe.scanlines * probe.elevation_layers;
    let rays = device.buffer("rays", u64::from(count) * 64, BufferKind::Storage).unwrap();
    let input = device.buffer("frame", size_of::<Frame>() as u64, BufferKind::Storage).unwrap();
    device.upload(&input, bytemuck::bytes_of(&frame(probe))).unwrap();
    let table = tables::scanlines(probe);
    let table: &[u8] = bytemuck::cast_slice(&table);
    let scanlines = device.buffer("scanlines", table.len() as u64, BufferKind::Storage).unwrap();
    device.upload(&scanlines, table).unwrap();
    let bindings = [Binding::Buffer(&input), Binding::Buffer(&rays), Binding::Buffer(&scanlines)];
    device.once(|commands| commands.dispatch(&kernel, [count, 1, 1], &[], &bindings)).unwrap();
    device.read_back_as(&rays).unwrap()
}

/// The line that differs most from `Probe::ray`, and by how many tolerances.
fn worst(lines: &[[[f32; 4]; 4]], probe: &Probe) -> f64 {
    let size = match probe.kind {
        ProbeKind::Convex { radius, .. } => radius,
        ProbeKind::Linear { width } => width,
        ProbeKind::Phased { .. } => 1.0,
    };
    let epsilon = EPSILONS * f64::from(f32::EPSILON);
    let distance = |a: [f32; 4], b: DVec3| {
        let a = DVec3::new(a[0].into(), a[1].into(), a[2].into());
        (a - b).abs().max_element()
    };
    let mut worst: f64 = 0.0;
    for e in 0..probe.elevation_layers {
        for l in 0..probe.scanlines {
            let line = lines[(e * probe.scanlines + l) as usize];
            let (origin, direction) = probe.ray(l, e);
            let lateral = DVec3::new(direction.z, 0.0, -direction.x);
            let height = f64::from(line[0][3]) - probe.elevation(e);
            let errors = [
                distance(line[0], origin) / size.max(probe.slice_thickness),
                height.abs() / probe.slice_thickness,
                distance(line[1], direction),
                distance(line[2], lateral),
            ];
            worst = errors.into_iter().fold(worst, |w, error| w.max(error / epsilon));
        }
    }
    worst
}

#[test]
fn glsl_and_rust_agree_on_every_line() {
    let device = test_device();
    for probe in [
        Probe::paper_table1(),
        Probe::abdominal(),
        Probe::cardiac(),
        Probe::linear(),
        Probe::phased(),
    ] {
        let lines = lines(&device, &probe);
        let found = worst(&lines, &probe);
        println!("{:?}: {found:.2} of the tolerance", probe.kind);
        assert!(found <= 1.0, "{:?}: {found} tolerances", probe.kind);
        // A hundredth of a line pitch is noticed.
        let mut planted = probe.clone();
        match &mut planted.kind {
            ProbeKind::Linear { width } => *width *= 1.0 + 0.01 / 96.0,
            ProbeKind::Convex { field_of_view, .. } | ProbeKind::Phased { field_of_view } => {
                *field_of_view *= 1.0 + 0.01 / 96.0;
            }
        }
        assert!(worst(&lines, &planted) > 1.0, "{:?}: planted error", probe.kind);
    }
    assert_eq!(device.validation_messages(), Vec::<String>::new());
}
