//! `chart`: labels from the scanlines to the pixels.

use super::display;
use super::inputs::{Random, samples};
use super::{Case, Check, Input, Job, Size, Subject};
use crate::reference::chart::{self, Charted};
use insonify::sim::layout::{Frame, Label, NONE};
use insonify::sim::stages;

/// Largest difference of quantities, as in `display`: white noise of 0..1, positions exact to about 1e-6 of the image.
const LEVEL: f64 = 2e-3;
/// Distance of a pixel, in samples, from a border between two results.
const EDGE: f64 = 1e-3;

pub const SUBJECT: Subject = Subject {
    tolerance: "indices exact, quantities within 2e-3 of the twin (white noise: a position error of 2e-3 samples); \
                within 1e-4 mm of the sector's edge, and within 1e-3 samples of the middle between two or of \
                a pixel's end, either side's will do",
    job,
    check,
    plant: |job, outputs| {
        job.edit(outputs, "pixel_labels", |labels: &mut [Label]| {
            let seen =
                labels.iter_mut().find(|label| label.tissue != NONE && label.place_loss[3] > 0.1);
            seen.expect("most are inside").place_loss[3] += 0.005;
        });
    },
    ..Subject::of(&stages::CHART)
};

fn job(case: Case, size: Size) -> Job {
    let frame = display::image(case, size);
    let mut random = Random(23);
    let mut labels = Vec::new();
    for i in 0..samples(&frame) {
        let mut within = || random.within(0.0, 1.0) as f32;
        let mut label = Label {
            place_loss: [within(), within(), within(), within()],
            moved_incidence: [within(), within(), within(), -1.0],
            contact: within(),
            level: within(),
            reverberation: within(),
            ..Label::default()
        };
        // Patches of some samples, of which some are not seen.
        let patch = i as u32 / 23;
        [label.true_tissue, label.true_instance] = [patch % 3, patch % 5];
        [label.tissue, label.instance] =
            if patch.is_multiple_of(7) { [NONE; 2] } else { [patch % 2, patch % 3] };
        if random.word().is_multiple_of(6) {
            label.moved_incidence[3] = random.within(0.0, 90.0) as f32;
        }
        if case == Case::NotFinite && i == 700 {
            label.level = f32::NAN;
        }
        labels.push(label);
    }
    let given = vec![Input::words("frame", &[frame]), Input::words("labels", &labels)];
    Job::of(&stages::CHART, given, Vec::new())
}

fn check(job: &Job, outputs: &[Vec<u8>]) -> Vec<Check> {
    let frame: Frame = job.one("frame");
    let labels: Vec<Label> = job.get("labels");
    let got: Vec<Label> = job.after(outputs, "pixel_labels");
    let places = crate::reference::display::places(&frame);
    let mut wrong = 0;
    for (i, (found, place)) in got.iter().zip(&places).enumerate() {
        let right = match place {
            None => agrees(found, &chart::OUTSIDE),
            Some([column, row]) => {
                let shifts = [[0.0, 0.0], [EDGE, 0.0], [-EDGE, 0.0], [0.0, EDGE], [0.0, -EDGE]];
                shifts.iter().any(|[a, b]| {
                    agrees(found, &chart::pixel(&frame, &labels, [column + a, row + b]))
                })
            }
        };
        wrong += usize::from(!right && !display::near_edge(&frame, i));
    }
    vec![
        Check::count("pixels", places.len(), wrong, 0),
        Check::equal("image size", &[got.len()], &[places.len()]),
    ]
}

fn agrees(found: &Label, twin: &Charted) -> bool {
    let indices = [found.true_tissue, found.true_instance, found.tissue, found.instance];
    let [x, y, z, loss] = found.place_loss;
    let [a, b, c, incidence] = found.moved_incidence;
    let quantities = [x, y, z, loss, a, b, c, found.contact, found.level, found.reverberation];
    let close = |(got, twin): (f32, f64)| twin.is_nan() || (f64::from(got) - twin).abs() < LEVEL;
    indices == twin.indices
        && quantities.into_iter().zip(twin.quantities).all(close)
        && match twin.incidence {
            Some(angle) => angle == f64::from(incidence),
            None => incidence < 0.0,
        }
}
