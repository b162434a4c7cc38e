//! Reflection, refraction and attenuation along traced paths.

use glam::{DAffine3, DVec3};
use insonify::probe::ProbeKind;
use insonify::scene::{Scene, Tissue};
use insonify::settings::Loss;
use insonify::sim::Tracer;
use insonify_tools::reference::Segment;

use crate::physics::check::{Bench, Check, Curve, Outcome, Physics, Plot};
use crate::physics::paths::Range;
use crate::physics::refraction::traced;
use crate::physics::render::{Inputs, angle};
use crate::physics::scenes::{add_box, add_layer, add_point, linear, silent, tissue};

/// Speed mm/us and impedance MRayl of water, fat, muscle, liver, bone, air.
const FLUIDS: [[f64; 2]; 6] = [
    [1.480, 1.480],
    [1.440, 1.340],
    [1.580, 1.650],
    [1.595, 1.690],
    [3.515, 6.500],
    [0.343, 0.0004],
];
const NAMES: [&str; 6] = ["water", "fat", "muscle", "liver", "bone", "air"];
const PAIRS: [[usize; 2]; 6] = [[0, 1], [1, 2], [2, 3], [1, 4], [4, 0], [3, 5]];

/// One scanline that meets a wall turned by `tilt` rad at 40 mm.
fn wall(before: [f64; 2], behind: [f64; 2], tilt: f64) -> Scene {
    let mut scene = linear(1, 1.0, tissue(before[0], before[1], 0.0));
    // Near total reflection, and into air, little goes through; a path that others of the aperture may light never ends.
    scene.simulation.min_weight = 1e-12;
    scene.simulation.loss = Loss::Ray;
    let place = DAffine3::from_translation(DVec3::new(0.0, 0.0, 40.0));
    // The middle of the face is on an edge between two triangles: move it aside, along the wall.
    let at = place
        * DAffine3::from_rotation_y(tilt)
        * DAffine3::from_translation(DVec3::new(3.1, 5.3, 0.0));
    add_box(&mut scene, [900.0, 900.0, 900.0], tissue(behind[0], behind[1], 0.0), at);
    scene
}

/// The transmitted segment behind the wall, if any, along each scanline.
fn transmitted(lines: &[Vec<Segment>]) -> Vec<Option<Segment>> {
    let through = |l: &Vec<Segment>| l.iter().find(|s| s.instance == 0).copied();
    lines.iter().map(through).collect()
}

/// The transmitted segment behind the wall turned by `tilt`, by the twins.
fn through(before: [f64; 2], behind: [f64; 2], tilt: f64) -> Option<Segment> {
    transmitted(&Inputs::new(&wall(before, behind, tilt)).traced().segments)[0]
}

/// Scanlines from a point, one at each whole degree, that meet a wall across the depth axis.
fn fan(before: [f64; 2], behind: [f64; 2]) -> Scene {
    let mut scene = linear(179, 1.0, silent(before[0], before[1], 0.0));
    scene.probe.kind = ProbeKind::Phased { field_of_view: 179f64.to_radians() };
    scene.probe.samples = 64;
    // Near total reflection, and into air, little goes through.
    scene.simulation.min_weight = 1e-12;
    scene.simulation.loss = Loss::Ray;
    // Near, so that the outermost scanline meets it within the image's depth.
    add_layer(&mut scene, 1.0, silent(behind[0], behind[1], 0.0));
    // Far away: it makes paths leave segments in silence.
    add_point(&mut scene, [0.0, 500.0, 10.0], 1.0);
    scene
}

/// A segment that the device transmits through a wall, with the speed and impedance behind it multiplied: tracer,
/// fluids, incidence, segment.
type Passage = (Tracer, [f64; 2], [f64; 2], f64, Option<Segment>);

