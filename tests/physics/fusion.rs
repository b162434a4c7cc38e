//! Fusion with an acquired volume: the mask of a ball, the volume along oblique scanlines, and the blending of the
//! two images.

use std::sync::Arc;

use glam::{DAffine3, DQuat, DVec3};
use insonify::scene::fusion::Acquired;
use insonify::scene::{Scene, shapes};
use insonify::settings::Words;
use insonify::settings::{Blend, Fusion, MaskSpeed, Surroundings};
use insonify::sim::fusion::FusionSteps;
use insonify::sim::{Simulator, Tracer, shaders::Library};
use insonify::volume::Voxels;

use crate::physics::check::{Bench, Check, Curve, Outcome, Physics, Picture, Plot, TRACERS};
use crate::physics::scenes::{add_body, add_box, add_sphere, linear, silent, tissue};

/// The steps of the frame, its grey levels (none where transparent), and their width.
struct Fused {
    steps: FusionSteps,
    levels: Vec<Option<u8>>,
    width: u32,
}

fn simulator(bench: &Bench, scene: &Scene, tracer: Tracer) -> Simulator {
    Simulator::new(&bench.device, &Library::embedded(), scene, tracer).expect("a simulator")
}

fn fused(bench: &Bench, scene: &Scene, tracer: Tracer) -> Fused {
    shoot(&mut simulator(bench, scene, tracer), scene)
}

fn shoot(simulator: &mut Simulator, scene: &Scene) -> Fused {
    simulator.frame(scene, 0).expect("a frame");
    let (width, _, rgba) = simulator.pixels().expect("pixels");
    let steps = simulator.fusion_steps().expect("read back");
    Fused {
        steps: steps.expect("the scene shows its volume"),
        levels: rgba.chunks_exact(4).map(|p| (p[3] > 0).then_some(p[0])).collect(),
        width,
    }
}

/// A volume of 8-bit-like floats in 0..1.
fn volume(size: [usize; 3], world_from_voxel: DAffine3, value: impl Fn(DVec3) -> f64) -> Acquired {
    let mut values = Vec::new();
    for k in 0..size[2] {
        for j in 0..size[1] {
            for i in 0..size[0] {
                let voxel = DVec3::new(i as f64, j as f64, k as f64);
                values.push(value(world_from_voxel.transform_point3(voxel)) as f32);
            }
        }
    }
    Acquired {
        size,
        volumes: vec![Arc::new(Voxels::F32(values))],
        now: 0,
        sequence: None,
        world_from_voxel,
        world_from_lps: DAffine3::IDENTITY,
        black: 0.0,
        white: 1.0,
    }
}

/// Masks the first `count` bodies of the scene.
fn mask(scene: &mut Scene, count: usize, blend: Blend) {
    scene.fusion = Some(Fusion {
        masks: (0..count).collect(),
        surroundings: Surroundings::Volume,
        blur: 32,
        blend,
        mask_speed: MaskSpeed::Enclosing,
        background_shadows: false,
    });
}

/// Check T29.
pub fn the_mask_fades_over_the_box_and_leaves_both_images_alone_beyond_it() -> Check {
    Check {
        row: "T29",
        name: "the_mask_fades_over_the_box_and_leaves_both_images_alone_beyond_it",
        claim: "The blurred mask of a straight border is a linear ramp of 32 pixels, from tap counts \
            alone; that of a right-angled corner is the product of two ramps (within 1/255); beyond \
            the ramp it is 0 or 1, and the pixel is the simulation's or the volume's to the last bit; \
            in between it is M I_b + (1 - M) I_f, rounded. With the smooth blend M is 3 m^2 - 2 m^3.",
        planted: "A box of 31 pixels; the offsets of the box one pixel aside.",
        run: borders,
    }
}

/// Pixels of the image are 0.25 mm wide, the scanlines a pixel apart: borders on the edges between
/// pixels are met exactly.
const PITCH: f64 = 0.25;
const LINES: u32 = 240;
const HEIGHT: u32 = 200;

