//! `wall_filter`, `autocorrelation` and `gate`: the pulses of a packet to correlations.

use super::inputs::Random;
use super::{Case, Check, Element, Extent, Input, Job, Size, Subject};
use crate::reference::doppler;
use insonify::sim::colour::polynomials;
use insonify::sim::push::{Autocorrelation, Gate, WallFilter};
use insonify::sim::stages;

pub const WALL_FILTER: Subject = Subject {
    tolerance: "1e-6 a pulse: shares are sums over the pulses of products up to 1, each rounded to 6e-8 of the sum",
    job: |case, size| {
        let (push, order) = packet(case, size);
        let table = order.map_or_else(Vec::new, |order| polynomials(push.count as usize, order));
        let taken = table.len() as u32 / push.count;
        let given = vec![
            Input::floats("polynomials", &table),
            Input::floats("pulses", pulses(case, &push, 31).as_flattened()),
        ];
        Job { inputs: given, push: bytemuck::bytes_of(&WallFilter { taken, ..push }).to_vec() }
    },
    size: |job, name| {
        let push: WallFilter = read(job);
        match name {
            "polynomials" => 4 * (push.taken * push.count) as usize,
            _ => 8 * (push.count * push.lines * push.samples) as usize,
        }
    },
    extent: Some(|job| {
        let push: WallFilter = read(job);
        Extent::threads(push.samples, push.lines)
    }),
    check: |job, outputs| {
        let push: WallFilter = read(job);
        let table: Vec<f32> = job.get("polynomials");
        let table = &table[..(push.taken * push.count) as usize];
        let expected =
            doppler::wall_filter(&job.get::<[f32; 2]>("pulses"), push.count as usize, table);
        let got: Vec<f32> = job.after(outputs, "pulses");
        let allowed = 1e-6 * f64::from(push.count);
        vec![Check::close("pulses", &got, expected.as_flattened(), |_| allowed)]
    },
    plant: |job, outputs| {
        job.edit(outputs, "pulses", |pulses: &mut [f32]| pulses[77] += 1e-4);
    },
    ..Subject::of(&stages::COLOUR[0])
};

pub const AUTOCORRELATION: Subject = Subject {
    tolerance: "2e-7 a pulse of the power: sums over the pulses of products, each rounded to 6e-8 of the sum",
    job: |case, size| {
        let (WallFilter { count, lines, samples, .. }, _) = packet(case, size);
        let push = Autocorrelation { count, lines, samples };
        let given = vec![
            Input::floats("pulses", pulses(case, &packet(case, size).0, 32).as_flattened()),
            Input::output("lags", Element::Float, 3 * (lines * samples) as usize),
        ];
        Job { inputs: given, push: bytemuck::bytes_of(&push).to_vec() }
    },
    size: |job, name| {
        let push: Autocorrelation = read(job);
        let each = (push.lines * push.samples) as usize;
        if name == "pulses" { 8 * push.count as usize * each } else { 12 * each }
    },
    extent: Some(|job| {
        let push: Autocorrelation = read(job);
        Extent::threads(push.samples, push.lines)
    }),
    check: |job, outputs| {
        let count = read::<Autocorrelation>(job).count as usize;
        let expected = doppler::autocorrelation(&job.get::<[f32; 2]>("pulses"), count);
        let got: Vec<f32> = job.after(outputs, "lags");
        let allowed = |i: usize| 2e-7 * count as f64 * expected[i / 3][2];
        vec![Check::close("lags", &got, expected.as_flattened(), allowed)]
    },
    plant: |job, outputs| {
        // Of what flows away instead of towards.
        job.edit(outputs, "lags", |lags: &mut [f32]| lags[31] = -lags[31]);
    },
    ..Subject::of(&stages::COLOUR[1])
};

pub const GATE: Subject = Subject {
    tolerance: "1e-6: means of up to 33 numbers up to 1, their sum rounded to 6e-8 with each",
    job: |case, size| {
        let (WallFilter { lines, samples, .. }, _) = packet(case, size);
        let reach = match case {
            Case::One => 0,
            // Farther than the box.
            Case::Empty => 40,
            _ => 16,
        };
        let count = 3 * (lines * samples) as usize;
        let mut lags = Random(33).floats(count, -1.0, 1.0);
        if case == Case::NotFinite {
            lags[400] = f32::NAN;
            lags[500] = f32::INFINITY;
        }
        let given = vec![
            Input::floats("lags", &lags),
            Input::output("correlations", Element::Float, count),
        ];
        let push = Gate { lines, samples, reach };
        Job { inputs: given, push: bytemuck::bytes_of(&push).to_vec() }
    },
    size: |job, _| {
        let push: Gate = read(job);
        12 * (push.lines * push.samples) as usize
    },
    extent: Some(|job| {
        let push: Gate = read(job);
        Extent::threads(push.samples, push.lines)
    }),
    check: |job, outputs| {
        let push: Gate = read(job);
        let lags: Vec<[f32; 3]> = job.get("lags");
        let expected = doppler::gate(&lags, push.samples as usize, push.reach as usize);
        let got: Vec<f32> = job.after(outputs, "correlations");
        vec![Check::close("correlations", &got, expected.as_flattened(), |_| 1e-6)]
    },
    plant: |job, outputs| {
        // One sample beside.
        job.edit(outputs, "correlations", |found: &mut [f32]| found.rotate_right(3));
    },
    ..Subject::of(&stages::COLOUR[2])
};

fn read<T: bytemuck::AnyBitPattern>(job: &Job) -> T {
    bytemuck::pod_read_unaligned(&job.push)
}

/// The packet of a case, and the order of its wall filter; none: nothing is taken off.
fn packet(case: Case, size: Size) -> (WallFilter, Option<u32>) {
    let ([count, lines, samples], order) = match (case, size) {
        (Case::Random, Size::Standard) => ([8, 115, 1229], Some(1)),
        (Case::Random, Size::Small) => ([8, 24, 150], Some(1)),
        (Case::Empty, _) => ([4, 0, 16], Some(1)),
        (Case::One, _) => ([2, 1, 1], Some(0)),
        (Case::Odd, _) => ([5, 23, 131], Some(2)),
        (Case::Modes, _) => ([64, 7, 65], None),
        (Case::NotFinite, _) => ([3, 12, 130], Some(1)),
    };
    (WallFilter { count, lines, samples, taken: 0 }, order)
}

/// Echoes by pulse and sample.
fn pulses(case: Case, push: &WallFilter, seed: u64) -> Vec<[f32; 2]> {
    let mut random = Random(seed);
    let count = (push.count * push.lines * push.samples) as usize;
    let mut echo = || [0, 1].map(|_| random.within(-1.0, 1.0) as f32);
    let mut echoes: Vec<[f32; 2]> = (0..count).map(|_| echo()).collect();
    if case == Case::NotFinite {
        echoes[700][0] = f32::NAN;
        echoes[900][1] = f32::NAN;
    }
    echoes
}
