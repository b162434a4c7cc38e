//! Elements that do not touch the skin neither send nor receive: closed forms of which elements these are, and of
//! the remaining brightness of a scanline, by both tracers.

use std::path::Path;
use std::sync::Arc;

use insonify::gpu::{Device, test_device};
use insonify::probe::ProbeKind;
use insonify::scene::Scene;
use insonify::sim::contact::{Coupling, Skins, table};
use insonify::sim::shaders::Library;
use insonify::sim::{Simulator, Tracer};

use crate::common::tracers::tracers;

/// Scatterers everywhere, no noise, a linear probe of 38 mm and 96 scanlines.
const BENCH: &str = r#"
    background = "liver"
    [probe]
    preset = "linear"
    scanlines = 96
    elevation_layers = 2
    samples = 512
    elevation_height = "1 mm"
    [imaging]
    noise = "-inf dB"
    [simulation]
    paths = 1
"#;

fn scene(text: &str) -> Scene {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("scene.toml");
    std::fs::write(&file, format!("{BENCH}{text}")).expect("written");
    Scene::load(&file, &[]).expect("a scene").0
}

/// A probe with one edge on a flat skin and rocked by `angle` rad, so that the gap along the beam grows
/// with the distance from that edge as its tangent; `gel` in mm.
fn rocked(angle: f64, gel: f64) -> Scene {
    let (sin, cos) = angle.sin_cos();
    let mut scene = scene(&format!(
        "[contact]\nmesh = [\"skin\"]\ngel = {gel}\ncouplant = \"liver\"\n\
         [[mesh]]\nname = \"skin\"\ntissue = \"liver\"\ntranslate = [0, 0, 50]\n\
         shape = {{ box = {{ size = [400, 300, 100] }} }}\n\
         [probe.pose]\nposition = [{}, 0, {}]\ndirection = [{sin}, 0, {cos}]\nlateral = [{cos}, 0, {}]\n",
        19.0 * cos,
        -19.0 * sin,
        -sin
    ));
    // Echoes of the skin's own flat surface would add nothing.
    scene.instances[0].surface[0].gain = -100.0;
    scene
}

/// Complex samples per scanline, before the axial kernel.
fn lines(device: &Arc<Device>, scene: &Scene, tracer: Tracer) -> Vec<Vec<f32>> {
    let mut simulator = Simulator::new(device, &Library::embedded(), scene, tracer).expect("one");
    simulator.frame(scene, 0).expect("a frame");
    let lateral = simulator.lateral().expect("samples");
    let each = 2 * scene.probe.samples as usize;
    lateral[..each * scene.probe.scanlines as usize].chunks(each).map(<[f32]>::to_vec).collect()
}

fn coupling(scene: &Scene) -> Coupling {
    Coupling::of(scene, &mut Skins::default()).expect("the scene asks for contact")
}

/// Number of coupled elements.
fn coupled(scene: &Scene) -> f64 {
    coupling(scene).elements.iter().sum()
}

#[test]
fn columns_whose_gap_exceeds_the_gel_are_dark_and_the_others_as_they_were() {
    let device = test_device();
    let angle = 10f64.to_radians();
    // Apertures of 1 mm: 1.3 scanlines to each side, and one for the grid of points.
    let narrow = |gel: f64| {
        let mut scene = rocked(angle, gel);
        scene.probe.f_number_transmit = scene.probe.focus;
        scene.probe.aperture = 1.0;
        scene
    };
    let border = |gel: f64| gel / angle.tan() / 38.0 * 96.0;
    for tracer in tracers(&device) {
        let free = {
            let mut scene = narrow(3.0);
            scene.contact = None;
            lines(&device, &scene, tracer)
        };
        let dark_as = |gel: f64, expected: f64| {
            let seen = lines(&device, &narrow(gel), tracer);
            seen.iter().zip(&free).enumerate().all(|(l, (seen, free))| {
                let middle = l as f64 + 0.5;
                assert!(free.iter().any(|&v| v != 0.0), "{l} has echoes");
                match middle - expected {
                    off if off < -2.3 => seen == free,
                    off if off > 2.3 => seen.iter().all(|&v| v == 0.0),
                    _ => true,
                }
            })
        };
        assert!(dark_as(3.0, border(3.0)), "{tracer}");
        assert!(dark_as(1.0, border(1.0)), "{tracer}");
        assert!(!dark_as(3.0, border(2.5)), "{tracer}: the wrong gel is noticed");
    }
    assert_eq!(device.validation_messages(), Vec::<String>::new());
}