/// A flat probe over 60 mm by 50 mm and a box-shaped mask over columns `x` and rows `z` of pixels.
fn boxed(x: [f64; 2], z: [f64; 2], blend: Blend) -> Scene {
    let mut scene = linear(LINES, f64::from(LINES) * PITCH, silent(1.54, 1.63, 0.0));
    scene.probe.depth = f64::from(HEIGHT) * PITCH;
    scene.probe.samples = 4 * HEIGHT;
    scene.imaging.image_height = HEIGHT;
    let half = f64::from(LINES) / 2.0;
    let at = |c: f64| (c - half) * PITCH;
    let size = [(x[1] - x[0]) * PITCH, 40.0, (z[1] - z[0]) * PITCH];
    let middle = DVec3::new((at(x[0]) + at(x[1])) / 2.0, 3.1, (z[0] + z[1]) / 2.0 * PITCH);
    let body = tissue(1.54, 1.64, 0.3);
    let place = DAffine3::from_translation(middle);
    add_body(&mut scene, shapes::cuboid(size), body, place);
    mask(&mut scene, 1, blend);
    let to_world = DAffine3::from_translation(DVec3::new(-40.0, -4.0, -3.0))
        * DAffine3::from_scale(DVec3::new(0.8, 1.0, 0.7));
    // Steep, so that no two neighbouring pixels have one level.
    let value = |p: DVec3| 0.5 + 0.3 * (p.x / 3.0).sin() + 0.2 * (p.z / 2.0).cos();
    scene.volume = Some(volume([101, 9, 81], to_world, value));
    scene
}

/// Share of a box of `n` pixels, at offsets `first`.. about pixel `i`, that lies at and beyond pixel
/// `edge`.
fn ramp(i: u32, edge: u32, n: i64, first: i64) -> f64 {
    let taps = (0..n).filter(|t| i64::from(i) + first + t >= i64::from(edge));
    taps.count() as f64 / n as f64
}

