//! The scenes that come with the program: sound, and with the expected content in their default view.

use std::path::Path;

use glam::DVec3;
use insonify::gpu::test_device;
use insonify::scene::Scene;
use insonify::sim::contact::{Coupling, Skins};
use insonify::sim::shaders::Library;
use insonify::sim::{Simulator, Tracer, seen};

fn shipped(name: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("scenes/{name}.toml"));
    let (scene, warnings) = Scene::load(&path, &[]).expect(name);
    assert!(warnings.is_empty(), "{name}: {warnings:?}");
    scene
}

/// Tissue at a point of the probe's space, mm: the highest priority among the meshes that a ray
/// to infinity leaves once more than it enters. Direct, in f64; shares nothing with the tracers.
fn tissue(scene: &Scene, point: [f64; 3]) -> &str {
    let from = scene.world_from_probe.transform_point3(point.into());
    // Along no axis and through no vertex.
    let along = DVec3::new(0.611, 0.357, -0.706);
    let inside = scene.instances.iter().filter(|instance| {
        let mesh = &scene.meshes[instance.mesh];
        let corner = |i: u32| {
            let p = mesh.positions[i as usize].map(f64::from);
            instance.world_from_object.transform_point3(p.into()) - from
        };
        let exits = mesh.triangles.iter().map(|t| {
            let [a, b, c] = t.map(corner);
            // Signed volumes with the ray: all of one sign where it passes inside.
            let sides = [(a, b), (b, c), (c, a)].map(|(p, q)| along.dot(p.cross(q)));
            let ahead = |normal: DVec3| a.dot(normal) / along.dot(normal) > 0.0;
            let normal = (b - a).cross(c - a);
            match sides {
                s if s.iter().all(|v| *v > 0.0) && ahead(normal) => 1,
                s if s.iter().all(|v| *v < 0.0) && ahead(normal) => -1,
                _ => 0,
            }
        });
        exits.sum::<i32>() != 0
    });
    let top = inside.max_by_key(|i| i.priority);
    &scene.tissues[top.map_or(scene.background, |i| i.tissue)].name
}

#[test]
fn the_abdomen_shows_its_organs_in_the_default_view() {
    let mut scene = shipped("abdomen");
    // Lateral, elevation and depth read off the section drawn by hand, each well inside.
    let view = [
        ([0.0, 0.0, -10.0], "gel"),
        ([0.0, 0.0, 10.0], "fat"),
        ([0.0, 0.0, 17.5], "muscle"),
        ([-44.0, 0.0, 20.0], "cortical_bone"),
        ([-11.0, 0.0, 47.0], "cyst_fluid"),
        ([-20.0, 0.0, 40.0], "liver"),
        ([-45.0, 0.0, 128.0], "liver"),
        ([-36.0, 0.0, 112.0], "tumour"),
        ([29.0, 0.0, 62.0], "bile"),
        ([67.0, 0.0, 80.0], "stool"),
        ([-15.0, 0.0, 118.0], "kidney"),
        ([25.0, 0.0, 115.0], "renal_sinus"),
        ([-98.0, 0.0, 85.0], "lung"),
    ];
    for (point, expected) in view {
        assert_eq!(tissue(&scene, point), expected, "at {point:?}");
    }
    // The comparison notices priorities: a liver above its cyst hides it.
    for instance in &mut scene.instances {
        if instance.name == "liver" {
            instance.priority = 1000;
        }
    }
    assert_eq!(tissue(&scene, [-11.0, 0.0, 47.0]), "liver");
}

#[test]
fn the_face_of_the_abdomens_probe_touches_the_skin() {
    let scene = shipped("abdomen");
    for l in [0, 48, 95, 143, 191] {
        for e in 0..scene.probe.elevation_layers {
            let (origin, _) = scene.probe.ray(l, e);
            let at = tissue(&scene, origin.into());
            assert!(["gel", "skin"].contains(&at), "line {l}, layer {e}: {at}");
            let deeper = tissue(&scene, (origin + DVec3::Z * 10.0).into());
            assert_eq!(deeper, "fat", "line {l}, layer {e}");
        }
    }
}

