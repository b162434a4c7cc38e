//! Strips of scanlines behind surfaces that part their paths or bring them together.

use std::rc::Rc;

use glam::{DAffine3, DVec2, DVec3};
use insonify::scene::Scene;
use insonify::settings::{Loss, Refraction};
use insonify_tools::reference::Segment;

use crate::common::moments::{decibel, mean};
use crate::physics::check::{Bench, Check, Curve, Outcome, Physics, Plot};
use crate::physics::interfaces::fresnel;
use crate::physics::refraction::{AROUND, RADIUS, offset, passage, traced};
use crate::physics::render::{Frame, twin_of};
use crate::physics::scenes::{add_box, add_sphere, tissue};
use crate::physics::speckle::homogeneous;

/// Check T39.
pub fn speckle_is_as_bright_however_refraction_parts_the_paths() -> Check {
    Check {
        row: "T39",
        name: "speckle_is_as_bright_however_refraction_parts_the_paths",
        claim: "The energy between the paths of two neighbouring scanlines, a ray tube, stays between them, and what they \
            enclose of scatterers grows as they part: the mean level does not depend on their distance, but on what surfaces \
            let through and how much tissue a pulse covers. A strip is as wide as its tube: cos t / cos i times the pitch in a \
            slab met at 65 degrees, the pitch again behind it, and what two refractions leave behind a ball. Levels within \
            0.5 dB, and no line behind a ball that is darker than chance makes it.",
        planted: "Strips as wide as the scanlines are apart.",
        run: |bench, physics| {
            let mut out = Outcome::default();
            let whole = free_images(bench);
            slab(bench, physics, &whole, &mut out);
            for (i, speed) in [1.450, 1.640].into_iter().enumerate() {
                ball(bench, physics, &whole, speed, &mut out);
                out.plots[i].title = format!("Behind a ball of {speed} mm/us");
            }
            out
        },
    }
}

const LINES: u32 = 80;
/// Distance of scanlines, mm.
const PITCH: f64 = 0.3;
const IMPEDANCE: f64 = 1.630;
/// Lines as far from the middle count, mm.
const COUNTED: f64 = 4.0;
/// Depths behind the bodies, mm.
const BEHIND: [f64; 2] = [40.0, 52.0];
/// Depths at which the slab's first face meets the middle, mm, and the slab's thickness.
const SLAB: [f64; 2] = [14.0, 6.0];
/// Radius of the balls and the depth of their middles, mm.
const BALL: [f64; 2] = [8.0, 12.0];
const SEEDS: u32 = 8;

/// Speckle of geometric acoustics, whose levels depend on nothing but strips.
fn free(seed: u32) -> Scene {
    let mut scene = homogeneous(LINES, PITCH, seed);
    scene.tissues[0] = tissue(AROUND, IMPEDANCE, 0.0);
    (scene.probe.speed, scene.probe.depth, scene.probe.samples) = (AROUND, 56.0, 1024);
    (scene.simulation.refraction, scene.simulation.loss) = (Refraction::Ray, Loss::Ray);
    scene
}

/// Scanlines that count, with their lateral places, mm.
fn counted() -> Vec<(usize, f64)> {
    let scene = free(0);
    let lines = (0..LINES as usize).map(|l| (l, offset(&scene, l)));
    lines.filter(|(_, place)| place.abs() < COUNTED).collect()
}

/// The image of the device; of the twins where strips are planted.
fn shown(bench: &Bench, physics: Physics, scene: &Scene) -> Rc<Frame> {
    match physics {
        Physics::Right => (bench.renderers[1].1)(scene),
        Physics::Planted => Rc::new(twin_of(scene, |s: &mut Segment| s.strip = [PITCH, 0.0])),
    }
}

/// Mean power of each scanline that counts, between two depths that go by its place, over images of all seeds.
fn powers(frames: &[Rc<Frame>], depths: impl Fn(f64) -> [f64; 2]) -> Vec<f64> {
    let pitch = free(0).probe.sample_pitch();
    let of = |(l, place): (usize, f64)| {
        let [from, to] = depths(place).map(|z| (z / pitch) as usize);
        let samples = frames.iter().flat_map(|frame| &frame.iq[l][from..to]);
        mean(&samples.map(|v| v[0] * v[0] + v[1] * v[1]).collect::<Vec<_>>())
    };
    counted().into_iter().map(of).collect()
}

/// Images without a body, by the device.
fn free_images(bench: &Bench) -> Vec<Rc<Frame>> {
    (0..SEEDS).map(|seed| shown(bench, Physics::Right, &free(seed))).collect()
}

/// Distance of the neighbouring path `x` mm behind a segment's start, over the scanlines'.
fn parted(segment: &Segment, physics: Physics, x: f64) -> f64 {
    match physics {
        Physics::Right => (segment.strip[0] + x * segment.strip[1]).abs() / PITCH,
        Physics::Planted => 1.0,
    }
}