fn borders(bench: &Bench, physics: Physics) -> Outcome {
    let mut out = Outcome::default();
    // The model's box of 32 pixels.
    let (n, first) = match physics {
        Physics::Right => (32, -16),
        Physics::Planted => (31, -15),
    };
    // A mask with one corner inside the image: open to the left and below.
    let (right, top) = (130_u32, 90_u32);
    for blend in [Blend::Linear, Blend::Smooth] {
        let scene =
            boxed([-40.0, f64::from(right)], [f64::from(top), f64::from(HEIGHT) + 40.0], blend);
        let got = fused(bench, &scene, Tracer::Bvh);
        let at = |i: u32, j: u32| (j * got.width + i) as usize;
        if blend == Blend::Linear {
            let m = &got.steps.mask;
            let stray = |right: u32, i: u32, j: u32| {
                let expected = if i < right && j >= top { 0.0 } else { 1.0 };
                let near = i.abs_diff(right) <= 1 || j.abs_diff(top) <= 1;
                !near && m[at(i, j)] != expected
            };
            let [count, wider] = [right, right + 4]
                .map(|right| pixels(&got).filter(|&(i, j)| stray(right, i, j)).count() as f64);
            out.compare("pixels away from the border that are not 0 or 1", count, 0.0, 0.0)
                .unlike("a mask four pixels wider", wider);
            let row = HEIGHT - 40;
            let measured = |i| f64::from(got.steps.blurred[at(i, row)]);
            let expected = |i| ramp(i, right, n, first);
            let worst = (0..got.width).map(|i| (measured(i) - expected(i)).abs());
            out.compare(
                "straight border: largest departure from the ramp",
                worst.fold(0.0, f64::max),
                0.0,
                1e-6,
            );
            let around = right - 30..right + 30;
            out.plots.push(Plot::linear(
                "Blurred mask across a straight border",
                ["pixel", "weight of the volume"],
                vec![
                    Curve::dots(
                        "kernel",
                        around.clone().map(|i| [f64::from(i), measured(i)]).collect(),
                    ),
                    Curve::line(
                        "share of the box",
                        around.map(|i| [f64::from(i), expected(i)]).collect(),
                    ),
                ],
            ));
            // Inside the mask both ramps are low: 1 - M is the product of their rests.
            let corner = |i: u32, j: u32| {
                let inside = (1.0 - ramp(i, right, n, first)) * ramp(j, top, n, first);
                1.0 - inside
            };
            let close = pixels(&got)
                .filter(|&(i, j)| i.abs_diff(right) < 40 && j.abs_diff(top) < 40)
                .map(|(i, j)| (f64::from(got.steps.blurred[at(i, j)]) - corner(i, j)).abs());
            out.compare(
                "corner: largest departure from the product of two ramps",
                close.fold(0.0, f64::max),
                0.0,
                1.0 / 255.0,
            );
        }
        let (mut foreign, mut swapped, mut mixed, mut turned, mut pure) = (0, 0, 0, 0, [0, 0]);
        for (i, j) in pixels(&got) {
            let m = f64::from(got.steps.blurred[at(i, j)]);
            let level = got.levels[at(i, j)].expect("the sector fills the image");
            let simulated = got.steps.simulated[4 * at(i, j)];
            let acquired = f64::from(got.steps.background[at(i, j)]);
            let [own, other] = [simulated, (acquired * 255.0 + 0.5).floor() as u8];
            if m == 0.0 {
                pure[0] += 1;
                foreign += u32::from(level != own);
                swapped += u32::from(level != other);
            } else if m == 1.0 {
                pure[1] += 1;
                foreign += u32::from(level != other);
                swapped += u32::from(level != own);
            } else {
                let m = match blend {
                    Blend::Smooth => m * m * (3.0 - 2.0 * m),
                    _ => m,
                };
                let mean = |m: f64| m * acquired * 255.0 + (1.0 - m) * f64::from(simulated);
                // Half a level by rounding, and single precision.
                let is_off = |m| u32::from((mean(m) - f64::from(level)).abs() > 0.501);
                mixed += is_off(m);
                turned += is_off(1.0 - m);
            }
        }
        out.compare(
            format!("{blend:?}: pixels beyond the ramp that are not one image's"),
            f64::from(foreign),
            0.0,
            0.0,
        )
        .unlike("the images swapped", f64::from(swapped));
        let expected = f64::from(got.width * HEIGHT) / 5.0;
        for (what, count) in [("simulation", pure[0]), ("volume", pure[1])] {
            let least = f64::from(count).min(expected);
            out.compare(
                format!("{blend:?}: pixels of the {what} alone, at least a fifth"),
                least,
                expected,
                0.0,
            )
            .unlike("the other image everywhere", 0.0);
        }
        out.compare(
            format!("{blend:?}: pixels in the ramp that are not the weighted mean"),
            f64::from(mixed),
            0.0,
            0.0,
        )
        .unlike("weights of the images swapped", f64::from(turned));
        out.pictures.push(picture(format!("Fused, {blend:?} blend"), &got));
    }
    out
}

fn pixels(got: &Fused) -> impl Iterator<Item = (u32, u32)> + use<> {
    let width = got.width;
    (0..got.levels.len() as u32).map(move |p| (p % width, p / width))
}

fn picture(title: String, got: &Fused) -> Picture {
    Picture { title, width: got.width, grey: got.levels.iter().map(|l| l.unwrap_or(255)).collect() }
}

/// Check T29.
pub fn bands_fade_over_their_own_widths_and_need_nothing_where_images_agree() -> Check {
    Check {
        row: "T29",
        name: "bands_fade_over_their_own_widths_and_need_nothing_where_images_agree",
        claim: "Blended by bands (Burt and Adelson 1983), constant images meet along a ramp whose \
            variance is that of the mask's own rise plus 2 (4^n - 1) / 3 pixels^2, n the levels above \
            the finest, the fewest for which that is at least the box's (b^2 - 1) / 12; a mask of \
            everything shows the simulation and a mask of nothing the volume, to the last bit; and \
            a volume that equals the simulation changes nothing.",
        planted: "A pyramid of one level less.",
        run: bands,
    }
}