/// Of each window onto the heart: what is to be seen there, by its least area, mm2.
const WINDOWS: [(&str, &[(&str, f64)]); 5] = [
    (
        "apical four-chamber",
        &[
            ("left-ventricle", 1500.0),
            ("right-ventricle", 800.0),
            ("left-atrium", 400.0),
            ("right-atrium", 400.0),
        ],
    ),
    ("apical two-chamber", &[("left-ventricle", 1500.0), ("left-atrium", 300.0)]),
    (
        "parasternal long axis",
        &[
            ("left-ventricle", 1000.0),
            ("right-ventricle", 200.0),
            ("left-atrium", 400.0),
            ("aorta", 400.0),
            ("mitral-valve", 20.0),
        ],
    ),
    (
        "parasternal short axis",
        &[("left-ventricle", 800.0), ("right-ventricle", 400.0), ("papillary-muscles", 50.0)],
    ),
    (
        "subcostal four-chamber",
        &[("left-ventricle", 500.0), ("right-ventricle", 400.0), ("right-atrium", 300.0)],
    ),
];

#[test]
fn every_window_onto_the_heart_shows_its_chambers() {
    let mut scene = shipped("heart");
    let (device, library) = (test_device(), Library::embedded());
    let mut skins = Skins::default();
    for (name, wanted) in WINDOWS {
        let pose = scene.poses.iter().find(|pose| pose.name == name).expect(name);
        scene.world_from_probe = pose.world_from_probe;
        let coupling = Coupling::of(&scene, &mut skins).expect("a skin");
        assert!(coupling.touch.share > 0.95, "{name}: {:?}", coupling.touch);
        let instance =
            |mesh: &str| scene.instances.iter().position(|i| i.name == mesh).expect(mesh);
        let instances: Vec<usize> = wanted.iter().map(|(mesh, _)| instance(mesh)).collect();
        let areas = seen::areas(&device, &library, &scene, Tracer::Bvh, &instances);
        for ((mesh, least), area) in wanted.iter().zip(areas.expect("a frame")) {
            println!("{name}: {mesh} {area:.0} mm2");
            assert!(area > *least, "{name}: {mesh} {area} mm2");
        }
    }
    // The comparison notices bone in front of the heart: the probe on the sternum.
    let on = scene.poses.iter().find(|pose| pose.name == "parasternal long axis").expect("there");
    let right = DVec3::new(-0.761, -0.213, 0.613);
    let mut off = on.world_from_probe;
    off.translation += 34.0 * right;
    scene.world_from_probe = off;
    let ventricle = scene.instances.iter().position(|i| i.name == "left-ventricle").expect("one");
    let areas = seen::areas(&device, &library, &scene, Tracer::Bvh, &[ventricle]).expect("a frame");
    let (_, least) = WINDOWS[2].1[0];
    assert!(areas[0] < least, "{areas:?} of {least} mm2 would pass");
}

#[test]
fn the_probe_of_every_scene_with_a_skin_touches_it() {
    for name in ["abdomen", "heart", "fetus", "pregnancy", "limbs"] {
        let scene = shipped(name);
        let coupling = Coupling::of(&scene, &mut Skins::default()).expect(name);
        assert_eq!(coupling.touch.share, 1.0, "{name}");
    }
}

#[test]
fn the_phantom_is_one_gel_with_contrast_in_it() {
    let scene = shipped("phantom");
    assert!(scene.wires.len() > 50);
    for (point, expected) in [
        ([0.0, 0.0, 0.5], "gel_050"),
        ([-60.0, 5.0, 65.0], "minus_9"),
        ([60.0, -5.0, 65.0], "plus_15"),
        ([-60.0, 0.0, 78.0], "anechoic"),
        ([-48.0, 0.0, 50.0], "anechoic"),
    ] {
        assert_eq!(tissue(&scene, point), expected, "at {point:?}");
    }
    let impedance = scene.tissues[0].impedance();
    // Equal to rounding: no interface may reflect.
    for tissue in &scene.tissues {
        assert!((tissue.impedance() / impedance - 1.0).abs() < 1e-12);
    }
}

