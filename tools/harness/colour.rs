//! `colour`: the finished image with what flows in colours.

use std::f64::consts::TAU;

use super::display::{image, pixels};
use super::inputs::{Random, rows};
use super::{Case, Check, Input, Job, Size, Subject, sizes};
use crate::reference::doppler::{Colours, Shade};
use insonify::sim::layout::{BOX_GREY, COLOUR_COLUMNS, COLOUR_ROWS, Row};
use insonify::sim::push::Colour;
use insonify::sim::stages;

/// Fraction of a sample by which a place may be off, and of a number by which means of white noise then are.
const OFF: f64 = 2e-3;

/// Third byte of all colours of the map: no grey is so.
const MARK: u32 = 77;

pub const SUBJECT: Subject = Subject {
    tolerance: "places are good to 2e-3 samples (1e-6 of the image), and means of white noise, of up to 1, to as much: so are \
                the angle (over the correlation), the variance and the brightness (over the power), in columns and rows of the \
                map; on a border of the box, or of what is coloured, either side will do",
    job,
    size: |job, name| match name {
        "correlations" => {
            let push = push(job);
            12 * (push.lines * push.samples) as usize
        }
        _ => sizes::of_frame(job, name),
    },
    check,
    plant: |job, outputs| {
        job.edit(outputs, "coloured", |pixels: &mut [u32]| {
            // Three columns on.
            let coloured =
                pixels.iter_mut().find(|p| (**p >> 16) == (0xff00 | MARK) && (**p & 0xff) < 200);
            *coloured.expect("something is coloured") += 3;
        });
    },
    ..Subject::of(&stages::COLOUR[3])
};

fn push(job: &Job) -> Colour {
    bytemuck::pod_read_unaligned(&job.push)
}

fn job(case: Case, size: Size) -> Job {
    let frame = image(case, size);
    let mut random = Random(34);
    // Among all scanlines and samples, but where there are few.
    let part = |all: u32| if all < 4 { (0, all) } else { (all / 4, all / 2) };
    let ((first_line, lines), (first_sample, samples)) =
        (part(frame.scanlines), part(frame.samples));
    let push = Colour {
        first_line,
        lines,
        first_sample,
        samples,
        shows_power: u32::from(matches!(case, Case::Odd | Case::Modes)),
        // Nothing stands in front of colour, or some of what is bright.
        priority: match case {
            Case::Odd => 256,
            Case::NotFinite => 200,
            _ => 128,
        },
        least: 0.15,
        gain: if case == Case::Modes { 1e-3 } else { 0.02 },
        baseline: match case {
            Case::Modes => -1.0,
            Case::Odd => 0.4,
            Case::NotFinite => 0.0,
            _ => 0.3,
        },
    };
    let mut correlations: Vec<[f32; 3]> = (0..lines * samples)
        .map(|_| {
            let power = random.within(0.0, 1.0);
            let next = power * random.within(0.5, 1.0);
            // Half the circle, so that means are hardly ever small.
            let angle = TAU * random.within(0.1, 0.6);
            [next * angle.cos(), next * angle.sin(), power].map(|x| x as f32)
        })
        .collect();
    if case == Case::NotFinite {
        correlations[100] = [f32::NAN; 3];
        correlations[201] = [f32::NAN; 3];
    }
    let grey = (0..pixels(&frame)).map(|_| 0xff00_0000 | ((random.word() & 0xff) * 0x0001_0101));
    let map = (0..COLOUR_ROWS)
        .flat_map(|row| (0..COLOUR_COLUMNS).map(move |column| (MARK << 16) | (row << 8) | column));
    let given = vec![
        Input::words("frame", &[frame]),
        Input::floats("rows", bytemuck::cast_slice(&rows(&frame))),
        Input::floats("correlations", correlations.as_flattened()),
        Input::words("colour_map", &map.collect::<Vec<u32>>()),
        Input::words("pixels", &grey.collect::<Vec<u32>>()),
    ];
    Job::of(&stages::COLOUR[3], given, bytemuck::bytes_of(&push).to_vec())
}

fn check(job: &Job, outputs: &[Vec<u8>]) -> Vec<Check> {
    let (rows, correlations): (Vec<Row>, Vec<[f32; 3]>) =
        (job.get("rows"), job.get("correlations"));
    let push = push(job);
    let of = Colours { frame: job.one("frame"), rows: &rows, correlations: &correlations, push };
    let before: Vec<u32> = job.get("pixels");
    let got: Vec<u32> = job.after(outputs, "coloured");
    let mut wrong = 0;
    for (at, (&got, &before)) in (0u32..).zip(got.iter().zip(&before)) {
        let place = [at % of.frame.image_width, at / of.frame.image_width];
        let shade = |shift: [f64; 2]| of.shade(place, before & 0xff, shift);
        let fits = |shade: Shade| match shade {
            Shade::Grey => got == before,
            Shade::Outline => got == 0xff00_0000 | (BOX_GREY * 0x0001_0101),
            Shade::Coloured { certain, .. } if certain < 4.0 * OFF && got == before => true,
            Shade::Coloured { place, next, power, .. } => {
                let is_one = (got >> 16) == (0xff00 | MARK);
                is_one && is_near(got, place, &push, next, power)
            }
        };
        // Where a border of something is as near as a place may be off, both sides are right.
        let shifts = [[0.0; 2], [OFF, 0.0], [-OFF, 0.0], [0.0, OFF], [0.0, -OFF]];
        wrong += usize::from(!shifts.into_iter().any(|shift| fits(shade(shift))));
    }
    vec![
        Check::count("coloured", got.len(), wrong, 0),
        Check::equal("image size", &[got.len()], &[before.len()]),
    ]
}

/// True if a pixel has a colour of the map beside this place, as far as its correlations allow.
fn is_near(pixel: u32, place: [f64; 2], push: &Colour, next: f64, power: f64) -> bool {
    let off = |index: u32, share: f64, count: u32| {
        let off = (f64::from(index) + 0.5) - share * f64::from(count);
        let around = off.abs().min(f64::from(count) - off.abs());
        // Half of one is none: the colour's own width.
        (off.abs() - 0.5, around - 0.5)
    };
    let (column, row) = (pixel & 0xff, (pixel >> 8) & 0xff);
    let (columns, rows) = (f64::from(COLOUR_COLUMNS), f64::from(COLOUR_ROWS));
    let (across, around) = off(column, place[0], COLOUR_COLUMNS);
    let (down, _) = off(row, place[1], COLOUR_ROWS);
    match push.shows_power {
        // Folded over, the last column is beside the first.
        0 => around <= 1e-3 + columns / TAU * OFF / next && down <= 1e-3 + rows * 2.0 * OFF / power,
        // dB of 60; a direction is one or the other where the angle says so.
        _ => across <= 1e-3 + columns / 60.0 * 4.35 * OFF / power && (down <= 0.0 || next < 0.05),
    }
}