fn bands(bench: &Bench, physics: Physics) -> Outcome {
    let mut out = Outcome::default();
    let everywhere = [-40.0, 400.0];
    // Black on the left, white on the right.
    let right = 121_u32;
    let mut scene = boxed([-40.0, f64::from(right)], everywhere, Blend::Multiband);
    for tissue in &mut scene.tissues {
        *tissue = silent(1.54, 1.63, 0.0);
    }
    scene.volume = Some(constant(1.0));
    let mut simulator = simulator(bench, &scene, Tracer::Bvh);
    for blur in [1, 8, 32] {
        scene.fusion.as_mut().expect("made").blur = blur;
        let got = shoot(&mut simulator, &scene);
        let row = (HEIGHT / 2 * got.width) as usize;
        let shown = |i: u32| f64::from(got.levels[row + i as usize].expect("inside")) / 255.0;
        let mask = |i: u32| f64::from(got.steps.mask[row + i as usize]);
        let moments = |values: &dyn Fn(u32) -> f64| {
            let rise = |i: u32| (f64::from(i) - 0.5, values(i) - values(i - 1));
            let mean: f64 = (1..got.width).map(rise).map(|(x, r)| x * r).sum();
            let variance = (1..got.width).map(rise);
            (mean, variance.map(|(x, r)| (x - mean).powi(2) * r).sum::<f64>())
        };
        let ((mean, variance), (middle, own)) = (moments(&shown), moments(&mask));
        let levels = match blur {
            1 => 0,
            8 => 2,
            _ => 4,
        };
        let levels = match physics {
            Physics::Planted => levels - 1,
            Physics::Right => levels,
        };
        let expected = own + 2.0 * (4f64.powi(levels) - 1.0) / 3.0;
        // Rounding to 256 levels, uniform and independent over the ramp's width: three deviations.
        let lost = 3.0 * 0.29 / 255.0;
        let half = 2.0 * expected.sqrt() + 1.0;
        out.compare(
            format!("box of {blur}: middle of the ramp, pixels"),
            mean,
            middle,
            lost * (2.0 * half).sqrt(),
        )
        .unlike("half a pixel aside, where a level of the pyramid begins", middle + 0.5);
        out.compare(
            format!("box of {blur}: variance of the ramp, pixels^2"),
            variance,
            expected,
            lost * 2.0 * (2.0 / 3.0 * half.powi(3)).sqrt(),
        );
        let around = right - 60..right + 60;
        let bell =
            |i: u32| (-(f64::from(i) - 0.5 - middle).powi(2) / (2.0 * expected.max(0.01))).exp();
        let whole: f64 = (1..got.width).map(bell).sum();
        let normal = |i: u32| (1..=i).map(bell).sum::<f64>() / whole;
        out.plots.push(Plot::linear(
            format!("Black beside white, bands of a box of {blur} pixels"),
            ["pixel", "grey level"],
            vec![
                Curve::dots("shown", around.clone().map(|i| [f64::from(i), shown(i)]).collect()),
                Curve::line(
                    "normal of that variance",
                    around.map(|i| [f64::from(i), normal(i)]).collect(),
                ),
            ],
        ));
    }
    if physics == Physics::Planted {
        return out;
    }
    let mut alone = |what: &str, x: [f64; 2], of_volume: bool, steep: bool| {
        let mut scene = boxed(x, everywhere, Blend::Multiband);
        if !steep {
            // As simulated with everything masked: its own pixels, one voxel each.
            let first = fused(bench, &scene, Tracer::Bvh);
            scene.volume = Some(pixels_as_volume(&first));
        }
        let got = fused(bench, &scene, Tracer::Bvh);
        let expected = |at: usize| match of_volume {
            true => (got.steps.background[at] * 255.0 + 0.5).floor() as u8,
            false => got.steps.simulated[4 * at],
        };
        let wrong = (0..got.levels.len()).filter(|&at| got.levels[at] != Some(expected(at)));
        let bright = (0..got.levels.len()).filter(|&at| expected(at) > 0);
        out.compare(format!("{what}: pixels that are not it"), wrong.count() as f64, 0.0, 0.0)
            .unlike("the coarsest band left out: black", bright.count() as f64);
        if !steep {
            let off = |aside: usize| {
                let off = (aside..got.levels.len()).filter(|&at| {
                    let own = f32::from(got.steps.simulated[4 * (at - aside)]) / 255.0;
                    (own - got.steps.background[at]).abs() > 1e-4
                });
                off.count() as f64
            };
            out.compare("pixels at which the volume is not the simulation", off(0), 0.0, 0.0)
                .unlike("a volume that lies a pixel aside", off(1));
        }
    };
    alone("mask of everything", everywhere, false, true);
    alone("mask of nothing", [600.0, 700.0], true, true);
    alone("volume of the simulation", everywhere, false, false);
    out
}