#[test]
fn the_pregnancy_has_its_fetus_in_a_small_volume_of_the_pelvis() {
    let scene = shipped("pregnancy");
    for (point, expected) in [
        ([0.0, 0.0, 20.0], "mother_skin"),
        ([0.0, 0.0, 44.0], "decidua"),
        ([0.0, 0.0, 50.0], "amniotic_fluid"),
        ([2.0, 0.0, 69.0], "fetal_soft_tissue"),
        ([9.0, 0.0, 66.0], "fetal_brain"),
    ] {
        assert_eq!(tissue(&scene, point), expected, "at {point:?}");
    }
    holds_its_view("pregnancy", &scene, [1.0, 117.0], 15.0);
}

#[test]
fn the_early_pregnancy_has_embryo_and_yolk_sac_in_a_small_volume() {
    let mut scene = shipped("early");
    for (point, expected) in [
        ([0.0, 0.0, 15.0], "mother"),
        ([0.0, 0.0, 22.5], "decidua"),
        ([0.0, 0.0, 30.0], "amniotic_fluid"),
        ([-1.4, 0.0, 40.0], "blood"),
        ([0.3, 0.0, 44.0], "embryonic"),
        ([12.2, 0.0, 36.2], "amniotic_fluid"),
        ([12.2, 0.0, 38.45], "yolk_wall"),
    ] {
        assert_eq!(tissue(&scene, point), expected, "at {point:?}");
    }
    holds_its_view("early", &scene, [1.0, 79.0], 10.0);
    // The heart beats 160 times a minute: wide after a quarter of 0.375 s, narrow after three.
    for (time, expected) in [(0.094, "blood"), (0.281, "embryonic_heart")] {
        scene.set_time(time);
        assert_eq!(tissue(&scene, [0.25, 0.0, 39.6]), expected, "at {time} s");
    }
}

#[test]
fn the_ectopic_pregnancy_has_its_ring_beside_the_middle_of_a_small_volume() {
    let scene = shipped("ectopic");
    for (point, expected) in [
        // Place of the empty uterus in the volume.
        ([-20.0, 0.0, 38.0], "mother"),
        ([24.0, 0.0, 30.0], "decidua"),
        ([24.0, 0.0, 35.0], "amniotic_fluid"),
        ([22.5, 0.0, 40.1], "blood"),
        ([28.3, 0.0, 38.15], "yolk_wall"),
    ] {
        assert_eq!(tissue(&scene, point), expected, "at {point:?}");
    }
    holds_its_view("ectopic", &scene, [1.0, 79.0], 10.0);
}

/// Asserts that the default view between two depths lies in the scene's volume, and so do views `beside` mm from
/// it; mm. The volume is small enough for a repository.
fn holds_its_view(name: &str, scene: &Scene, depths: [f64; 2], beside: f64) {
    assert!(scene.shows_volume() && scene.masks_off_the_image().is_empty());
    let acquired = scene.volume.as_ref().expect("a volume");
    let voxel_from_probe = acquired.world_from_voxel.inverse() * scene.world_from_probe;
    let last = DVec3::from(acquired.size.map(|n| n as f64 - 1.0));
    let lines = scene.probe.scanlines;
    for (l, y) in
        [0, lines / 2, lines - 1].iter().flat_map(|l| [-beside, 0.0, beside].map(|y| (*l, y)))
    {
        let (mut origin, direction) = scene.probe.ray(l, 0);
        origin.y = y;
        for depth in depths {
            let voxel = voxel_from_probe.transform_point3(origin + depth * direction);
            assert!(
                voxel.cmpge(DVec3::ZERO).all() && voxel.cmple(last).all(),
                "{name}: line {l}, y {y}, depth {depth}: {voxel}"
            );
        }
    }
    let file = format!("scenes/{name}/pelvis.mha");
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(file);
    let bytes = std::fs::metadata(&file).expect("the volume").len();
    assert!(bytes < 3_200_000, "{bytes} bytes in the repository");
}

