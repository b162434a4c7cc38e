//! Curved interfaces between sound speeds: the paths of rays, and the places that no ray reaches.

use std::f64::consts::{FRAC_PI_2, TAU};

use glam::{DAffine3, DVec3};
use insonify::scene::{Instance, Keyframes, Mesh, Scene, Tissue};
use insonify::settings::{Loss, Refraction};
use insonify_tools::reference::Segment;

use crate::physics::check::{Bench, Check, Curve, Outcome, Physics, Picture, Plot};
use crate::physics::paths::Range;
use crate::physics::pictures::shown;
use crate::physics::render::Inputs;
use crate::physics::scenes::{add_point, linear, mirror, silent, tissue};

/// Radius of the cylinder, depth of its axis, and distance behind it at which the rays are compared, mm.
pub const RADIUS: f64 = 5.0;
pub const AXIS: f64 = 30.0;
const BEHIND: f64 = 20.0;
/// Speed around it, mm/us.
pub const AROUND: f64 = 1.540;
/// Number of sides of the prism in its place: its sides are 2 um inside the cylinder.
const SIDES: u32 = 768;

/// A cylinder along y with the cylinder's own normals, ends left open beyond the slice.
pub fn tube() -> Mesh {
    let mut mesh = Mesh { name: "tube".into(), ..Mesh::default() };
    for i in 0..SIDES {
        let (sin, cos) = (TAU * (f64::from(i) + 0.3) / f64::from(SIDES)).sin_cos();
        for y in [-41.0, 37.0] {
            let outward = DVec3::new(sin, 0.0, cos);
            let at = RADIUS * outward + DVec3::Y * y;
            mesh.positions.push(at.as_vec3().to_array());
            mesh.normals.push(outward.as_vec3().to_array());
        }
        let (a, b) = (2 * i, 2 * ((i + 1) % SIDES));
        mesh.triangles.extend([[a, b, b + 1], [a, b + 1, a + 1]]);
    }
    mesh
}

/// A scene of parallel scanlines at lateral places `from`..`to`, mm, past the cylinder; its impedance is near the
/// surrounding one, so that paths are not cut for their weight.
fn cylinder(lines: u32, [from, to]: [f64; 2], around: Tissue, inside: Tissue) -> Scene {
    let mut scene = linear(lines, to - from, around);
    scene.world_from_probe = DAffine3::from_translation(DVec3::new((from + to) / 2.0, 0.0, 0.0));
    scene.probe.depth = 60.0;
    scene.simulation.min_weight = 1e-12;
    scene.simulation.loss = Loss::Ray;
    scene.meshes.push(tube().into());
    scene.instances.push(Instance {
        name: "cylinder".into(),
        mesh: 0,
        keyframes: Keyframes::default(),
        shown: true,
        tissue: 1,
        priority: 0,
        world_from_object: DAffine3::from_translation(DVec3::new(0.0, 0.0, AXIS)),
        surface: [mirror(); 2],
    });
    scene.tissues.push(inside);
    scene
}

/// A scene for rays only, of geometric acoustics: a point far away makes paths leave segments in silence.
pub fn rays(lines: u32, between: [f64; 2], inside: f64) -> Scene {
    let (a, b) = (silent(AROUND, 1.6, 0.0), silent(inside, 1.55, 0.0));
    let mut scene = cylinder(lines, between, a, b);
    scene.simulation.refraction = Refraction::Ray;
    scene.probe.samples = 64;
    add_point(&mut scene, [0.0, 500.0, 10.0], 1.0);
    scene
}

/// Segments of every scanline, in order of time, by the twins and the tracers.
pub fn traced(bench: &Bench, scene: &Scene) -> Vec<(String, Vec<Vec<Segment>>)> {
    let mut all = vec![("twins".to_owned(), Inputs::new(scene).traced().segments)];
    for &tracer in bench.tracers {
        let shot = Range::new(bench, scene, tracer).shoot(scene);
        all.push((tracer.to_string(), shot.segments));
    }
    for line in all.iter_mut().flat_map(|(_, lines)| lines) {
        line.sort_by(|a, b| a.time.total_cmp(&b.time));
    }
    all
}