/// A volume of one grey level around everything.
fn constant(level: f64) -> Acquired {
    let around = DAffine3::from_translation(DVec3::splat(-300.0))
        * DAffine3::from_scale(DVec3::splat(600.0));
    volume([2, 2, 2], around, |_| level)
}

/// The simulated image as a volume of one voxel per pixel, as thick as three pixels are wide.
fn pixels_as_volume(got: &Fused) -> Acquired {
    let (width, height) = (got.width as usize, HEIGHT as usize);
    let first = DVec3::new(-0.5 * f64::from(LINES) + 0.5, -1.0, 0.5) * PITCH;
    let place = DAffine3::from_translation(first) * DAffine3::from_scale(DVec3::splat(PITCH));
    let level = |p: DVec3| {
        let pixel = (p - first) / PITCH;
        let at = pixel.z.round() as usize * width + pixel.x.round() as usize;
        f64::from(got.steps.simulated[4 * at]) / 255.0
    };
    volume([width, 3, height], place, level)
}

/// Check T30.
pub fn the_mask_of_a_ball_is_its_chord_on_every_scanline() -> Check {
    Check {
        row: "T30",
        name: "the_mask_of_a_ball_is_its_chord_on_every_scanline",
        claim: "Sample k of a scanline is inside where |o + k dz d - centre| < r, within one sample \
            beside the ball's surface (of 20 480 triangles, up to 2.5e-4 of the radius inside): a ball \
            in front of the probe, one around its face, two that overlap, all placed obliquely.",
        planted: "A ball 0.3 mm aside of where it is said to be.",
        run: balls,
    }
}

