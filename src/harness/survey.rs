//! `survey`: the anatomy as an eye sees it.

use std::mem::size_of;

use glam::{DAffine3, DQuat, DVec2, DVec3};

use super::inputs::Random;
use super::{Case, Check, Element, Extent, Input, Job, Size, Subject, display, worlds};
use crate::reference::survey::View;
use crate::sim::layout::{Frame, Instance, Survey};
use crate::sim::placement;
use crate::sim::survey::Sight;

/// Levels by which a pixel may differ: rounding to bytes is half of one.
const LEVELS: f64 = 1.0;
/// Pixels by which a ray may miss what the twin's meets: edges.
const EDGE: f64 = 2e-3;

pub const SUBJECT: Subject = Subject {
    name: "survey",
    stems: &["survey_bvh", "survey_query"],
    tolerance: "a pixel is within one of 255 levels of the twin's (half of one is rounding), or within \
                that of what the twin sees 0.002 pixels beside it: single precision at 250 mm is good \
                to 1e-4 of a pixel",
    job,
    sizes: |job| {
        let frame: Frame = job.one("frame");
        let survey: Survey = job.one("survey");
        let mut sizes = vec![size_of::<Frame>()];
        sizes.extend(worlds::sizes(job));
        sizes.extend([
            size_of::<Survey>(),
            16 * job.get::<Instance>("instances").len(),
            4 * display::pixels(&frame),
            4 * pixels(&survey),
        ]);
        sizes
    },
    extent: |job| {
        let survey: Survey = job.one("survey");
        Extent::Threads([survey.width, survey.height, 1])
    },
    check,
    plant: |job, outputs| {
        job.edit(outputs, "picture", |picture: &mut [u32]| {
            let pixel = picture.iter_mut().find(|p| (**p & 0xff) > 0x80);
            *pixel.expect("something is bright") -= 3;
        });
    },
};

fn pixels(survey: &Survey) -> usize {
    survey.width as usize * survey.height as usize
}

fn job(case: Case, size: Size) -> Job {
    let mut frame = display::image(case, size);
    let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.1, -0.2, 0.15);
    let pose = DAffine3::from_rotation_translation(turn, DVec3::new(1.0, -2.0, 3.0));
    frame.world_from_probe = placement::rows(&pose);
    frame.probe_from_world = placement::rows(&pose.inverse());
    let world = worlds::world(case).inputs();
    let instances = world.iter().find(|i| i.name == "instances");
    let count = instances.map_or(0, |i| i.bytes.len() / size_of::<Instance>());
    let mut random = Random(21);
    let mut looks: Vec<[f32; 4]> = (0..count)
        .map(|i| {
            let mut c = || random.within(0.2, 1.0) as f32;
            [c(), c(), c(), [0.3, 1.0, 0.6, 0.0, 1.0, 0.45][i % 6]]
        })
        .collect();
    if case == Case::Modes {
        // Where surfaces coincide either may be seen.
        looks.fill([0.7, 0.4, 0.2, 0.4]);
    }
    let size = match (case, size) {
        (Case::Random, Size::Standard) => [640, 480],
        (Case::Empty, _) => [0, 5],
        (Case::One, _) => [1, 1],
        (Case::Odd, _) => [61, 43],
        _ => [48, 40],
    };
    let eye = DVec3::new(90.0, 160.0, -110.0);
    let forward = (DVec3::new(1.0, 0.0, 18.0) - eye).normalize();
    let right = forward.cross(DVec3::NEG_Z).normalize();
    let pitch = 150.0 / 220.0 / f64::from(size[0].max(size[1]));
    let sight = Sight {
        size,
        eye,
        forward,
        right: right * pitch,
        down: forward.cross(right) * pitch,
        cut: matches!(case, Case::Random | Case::Modes | Case::Empty),
        image: !matches!(case, Case::Modes),
        looks,
    };
    let mut survey = sight.constants(&frame);
    if case == Case::NotFinite {
        survey.eye[1] = f32::NAN;
    }
    let greys = Random(4).floats(display::pixels(&frame), 0.0, 255.0);
    let inside = crate::reference::display::places(&frame);
    let image: Vec<u32> = (greys.iter().zip(inside))
        .map(|(grey, place)| place.map_or(0, |_| 0xff00_0000 | (*grey as u32 * 0x0001_0101)))
        .collect();
    let mut inputs = vec![Input::words("frame", &[frame])];
    inputs.extend(world);
    inputs.extend([
        Input::words("survey", &[survey]),
        Input::floats("looks", sight.looks.as_flattened()),
        Input::words("pixels", &image),
        Input::output("picture", Element::Word, pixels(&survey)),
    ]);
    Job { inputs, push: Vec::new() }
}

fn check(job: &Job, outputs: &[Vec<u8>]) -> Vec<Check> {
    let owned = worlds::owned(job);
    let survey: Survey = job.one("survey");
    let (looks, image): (Vec<[f32; 4]>, Vec<u32>) = (job.get("looks"), job.get("pixels"));
    let view = View { world: owned.world(), survey: &survey, looks: &looks, pixels: &image };
    let picture: Vec<u32> = job.after(outputs, "picture");
    let (mut wrong, mut edges, mut clear) = (0, 0, 0);
    for (i, &pixel) in picture.iter().enumerate() {
        let (x, y) = (i as u32 % survey.width, i as u32 / survey.width);
        let place = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
        let [r, g, b, a] = pixel.to_le_bytes();
        let got = DVec3::new(r.into(), g.into(), b.into());
        clear += usize::from(a != 255);
        let apart = |off: [f64; 2]| {
            let seen = 255.0 * view.colour(place + EDGE * DVec2::from(off));
            (got - seen).abs().max_element() > LEVELS
        };
        if apart([0.0, 0.0]) {
            let around = [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]];
            edges += 1;
            wrong += usize::from(around.into_iter().all(apart));
        }
    }
    vec![
        Check::equal("size", &[picture.len()], &[pixels(&survey)]),
        Check::count("pixels", picture.len(), wrong, 0),
        Check::count("transparent pixels", picture.len(), clear, 0),
        // A hundredth is what edges may be; else the comparison excuses everything.
        Check::count("pixels at an edge", picture.len(), edges, picture.len() / 100 + 1),
    ]
}
