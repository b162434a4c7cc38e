//! Brightness behind interfaces: it belongs to the anatomy, not to the number of paths.

use insonify::scene::Scene;
use insonify::settings::{Loss, Sampling};
use insonify::sim::Tracer;

use crate::common::skip::{Lacking, skip};
use crate::physics::check::{Bench, Check, Curve, Outcome, Physics, Plot};
use crate::physics::paths::Range;
use crate::physics::pictures::shown;

/// Check T24, in a whole scene.
pub fn brightness_behind_the_abdominal_wall_does_not_depend_on_paths() -> Check {
    Check {
        row: "T24",
        name: "brightness_behind_the_abdominal_wall_does_not_depend_on_paths",
        claim: "Speckle of the liver 110 to 155 mm deep, behind skin, fat, muscle and whatever the liver \
            holds above, has one level for every number of paths and every roughness; independent \
            paths and paths that share their first stretch have the same expectation as the main path.",
        planted: "Independent paths that also refract at the sampled normals of rough interfaces.",
        run: brightness,
    }
}

/// Depths compared, mm, and least distance from other tissue: beyond the pulse and the beam's width.
const DEPTHS: [f64; 2] = [110.0, 155.0];
const MARGIN: f64 = 3.0;
const ROUGHNESS: [f64; 5] = [10.0, 100.0, 1e3, 1e4, f64::INFINITY];
const PATHS: [u32; 3] = [1, 8, 32];

/// A patient's liver behind a wall or, where the data are absent, the shipped abdomen: one layer of `lines`
/// scanlines without noise, and a name.
fn load(lines: u32) -> (&'static str, Scene) {
    let root = insonify_tools::root();
    let (name, file) = if root.join("../shared/data").exists() {
        ("liver", "tests/scenes/liver.toml")
    } else {
        skip(Lacking::Data, "no shared data: the shipped abdomen instead of a patient's liver");
        ("abdomen", "scenes/abdomen.toml")
    };
    let smaller = [
        ("probe.scanlines", lines.to_string()),
        ("probe.elevation_layers", "1".to_owned()),
        ("probe.depth", "160 mm".to_owned()),
        ("imaging.image_height", "400".to_owned()),
    ]
    .map(|(key, value)| (key.to_owned(), value));
    let (mut scene, _) = Scene::load(&root.join(file), &smaller).expect(file);
    scene.imaging.noise = f64::NEG_INFINITY;
    // Independent paths lose what they meet, which the aperture of one main path does not.
    scene.simulation.loss = Loss::Ray;
    (name, scene)
}

/// Samples of each scanline in the liver, by the times between which the transmitted path is in it.
fn liver(bench: &Bench, scene: &Scene) -> Vec<Vec<bool>> {
    let mut straight = scene.clone();
    straight.simulation.max_reflections = 0;
    straight.simulation.sampling = Sampling::MainPath;
    let shot = Range::new(bench, &straight, Tracer::Bvh).shoot(&straight);
    let probe = &scene.probe;
    let within = |k: u32, s: &insonify_tools::reference::Segment| {
        let z = f64::from(k) * probe.sample_pitch();
        let tissue = &scene.tissues[s.tissue as usize];
        let top = probe.speed * s.time;
        let bottom = top + probe.speed * s.length / tissue.speed;
        tissue.name == "liver" && z > top + MARGIN && z < bottom - MARGIN
    };
    let deep = |k: u32| (DEPTHS[0]..DEPTHS[1]).contains(&(f64::from(k) * probe.sample_pitch()));
    let line = |segments: &Vec<_>| {
        (0..probe.samples).map(|k| deep(k) && segments.iter().any(|s| within(k, s))).collect()
    };
    shot.segments.iter().map(line).collect()
}

type Image = Vec<Vec<[f64; 2]>>;

/// Mean over the mask of the real part of a times conjugate b.
fn product(mask: &[Vec<bool>], a: &Image, b: &Image) -> f64 {
    let inside = |v: &Image| -> Vec<[f64; 2]> {
        let lines = v.iter().zip(mask);
        lines
            .flat_map(|(line, mask)| line.iter().zip(mask).filter(|(_, m)| **m).map(|(v, _)| *v))
            .collect()
    };
    let (a, b) = (inside(a), inside(b));
    let terms = a.iter().zip(&b).map(|(a, b)| a[0] * b[0] + a[1] * b[1]);
    terms.sum::<f64>() / a.len() as f64
}

/// 10 lg of the mean power over the mask.
fn level(mask: &[Vec<bool>], image: &Image) -> f64 {
    10.0 * product(mask, image, image).log10()
}