fn balls(bench: &Bench, physics: Physics) -> Outcome {
    let mut out = Outcome::default();
    let ahead = (DVec3::new(4.0, 1.0, 33.0), 12.0);
    let around = (DVec3::new(-3.0, 0.5, -2.0), 21.0);
    let beside = (DVec3::new(-7.0, -2.0, 40.0), 9.0);
    for (what, balls) in [
        ("ahead", &[ahead][..]),
        ("around the face", &[around]),
        ("two overlapping", &[ahead, beside]),
        ("ahead and around", &[around, ahead]),
    ] {
        for tracer in TRACERS {
            let mut scene = linear(96, 40.0, silent(1.54, 1.63, 0.0));
            scene.probe.kind =
                insonify::probe::ProbeKind::Convex { radius: 30.0, field_of_view: 1.1 };
            scene.probe.depth = 70.0;
            scene.probe.samples = 700;
            scene.imaging.image_height = 160;
            let turn = DQuat::from_axis_angle(DVec3::new(1.0, -2.0, 0.7).normalize(), 0.9);
            let place = DAffine3::from_rotation_translation(turn, DVec3::new(30.0, -20.0, 55.0));
            scene.world_from_probe = place;
            for (centre, radius) in balls {
                add_sphere(
                    &mut scene,
                    *radius,
                    silent(1.54, 1.64, 0.0),
                    place.transform_point3(*centre),
                );
            }
            mask(&mut scene, balls.len(), Blend::Linear);
            scene.volume = Some(volume([2, 2, 2], DAffine3::IDENTITY, |_| 0.5));
            let got = fused(bench, &scene, tracer);
            let shift = match physics {
                Physics::Right => DVec3::ZERO,
                Physics::Planted => DVec3::new(0.3, 0.0, 0.0),
            };
            let (mut wrong, mut inside) = (0, 0);
            for l in 0..scene.probe.scanlines {
                let (mut o, d) = scene.probe.ray(l, 0);
                o.y = 0.0;
                let pitch = scene.probe.sample_pitch();
                let within = |t: f64| {
                    let p = o + t * d - shift;
                    balls.iter().any(|(c, r)| p.distance(*c) < *r)
                };
                for k in 0..scene.probe.samples {
                    let t = f64::from(k) * pitch;
                    let at = 2 * (l * scene.probe.samples + k) as usize;
                    let found = got.steps.prescan[at] == 0.0;
                    inside += u32::from(found);
                    // One sample to either side.
                    let close = [t - pitch, t, t + pitch].map(within);
                    wrong += u32::from(!close.contains(&found));
                }
            }
            let name = tracer.to_string();
            out.compare(
                format!("{name}, {what}: samples on the wrong side"),
                f64::from(wrong),
                0.0,
                0.0,
            );
            out.compare(
                format!("{name}, {what}: samples inside, at least a thousand"),
                f64::from(inside).min(1000.0),
                1000.0,
                0.0,
            )
            .unlike("a mask that is nowhere", 0.0);
            if tracer == Tracer::Bvh {
                let grey = got.steps.blurred.iter().map(|m| (m * 255.0) as u8);
                out.pictures.push(Picture {
                    title: format!("Blurred mask, {what}"),
                    width: got.width,
                    grey: grey.collect(),
                });
            }
        }
    }
    out
}

/// Check T30.
pub fn a_linear_volume_is_exact_along_oblique_scanlines() -> Check {
    Check {
        row: "T30",
        name: "a_linear_volume_is_exact_along_oblique_scanlines",
        claim: "Trilinear interpolation reproduces a linear function: a volume of anisotropic spacing \
            (0.4, 1.1, 2.3 mm) whose axes are turned, placed by a rotation, a scale and a shift, shows \
            a + b . x at every sample inside it, within 2e-6 (single precision of numbers up to 1), \
            and black outside; stored in 8, 16 bits and in floats, each within half its own step.",
        planted: "The first voxel's corner where its centre should be: half a voxel aside.",
        run: oblique,
    }
}

