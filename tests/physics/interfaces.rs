//! Reflection, refraction and attenuation along traced paths.

use glam::{DAffine3, DVec3};
use insonify::reference::Segment;
use insonify::scene::{Scene, Tissue};

use crate::check::{Bench, Check, Curve, Outcome, Physics, Plot};
use crate::render::{Inputs, angle};
use crate::scenes::{add_box, add_layer, linear, tissue};

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

/// One line that meets a wall turned by `tilt` rad at 40 mm.
fn wall(before: [f64; 2], behind: [f64; 2], tilt: f64) -> Scene {
    let mut scene = linear(1, 1.0, tissue(before[0], before[1], 0.0));
    scene.simulation.min_weight = 0.0;
    let place = DAffine3::from_translation(DVec3::new(0.0, 0.0, 40.0));
    // The middle of the face is on an edge between two triangles: move it aside, along the wall.
    let at = place
        * DAffine3::from_rotation_y(tilt)
        * DAffine3::from_translation(DVec3::new(3.1, 5.3, 0.0));
    add_box(
        &mut scene,
        [900.0, 900.0, 900.0],
        tissue(behind[0], behind[1], 0.0),
        at,
    );
    scene
}

/// What goes through the wall, if anything.
fn transmitted(scene: &Scene) -> Option<Segment> {
    let segments = Inputs::new(scene).traced().segments;
    segments[0].iter().find(|s| s.instance == 0).copied()
}

/// For every pair and whole degree of incidence: the tilt, both fluids, and the sine behind.
fn incidences() -> impl Iterator<Item = (f64, [f64; 2], [f64; 2], f64)> {
    PAIRS.into_iter().flat_map(|[a, b]| {
        (0..90).map(move |degrees| {
            let tilt = f64::from(degrees).to_radians();
            (
                tilt,
                FLUIDS[a],
                FLUIDS[b],
                FLUIDS[b][0] / FLUIDS[a][0] * tilt.sin(),
            )
        })
    })
}

/// 4 Z1 Z2 cos i cos t / (Z2 cos i + Z1 cos t)^2, 0 at total reflection.
fn fresnel([c1, z1]: [f64; 2], [c2, z2]: [f64; 2], incidence: f64) -> f64 {
    let sine = c2 / c1 * incidence.sin();
    if sine >= 1.0 {
        return 0.0;
    }
    let (n1, n2) = (z1 / incidence.cos(), z2 / sine.asin().cos());
    4.0 * n1 * n2 / (n1 + n2).powi(2)
}

/// T1.
pub fn what_a_wall_lets_through_is_the_fluid_fresnel_law_at_every_angle() -> Check {
    Check {
        row: "T1",
        name: "what_a_wall_lets_through_is_the_fluid_fresnel_law_at_every_angle",
        claim: "Of the intensity, 4 Z1 Z2 cos i cos t / (Z2 cos i + Z1 cos t)^2 passes a plane between \
            fluids, nothing beyond the critical angle: six pairs of tissues, every whole degree. Within \
            1e-6 and what 2e-7 rad of incidence make, because fluids and placements are kept in single \
            precision and the law is steep near total reflection.",
        planted: "An impedance a thousandth too large behind the wall.",
        run: fresnel_law,
    }
}

