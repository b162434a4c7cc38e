//! `geometry`: the probe's lines and face.

use super::{Case, Check, Element, Extent, Input, Job, Size, Subject, inputs, sizes};
use crate::reference::geometry;
use insonify::sim::layout::Frame;

pub const SUBJECT: Subject = Subject {
    name: "geometry",
    pass: None,
    tolerance: "directions within 1.2e-7, the table's rounding, normals within 4e-7; 4e-6 \
                of the radius or depth for places, since the face is sought from a rounded point",
    job,
    size: |job, name| match name {
        "rays" => 64 * inputs::lines(&job.one("frame")),
        _ => sizes::of_frame(job, name),
    },
    extent: Some(|job| Extent::threads(inputs::lines(&job.one("frame")) as u32, 1)),
    check,
    plant: |job, outputs| {
        job.edit(outputs, "rays", |rays: &mut [[f32; 4]]| {
            let middle = rays.len() / 8 * 4;
            rays[middle + 1][0] += 2e-5;
        });
    },
};

fn job(case: Case, size: Size) -> Job {
    let mut frame = inputs::frame(case, size);
    if case == Case::NotFinite {
        frame.depth = f32::NAN;
        frame.slice_thickness = f32::INFINITY;
    }
    Job {
        inputs: vec![
            Input::words("frame", &[frame]),
            Input::output("rays", Element::Float, 16 * inputs::lines(&frame)),
            inputs::scanlines(&frame),
        ],
        push: Vec::new(),
    }
}

fn check(job: &Job, outputs: &[Vec<u8>]) -> Vec<Check> {
    let frame: Frame = job.one("frame");
    let mut expected: Vec<f64> = Vec::new();
    for e in 0..frame.layers {
        for l in 0..frame.scanlines {
            let line = geometry::line(&frame, l, e);
            let end = line.origin + f64::from(frame.depth) * line.direction;
            let face = geometry::face(&frame, end, -line.direction, 1e-3);
            let normal = match frame.kind {
                insonify::sim::layout::KIND_CONVEX => line.direction,
                _ => glam::DVec3::Z,
            };
            expected.extend(line.origin.to_array());
            expected.push(geometry::probe(&frame).elevation(e));
            expected.extend(line.direction.to_array());
            expected.push(face.map_or(-1.0, |(t, _)| t));
            expected.extend(line.lateral.to_array());
            expected.push(0.0);
            expected.extend(normal.to_array());
            expected.push(0.0);
        }
    }
    let got: Vec<f32> = job.after(outputs, "rays");
    let size = f64::from(frame.radius.max(frame.depth));
    let place = [0, 1, 2, 3, 7];
    let allowed = |i: usize| match i % 16 {
        at if place.contains(&at) => 4e-6 * size,
        4..12 => 1.2e-7,
        _ => 4e-7,
    };
    vec![Check::close("rays", &got, &expected, allowed)]
}