#[test]
fn a_line_keeps_the_coupled_shares_of_what_sends_and_of_what_receives() {
    let device = test_device();
    let angle = 10f64.to_radians();
    let mut with = rocked(angle, 3.0);
    with.probe.aperture = 8.0;
    let mut without = with.clone();
    without.contact = None;
    let (width, border) = (38.0, 3.0 / angle.tan());
    let share = |middle: f64, aperture: f64| {
        let (left, right) =
            ((middle - aperture / 2.0).max(0.0), (middle + aperture / 2.0).min(width));
        ((border - left) / (right - left)).clamp(0.0, 1.0)
    };
    let pitch = width / 96.0;
    let transmit = with.probe.focus / with.probe.f_number_transmit;
    for tracer in tracers(&device) {
        let (seen, free) = (lines(&device, &with, tracer), lines(&device, &without, tracer));
        let worst = |receives: bool| {
            let mut worst = 0.0_f64;
            for l in 0..96 {
                let middle = (f64::from(l) + 0.5) * pitch;
                for k in 0..with.probe.samples {
                    let z = f64::from(k) * with.probe.sample_pitch();
                    let receive =
                        (z / with.probe.f_number_receive).min(with.probe.aperture).max(pitch);
                    let rest = if receives { share(middle, receive) } else { 1.0 };
                    let expected = share(middle, transmit) * rest;
                    let i = (l as usize, 2 * k as usize);
                    let [a, b] = [&seen, &free].map(|f| f64::from(f[i.0][i.1]));
                    if b == 0.0 {
                        continue;
                    }
                    // The border lies between two of the points, half an element apart: half of that
                    // decides about the share, and single precision about the rest. At the face's ends
                    // only half of an aperture is there.
                    let allowed = 0.25 * pitch * (2.0 / transmit + 2.0 / receive) + 1e-4;
                    worst = worst.max((a / b - expected).abs() / allowed);
                }
            }
            worst
        };
        assert!(worst(true) < 1.0, "{tracer}: {}", worst(true));
        assert!(worst(false) > 2.0, "{tracer}: {}", worst(false));
    }
}

#[test]
fn on_a_sphere_the_coupled_elements_and_the_depth_are_those_of_the_closed_form() {
    // Subdivided six times its facets lie 2 um below the sphere.
    let ball = |lift: f64| {
        scene(&format!(
            "[contact]\nmesh = [\"ball\"]\ngel = 2\n\
             [[mesh]]\nname = \"ball\"\ntissue = \"liver\"\ntranslate = [0, 0, {}]\n\
             shape = {{ sphere = {{ radius = 60, subdivisions = 6 }} }}\n",
            60.0 + lift
        ))
    };
    // Joined where x^2 <= R^2 - (R + lift - gel)^2.
    let elements = |lift: f64, gel: f64| {
        let x = (60f64.powi(2) - (60.0 + lift - gel).powi(2)).max(0.0).sqrt();
        (2.0 * x).min(38.0) / 38.0 * 96.0
    };
    for lift in [1.9, 1.0, 0.5, 0.0, -0.5, -0.9, -3.0] {
        let expected = elements(lift, 2.0);
        let found = coupled(&ball(lift));
        assert!((found - expected).abs() < 1.0, "{lift}: {found} {expected}");
    }
    let planted = coupled(&ball(0.5));
    assert!((planted - elements(0.5, 1.8)).abs() > 1.0, "2 mm are not 1.8");
    assert_eq!(coupled(&ball(2.01)), 0.0);
    // Mean of sqrt(R^2 - x^2) - (R - p) over the range where it is above 0.
    let press = 1.5_f64;
    let half = (60f64.powi(2) - (60.0 - press).powi(2)).sqrt();
    let steps = 10_000;
    let at = |i: i32| (f64::from(i) + 0.5) / f64::from(steps) * half;
    let sum: f64 =
        (0..steps).map(|i| (60f64.powi(2) - at(i).powi(2)).sqrt() - (60.0 - press)).sum();
    let expected = sum / f64::from(steps) * 2.0 * half / 38.0;
    let depth = coupling(&ball(-press)).touch.depth;
    assert!((depth - expected).abs() < 0.01, "{depth} {expected}");
    assert_eq!(coupling(&ball(0.0)).touch.share, coupled(&ball(0.0)) / 96.0);
}

#[test]
fn lifted_off_there_is_nothing_but_noise() {
    let device = test_device();
    for tracer in tracers(&device) {
        let mut lifted = rocked(0.0, 3.0);
        lifted.imaging.noise = -80.0;
        lifted.world_from_probe.translation.z = -3.1;
        let mut silent = lifted.clone();
        silent.contact = None;
        for tissue in &mut silent.tissues {
            tissue.echogenicity = f64::NEG_INFINITY;
        }
        let touch = |scene: &Scene| {
            let mut simulator =
                Simulator::new(&device, &Library::embedded(), scene, tracer).expect("one");
            simulator.frame(scene, 7).expect("a frame");
            (simulator.log_image().expect("levels"), simulator.contact())
        };
        let (dark, contact) = touch(&lifted);
        let (noise, none) = touch(&silent);
        assert_eq!(contact.map(|c| (c.share, c.depth)), Some((0.0, 0.0)));
        assert_eq!(none, None);
        assert_eq!(dark, noise, "{tracer}");
        lifted.world_from_probe.translation.z = -2.9;
        assert_ne!(touch(&lifted).0, noise, "{tracer}: held to the skin it hears");
    }
}