/// Lateral place of scanline `l` of `scene`, mm.
pub fn offset(scene: &Scene, l: usize) -> f64 {
    scene.world_from_probe.translation.x + scene.probe.ray(l as u32, 0).0.x
}

/// Check T20.
pub fn a_slower_cylinder_casts_the_edge_shadow_of_its_entry_angles() -> Check {
    Check {
        row: "T20",
        name: "a_slower_cylinder_casts_the_edge_shadow_of_its_entry_angles",
        claim: "A ray that enters at angle i runs a chord 2 R cos t and leaves deflected by 2 (t - i), \
            sin t = c2 / c1 sin i. Behind a slower cylinder the rays of one side end at a caustic; \
            between it and the ray that just misses lies the edge shadow.",
        planted: "Snell's law with the speeds swapped.",
        run: edge_shadow,
    }
}

/// Place and direction (x, z) of the ray of impact parameter `b` on leaving the cylinder of speed
/// `inside`, axis at the origin.
pub fn passage(b: f64, inside: f64) -> [DVec3; 2] {
    let incidence = (b / RADIUS).asin();
    let refracted = (inside / AROUND * b / RADIUS).asin();
    // Turned towards the axis where sound is slower.
    let towards = |angle: f64| DVec3::new(-angle.sin(), 0.0, angle.cos());
    let entry = DVec3::new(b, 0.0, -RADIUS * incidence.cos());
    let chord = 2.0 * RADIUS * refracted.cos();
    let exit = entry + chord * towards(incidence - refracted);
    [exit, towards(2.0 * (incidence - refracted))]
}

/// Place where the ray through `p` along `d` meets the plane BEHIND the axis, z measured from the axis.
fn behind([p, d]: [DVec3; 2]) -> f64 {
    p.x + d.x / d.z * (BEHIND - p.z)
}

fn edge_shadow(bench: &Bench, physics: Physics) -> Outcome {
    let mut out = Outcome::default();
    let slower = 1.450;
    let speed = match physics {
        Physics::Right => slower,
        Physics::Planted => AROUND * AROUND / slower,
    };
    let law = |b: f64| behind(passage(b, slower));
    // The caustic is the farthest place that the rays of one side reach on that side.
    let impact = |i: u32| RADIUS * f64::from(i) / 10_000.0;
    let caustic = (0..9_990).map(impact).map(law).fold(0.0, f64::max);
    // 521 scanlines, 0.02 mm apart.
    let scene = rays(521, [-5.21, 5.21], speed);
    let mut plot = Plot {
        title: "Rays 20 mm behind the axis of a slower cylinder".into(),
        axes: ["impact parameter, mm".into(), "place, mm".into()],
        logarithmic: [false, false],
        curves: vec![Curve {
            label: "two refractions in closed form".into(),
            points: (-480..=480).map(|i| [0.01 * f64::from(i), law(0.01 * f64::from(i))]).collect(),
            line: true,
        }],
    };
    for (name, lines) in traced(bench, &scene) {
        let (mut worst, mut turned, mut reach, mut lit) = (0f64, 0f64, 0f64, 0);
        let mut points = vec![];
        for (l, segments) in lines.iter().enumerate() {
            let b = offset(&scene, l);
            let last = segments.last().expect("a path");
            let from = last.origin - DVec3::Z * AXIS;
            let place = behind([from, last.direction]);
            points.push([b, place]);
            let own = place * b.signum();
            if b.abs() > RADIUS {
                // Past it: undisturbed.
                worst = worst.max((place - b).abs());
                continue;
            }
            let straight = segments.len() == 3 && own > 0.0;
            if straight {
                reach = reach.max(own);
            }
            lit += u32::from(own > caustic + 0.02 && own < RADIUS && straight);
            // The law's slope grows without bound towards grazing: up to 4.8 mm a micrometre of the
            // prism's sides is less than a hundredth behind.
            if b.abs() < 4.8 {
                worst = worst.max((place - law(b)).abs());
                let [_, d] = passage(b, slower);
                turned = turned.max((last.direction.x - d.x).abs());
            }
        }
        // 0.02 mm: prism for cylinder, and the spacing of the scanlines about the caustic.
        out.compare(format!("{name}: place behind, worst, mm"), worst, 0.0, 0.02);
        let what = format!("{name}: deflection, worst, rad");
        out.compare(what, turned, 0.0, 1e-3);
        out.compare(format!("{name}: caustic, mm"), reach, caustic, 0.02);
        let what = format!("{name}: rays in the shadow from {caustic:.3} to 5 mm");
        out.compare(what, f64::from(lit), 0.0, 0.5);
        plot.curves.push(Curve { label: name, points, line: false });
    }
    out.plots.push(plot);
    if physics == Physics::Right {
        out.pictures.push(picture(bench, slower));
    }
    out
}