fn passages(bench: &Bench, [speed, impedance]: [f64; 2]) -> Vec<Passage> {
    let mut all = vec![];
    for ([a, b], tracer) in
        PAIRS.into_iter().flat_map(|p| bench.tracers.iter().map(move |&t| (p, t)))
    {
        let (before, behind) = (FLUIDS[a], FLUIDS[b]);
        let scene = fan(before, [speed * behind[0], impedance * behind[1]]);
        let shot = Range::new(bench, &scene, tracer).shoot(&scene);
        let segments = transmitted(&shot.segments).into_iter().enumerate();
        all.extend(segments.map(|(l, segment)| {
            let incidence = angle(scene.probe.ray(l as u32, 0).1);
            (tracer, before, behind, incidence, segment)
        }));
    }
    all
}

/// For every pair and whole degree of incidence: the tilt, both fluids, and the sine behind.
fn incidences() -> impl Iterator<Item = (f64, [f64; 2], [f64; 2], f64)> {
    PAIRS.into_iter().flat_map(|[a, b]| {
        (0..90).map(move |degrees| {
            let tilt = f64::from(degrees).to_radians();
            (tilt, FLUIDS[a], FLUIDS[b], FLUIDS[b][0] / FLUIDS[a][0] * tilt.sin())
        })
    })
}

/// Transmission 4 Z1 Z2 cos i cos t / (Z2 cos i + Z1 cos t)^2, 0 at total reflection.
pub fn fresnel([c1, z1]: [f64; 2], [c2, z2]: [f64; 2], incidence: f64) -> f64 {
    let sine = c2 / c1 * incidence.sin();
    if sine >= 1.0 {
        return 0.0;
    }
    let (n1, n2) = (z1 / incidence.cos(), z2 / sine.asin().cos());
    4.0 * n1 * n2 / (n1 + n2).powi(2)
}

/// Check T1.
pub fn what_a_wall_lets_through_is_the_fluid_fresnel_law_at_every_angle() -> Check {
    Check {
        row: "T1",
        name: "what_a_wall_lets_through_is_the_fluid_fresnel_law_at_every_angle",
        claim: "Of the intensity, 4 Z1 Z2 cos i cos t / (Z2 cos i + Z1 cos t)^2 passes a plane between \
            fluids, nothing beyond the critical angle: six pairs of tissues, every whole degree. Within \
            1e-6 and what 2e-7 rad of incidence make, because fluids and placements are kept in single \
            precision and the law is steep near total reflection; three times that on the device, which rounds \
            directions, cosines and sines as well.",
        planted: "An impedance a thousandth too large behind the wall.",
        run: fresnel_law,
    }
}

/// Deviation of a transmitted weight from the law, as a multiple of the tolerance.
fn fresnel_error(weight: f64, a: [f64; 2], b: [f64; 2], incidence: f64) -> f64 {
    let slope = fresnel(a, b, incidence + 1e-7) - fresnel(a, b, incidence - 1e-7);
    (weight - fresnel(a, b, incidence)).abs() / (1e-6 + slope.abs())
}

fn fresnel_law(bench: &Bench, physics: Physics) -> Outcome {
    let planted = match physics {
        Physics::Right => 1.0,
        Physics::Planted => 1.001,
    };
    let mut worst: f64 = 0.0;
    let mut shown: Vec<[f64; 2]> = vec![];
    for (tilt, a, b, _) in incidences() {
        let weight = through(a, [b[0], planted * b[1]], tilt).map_or(0.0, |s| s.weight);
        worst = worst.max(fresnel_error(weight, a, b, tilt));
        if (tilt.to_degrees() / 3.0).fract() < 1e-9 {
            shown.push([tilt.to_degrees(), weight]);
        }
    }
    let mut out = Outcome::default();
    let what = "twins: largest deviation of the transmission, of what is allowed";
    out.compare(what, worst, 0.0, 1.0);
    let passages = passages(bench, [1.0, planted]);
    for &tracer in bench.tracers {
        let own = passages.iter().filter(|p| p.0 == tracer);
        let error = |&(_, a, b, incidence, through): &Passage| {
            fresnel_error(through.map_or(0.0, |s| s.weight), a, b, incidence.abs())
        };
        let what = format!("{tracer}: largest deviation of the transmission, of what is allowed");
        out.compare(what, own.map(error).fold(0.0, f64::max), 0.0, 3.0);
    }
    let mut curves = law_curves(|a, b, tilt| Some(fresnel(a, b, tilt)));
    curves.push(Curve::dots("twins", shown));
    let axes = ["incidence, degrees", "transmitted intensity"];
    out.plots.push(Plot::linear("Transmission through a wall", axes, curves));
    out
}