fn oblique(bench: &Bench, physics: Physics) -> Outcome {
    let mut out = Outcome::default();
    let mut scene = linear(64, 36.0, silent(1.54, 1.63, 0.0));
    scene.probe.depth = 60.0;
    scene.probe.samples = 512;
    scene.imaging.image_height = 120;
    let turn = |x: f64, y: f64, z: f64, angle| {
        DQuat::from_axis_angle(DVec3::new(x, y, z).normalize(), angle)
    };
    scene.world_from_probe = DAffine3::from_rotation_translation(
        turn(0.3, 1.0, -0.4, 1.2),
        DVec3::new(12.0, -7.0, 90.0),
    );
    // A mask that no scanline meets: the volume is looked up everywhere.
    add_sphere(&mut scene, 2.0, silent(1.54, 1.64, 0.0), DVec3::new(500.0, 0.0, 0.0));
    mask(&mut scene, 1, Blend::Linear);
    // Direction cosines and spacing of the file, placement of the scene.
    let size = [90, 40, 17];
    let placed = DAffine3::from_scale_rotation_translation(
        DVec3::splat(1.25),
        turn(1.0, 0.2, 0.3, -0.8),
        DVec3::new(5.0, 2.0, -1.0),
    );
    let spacing = DVec3::new(0.4, 1.1, 2.3);
    let file = DAffine3::from_quat(turn(-0.5, 0.1, 1.0, 0.6)) * DAffine3::from_scale(spacing);
    // Its middle 28 mm below the face.
    let middle = DVec3::from(size.map(|n| (n as f64 - 1.0) / 2.0));
    let seen = scene.world_from_probe.transform_point3(DVec3::Z * 28.0);
    let turned = placed * file;
    let shift = seen - turned.transform_point3(middle);
    let world_from_voxel = DAffine3::from_translation(shift) * turned;
    let slope = DVec3::new(0.004, -0.006, 0.005);
    let value = |p: DVec3| 0.5 + slope.dot(p - seen);
    let whole = volume(size, world_from_voxel, value);
    let Voxels::F32(exact) = whole.voxels() else { unreachable!("made of floats") };
    let code = |steps: f64| exact.iter().map(move |v| (f64::from(*v) * steps).round());
    let forms = [
        ("float", Voxels::F32(exact.clone()), 0.0, 1.0, 2e-6),
        (
            "8 bits",
            Voxels::U8(code(255.0).map(|v| v as u8).collect()),
            0.0,
            255.0,
            0.5 / 255.0 + 2e-6,
        ),
        (
            "16 bits, signed",
            Voxels::I16(code(65535.0).map(|v| (v - 32768.0) as i16).collect()),
            -32768.0,
            32767.0,
            0.5 / 65535.0 + 2e-6,
        ),
    ];
    for (name, voxels, black, white, tolerance) in forms {
        scene.volume = Some(Acquired {
            volumes: vec![Arc::new(voxels)],
            now: 0,
            sequence: None,
            black,
            white,
            ..whole.clone()
        });
        for tracer in TRACERS {
            let got = fused(bench, &scene, tracer);
            let (mut worst, mut inside, mut outside, mut spilt) = (0.0_f64, 0, 0, 0);
            let voxel_from_world = world_from_voxel.inverse();
            for l in 0..scene.probe.scanlines {
                let (mut o, d) = scene.probe.ray(l, 0);
                o.y = 0.0;
                for k in 0..scene.probe.samples {
                    let p = o + f64::from(k) * scene.probe.sample_pitch() * d;
                    let p = scene.world_from_probe.transform_point3(p);
                    let mut voxel = voxel_from_world.transform_point3(p);
                    let at = 2 * (l * scene.probe.samples + k) as usize + 1;
                    let shown = f64::from(got.steps.prescan[at]);
                    let size = DVec3::from(size.map(|n| n as f64));
                    let least = voxel.min(size - 1.0 - voxel).min_element();
                    if least > 0.0 {
                        if physics == Physics::Planted {
                            voxel -= 0.5;
                        }
                        let p = world_from_voxel.transform_point3(voxel);
                        worst = worst.max((shown - value(p)).abs());
                        inside += 1;
                    } else if least < -0.501 {
                        outside += 1;
                        spilt += u32::from(shown != 0.0);
                    }
                }
            }
            out.compare(format!("{tracer}, {name}: largest error"), worst, 0.0, tolerance);
            out.compare(
                format!("{tracer}, {name}: samples outside that are not black"),
                f64::from(spilt),
                0.0,
                0.0,
            )
            .unlike("a volume that goes on at its edge", f64::from(outside));
            out.compare(
                format!("{tracer}, {name}: samples inside, at least a tenth"),
                f64::from(inside).min(3276.0),
                3276.0,
                0.0,
            )
            .unlike("a volume that is nowhere", 0.0);
        }
    }
    out
}

/// Check T30.
pub fn both_borders_of_a_mask_lie_where_its_surface_echoes() -> Check {
    Check {
        row: "T30",
        name: "both_borders_of_a_mask_lie_where_its_surface_echoes",
        claim: "Of a masking slab of fat from 20 to 60 mm the mask begins at 20 mm and ends at 20 + 40 (1540 / 1450) \
            mm, where both faces echo, within a sample; the volume shows on both sides and in it what is at the place \
            that the sound has reached, behind it 40 (1540 / 1450 - 1) = 2.48 mm nearer than its depth, within 2e-6. At the probe's \
            speed the mask ends at 60 mm and the volume is where the depth says.",
        planted: "The probe's speed in the mask, said to be that of fat.",
        run: far_border,
    }
}