/// `scene` with the roughness of all its surfaces set; none leaves them.
fn rough(scene: &Scene, roughness: Option<f64>) -> Scene {
    let mut scene = scene.clone();
    let sides = scene.instances.iter_mut().flat_map(|i| &mut i.surface);
    sides.for_each(|side| side.roughness = roughness.unwrap_or(side.roughness));
    scene
}

fn brightness(bench: &Bench, physics: Physics) -> Outcome {
    let mut out = Outcome::default();
    let (name, mut scene) = load(24);
    if physics == Physics::Planted {
        scene.simulation.rough_transmission = true;
        scene.simulation.sampling = Sampling::Plain;
    }
    levels(bench, name, &scene, physics, &mut out);
    if physics == Physics::Right {
        schemes(bench, name, load(8).1, &mut out);
        let (name, mut scene) = load(96);
        scene.simulation.paths = 8;
        out.pictures.push(shown(bench, name, &scene));
    }
    out
}

fn levels(bench: &Bench, name: &str, scene: &Scene, physics: Physics, out: &mut Outcome) {
    let mask = liver(bench, scene);
    let samples = mask.iter().flatten().filter(|m| **m).count();
    assert!(samples > 1000, "{name}: {samples} samples of liver");
    let mut most = scene.clone();
    most.simulation.paths = PATHS[PATHS.len() - 1];
    let mut range = Range::new(bench, &most, Tracer::Bvh);
    let mut straight = scene.clone();
    straight.simulation.max_reflections = 0;
    straight.simulation.rough_transmission = false;
    straight.simulation.sampling = Sampling::MainPath;
    straight.simulation.paths = 1;
    let expected = level(&mask, &range.iq(&straight));
    let mut plot = Plot {
        title: format!("Liver behind the wall, {name}"),
        axes: ["paths".into(), "level, dB re perfect mirror".into()],
        logarithmic: [true, false],
        curves: vec![Curve {
            label: "transmitted paths alone".into(),
            points: vec![[1.0, expected], [32.0, expected]],
            line: true,
        }],
    };
    let all: Vec<Option<f64>> = match physics {
        Physics::Right => std::iter::once(None).chain(ROUGHNESS.map(Some)).collect(),
        Physics::Planted => vec![Some(1e3)],
    };
    for roughness in all {
        let label =
            roughness.map_or("the scene's own roughness".to_owned(), |s| format!("roughness {s}"));
        let mut scene = rough(scene, roughness);
        let points = PATHS.map(|paths| {
            scene.simulation.paths = paths;
            let measured = level(&mask, &range.iq(&scene));
            // 0.3 dB: the possible contribution of reflected paths.
            let what = format!("{name}, {label}, N = {paths}: level, dB");
            out.compare(what, measured, expected, 0.3)
                .unlike("every second path lost", expected - 20.0 * 2f64.log10());
            [f64::from(paths), measured]
        });
        plot.curves.push(Curve { label, points: points.to_vec(), line: false });
    }
    out.plots.push(plot);
}

/// Seeds over which schemes that choose by chance are averaged, and paths of each.
const SEEDS: u32 = 48;
const FEW: u32 = 32;

/// The mean image of the other schemes, projected on the main path's. About a twentieth of all paths
/// is reflected somewhere above: the standard error of 1536 paths is 0.6 %, and 0.2 dB are four of
/// them. Many seeds of few paths: the fixed point rounds each path's share.
fn schemes(bench: &Bench, name: &str, mut scene: Scene, out: &mut Outcome) {
    // Images are linear in the paths: a coarse lattice is enough.
    scene.simulation.cell = 0.6;
    scene.simulation.paths = FEW;
    let mask = liver(bench, &scene);
    let all = [Sampling::MainPath, Sampling::Plain, Sampling::SharedPrimary];
    let with = |sampling, seed: u32| {
        let mut scene = scene.clone();
        scene.simulation.sampling = sampling;
        scene.simulation.seed = seed;
        scene
    };
    let mut ranges = all.map(|sampling| Range::new(bench, &with(sampling, 1), Tracer::Bvh));
    let mut sums = [0.0; 3];
    for seed in 1..=SEEDS {
        // The seed also determines the scatterers: each seed has a main path of its own.
        let main = ranges[0].iq(&with(all[0], seed));
        for i in 0..3 {
            let image = ranges[i].iq(&with(all[i], seed));
            sums[i] += product(&mask, &image, &main);
        }
    }
    for i in 1..3 {
        let decibel = 20.0 * (sums[i] / sums[0]).log10();
        let what = format!("{name}, {:?}: mean image over the main path's, dB", all[i]);
        out.compare(what, decibel, 0.0, 0.2).unlike("every second path lost", -20.0 * 2f64.log10());
    }
}
