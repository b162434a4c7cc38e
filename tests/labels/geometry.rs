//! Where things are and where they are seen.

use std::path::Path;

use glam::{DAffine3, DVec3};
use insonify::gpu::test_device;
use insonify::scene::Scene;
use insonify::settings::Refraction;
use insonify::sim::Tracer;
use insonify::sim::layout::{Label, NONE};

use super::scenes::{add_box, add_layer, linear, tissue};
use super::tracers::tracers;
use super::{at, labels, place};

/// How many places two sets have in common, and how many are in either.
fn overlap(pairs: impl Iterator<Item = (bool, bool)>) -> [usize; 2] {
    pairs.fold([0; 2], |[both, either], (a, b)| {
        [both + usize::from(a && b), either + usize::from(a || b)]
    })
}

fn ratio([both, either]: [usize; 2]) -> f64 {
    both as f64 / either.max(1) as f64
}

fn phantom(settings: &[(&str, &str)]) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/phantom.toml");
    let set: Vec<_> = settings.iter().map(|&(k, v)| (k.to_owned(), v.to_owned())).collect();
    let (mut scene, _) = Scene::load(&path, &set).expect("a shipped scene");
    // Speckle and wires have nothing to do with it.
    scene.wires.clear();
    scene.simulation.paths = 1;
    scene
}

/// Number, centre and radius of the phantom's circles in the scan plane: bodies of no echo.
fn cysts(scene: &Scene) -> Vec<(u32, [f64; 2], f64)> {
    let numbered = scene.instances.iter().zip(0..);
    let hollow = numbered.filter(|(i, _)| scene.tissues[i.tissue].name == "anechoic");
    hollow
        .map(|(instance, number)| {
            let corners = &scene.meshes[instance.mesh].positions;
            let radius = corners.iter().map(|p| f64::from(p[0].hypot(p[1]))).fold(0.0, f64::max);
            let centre = instance.world_from_object.translation;
            (number, [centre.x, centre.z], radius)
        })
        .collect()
}

#[test]
fn labels_of_the_phantom_s_cysts_are_their_circles() {
    for tracer in tracers(&test_device()) {
        // One layer, and scanlines closer than an image needs them: the test is of places, not of their grid.
        let mut scene = phantom(&[
            ("probe.elevation_layers", "1"),
            ("probe.scanlines", "1024"),
            ("imaging.image_height", "900"),
        ]);
        let labels = labels(&mut scene, tracer);
        let frame = insonify::sim::tables::frame(&scene, 0);
        let found = cysts(&scene);
        assert_eq!(found.len(), 16);
        let mut all = [0; 2];
        for (number, [x, z], radius) in found {
            let inside = |p: DVec3| (p.x - x).hypot(p.z - z) < radius;
            let of_samples = |of: fn(&Label) -> u32| {
                overlap(labels.samples.labels.iter().map(|l| (of(l) == number, inside(place(l)))))
            };
            let shape = labels.pixels.shape;
            let of_pixels = |of: fn(&Label) -> u32| {
                let pixels = labels.pixels.labels.iter().enumerate();
                let pitch = f64::from(frame.pixel_pitch);
                overlap(pixels.filter(|(_, l)| l.true_tissue != NONE).map(|(i, l)| {
                    let centre = |i: usize, first: f32| f64::from(first) + (i as f64 + 0.5) * pitch;
                    let x = centre(i % shape[1], frame.image_left);
                    let z = centre(i / shape[1], frame.image_top);
                    (of(l) == number, inside(DVec3::new(x, 0.0, z)))
                }))
            };
            let samples = of_samples(|l| l.instance);
            assert_eq!(
                samples,
                of_samples(|l| l.true_instance),
                "one speed: what is seen is there"
            );
            all = [all[0] + samples[0], all[1] + samples[1]];
            let [samples, pixels] = [samples, of_pixels(|l| l.instance)].map(ratio);
            println!(
                "{tracer} {:.1} mm at {z}: samples {samples:.4}, pixels {pixels:.4}",
                2.0 * radius
            );
            // Meshes of 48 sides have 0.3 % less area than their circles, those of 32 sides 0.6 %; and the smallest
            // have 400 samples, of which one or two lie at the border by chance.
            assert!(samples >= if radius > 2.0 { 0.99 } else { 0.98 }, "{number}: {samples}");
            // The nearest sample is off by up to half the grid's pitch, a quarter on the average, in both axes: the circle's
            // border by as much.
            let along = scene.probe.sample_pitch().max(f64::from(frame.pixel_pitch));
            let least = 0.99 - (scene.probe.line_pitch(z) + along) / 4.0 * 2.0 / radius;
            assert!(pixels >= least, "{number}: {pixels} of {least}");
        }
        let all = ratio(all);
        println!("{tracer} all: {all:.4}");
        assert!(all >= 0.99, "{tracer}: {all}");
    }
}