/// Picture of the cylinder in speckle.
fn picture(bench: &Bench, speed: f64) -> Picture {
    let around = tissue(AROUND, 1.6, 0.5);
    let mut scene = cylinder(160, [-16.0, 16.0], around, tissue(speed, 1.55, 0.5));
    scene.probe.samples = 1024;
    scene.imaging.image_height = 480;
    shown(bench, "A slower cylinder in speckle, dark beside its back", &scene)
}

/// Check T21.
pub fn a_faster_cylinder_reflects_totally_beyond_its_critical_impact() -> Check {
    Check {
        row: "T21",
        name: "a_faster_cylinder_reflects_totally_beyond_its_critical_impact",
        claim: "Rays of impact parameter b > R c1 / c2 are totally reflected: sin i = b / R.",
        planted: "Speed inside a thousandth too high.",
        run: critical_impact,
    }
}

fn critical_impact(bench: &Bench, physics: Physics) -> Outcome {
    let mut out = Outcome::default();
    let faster = 1.620;
    let expected = RADIUS * AROUND / faster;
    let speed = match physics {
        Physics::Right => faster,
        Physics::Planted => 1.001 * faster,
    };
    // 0.1 um apart about the onset.
    let half = 0.01;
    // The law of a ray: a beam of finite width has no sharp onset.
    let geometric = |lines, between| {
        let mut scene = rays(lines, between, speed);
        scene.simulation.beam_footprint = false;
        scene
    };
    let scene = geometric(401, [expected - half, expected + half]);
    let wide = geometric(251, [0.0, 5.02]);
    let mut plot = Plot {
        title: "Transmission into a faster cylinder".into(),
        axes: ["impact parameter, mm".into(), "1 - R".into()],
        logarithmic: [false, false],
        curves: vec![Curve {
            label: "Fresnel".into(),
            points: (0..500)
                .map(|i| 0.01 * f64::from(i))
                .map(|b| [b, transmitted(b, faster)])
                .collect(),
            line: true,
        }],
    };
    for ((name, lines), (_, overview)) in
        traced(bench, &scene).into_iter().zip(traced(bench, &wide))
    {
        let inside = |segments: &Vec<Segment>| segments.iter().find(|s| s.instance == 0).copied();
        let mut entered = lines.iter().map(|line| inside(line).is_some());
        let count = entered.by_ref().take_while(|&e| e).count();
        let beyond = entered.filter(|&e| e).count();
        out.compare(format!("{name}: lines beyond the onset that enter"), beyond as f64, 0.0, 0.0)
            .unlike("no total reflection", (lines.len() - count - 1) as f64);
        let pitch = 2.0 * half / lines.len() as f64;
        let onset = expected - half + pitch * count as f64;
        // 1e-3 mm: the prism's sides lie up to 42 nm inside, scanlines 50 nm apart, speeds in f32 1e-7.
        out.compare(format!("{name}: onset, mm"), onset, expected, 1e-3);
        let weight = |(l, line)| [offset(&wide, l), inside(line).map_or(0.0, |s| s.weight)];
        plot.curves.push(Curve {
            label: name,
            points: overview.iter().enumerate().map(weight).collect(),
            line: false,
        });
    }
    out.plots.push(plot);
    out
}

/// Transmission 1 - R of the fluid interface at impact parameter `b`.
fn transmitted(b: f64, inside: f64) -> f64 {
    let sine = inside / AROUND * b / RADIUS;
    let incidence = (b / RADIUS).asin();
    if sine >= 1.0 || incidence >= FRAC_PI_2 {
        return 0.0;
    }
    let (front, back) = (1.6 / incidence.cos(), 1.55 / sine.asin().cos());
    4.0 * front * back / (front + back).powi(2)
}