/// A law over the angle of incidence for every pair of fluids.
fn law_curves(law: fn([f64; 2], [f64; 2], f64) -> Option<f64>) -> Vec<Curve> {
    let one = |[a, b]: [usize; 2]| {
        let points = (0..360).map(|i| f64::from(i) * 0.25);
        let value = |d: f64| law(FLUIDS[a], FLUIDS[b], d.to_radians()).map(|v| [d, v]);
        let label = format!("{} to {}", NAMES[a], NAMES[b]);
        Curve::line(label, points.filter_map(value).collect())
    };
    PAIRS.into_iter().map(one).collect()
}

/// Check T2.
pub fn refraction_is_snells_law_by_speeds_and_total_reflection_switches_there() -> Check {
    Check {
        row: "T2",
        name: "refraction_is_snells_law_by_speeds_and_total_reflection_switches_there",
        claim: "sin t / c2 = sin i / c1, for six pairs of tissues at every whole degree, within 1e-5 \
            rad (speeds are kept in single precision, and the arcsine is steep near one); total \
            reflection from arcsin(c1 / c2) on, 24.19 degrees from fat to bone, to 0.01 degree.",
        planted: "A speed a thousandth too large behind the wall.",
        run: snells_law,
    }
}

/// Angle of refraction, rad; none at total reflection.
fn snell([c1, _]: [f64; 2], [c2, _]: [f64; 2], incidence: f64) -> Option<f64> {
    let sine = c2 / c1 * incidence.sin();
    (sine < 1.0).then(|| sine.asin())
}

/// Error of an angle of refraction, rad; infinite where only one of the two is totally reflected.
fn snell_error(refracted: Option<f64>, a: [f64; 2], b: [f64; 2], incidence: f64) -> f64 {
    match (refracted, snell(a, b, incidence)) {
        (Some(got), Some(expected)) => (got - expected).abs(),
        (None, None) => 0.0,
        _ => f64::INFINITY,
    }
}

fn snells_law(bench: &Bench, physics: Physics) -> Outcome {
    let planted = match physics {
        Physics::Right => 1.0,
        Physics::Planted => 1.001,
    };
    let mut out = Outcome::default();
    let mut worst: f64 = 0.0;
    let mut shown: Vec<[f64; 2]> = vec![];
    for (tilt, a, b, _) in incidences() {
        let through = through(a, [planted * b[0], b[1]], tilt);
        // A wall turned to +x by the tilt bends the ray from incidence to refraction.
        let refracted = through.map(|s| tilt - angle(s.direction));
        worst = worst.max(snell_error(refracted, a, b, tilt));
        if let Some(t) = refracted.filter(|_| (tilt.to_degrees() / 3.0).fract() < 1e-9) {
            shown.push([tilt.to_degrees(), t.to_degrees()]);
        }
    }
    out.compare("twins: largest error of refraction, rad", worst, 0.0, 1e-5);
    let passages = passages(bench, [planted, 1.0]);
    for &tracer in bench.tracers {
        let own = passages.iter().filter(|p| p.0 == tracer);
        let error = |&(_, a, b, incidence, through): &Passage| {
            // The fan bends to both sides of the wall's normal.
            let refracted = through.map(|s| angle(s.direction).abs());
            snell_error(refracted, a, b, incidence.abs())
        };
        let what = format!("{tracer}: largest error of refraction, rad");
        out.compare(what, own.map(error).fold(0.0, f64::max), 0.0, 1e-5);
    }
    let bone = [planted * FLUIDS[4][0], FLUIDS[4][1]];
    let onset = (FLUIDS[1][0] / FLUIDS[4][0]).asin();
    for (side, passes) in [(-0.01f64, 1.0), (0.01, 0.0)] {
        let scene = wall(FLUIDS[1], bone, onset + side.to_radians());
        for (name, lines) in traced(bench, &scene) {
            let got = transmitted(&lines).iter().flatten().count();
            let what =
                format!("{name}: rays from fat into bone {side} degree from the critical angle");
            let figure = out.compare(what, got as f64, passes, 0.0);
            figure.unlike("a speed a thousandth too small behind the wall", 1.0);
        }
    }
    let mut curves = law_curves(|a, b, i| snell(a, b, i).map(f64::to_degrees));
    curves.push(Curve::dots("twins", shown));
    let axes = ["incidence, degrees", "refraction, degrees"];
    out.plots.push(Plot::linear("Refraction at a wall", axes, curves));
    out
}

