//! `fuse`: the mixed image.

use super::display;
use super::inputs::{Random, samples};
use super::{Case, Check, Input, Job, Size, Subject, sizes, tiles};
use crate::reference::{display as scan, fuse, tiles as twin};
use insonify::sim::layout::{
    BLEND_LINEAR, BLEND_MULTIBAND, BLEND_SMOOTH, Frame, Fusion, TILE_ACQUIRED, TILE_SIMULATED,
};
use insonify::sim::stages;

/// Levels of 0..1 by which an interpolated value may differ, as in `display`.
const LEVEL: f64 = 2e-3;
/// Distance from the middle between two grey levels within which either level is correct: single precision of
/// numbers to 255.
const ROUNDING: f64 = 1e-4;

pub const SUBJECT: Subject = Subject {
    tolerance: "a grey level for which both images are within 2e-3 of the twin's (white noise: a position error \
                of 2e-3 samples); 1e-4 from the middle between two levels (single precision) either; within 1e-4 mm \
                of the sector's edge either side will do",
    job,
    check,
    plant: |job, outputs| {
        job.edit(outputs, "fused", |fused: &mut [u32]| {
            let inside = fused.iter_mut().find(|p| (0xff10_1010..0xffe0_e0e0).contains(*p));
            *inside.expect("most greys are between") += 0x0003_0303;
        });
    },
    size: |job, name| match name {
        "change" if job.one::<Fusion>("fusion").blend != BLEND_MULTIBAND => 0,
        "change" => 4 * display::pixels(&job.one("frame")),
        _ => sizes::of_frame(job, name),
    },
    ..Subject::of(&stages::FUSE)
};

fn job(case: Case, size: Size) -> Job {
    let frame = display::image(case, size);
    let pixels = display::pixels(&frame);
    let fusion = Fusion {
        blur: 32,
        blend: match case {
            Case::Odd => BLEND_SMOOTH,
            Case::Modes => BLEND_MULTIBAND,
            _ => BLEND_LINEAR,
        },
        ..Fusion::default()
    };
    let mut random = Random(8);
    let mut log_image = random.floats(samples(&frame), 0.0, 1.0);
    // A negative, as for `display`.
    let grey: Vec<u32> = (0..256).map(|v| 255 - v).collect();
    let mut prescan = random.floats(2 * samples(&frame), 0.0, 1.0);
    let mut background = random.floats(pixels, 0.0, 1.0);
    let sums: Vec<[f32; 2]> = (0..pixels)
        .map(|_| {
            let weight = random.within(1.0, 1024.0).floor() as f32;
            match random.word() % 4 {
                0 => [0.0, weight],
                1 => [weight, weight],
                _ => [weight * random.within(0.0, 1.0) as f32, weight],
            }
        })
        .collect();
    let change = random.floats(pixels, -0.6, 0.6);
    if case == Case::NotFinite {
        log_image[700] = f32::NAN;
        prescan[901] = f32::NAN;
        background[pixels / 2] = f32::NAN;
    }
    let both = TILE_ACQUIRED | TILE_SIMULATED;
    let bits: &[u32] = match case {
        Case::One | Case::Modes => &[both],
        _ => &[0, TILE_ACQUIRED, TILE_SIMULATED, both, both],
    };
    let given = vec![
        Input::words("frame", &[frame]),
        Input::words("fusion", &[fusion]),
        Input::floats("log_image", &log_image),
        Input::words("grey", &grey),
        Input::floats("prescan", &prescan),
        Input::words("tiles", &tiles::random(&frame, bits, &mut random)),
        Input::floats("sums", sums.as_flattened()),
        Input::floats("background", &background),
        Input::floats("change", &change),
    ];
    Job::of(&stages::FUSE, given, Vec::new())
}

/// Least and greatest level of a pixel that is right, at a place among the scanlines.
struct Right<'a> {
    frame: &'a Frame,
    log_image: Vec<f32>,
    grey: Vec<u32>,
    acquired: Vec<f32>,
}

impl Right<'_> {
    fn levels(&self, [column, row]: [f64; 2], share: f64) -> [f64; 2] {
        let acquired = scan::sample(self.frame, &self.acquired, column, row);
        let simulated = scan::sample(self.frame, &self.log_image, column, row);
        let simulated = if simulated.is_nan() { 0.0 } else { simulated };
        let index = |v: f64| (v.clamp(0.0, 1.0) * 255.0 + 0.5).floor() as usize;
        let greys = self.grey[index(simulated - LEVEL)..=index(simulated + LEVEL)].iter();
        let ends = [greys.clone().min(), greys.max()].map(|g| f64::from(*g.expect("at least one")));
        let at = |acquired: f64, simulated: f64| fuse::level(share, 255.0 * acquired, simulated);
        [at(acquired - LEVEL, ends[0]), at(acquired + LEVEL, ends[1])]
    }
}

fn check(job: &Job, outputs: &[Vec<u8>]) -> Vec<Check> {
    let (frame, fusion): (Frame, Fusion) = (job.one("frame"), job.one("fusion"));
    let prescan: Vec<[f32; 2]> = job.get("prescan");
    let expected = Right {
        frame: &frame,
        log_image: job.get("log_image"),
        grey: job.get("grey"),
        acquired: prescan.iter().map(|p| p[1]).collect(),
    };
    let kinds: Vec<u32> = job.get("tiles");
    let background: Vec<f32> = job.get("background");
    let sums: Vec<[f32; 2]> = job.get("sums");
    let change: Vec<f32> = job.get("change");
    let got: Vec<u32> = job.after(outputs, "fused");
    let places = scan::places(&frame);
    let right = |i: usize| {
        let [x, y] = [i as u32 % frame.image_width, i as u32 / frame.image_width];
        let tile = kinds[twin::of_pixel(&frame, x, y)];
        let Some(place) = places[i].filter(|_| tile & (TILE_ACQUIRED | TILE_SIMULATED) != 0) else {
            return got[i] == 0;
        };
        let [low, high] = match fusion.blend {
            BLEND_MULTIBAND => {
                let v = 255.0 * (f64::from(background[i]) + f64::from(change[i]));
                [fuse::level(1.0, v, 0.0); 2]
            }
            _ => expected.levels(place, fuse::share(&fusion, tile, sums[i])),
        };
        let [low, high] =
            [low - ROUNDING, high + ROUNDING].map(|v| (v.max(0.0) + 0.5).floor() as u32);
        (low..=high.min(255)).any(|g| got[i] == 0xff00_0000 | (g * 0x0001_0101))
    };
    let wrong = (0..places.len().min(got.len()))
        .filter(|&i| !right(i) && !display::near_edge(&frame, i))
        .count();
    vec![
        Check::count("pixels", places.len(), wrong, 0),
        Check::equal("image size", &[got.len()], &[places.len()]),
    ]
}
