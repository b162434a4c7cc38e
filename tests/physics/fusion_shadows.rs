//! Shadows of simulated anatomy in the acquired volume.

use std::sync::Arc;

use glam::{DAffine3, DVec3};
use insonify::scene::fusion::Acquired;
use insonify::scene::{Scene, Tissue};
use insonify::settings::{Blend, Fusion, MaskSpeed, Surroundings};
use insonify::sim::{Simulator, Tracer, shaders::Library};
use insonify::volume::Voxels;

use crate::physics::check::{Bench, Check, Curve, Outcome, Physics, Plot};
use crate::physics::scenes::{add_box, linear, silent};

/// Check T30.
pub fn a_slab_throws_its_shadow_into_the_volume() -> Check {
    Check {
        row: "T30",
        name: "a_slab_throws_its_shadow_into_the_volume",
        claim: "Behind a slab inside the mask, at normal incidence, a volume of one grey level is darker \
            by 2 (alpha - alpha_0) f d, alpha_0 that of the tissue in front of the mask, plus \
            20 log10 of (1 - R)^2 for its two faces, within 0.02 dB (0.05 dB where the slope changes between \
            two samples); the mask's own tissue counts over \
            its own thickness, and nothing changes behind the mask. Behind bone it is black, behind \
            fluid as it was; in front nothing changes, and neither does the simulation, to the last bit.",
        planted: "Absorption on the way there only.",
        run: slabs,
    }
}

const DEPTH: f64 = 50.0;
/// Depth of the front face and thickness, mm, of the mask and of a slab in it.
const MASK: [f64; 2] = [8.0, 30.0];
const SLAB: [f64; 2] = [16.0, 6.0];
/// Grey level of the volume.
const LEVEL: f32 = 0.9;
/// Attenuation around the mask, dB/(cm MHz).
const AROUND: f64 = 0.5;

/// A slab of `slab` in a mask of `host`.
fn scene(host: Tissue, slab: Tissue) -> Scene {
    let mut scene = linear(24, 24.0, silent(1.54, 1.63, AROUND));
    scene.probe.depth = DEPTH;
    scene.probe.samples = 1000;
    scene.probe.elevation_layers = 3;
    scene.imaging.image_height = 250;
    for ([top, thickness], tissue, width) in [(MASK, host, 200.0), (SLAB, slab, 150.0)] {
        let at = DAffine3::from_translation(DVec3::new(3.1, 5.3, top));
        add_box(&mut scene, [width, width, thickness], tissue, at);
    }
    scene.volume = Some(Acquired {
        size: [2, 2, 2],
        volumes: vec![Arc::new(Voxels::F32(vec![LEVEL; 8]))],
        now: 0,
        sequence: None,
        world_from_voxel: DAffine3::from_translation(DVec3::splat(-300.0))
            * DAffine3::from_scale(DVec3::splat(600.0)),
        world_from_lps: DAffine3::IDENTITY,
        black: 0.0,
        white: 1.0,
    });
    scene.fusion = Some(Fusion {
        masks: vec![0],
        surroundings: Surroundings::Volume,
        blur: 32,
        blend: Blend::Linear,
        mask_speed: MaskSpeed::Enclosing,
        background_shadows: true,
    });
    scene
}

/// Result of a frame, pixel by pixel.
struct Shown {
    background: Vec<f32>,
    simulated: Vec<u8>,
}

fn shoot(simulator: &mut Simulator, scene: &Scene) -> Shown {
    simulator.frame(scene, 0).expect("a frame");
    let steps = simulator.fusion_steps().expect("read").expect("fused");
    Shown { background: steps.background, simulated: steps.simulated }
}

/// Levels of the middle column down the image, and their depths, mm.
fn column(shown: &Shown) -> Vec<[f64; 2]> {
    let width = shown.background.len() / 250;
    let at = |j: usize| f64::from(shown.background[j * width + width / 2]);
    (0..250).map(|j| [(j as f64 + 0.5) * DEPTH / 250.0, at(j)]).collect()
}