/// The rim of a mask in the picture: middle, half-axes of the ellipse in the middle of the rim, and half of its
/// width as a share of them; lateral and depth, mm.
struct Rim {
    middle: [f64; 2],
    radii: [f64; 2],
    width: f64,
}

#[test]
fn the_pregnancys_simulation_is_as_bright_as_its_volume() {
    let rim = Rim { middle: [0.0, 70.0], radii: [39.0, 26.0], width: 0.03 };
    is_as_bright("pregnancy", 96, &rim);
}

#[test]
fn the_early_pregnancys_simulation_is_as_bright_as_its_volume() {
    let rim = Rim { middle: [0.4, 38.8], radii: [19.2, 15.6], width: 0.06 };
    is_as_bright("early", 128, &rim);
}

#[test]
fn the_ectopic_pregnancys_simulation_is_as_bright_as_its_volume() {
    let rim = Rim { middle: [24.0, 39.0], radii: [10.4, 8.6], width: 0.1 };
    is_as_bright("ectopic", 128, &rim);
}

/// Asserts equal brightness on both sides of a sac's rim. In front of the sac nothing that floats in it shades the rim:
/// there the volume, swept over a pelvis with all its layers, and the simulation, through one medium in their
/// place, show the same tissue.
fn is_as_bright(name: &str, scanlines: u32, rim: &Rim) {
    let mut scene = shipped(name);
    scene.probe.scanlines = scanlines;
    scene.probe.elevation_layers = 3;
    let device = test_device();
    let simulator = Simulator::new(&device, &Library::embedded(), &scene, Tracer::Bvh);
    let mut simulator = simulator.expect("a simulator");
    // Mean grey in three parts of the ring between the sac and the muscle, from left to right.
    let mut of_one_draw = |scene: &Scene| {
        simulator.frame(scene, 0).expect("a frame");
        let steps = simulator.fusion_steps().expect("steps").expect("fused");
        let frame = *simulator.constants();
        let pitch = f64::from(frame.pixel_pitch);
        [-130f64, -90.0, -50.0].map(|middle| {
            let (mut sums, mut count) = ([0.0, 0.0], 0.0);
            for pixel in 0..steps.background.len() {
                let [i, j] = [pixel as u32 % frame.image_width, pixel as u32 / frame.image_width];
                let x = f64::from(frame.image_left) + (f64::from(i) + 0.5) * pitch;
                let z = f64::from(frame.image_top) + (f64::from(j) + 0.5) * pitch;
                let x = (x - rim.middle[0]) / rim.radii[0];
                let z = (z - rim.middle[1]) / rim.radii[1];
                let turn = z.atan2(x).to_degrees() - middle;
                if (x.hypot(z) - 1.0).abs() < rim.width && turn.abs() < 20.0 {
                    sums[0] += 255.0 * f64::from(steps.background[pixel]);
                    sums[1] += f64::from(steps.simulated[4 * pixel]);
                    count += 1.0;
                }
            }
            (sums[1] - sums[0]) / count
        })
    };
    // A part holds some twenty spots of speckle, whose mean strays by 5 grey levels: over eight draws by 2.
    let mut differences = |scene: &Scene| {
        let mut mean = [0.0; 3];
        for seed in 1..=8 {
            let mut scene = scene.clone();
            scene.simulation.seed = seed;
            let one = of_one_draw(&scene);
            mean = std::array::from_fn(|i| mean[i] + one[i] / 8.0);
        }
        mean
    };
    // 12 grey levels are 2.8 of the 60 dB: a reader of two grey wedges side by side overlooks that.
    let alike = |d: [f64; 3]| d.iter().all(|d| d.abs() < 12.0);
    let found = differences(&scene);
    println!("{name}: simulation above volume by {found:.1?} grey levels");
    assert!(alike(found), "{found:?}");
    // Planted: 6 dB.
    scene.imaging.gain += 6.0;
    let planted = differences(&scene);
    assert!(!alike(planted), "{planted:?}");
}
