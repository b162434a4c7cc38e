//! `level`: expected power of the echoes, and the share of it that was reflected.

use super::beam::contact;
use super::inputs::{Random, frame, rows, samples};
use super::{Case, Check, Input, Job, Size, Subject};
use crate::reference::level;
use insonify::sim::layout::{Frame, Label, POWER_UNITS};
use insonify::sim::stages;

pub const SUBJECT: Subject = Subject {
    tolerance: "1e-4 dB and 1e-5: 65 taps good to 3e-7 each, a logarithm within 2^-21, and the difference of \
                two samples of IQ",
    job,
    check,
    plant: |job, outputs| {
        job.edit(outputs, "labels", |labels: &mut [Label]| {
            labels[70].level += 1e-3;
        });
    },
    ..Subject::of(&stages::LEVEL)
};

fn job(case: Case, size: Size) -> Job {
    let frame = frame(case, size);
    let mut random = Random(22);
    let count = samples(&frame);
    let power = |random: &mut Random| {
        let units = 10_f64.powf(random.within(-9.0, -1.0)) * f64::from(POWER_UNITS);
        [units as u64 as u32, (units as u64 >> 32) as u32]
    };
    let mut expected: Vec<[u32; 4]> = Vec::new();
    for _ in 0..count {
        let [[a, b], [c, d]] = [power(&mut random), power(&mut random)];
        expected.push(if random.word().is_multiple_of(5) { [0; 4] } else { [a, b, c, d] });
    }
    let direct = random.floats(2 * count, -0.3, 0.3);
    let rest = random.floats(2 * count, -0.1, 0.1);
    // Where nothing was reflected, nothing may be left.
    let reflected = (0..2 * count).map(|i| i / 2 % 3 == 0);
    let mut all: Vec<f32> = (direct.iter().zip(&rest).zip(reflected))
        .map(|((direct, rest), reflected)| if reflected { direct + rest } else { *direct })
        .collect();
    if case == Case::NotFinite {
        all[130] = f32::NAN;
    }
    let given = vec![
        Input::words("frame", &[frame]),
        Input::floats("rows", bytemuck::cast_slice(&rows(&frame))),
        Input::floats("contact", &contact(&frame, &mut random)),
        Input::words("expected", &expected),
        Input::floats("surface_iq", &all),
        Input::floats("direct_iq", &direct),
    ];
    Job::of(&stages::LEVEL, given, Vec::new())
}

fn check(job: &Job, outputs: &[Vec<u8>]) -> Vec<Check> {
    let frame: Frame = job.one("frame");
    let sums: Vec<[u32; 4]> = job.get("expected");
    let power = |low: u32, high: u32| {
        (u64::from(low) | u64::from(high) << 32) as f64 / f64::from(POWER_UNITS)
    };
    let powers: Vec<[f64; 2]> =
        sums.iter().map(|&[a, b, c, d]| [power(a, b), power(c, d)]).collect();
    let [all, direct] = ["surface_iq", "direct_iq"].map(|name| job.get::<[f32; 2]>(name));
    let twin = level::level(
        &frame,
        &job.get("rows"),
        &job.get::<f32>("contact"),
        &powers,
        [&all, &direct],
    );
    let got: Vec<Label> = job.after(outputs, "labels");
    let part = |part: usize| twin.iter().map(|pair| pair[part]).collect::<Vec<f64>>();
    let levels: Vec<f32> = got.iter().map(|label| label.level).collect();
    let shares: Vec<f32> = got.iter().map(|label| label.reverberation).collect();
    // Beside a value that is no number any result is allowed.
    let known = |expected: Vec<f64>, got: &[f32]| -> Vec<f64> {
        let bad = all.iter().map(|iq| iq.iter().any(|v| v.is_nan()));
        let both = expected.iter().zip(got).zip(bad);
        both.map(|((&e, &g), bad)| if bad { f64::from(g) } else { e }).collect()
    };
    vec![
        Check::close("level", &levels, &known(part(0), &levels), |_| 1e-4),
        Check::close("reverberation", &shares, &known(part(1), &shares), |_| 1e-5),
    ]
}