fn shipped(name: &str) -> Tissue {
    Tissue::shipped(name).unwrap_or_else(|| panic!("no {name}"))
}

/// The abdominal wall down to the liver: tops of the layers below the first, mm.
const TOPS: [f64; 3] = [2.5, 17.0, 31.0];

fn abdominal_wall() -> Scene {
    let mut scene = linear(1, 1.0, shipped("skin"));
    for (top, name) in TOPS.into_iter().zip(["fat", "muscle", "liver"]) {
        add_layer(&mut scene, top, shipped(name));
    }
    scene
}

/// Check T4.
pub fn transmission_is_beer_lambert_times_fresnel() -> Check {
    Check {
        row: "T4",
        name: "transmission_is_beer_lambert_times_fresnel",
        claim: "Through skin, fat and muscle to the liver, a path keeps 10^(-alpha f d / 10) of its \
            one-way intensity per layer and 1 - ((Z2 - Z1) / (Z2 + Z1))^2 per interface. 1e-5: the \
            tables are in single precision.",
        planted: "Half the attenuation in dB: that of one-way amplitude.",
        run: transmission,
    }
}

fn transmission(bench: &Bench, physics: Physics) -> Outcome {
    let truth = abdominal_wall();
    let mut scene = abdominal_wall();
    if physics == Physics::Planted {
        for t in &mut scene.tissues {
            t.attenuation /= 2.0;
        }
    }
    let mut out = Outcome::default();
    let (weights, line) = weights(&truth);
    let decibels = |weight: f64| 10.0 * weight.log10();
    let mut curves = vec![Curve::line("attenuation and transmission", line)];
    for (name, lines) in traced(bench, &scene) {
        let got = &lines[0];
        assert_eq!(got.len(), weights.len(), "{name}: a segment for each tissue");
        let entered = weights.iter().zip(got.iter().zip(&truth.tissues));
        // A path begins with a weight of 1.
        for ((_, expected), (segment, tissue)) in entered.skip(1) {
            let what = format!("{name}: weight on entering {}", tissue.name);
            out.compare(what, segment.weight, *expected, 1e-5 * expected);
        }
        let dots = weights.iter().zip(got).map(|((top, _), s)| [*top, decibels(s.weight)]);
        curves.push(Curve::dots(format!("{name}, on entering a tissue"), dots.collect()));
    }
    out.plots.push(Plot::linear(
        "Weight of a path through the abdominal wall",
        ["depth, mm", "weight, dB"],
        curves,
    ));
    out
}

/// Top of every layer with the weight below it, and the weight in dB over depth.
fn weights(truth: &Scene) -> (Vec<(f64, f64)>, Vec<[f64; 2]>) {
    let decibels = |weight: f64| 10.0 * weight.log10();
    let (mut weight, mut above) = (1.0, 0.0);
    let (mut entering, mut line) = (vec![(0.0, 1.0)], vec![[0.0, 0.0]]);
    for (i, top) in TOPS.into_iter().enumerate() {
        let [this, next] = [&truth.tissues[i], &truth.tissues[i + 1]];
        let centimetres = (top - above) / 10.0;
        weight *= 10f64.powf(-this.attenuation * truth.probe.frequency * centimetres / 10.0);
        line.push([top, decibels(weight)]);
        let [z1, z2] = [this, next].map(|t| t.density * t.speed);
        weight *= 1.0 - ((z2 - z1) / (z2 + z1)).powi(2);
        line.push([top, decibels(weight)]);
        entering.push((top, weight));
        above = top;
    }
    (entering, line)
}