fn far_border(bench: &Bench, physics: Physics) -> Outcome {
    let mut out = Outcome::default();
    let (speed, fat, top, chord) = (1.54, 1.45, 20.0, 40.0);
    let mut scene = linear(16, 16.0, silent(speed, 1.63, 0.0));
    scene.probe.depth = 90.0;
    scene.probe.samples = 1800;
    scene.imaging.image_height = 120;
    let place = DAffine3::from_translation(DVec3::new(3.1, 5.3, top));
    add_box(&mut scene, [200.0, 200.0, chord], silent(fat, 1.34, 0.0), place);
    mask(&mut scene, 1, Blend::Linear);
    let to_world = DAffine3::from_translation(DVec3::new(-100.0, -100.0, -20.0))
        * DAffine3::from_scale(DVec3::new(200.0, 200.0, 200.0));
    let level = |z: f64| (z + 20.0) / 200.0;
    scene.volume = Some(volume([2, 2, 2], to_world, |p| level(p.z)));
    let pitch = scene.probe.sample_pitch();
    for (said, rate) in [(MaskSpeed::Enclosing, fat / speed), (MaskSpeed::Probe, 1.0)] {
        let fusion = scene.fusion.as_mut().expect("masked");
        fusion.mask_speed = match physics {
            Physics::Right => said,
            Physics::Planted => MaskSpeed::Probe,
        };
        for tracer in TRACERS {
            let mut simulator = simulator(bench, &scene, tracer);
            let got = shoot(&mut simulator, &scene);
            let [surface, _] = simulator.echoes().expect("read back");
            let samples = scene.probe.samples as usize;
            let line = 8;
            let prescan = &got.steps.prescan[2 * line * samples..][..2 * samples];
            let inside: Vec<usize> = (0..samples).filter(|k| prescan[2 * k] == 0.0).collect();
            let ends = [inside[0], inside[inside.len() - 1] + 1].map(|k| k as f64);
            let far = top + chord / rate;
            let slow = speed / fat;
            for (what, found, expected, other) in
                [("near", ends[0], top, top * slow), ("far", ends[1], far, (top + chord) * slow)]
            {
                let name = format!("{tracer}, {}: {what} border, sample", said.word());
                out.compare(name, found, expected / pitch, 1.0)
                    .unlike("fat's speed from the face on", other / pitch);
            }
            if said == MaskSpeed::Enclosing {
                let echoes = &surface[2 * line * samples..][..2 * samples];
                let size = |k: usize| f64::from(echoes[2 * k]).hypot(f64::from(echoes[2 * k + 1]));
                let behind = (far / pitch) as usize;
                let window = behind - 60..(behind + 60).min(samples);
                let sum: f64 = window.clone().map(size).sum();
                let centre = window.map(|k| k as f64 * size(k)).sum::<f64>() / sum;
                let name =
                    format!("{tracer}: the far face echoes where the mask ends, samples off");
                out.compare(name, centre - ends[1], 0.0, 1.0);
            }
            let mut worst = 0.0_f64;
            for k in 0..samples {
                let depth = k as f64 * pitch;
                let through = (depth.min(far) - top).max(0.0);
                let z = depth - through * (1.0 - rate);
                // Beside a border rounding chooses the side.
                if [top, far].iter().all(|b| (depth - b).abs() > pitch) {
                    worst = worst.max((f64::from(prescan[2 * k + 1]) - level(z)).abs());
                }
            }
            let name = format!("{tracer}, {}: largest error of the volume's level", said.word());
            out.compare(name, worst, 0.0, 2e-6).unlike(
                "nearer by fat's speed, and where it should not be",
                chord * (slow - 1.0) / 200.0,
            );
        }
    }
    out
}