fn fresnel_law(_: &Bench, physics: Physics) -> Outcome {
    let planted = match physics {
        Physics::Right => 1.0,
        Physics::Planted => 1.001,
    };
    let mut worst: f64 = 0.0;
    let mut shown: Vec<[f64; 2]> = vec![];
    for (tilt, a, b, _) in incidences() {
        let through = transmitted(&wall(a, [b[0], planted * b[1]], tilt));
        let weight = through.map_or(0.0, |s| s.weight);
        let slope = fresnel(a, b, tilt + 1e-7) - fresnel(a, b, tilt - 1e-7);
        worst = worst.max((weight - fresnel(a, b, tilt)).abs() / (1e-6 + slope.abs()));
        if (tilt.to_degrees() / 3.0).fract() < 1e-9 {
            shown.push([tilt.to_degrees(), weight]);
        }
    }
    let mut out = Outcome::default();
    let what = "twins: largest deviation of the transmission, of what is allowed";
    out.compare(what, worst, 0.0, 1.0);
    let mut curves = law_curves(|a, b, tilt| Some(fresnel(a, b, tilt)));
    curves.push(Curve::dots("twins", shown));
    let axes = ["incidence, degrees", "transmitted intensity"];
    out.plots
        .push(Plot::linear("Transmission through a wall", axes, curves));
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

/// T2.
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

/// Angle of refraction, rad, unless all is reflected.
fn snell([c1, _]: [f64; 2], [c2, _]: [f64; 2], incidence: f64) -> Option<f64> {
    let sine = c2 / c1 * incidence.sin();
    (sine < 1.0).then(|| sine.asin())
}

fn snells_law(_: &Bench, physics: Physics) -> Outcome {
    let planted = match physics {
        Physics::Right => 1.0,
        Physics::Planted => 1.001,
    };
    let mut out = Outcome::default();
    let mut worst: f64 = 0.0;
    let mut shown: Vec<[f64; 2]> = vec![];
    for (tilt, a, b, _) in incidences() {
        let through = transmitted(&wall(a, [planted * b[0], b[1]], tilt));
        // A wall turned to +x by the tilt bends the ray from incidence to refraction.
        let refracted = through.map(|s| tilt - angle(s.direction));
        let error = match (refracted, snell(a, b, tilt)) {
            (Some(got), Some(expected)) => (got - expected).abs(),
            (None, None) => 0.0,
            _ => f64::INFINITY,
        };
        worst = worst.max(error);
        if let Some(t) = refracted.filter(|_| (tilt.to_degrees() / 3.0).fract() < 1e-9) {
            shown.push([tilt.to_degrees(), t.to_degrees()]);
        }
    }
    out.compare("twins: largest error of refraction, rad", worst, 0.0, 1e-5);
    let bone = [planted * FLUIDS[4][0], FLUIDS[4][1]];
    let onset = (FLUIDS[1][0] / FLUIDS[4][0]).asin();
    for (side, passes) in [(-0.01f64, 1.0), (0.01, 0.0)] {
        let through = transmitted(&wall(FLUIDS[1], bone, onset + side.to_radians()));
        let what = format!("twins: rays through fat to bone {side} degree from the critical angle");
        out.compare(what, f64::from(u8::from(through.is_some())), passes, 0.0);
    }
    let mut curves = law_curves(|a, b, i| snell(a, b, i).map(f64::to_degrees));
    curves.push(Curve::dots("twins", shown));
    let axes = ["incidence, degrees", "refraction, degrees"];
    out.plots
        .push(Plot::linear("Refraction at a wall", axes, curves));
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

/// T4.
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

fn transmission(_: &Bench, physics: Physics) -> Outcome {
    let truth = abdominal_wall();
    let mut scene = abdominal_wall();
    if physics == Physics::Planted {
        for t in &mut scene.tissues {
            t.attenuation /= 2.0;
        }
    }
    let segments = &Inputs::new(&scene).traced().segments[0];
    let mut out = Outcome::default();
    let layers = TOPS.len() as f64 + 1.0;
    out.compare("twins: segments", segments.len() as f64, layers, 0.0);
    let decibels = |weight: f64| 10.0 * weight.log10();
    let (mut expected, mut above) = (1.0, 0.0);
    let (mut line, mut dots) = (vec![[0.0, 0.0]], vec![]);
    for (i, segment) in segments.iter().enumerate() {
        let what = format!("twins: weight on entering {}", truth.tissues[i].name);
        out.compare(what, segment.weight, expected, 1e-5 * expected);
        dots.push([above, decibels(segment.weight)]);
        if let Some(&top) = TOPS.get(i) {
            let [this, next] = [&truth.tissues[i], &truth.tissues[i + 1]];
            let centimetres = (top - above) / 10.0;
            expected *= 10f64.powf(-this.attenuation * truth.probe.frequency * centimetres / 10.0);
            line.push([top, decibels(expected)]);
            let [z1, z2] = [this, next].map(|t| t.density * t.speed);
            expected *= 1.0 - ((z2 - z1) / (z2 + z1)).powi(2);
            line.push([top, decibels(expected)]);
            above = top;
        }
    }
    out.plots.push(Plot::linear(
        "Weight of a path through the abdominal wall",
        ["depth, mm", "weight, dB"],
        vec![
            Curve::line("attenuation and transmission", line),
            Curve::dots("twins, on entering a tissue", dots),
        ],
    ));
    out
}
