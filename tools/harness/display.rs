//! `display`: scan conversion and grey map.

use super::inputs::{Random, frame, samples};
use super::{Case, Check, Input, Job, Size, Subject};
use crate::reference::display;
use insonify::sim::layout::Frame;
use insonify::sim::stages;

/// Levels by which the interpolated value may differ: positions are good to about 1e-6 of the
/// image's size, and neighbouring samples of the random image differ by up to 1.
const LEVEL: f64 = 2e-3;
/// Distance from the sector's edge, mm, at which a pixel may be on either side.
const EDGE: f64 = 1e-4;

pub const SUBJECT: Subject = Subject {
    tolerance: "a pixel shows a level within 2e-3 of the twin's (white noise: a position error of \
                2e-3 samples, 1e-6 of the image), and within 1e-4 mm of the edge either side will do",
    job,
    check,
    plant: |job, outputs| {
        job.edit(outputs, "pixels", |pixels: &mut [u32]| {
            let inside = pixels.iter_mut().find(|p| (0xff101010..0xffe0e0e0).contains(*p));
            *inside.expect("most greys are between") += 0x0002_0202;
        });
    },
    ..Subject::of(&stages::DISPLAY)
};

/// Pixels of the image.
pub(super) fn pixels(frame: &Frame) -> usize {
    frame.image_width as usize * frame.image_height as usize
}

/// The frame of a case with an image wider and taller than the sector.
pub(super) fn image(case: Case, size: Size) -> Frame {
    let mut frame = frame(case, size);
    [frame.image_width, frame.image_height] = match (case, size) {
        (Case::Random, Size::Standard) => [1024, 768],
        (Case::Empty, _) => [0, 5],
        (Case::One, _) => [1, 1],
        (Case::Odd, _) => [333, 211],
        _ => [200, 160],
    };
    frame.pixel_pitch = 70.0 / frame.image_width.max(1) as f32;
    frame.image_left = -35.0;
    frame.image_top = -12.0;
    if case == Case::One {
        frame.image_top = -30.0;
    }
    frame
}

fn job(case: Case, size: Size) -> Job {
    let frame = image(case, size);
    let mut log_image = Random(4).floats(samples(&frame), 0.0, 1.0);
    if case == Case::NotFinite {
        log_image[700] = f32::NAN;
        log_image[900..905].fill(f32::NAN);
    }
    // A negative: no two levels share a grey, and a kernel that skips the map is caught.
    let grey: Vec<u32> = (0..256).map(|v| 255 - v).collect();
    let _pixels = pixels(&frame);
    let given = vec![
        Input::words("frame", &[frame]),
        Input::floats("log_image", &log_image),
        Input::words("grey", &grey),
    ];
    Job::of(&stages::DISPLAY, given, Vec::new())
}

fn check(job: &Job, outputs: &[Vec<u8>]) -> Vec<Check> {
    let frame: Frame = job.one("frame");
    let grey: Vec<u32> = job.get("grey");
    let image: Vec<f32> = job.get("log_image");
    let got: Vec<u32> = job.after(outputs, "pixels");
    let levels = display::levels(&frame, &image);
    let index = |level: f64| (level.clamp(0.0, 1.0) * 255.0 + 0.5).floor() as usize;
    let shows = |pixel: u32, level: f64| {
        let greys = &grey[index(level - LEVEL)..=index(level + LEVEL)];
        greys.iter().any(|g| pixel == 0xff00_0000 | (g * 0x0001_0101))
    };
    let mut wrong = 0;
    for (i, (&pixel, level)) in got.iter().zip(&levels).enumerate() {
        let right = match level {
            Some(level) => shows(pixel, *level),
            None => pixel == 0,
        };
        if !right && !near_edge(&frame, i) {
            wrong += 1;
        }
    }
    vec![
        Check::count("pixels", levels.len(), wrong, 0),
        Check::equal("image size", &[got.len()], &[levels.len()]),
    ]
}

/// True if the sector's edge is within [`EDGE`] of pixel `i`.
pub(super) fn near_edge(frame: &Frame, i: usize) -> bool {
    let pitch = f64::from(frame.pixel_pitch);
    let width = frame.image_width as usize;
    let x = f64::from(frame.image_left) + ((i % width) as f64 + 0.5) * pitch;
    let z = f64::from(frame.image_top) + ((i / width) as f64 + 0.5) * pitch;
    let shifts = [(EDGE, 0.0), (-EDGE, 0.0), (0.0, EDGE), (0.0, -EDGE)];
    let inside = |dx: f64, dz: f64| display::sector(frame, x + dx, z + dz).is_some();
    shifts.iter().any(|&(dx, dz)| inside(dx, dz) != inside(0.0, 0.0))
}
