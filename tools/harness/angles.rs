//! `angles`: sines, cosines and arcs from sums and products alone.

use super::inputs::Random;
use super::{Case, Check, Element, Extent, Input, Job, Size, Subject};
use crate::reference::angles;

pub const SUBJECT: Subject = Subject {
    name: "angles",
    pass: None,
    tolerance: "the circle is the twin's in every bit, since a device rounds sums and products \
                correctly, and within 2.5e-7 of the true one; angles within 4e-7 and arcsines within \
                5e-7, since a quotient may be 2.5 units in the last place off",
    job,
    size: |job, _| 16 * arguments(job).len(),
    extent: Some(|job| Extent::threads(arguments(job).len() as u32, 1)),
    check,
    plant: |job, outputs| {
        // The largest error that a device's own sine may have.
        job.edit(outputs, "results", |results: &mut [[f32; 4]]| {
            let middle = results.len() / 2;
            results[middle][1] += f32::powi(2.0, -11);
        });
    },
};

fn arguments(job: &Job) -> Vec<[f32; 4]> {
    job.get("arguments")
}

fn job(case: Case, size: Size) -> Job {
    let mut random = Random(17);
    let count = match (case, size) {
        (Case::Random, Size::Standard) => 1 << 20,
        (Case::Random, Size::Small) => 1 << 14,
        (Case::Empty, _) => 0,
        (Case::One, _) => 1,
        _ => 1001,
    };
    let mut values: Vec<[f32; 4]> = (0..count)
        .map(|i| {
            // Half of them within half a turn, half as far as a carrier turns over a line.
            let far = if i % 2 == 0 { 0.5 } else { 2000.0 };
            let [turns, y, x] = [far, 130.0, 130.0].map(|r| random.within(-r, r) as f32);
            [turns, y, x, random.within(-1.0, 1.0) as f32]
        })
        .collect();
    if case == Case::Modes {
        // Arguments at which the formula for the circle changes, and the ends.
        let quarters = values.iter_mut().zip(-12i16..=12);
        for (value, quarter) in quarters {
            let [y, x] = [quarter % 3, quarter % 2].map(f32::from);
            *value = [f32::from(quarter) / 8.0, y, x, y.clamp(-1.0, 1.0)];
        }
    }
    if case == Case::NotFinite {
        let none = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
        for (value, none) in values.iter_mut().zip(none) {
            value[0] = none;
        }
    }
    Job {
        inputs: vec![
            Input::floats("arguments", values.as_flattened()),
            Input::output("results", Element::Float, 4 * values.len()),
        ],
        push: Vec::new(),
    }
}

fn check(job: &Job, outputs: &[Vec<u8>]) -> Vec<Check> {
    let given = arguments(job);
    let got: Vec<[f32; 4]> = job.after(outputs, "results");
    let circle = |v: &[f32; 4]| [v[0], v[1]];
    let bits = |v: [f32; 2]| v.map(|x| if x.is_nan() { u32::MAX } else { x.to_bits() });
    let found: Vec<[u32; 2]> = got.iter().map(|v| bits(circle(v))).collect();
    let twin: Vec<[u32; 2]> = (given.iter()).map(|v| bits(angles::phasor(v[0]))).collect();
    let exact = |f: fn(&[f32; 4]) -> f64| given.iter().map(f).collect::<Vec<f64>>();
    let turn = |v: &[f32; 4]| std::f64::consts::TAU * f64::from(v[0]);
    let close = |what, at: usize, expected: Vec<f64>, allowed| {
        let got: Vec<f32> = got.iter().map(|v| v[at]).collect();
        Check::close(what, &got, &expected, |_| allowed)
    };
    vec![
        Check::equal("bits of the circle", &found, &twin),
        close("cosine", 0, given.iter().map(|v| turn(v).cos()).collect(), 2.5e-7),
        close("sine", 1, given.iter().map(|v| turn(v).sin()).collect(), 2.5e-7),
        close("angle", 2, exact(|v| f64::from(v[1]).atan2(v[2].into())), 4e-7),
        close("arcsine", 3, exact(|v| f64::from(v[3]).asin()), 5e-7),
    ]
}