/// Expected change along the image's depths, dB; depths are computed with the probe's own speed.
fn expected(scene: &Scene, depth: f64, physics: Physics) -> f64 {
    let [around, host, slab] = [0, 1, 2].map(|i| &scene.tissues[i]);
    let passes = |a: &Tissue, b: &Tissue| {
        let (a, b) = (a.speed * a.density, b.speed * b.density);
        20.0 * (1.0 - ((a - b) / (a + b)).powi(2)).log10()
    };
    let front = SLAB[0] - MASK[0];
    let rest = MASK[1] - front - SLAB[1];
    let mut at = MASK[0];
    let mut change = 0.0;
    for (tissue, before, thickness) in [
        (host, around, front),
        (slab, host, SLAB[1]),
        (host, slab, rest),
        (around, host, f64::INFINITY),
    ] {
        if depth < at {
            break;
        }
        // In the image a slower medium is thicker.
        let stretch = scene.probe.speed / tissue.speed;
        let inside = (depth - at).min(thickness * stretch) / stretch;
        let excess = tissue.attenuation - AROUND;
        let ways = if physics == Physics::Right { 2.0 } else { 1.0 };
        let absorbed = match thickness.is_finite() {
            true => ways * excess * scene.probe.frequency * inside / 10.0,
            false => 0.0,
        };
        change += passes(before, tissue) - absorbed;
        at += thickness * stretch;
    }
    change
}

fn slabs(bench: &Bench, physics: Physics) -> Outcome {
    let mut out = Outcome::default();
    let level = LEVEL;
    let plain = || silent(1.54, 1.63, AROUND);
    let other = || silent(1.50, 1.58, 0.9);
    let cases = [
        ("slab", scene(plain(), silent(1.60, 1.80, 2.0))),
        ("slower slab in another host", scene(other(), silent(1.45, 1.38, 1.4))),
        ("fluid", scene(plain(), silent(1.54, 1.63, 0.0))),
        ("bone", scene(plain(), silent(3.2, 6.0, 20.0))),
    ];
    for tracer in [Tracer::Bvh, Tracer::RayQuery] {
        let library = Library::embedded();
        let mut simulator =
            Simulator::new(&bench.device, &library, &cases[0].1, tracer).expect("a simulator");
        for (what, with) in &cases {
            let mut without = with.clone();
            without.fusion.as_mut().expect("made").background_shadows = false;
            let [shaded, clear] = [with, &without].map(|scene| shoot(&mut simulator, scene));
            let range = with.imaging.dynamic_range;
            let shade =
                |z| (f64::from(level) + expected(with, z, physics).min(0.0) / range).max(0.0);
            let departures = column(&shaded).into_iter().map(|[depth, shown]| {
                // A surface lies somewhere between two samples, 0.05 mm apart.
                let [a, b] = [depth - 0.06, depth + 0.06].map(shade);
                match (a - b).abs() * range > 0.5 {
                    true => (a.min(b) - shown).max(shown - a.max(b)),
                    false => (shown - shade(depth)).abs(),
                }
            });
            let worst = departures.fold(0.0, f64::max) * range;
            let behind = column(&shaded)[245][1] - f64::from(level);
            let total = expected(with, 49.0, physics);
            let limited = total.clamp(-f64::from(level) * range, 0.0);
            let name = format!("{tracer}, {what}: largest departure down the image, dB");
            out.compare(name, worst, 0.0, 0.05)
                .unlike("brighter behind what absorbs less", total - limited);
            let name = format!("{tracer}, {what}: change at the bottom, dB");
            out.compare(name, behind * range, limited, 0.02)
                .unlike("brighter behind what absorbs less, and darker than black", total);
            let pixels = shaded.background.len();
            let front = (MASK[0] / DEPTH * pixels as f64) as usize - 2 * pixels / 250;
            let touched = (0..front).filter(|&i| shaded.background[i] != clear.background[i]);
            let foreign = (0..4 * pixels).filter(|&i| shaded.simulated[i] != clear.simulated[i]);
            out.compare(
                format!("{tracer}, {what}: values in front, and of the simulation, that change"),
                (touched.count() + foreign.count()) as f64,
                0.0,
                0.0,
            )
            .unlike("a shadow from the face on", front as f64);
            let stained = clear.background.iter().filter(|&&v| (v - level).abs() > 1e-6);
            out.compare(
                format!("{tracer}, {what}: pixels that change without shadows"),
                stained.count() as f64,
                0.0,
                0.0,
            )
            .unlike("no volume at all", pixels as f64);
            if tracer == Tracer::Bvh {
                let line = column(&shaded).into_iter().map(|[z, _]| [z, shade(z)]);
                out.plots.push(Plot::linear(
                    format!("A volume of one grey level behind: {what}"),
                    ["depth, mm", "grey level"],
                    vec![
                        Curve::dots("shown", column(&shaded)),
                        Curve::line("absorption and Fresnel", line.collect()),
                    ],
                ));
            }
        }
    }
    out
}