/// Samples per mm of depth.
fn samples_per_mm(scene: &Scene) -> f64 {
    scene.probe.sample_pitch().recip()
}

#[test]
fn behind_a_slab_the_loss_is_what_absorption_and_both_faces_take() {
    for tracer in tracers(&test_device()) {
        // 0.5 dB/(cm MHz) in front and behind; a slab of 8 mm and 3 dB/(cm MHz), 1.7 times the impedance.
        let mut scene = linear(8, 8.0, tissue(1.54, 1.6, 0.5));
        add_box(
            &mut scene,
            [90.0, 90.0, 8.0],
            tissue(1.54, 2.72, 3.0),
            DAffine3::from_translation(DVec3::new(3.1, 5.3, 20.0)),
        );
        let labels = labels(&mut scene, tracer);
        let mhz = scene.probe.frequency;
        let reflected = (1.12_f64 / 4.32).powi(2);
        let face = -20.0 * (1.0 - reflected).log10();
        let absorbed = |mm: f64, coefficient: f64| 2.0 * coefficient * mhz * mm / 10.0;
        for l in 0..8 {
            for (z, mm, thick, faces) in
                [(10.0, 10.0, 0.0, 0.0), (24.0, 20.0, 4.0, 1.0), (60.0, 52.0, 8.0, 2.0)]
            {
                let k = (z * samples_per_mm(&scene)).round();
                let off = k / samples_per_mm(&scene) - z;
                let label = at(&labels, l, k as usize);
                let rest = absorbed(off, if faces == 1.0 { 3.0 } else { 0.5 });
                let loss = absorbed(mm, 0.5) + absorbed(thick, 3.0) + faces * face + rest;
                let found = f64::from(label.place_loss[3]);
                assert!((found - loss).abs() < 0.1, "{tracer} {z} mm: {found} dB, {loss}");
                // Without the faces, and with the slab's absorption one way only, it would be another.
                assert!(faces == 0.0 || (loss - faces * face - found).abs() > 0.5);
            }
        }
    }
}

#[test]
fn behind_an_inclined_surface_snell_says_what_is_seen() {
    const ANGLE: f64 = 0.5;
    const SURFACE: f64 = 20.0;
    const SPEEDS: [f64; 2] = [1.45, 1.65];
    for tracer in tracers(&test_device()) {
        for refraction in [Refraction::Ray, Refraction::Beam] {
            let mut scene = linear(1, 1.0, tissue(SPEEDS[0], 1.6, 0.0));
            scene.simulation.refraction = refraction;
            let tilt = DAffine3::from_translation(DVec3::new(0.0, 0.0, SURFACE))
                * DAffine3::from_rotation_y(ANGLE)
                * DAffine3::from_translation(DVec3::new(3.1, 5.3, 0.0));
            add_box(&mut scene, [900.0, 900.0, 400.0], tissue(SPEEDS[1], 1.6, 0.0), tilt);
            // By Snell's law the ray leaves at asin(sin 0.5 * 1.65 / 1.45) = 0.577 rad to the normal, 0.077 rad off
            // its way, and is 2.3 mm beside it 30 mm further. A body there, 2 mm wide, is not on the scanline.
            let behind = (ANGLE.sin() * SPEEDS[1] / SPEEDS[0]).asin();
            let off = behind - ANGLE;
            // The normal against the beam is turned by ANGLE from -z; the beam turns towards the surface.
            let way = DVec3::new(off.sin(), 0.0, off.cos());
            let side = |way: DVec3| DVec3::new(0.0, 0.0, SURFACE) + 30.0 * way;
            let [target, other] = [way, DVec3::new(-way.x, 0.0, way.z)].map(side);
            for centre in [target, other] {
                let at = DAffine3::from_translation(centre - DVec3::Z);
                add_box(&mut scene, [2.0, 2.0, 2.0], tissue(SPEEDS[1], 1.6, 0.0), at);
            }
            let labels = labels(&mut scene, tracer);
            let seen = |label: &&Label| label.instance == 1 || label.instance == 2;
            let hit: Vec<&Label> = labels.samples.labels.iter().filter(seen).collect();
            assert!(!hit.is_empty(), "{tracer} {refraction:?}: neither target is met");
            let number = hit[0].instance;
            let expected = if number == 1 { target } else { other };
            let middle = hit[hit.len() / 2];
            let pitch = scene.probe.sample_pitch();
            assert!(
                place(middle).distance(expected) < 2.0 * pitch,
                "{tracer} {refraction:?}: {} {expected}",
                place(middle)
            );
            assert!(
                middle.true_instance == 0,
                "the scan plane has only what lies behind the surface"
            );
            // Along the ray, by the time that it takes: places are those of the time, to the micrometre.
            let x = if number == 1 { way.x } else { -way.x };
            for k in (0..scene.probe.samples as usize).step_by(97) {
                let label = at(&labels, 0, k);
                let time = k as f64 * pitch / scene.probe.speed;
                let before = SURFACE / SPEEDS[0];
                let there = match time <= before {
                    true => DVec3::new(0.0, 0.0, time * SPEEDS[0]),
                    false => {
                        let way = DVec3::new(x, 0.0, way.z);
                        DVec3::new(0.0, 0.0, SURFACE) + (time - before) * SPEEDS[1] * way
                    }
                };
                assert!(place(label).distance(there) < 2e-3, "{k}: {} {there}", place(label));
            }
            let angles = labels.samples.labels.iter().map(|l| l.moved_incidence[3]);
            let met: Vec<f32> = angles.filter(|angle| *angle >= 0.0).collect();
            assert!((f64::from(met[0]) - ANGLE.to_degrees()).abs() < 0.01, "{met:?}");
        }
    }
}