/// A probe 5 mm above a slab of 20 mm of liver, all of its elements coupled through gel.
fn above_a_slab(background: &str, couplant: &str) -> Scene {
    let text = format!(
        "[contact]\nmesh = [\"slab\"]\ngel = 6\ncouplant = \"{couplant}\"\n\
         [[mesh]]\nname = \"slab\"\ntissue = \"liver\"\ntranslate = [0, 0, 15]\n\
         shape = {{ box = {{ size = [200, 200, 20] }} }}\n"
    );
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("scene.toml");
    let bench = BENCH.replace("\"liver\"", &format!("\"{background}\""));
    std::fs::write(&file, bench + &text).expect("written");
    Scene::load(&file, &[]).expect("a scene").0
}

#[test]
fn the_gap_is_filled_by_the_couplant_and_behind_the_body_is_the_background() {
    let device = test_device();
    for tracer in tracers(&device) {
        let heard = |background: &str, couplant: &str| {
            let scene = above_a_slab(background, couplant);
            let pitch = scene.probe.sample_pitch();
            // Magnitudes of a line in the middle, and where a depth is within them.
            let line = lines(&device, &scene, tracer).swap_remove(48);
            let samples: Vec<f64> =
                line.chunks(2).map(|v| f64::from(v[0]).hypot(f64::from(v[1]))).collect();
            move |from: f64, to: f64| {
                let at = |z: f64| (z / pitch) as usize;
                samples[at(from)..at(to)].to_vec()
            }
        };
        let loudest = |samples: Vec<f64>| samples.into_iter().fold(0.0, f64::max);
        let (air, gel) = (heard("air", "gel"), heard("gel", "gel"));
        // The same up to the far side, 5 mm of gel and 20 mm of liver away: 24.86 mm at 1540 m/s.
        assert_eq!(air(0.0, 24.0), gel(0.0, 24.0), "{tracer}");
        assert_eq!(loudest(air(1.0, 4.0)), 0.0, "{tracer}: gel is anechoic");
        assert!(loudest(air(8.0, 20.0)) > 0.0, "{tracer}: liver is heard");
        // From there air sends back all, gel 5 %.
        let side = |heard: &dyn Fn(f64, f64) -> Vec<f64>| loudest(heard(24.5, 25.2));
        let scene = above_a_slab("air", "gel");
        let impedance =
            |name: &str| scene.tissues.iter().find(|t| t.name == name).expect("used").impedance();
        let reflected = |name: &str| {
            let (a, b) = (impedance("liver"), impedance(name));
            ((b - a) / (b + a)).abs()
        };
        let found = 20.0 * (side(&air) / side(&gel)).log10();
        let expected = 20.0 * (reflected("air") / reflected("gel")).log10();
        assert!((found - expected).abs() < 1.0, "{tracer}: {found} {expected}");
        // Planted: the gap is of what is around.
        let silent = heard("air", "air");
        assert!(loudest(silent(8.0, 20.0)) < 1e-3 * loudest(air(8.0, 20.0)), "{tracer}");
    }
}

#[test]
fn the_skin_is_where_its_transforms_and_selectors_put_it() {
    let text = r#"
        [contact]
        mesh = ["low", "high"]
        gel = 1
        [[selector]]
        name = "turn"
        period = "2 s"
        [[transform]]
        name = "breath"
        parent = "turn"
        motion = { kind = "sine", period = "1 s", translate = [0, 0, 4] }
        [[group]]
        name = "away"
        parent = "turn"
        [[mesh]]
        name = "low"
        parent = "breath"
        tissue = "liver"
        shape = { box = { size = [200, 200, 20] } }
        translate = [0, 0, 10]
        [[mesh]]
        name = "high"
        parent = "away"
        tissue = "liver"
        shape = { box = { size = [200, 200, 20] } }
        translate = [0, 0, 60]
    "#;
    let mut scene = scene(text);
    let mut skins = Skins::default();
    let mut at = |seconds: f64| {
        scene.set_time(seconds);
        Coupling::of(&scene, &mut skins).expect("contact").touch
    };
    let phase = |t: f64| 4.0 * (std::f64::consts::TAU * t).sin();
    for t in [0.0, 0.1, 0.25, 0.6, 0.75] {
        // The skin's top follows a sine: above 1 mm of gap nothing is coupled, below 0 it is pressed.
        let (touch, top) = (at(t), phase(t));
        assert_eq!(touch.share, if top <= 1.0 { 1.0 } else { 0.0 }, "{t}");
        assert!((touch.depth - (-top).max(0.0)).abs() < 1e-6, "{t}: {touch:?}");
    }
    assert_eq!(at(1.5).share, 0.0, "the other skin is far away");
}