fn slab(bench: &Bench, physics: Physics, whole: &[Rc<Frame>], out: &mut Outcome) {
    let (incidence, speed) = (65f64.to_radians(), 1.450);
    let [entry, thickness] = SLAB;
    let scene = |seed: u32| {
        let mut scene = free(seed);
        let at = DAffine3::from_translation(DVec3::new(0.0, 0.0, entry))
            * DAffine3::from_rotation_y(incidence);
        add_box(&mut scene, [100.0, 100.0, thickness], tissue(speed, IMPEDANCE, 0.0), at);
        scene
    };
    let refracted = (speed / AROUND * incidence.sin()).asin();
    let wider = refracted.cos() / incidence.cos();
    for (name, lines) in traced(bench, &scene(0)) {
        let mut worst = 0.0_f64;
        for (l, _) in counted() {
            let last = lines[l].last().expect("behind the slab");
            let inside = lines[l].iter().find(|s| s.tissue == 1).expect("in the slab");
            for (segment, expected) in [(inside, wider), (last, 1.0)] {
                let ratio = parted(segment, physics, 5.0) / expected;
                worst = worst.max((ratio - 1.0).abs());
            }
        }
        out.compare(format!("{name}: slab: a strip's width, worst error"), worst, 0.0, 2e-3);
    }
    let frames: Vec<_> = (0..SEEDS).map(|seed| shown(bench, physics, &scene(seed))).collect();
    // Down to where the path of a scanline leaves the slab, in depths of the image.
    let within = |place: f64| {
        let begin = entry - place * incidence.tan();
        [begin + 1.5, begin + thickness / refracted.cos() * AROUND / speed - 1.5]
    };
    let through = 2.0 * decibel(fresnel([AROUND, IMPEDANCE], [speed, IMPEDANCE], incidence));
    let level = |depths: &dyn Fn(f64) -> [f64; 2]| {
        decibel(mean(&powers(&frames, depths)) / mean(&powers(whole, depths)))
    };
    let inside = decibel(speed / AROUND) + through;
    out.compare("bvh: level in the slab, dB", level(&within), inside, 0.5)
        .unlike("strips that hear as many scatterers as their width says", inside + decibel(wider));
    out.compare("bvh: level behind the slab, dB", level(&|_| BEHIND), 2.0 * through, 0.5)
        .unlike("strips behind it as wide as in it", 2.0 * through + decibel(wider));
}

/// Distance of rays of neighbouring impact parameters, for each mm between these, at the distance `x` behind a ball whose
/// middle is the origin.
fn tube_width(b: f64, speed: f64, x: f64) -> f64 {
    let scale = BALL[0] / RADIUS;
    let at = |b: f64| {
        let [p, d] = passage(b / scale, speed);
        [DVec2::new(p.x, p.z) * scale, DVec2::new(d.x, d.z)]
    };
    let step = 1e-4;
    let [[p1, d1], [p2, d2], [_, d]] = [at(b - step), at(b + step), at(b)];
    let apart = (p2 - p1) + x * (d2 - d1);
    (apart.dot(DVec2::new(d.y, -d.x)) / (2.0 * step)).abs()
}

fn ball(bench: &Bench, physics: Physics, whole: &[Rc<Frame>], speed: f64, out: &mut Outcome) {
    let scene = |seed: u32| {
        let mut scene = free(seed);
        let centre = DVec3::new(0.0, 0.0, BALL[1]);
        add_sphere(&mut scene, BALL[0], tissue(speed, IMPEDANCE, 0.0), centre);
        scene
    };
    let mut plot = Plot::linear("", ["place on the face, mm", "distance over the pitch"], vec![]);
    for (name, lines) in traced(bench, &scene(0)) {
        let mut worst = 0.0_f64;
        let mut points = Vec::new();
        for (l, place) in counted() {
            let last = lines[l].last().expect("behind the ball");
            for x in [0.0, 25.0] {
                let ratio = parted(last, physics, x) / tube_width(place, speed, x);
                worst = worst.max((ratio - 1.0).abs());
            }
            points.push([place, parted(last, physics, 25.0)]);
        }
        let what = format!("{name}: ball of {speed}: a strip's width, worst error");
        out.compare(what, worst, 0.0, 0.03);
        plot.curves.push(Curve::dots(format!("{name}, 25 mm behind it"), points));
    }
    let places = (-40..=40).map(|i| 0.1 * f64::from(i));
    let law = places.map(|b| [b, tube_width(b, speed, 25.0)]).collect();
    plot.curves.push(Curve::line("two refractions in closed form", law));
    out.plots.push(plot);

    let frames: Vec<_> = (0..SEEDS).map(|seed| shown(bench, physics, &scene(seed))).collect();
    let found = powers(&frames, |_| BEHIND);
    let expected = mean(&powers(whole, |_| BEHIND));
    let level = decibel(mean(&found) / expected);
    let figure = out.compare(format!("bvh: level behind the ball of {speed}, dB"), level, 0.0, 0.5);
    // Fixed strips that paths leave without hearing more than once are as bright.
    let ratio = tube_width(0.0, speed, 26.0);
    figure.unlike("strips that hear as many scatterers as their width says", decibel(ratio));
    if speed < AROUND {
        let darkest = found.iter().copied().fold(f64::INFINITY, f64::min);
        let what = format!("bvh: darkest line behind the ball of {speed}, dB");
        out.compare(what, decibel(darkest / expected), 0.0, 1.2);
    }
}
