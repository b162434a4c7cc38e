//! `detect`: gain, envelope, logarithm, the last step of the kernel `axial`.

use super::axial;
use super::inputs::{Random, frame, samples};
use super::{Case, Check, Job, Size, Subject};
use crate::reference::detect;
use insonify::sim::layout::{Frame, Row};
use insonify::sim::stages;

pub const SUBJECT: Subject = Subject {
    name: "detect",
    tolerance: "1e-6: an envelope good to 5e-7 is 4e-6 dB, a logarithm near 1 good to 2^-21 is \
                3e-6 dB, of 60 dB, and 1 minus up to 400 dB / 60 rounds at 4e-7",
    job,
    check,
    plant: |job, outputs| {
        // A thousandth of the range, a quarter of a grey level.
        job.edit(outputs, "log_image", |v: &mut [f32]| {
            let gray = v.iter_mut().find(|v| (0.2..0.8).contains(*v));
            *gray.expect("levels spread over the range") += 1e-3;
        });
    },
    ..Subject::of(&stages::AXIAL)
};

fn job(case: Case, size: Size) -> Job {
    let mut frame = frame(case, size);
    // The samples as they are.
    frame.axial_sigma = 0.0;
    let mut random = Random(3);
    // Amplitudes over twice the range.
    let mut value = || {
        let decibels = random.within(-120.0, 6.0);
        let sign = if random.word() & 1 == 0 { 1.0 } else { -1.0 };
        (sign * 10f64.powf(decibels / 20.0)) as f32
    };
    let mut iq: Vec<f32> = (0..2 * samples(&frame)).map(|_| value()).collect();
    if case == Case::NotFinite {
        let odd = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.0, f32::MAX, 1e-40];
        let pairs = odd.iter().flat_map(|&a| odd.map(|b| [a, b]));
        for (to, from) in iq.chunks_exact_mut(2).zip(pairs) {
            to.copy_from_slice(&from);
        }
    }
    axial::bindings(&frame, &iq)
}

fn check(job: &Job, outputs: &[Vec<u8>]) -> Vec<Check> {
    let frame: Frame = job.one("frame");
    let iq: Vec<f32> = job.after(outputs, "iq");
    let expected = detect::detect(&frame, &job.get::<Row>("rows"), &iq);
    let got: Vec<f32> = job.after(outputs, "log_image");
    vec![Check::close("log_image", &got, &expected, |_| 1e-6)]
}