#[test]
fn layers_that_touch_are_one_body_and_any_placement_will_do() {
    let text = r#"
        [contact]
        mesh = ["skin", "fat"]
        [[mesh]]
        name = "skin"
        tissue = "skin"
        shape = { box = { size = [100, 100, 1] } }
        translate = [0, 0, 2]
        scale = 2
        [[mesh]]
        name = "fat"
        tissue = "fat"
        shape = { box = { size = [60, 200, 20] } }
        rotate = { axis = [0, 0, 1], angle = "90 deg" }
        translate = [0, 0, 13.05]
    "#;
    let scene = scene(text);
    let skin = Skins::default().of(&scene);
    let gap = |x: f64, z: f64| skin.gap(glam::DVec3::new(x, 3.0, z), glam::DVec3::Z);
    // Skin from 1 to 3, fat from 3.05 to 23.05, only up to x = 100 and y = 30.
    for (x, z, expected) in [
        (0.0, -4.0, Some(5.0)),
        (0.0, 0.0, Some(1.0)),
        (0.0, 2.0, Some(-1.0)),
        (0.0, 3.02, Some(-2.02)),
        (0.0, 20.0, Some(-19.0)),
        (0.0, 24.0, None),
        (150.0, 0.0, None),
    ] {
        let found = gap(x, z);
        let close = match (found, expected) {
            (Some(a), Some(b)) => (a - b).abs() < 1e-5,
            (a, b) => a == b,
        };
        assert!(close, "{x} {z}: {found:?} {expected:?}");
    }
    let away = skin.gap(glam::DVec3::new(0.0, 3.0, -4.0), -glam::DVec3::Z);
    assert_eq!(away, None, "it looks away from the body");
}

/// The scenes that ship with a skin are in full contact at all times: their images stay as they were.
#[test]
fn shipped_scenes_are_in_full_contact_and_look_as_without_it() {
    let load = |name: &str| {
        let file = format!("scenes/{name}.toml");
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(file);
        let smaller = [
            ("probe.scanlines", "48"),
            ("probe.elevation_layers", "2"),
            ("probe.samples", "512"),
            ("imaging.image_height", "200"),
        ]
        .map(|(key, value)| (key.to_owned(), value.to_owned()));
        Scene::load(&path, &smaller).expect(name).0
    };
    for name in ["abdomen", "heart", "fetus"] {
        let mut scene = load(name);
        scene.probe.scanlines = 192;
        let mut skins = Skins::default();
        for seconds in [0.0, 0.3, 0.7, 3.1] {
            scene.set_time(seconds);
            let coupling = Coupling::of(&scene, &mut skins).expect(name);
            assert_eq!(coupling.touch.share, 1.0, "{name} at {seconds} s");
            assert_eq!(table(&scene, Some(&coupling)), table(&scene, None), "{name}");
        }
    }
    let device = test_device();
    let scene = load("abdomen");
    let mut without = scene.clone();
    without.contact = None;
    for tracer in tracers(&device) {
        assert!(lines(&device, &scene, tracer) == lines(&device, &without, tracer));
    }
}

#[test]
fn every_kind_of_probe_has_a_face_as_wide_as_it_is() {
    let mut scene = rocked(0.0, 3.0);
    for (kind, width) in [
        (ProbeKind::Linear { width: 38.0 }, 38.0),
        (ProbeKind::Convex { radius: 50.0, field_of_view: 1.0 }, 50.0),
        (ProbeKind::Phased { field_of_view: 1.5 }, 19.0),
    ] {
        scene.probe.kind = kind;
        scene.probe.aperture = 19.0;
        assert_eq!(scene.probe.face_width(), width);
        // Neighbouring points are as far apart as their share of the width implies.
        let (a, n) = scene.probe.face(0.2, 0.0);
        let (b, _) = scene.probe.face(0.201, 0.0);
        assert!((a.distance(b) - 0.001 * width).abs() < 1e-6);
        assert!((b - a).dot(n).abs() < 1e-3 * width * 1e-3);
        // With the middle of the face on the skin a convex face is coupled where its edge is not higher than the
        // gel: r (1 / cos a - 1) <= gel along the beam.
        let expected = match kind {
            ProbeKind::Convex { radius, .. } => (2.0 * (radius / (radius + 3.0)).acos()).min(1.0),
            _ => 1.0,
        };
        scene.world_from_probe = glam::DAffine3::IDENTITY;
        let share = coupling(&scene).touch.share;
        assert!((share - expected).abs() < 1.0 / 96.0, "{share} {expected}");
    }
}
