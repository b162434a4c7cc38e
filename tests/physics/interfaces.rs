//! Reflection, refraction and attenuation along traced paths.

use glam::{DAffine3, DVec3};
use insonify::reference::Segment;
use insonify::scene::{Scene, Tissue};

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

/// Worst deviation of transmitted weights from the law, in units of what is allowed: 1e-6, and what
/// 2e-7 rad of incidence make, because fluids and placements are kept in f32 and the law is steep
/// near total reflection. Impedances behind the wall are scaled by `planted`.
fn fresnel_error(planted: f64) -> f64 {
    let mut worst: f64 = 0.0;
    for (tilt, a, b, _) in incidences() {
        let through = transmitted(&wall(a, [b[0], planted * b[1]], tilt));
        let expected = fresnel(a, b, tilt);
        let slope = fresnel(a, b, tilt + 1e-7) - fresnel(a, b, tilt - 1e-7);
        let error = (through.map_or(0.0, |s| s.weight) - expected).abs();
        worst = worst.max(error / (1e-6 + slope.abs()));
    }
    worst
}

#[test]
fn what_a_wall_lets_through_is_the_fluid_fresnel_law_at_every_angle() {
    let error = fresnel_error(1.0);
    assert!(error < 1.0, "{error}");
    assert!(
        fresnel_error(1.001) > 1.0,
        "a thousandth of the impedance is noticed"
    );
}

/// Worst deviation, rad, from arcsin(c2 / c1 sin i), with sound behind the wall `planted` times as fast.
fn snell_error(planted: f64) -> f64 {
    let mut worst: f64 = 0.0;
    for (tilt, a, b, sine) in incidences() {
        let through = transmitted(&wall(a, [planted * b[0], b[1]], tilt));
        let error = match through {
            // A wall turned to +x by the tilt bends the ray from incidence to refraction.
            Some(s) if sine < 1.0 => (angle(s.direction) - (tilt - sine.asin())).abs(),
            None if sine > 1.0 => 0.0,
            _ => f64::INFINITY,
        };
        worst = worst.max(error);
    }
    worst
}

// 1e-5 rad: f32 speeds, with the arcsine's slope where the sine comes near one.
#[test]
fn refraction_is_snells_law_by_speeds_and_total_reflection_switches_there() {
    let error = snell_error(1.0);
    assert!(error < 1e-5, "{error}");
    assert!(
        snell_error(1.001) > 1e-4,
        "a thousandth of the speed is noticed"
    );
    // Fat to bone: arcsin(1440 / 3515), 0.01 degree to either side.
    let onset = (1.440f64 / 3.515).asin();
    let lets_through = |tilt| transmitted(&wall(FLUIDS[1], FLUIDS[4], tilt)).is_some();
    assert!(lets_through(onset - 0.01f64.to_radians()));
    assert!(!lets_through(onset + 0.01f64.to_radians()));
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

/// Worst relative deviation of the weights at each layer's top from 10^(-alpha f d / 10) per layer
/// and 1 - R per interface of `truth`.
fn transmission_error(scene: &Scene, truth: &Scene) -> f64 {
    let segments = &Inputs::new(scene).traced().segments[0];
    assert_eq!(segments.len(), TOPS.len() + 1);
    let (mut expected, mut worst, mut above) = (1.0, 0f64, 0.0);
    for (i, segment) in segments.iter().enumerate() {
        worst = worst.max((segment.weight / expected - 1.0).abs());
        if let Some(&top) = TOPS.get(i) {
            let [this, next] = [&truth.tissues[i], &truth.tissues[i + 1]];
            let centimetres = (top - above) / 10.0;
            expected *= 10f64.powf(-this.attenuation * truth.probe.frequency * centimetres / 10.0);
            let [z1, z2] = [this, next].map(|t| t.density * t.speed);
            expected *= 1.0 - ((z2 - z1) / (z2 + z1)).powi(2);
            above = top;
        }
    }
    worst
}

// 1e-5: the tables are f32.
#[test]
fn transmission_is_beer_lambert_times_fresnel() {
    let truth = abdominal_wall();
    let error = transmission_error(&truth, &truth);
    assert!(error < 1e-5, "{error}");
    let mut half = abdominal_wall();
    for t in &mut half.tissues {
        t.attenuation /= 2.0;
    }
    assert!(
        transmission_error(&half, &truth) > 0.1,
        "one-way amplitude is noticed"
    );
}