#[test]
fn nothing_is_seen_behind_total_reflection() {
    let mut scene = linear(1, 1.0, tissue(1.45, 1.6, 0.0));
    scene.simulation.refraction = Refraction::Ray;
    scene.simulation.beam_footprint = false;
    let tilt = DAffine3::from_translation(DVec3::new(0.0, 0.0, 20.0))
        * DAffine3::from_rotation_y(1.1)
        * DAffine3::from_translation(DVec3::new(3.1, 5.3, 0.0));
    add_box(&mut scene, [900.0, 900.0, 400.0], tissue(3.5, 6.0, 0.0), tilt);
    let labels = labels(&mut scene, Tracer::Bvh);
    let k = (25.0 * samples_per_mm(&scene)) as usize;
    let label = at(&labels, 0, k);
    assert_eq!([label.tissue, label.instance, label.true_tissue], [NONE, NONE, 1]);
    let arrays = labels.samples.arrays();
    let loss = arrays.iter().find(|array| array.kind.name == "loss").expect("an array");
    let insonify::sim::labels::LabelValues::Quantities(values) = &loss.values else {
        panic!("levels are quantities")
    };
    assert!(values[k].is_nan() && values[10].is_finite());
}

#[test]
fn the_picture_is_the_same_with_labels_and_without() {
    for tracer in tracers(&test_device()) {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/abdomen.toml");
        let set = [("probe.scanlines", "24"), ("probe.samples", "512"), ("simulation.paths", "2")];
        let set = set.map(|(key, value)| (key.to_owned(), value.to_owned()));
        let (mut scene, _) = Scene::load(&path, &set).expect("a shipped scene");
        let mut simulator = super::simulator(&mut scene, tracer);
        let mut pictures = Vec::new();
        for wanted in [true, false, true] {
            scene.simulation.labels = wanted;
            simulator.frame(&scene, 7).expect("a frame");
            assert_eq!(simulator.labels().expect("no device error").is_some(), wanted);
            let counters = simulator.counters().expect("counters");
            let log = simulator.log_image().expect("an image");
            pictures.push((
                simulator.echoes().expect("echoes"),
                log,
                counters.rays,
                counters.segments,
            ));
        }
        assert!(pictures[0] == pictures[1] && pictures[1] == pictures[2], "{tracer}");
    }
}

#[test]
fn a_layer_of_another_tissue_begins_where_it_is() {
    let mut scene = linear(4, 4.0, tissue(1.54, 1.6, 0.0));
    add_layer(&mut scene, 30.0, tissue(1.6, 1.7, 0.0));
    let labels = labels(&mut scene, Tracer::Bvh);
    let k = (30.0 * samples_per_mm(&scene)).ceil() as usize;
    assert_eq!([at(&labels, 2, k - 1), at(&labels, 2, k)].map(|l| l.true_tissue), [0, 1]);
    assert_eq!([at(&labels, 2, k - 1), at(&labels, 2, k)].map(|l| l.tissue), [0, 1]);
    // Perpendicular: 0 degrees, in one sample of each scanline, and of each column of pixels.
    let [rows, columns] = labels.samples.shape;
    let met = labels.samples.labels.iter().filter(|l| l.moved_incidence[3] >= 0.0);
    assert_eq!(met.count(), rows);
    assert!(columns > rows);
    assert!(labels.samples.labels.iter().all(|l| l.moved_incidence[3] < 0.01));
    let width = labels.pixels.shape[1];
    let column = (0..labels.pixels.shape[0]).map(|j| &labels.pixels.labels[j * width + width / 2]);
    assert_eq!(column.filter(|l| l.moved_incidence[3] >= 0.0).count(), 1);
}
