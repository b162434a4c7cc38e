//! The work that a fused frame saves: around the masks sound goes straight on, and paths that nobody hears are
//! not traced.

use std::sync::Arc;

use insonify::gpu::{Device, test_device};
use insonify::scene::Scene;
use insonify::sim::layout::Counters;
use insonify::sim::shaders::Library;
use insonify::sim::{Simulator, Tracer, dump, tables};

use crate::common::tracers::tracers;

/// Two balls, the second behind the first, both beside the middle; a plate with the surrounding speed lies in
/// front of parts of both. No refraction.
const SCENE: &str = r#"
background = "around"
[probe]
preset = "linear"
scanlines = 48
elevation_layers = 1
samples = 800
depth = "40 mm"
speed = "1540 m/s"
[simulation]
paths = 4
max_reflections = 0
[imaging]
noise = -inf
image_height = 200
[tissues.around]
based_on = "liver"
speed = "1540 m/s"
[tissues.denser]
based_on = "around"
density = "1100 kg/m3"
[tissues.plate]
based_on = "around"
density = "1250 kg/m3"
[[mesh]]
name = "near"
tissue = "denser"
shape = { sphere = { radius = 5 } }
translate = [4.1, 0.3, 14.2]
[[mesh]]
name = "far"
tissue = "denser"
shape = { sphere = { radius = 6 } }
translate = [3.2, -0.4, 29.3]
[[mesh]]
name = "plate"
tissue = "plate"
priority = 1
shape = { box = { size = [16, 30, 2] } }
translate = [-1.3, 0.2, 5.7]
"#;
const VOLUME: &str = "NDims = 3\nDimSize = 2 2 2\nElementSpacing = 40 30 40\nOffset = -20 -15 0\n\
    ElementType = MET_UCHAR\nElementDataFile = LOCAL\n";
const FUSED: &str = "[volume]\nfile = \"volume.mha\"\n[fusion]\nmask = [\"near\", \"far\"]\n";

fn load(more: &str, overrides: &[(&str, &str)]) -> Scene {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("scene.toml"), format!("{SCENE}{more}")).expect("written");
    std::fs::write(at("volume.mha"), [VOLUME.as_bytes(), &[99; 8]].concat()).expect("written");
    let owned = |&(key, value): &(&str, &str)| (key.to_owned(), value.to_owned());
    let overrides: Vec<_> = overrides.iter().map(owned).collect();
    Scene::load(&at("scene.toml"), &overrides).expect("sound").0
}

/// Surface and volume echoes, and counters.
fn shoot(device: &Arc<Device>, scene: &Scene, tracer: Tracer) -> ([Vec<i32>; 2], Counters) {
    let mut simulator =
        Simulator::new(device, &Library::embedded(), scene, tracer).expect("a simulator");
    simulator.frame(scene, 0).expect("a frame");
    let counters = simulator.counters().expect("counters");
    (simulator.echoes().expect("echoes"), counters)
}

/// Distance from a ball's surface that its own echo and the beam's width reach, mm.
const REACH: f64 = 0.4;
/// Tolerance as a share of the loudest echo: a stretch cut at the mask's border starts elsewhere, and single
/// precision rounds its distances and phases (400 cycles of the carrier) anew.
const ROUNDING: f64 = 1e-3;

/// Indices in `echoes` of the samples well inside one of the first two meshes, which are balls.
fn inside(scene: &Scene) -> Vec<usize> {
    let balls = [(0, 5.0), (1, 6.0)];
    let mut places = Vec::new();
    for l in 0..scene.probe.scanlines {
        let (o, d) = scene.probe.ray(l, 0);
        for k in 0..scene.probe.samples {
            let p = o + f64::from(k) * scene.probe.sample_pitch() * d;
            let within = |&(i, r): &(usize, f64)| {
                let instance = &scene.instances[i];
                p.distance(instance.world_from_object.translation) < r - REACH
            };
            if balls.iter().any(within) {
                let at = 2 * (l * scene.probe.samples + k) as usize;
                places.extend([at, at + 1]);
            }
        }
    }
    places
}

/// Number of samples inside the balls at which the echoes differ by more than rounding.
fn unequal(scene: &Scene, fused: &[Vec<i32>; 2], whole: &[Vec<i32>; 2]) -> usize {
    let places = inside(scene);
    assert!(places.len() > 5_000, "{}", places.len());
    let pairs = fused.iter().zip(whole);
    let far = pairs.map(|(fused, whole)| {
        let loudest = whole.iter().map(|v| v.unsigned_abs()).max().unwrap_or(0);
        let allowed = (ROUNDING * f64::from(loudest)) as u32;
        let differ = |&&at: &&usize| fused[at].abs_diff(whole[at]) > allowed;
        places.iter().filter(differ).count()
    });
    far.sum()
}

#[test]
fn inside_two_masks_in_a_row_the_echoes_are_those_of_the_whole_scene_for_less_work() {
    let device = test_device();
    // Along the scanlines alone: others of the aperture pass beside the masks, where nobody follows them.
    let ray = ("simulation.loss", "ray");
    let (whole, fused) = (load("", &[ray]), load(FUSED, &[ray]));
    let shifted = load("", &[ray, ("mesh.far.translate", "[3.2, -0.4, 29.33]")]);
    for tracer in tracers(&device) {
        let (expected, all) = shoot(&device, &whole, tracer);
        let (echoes, kept) = shoot(&device, &fused, tracer);
        assert_eq!(unequal(&fused, &echoes, &expected), 0, "{tracer}");
        // The comparison notices a ball that is 0.03 mm, a fifth of a wavelength, lower.
        let (other, _) = shoot(&device, &shifted, tracer);
        assert!(unequal(&fused, &other, &expected) > 100, "{tracer}");
        // Two thirds of the scanlines meet no mask; the others end behind the second.
        assert!(4 * kept.rays < 3 * all.rays, "{} of {}", kept.rays, all.rays);
        assert!(2 * kept.segments < all.segments, "{kept:?} of {all:?}");
        assert!(3 * kept.candidates < all.candidates, "{kept:?} of {all:?}");
        assert!(kept.deposits > 0);
    }
    assert_eq!(device.validation_messages(), Vec::<String>::new());
}

#[test]
fn a_mask_off_the_image_costs_no_ray() {
    let device = test_device();
    let off = [("mesh.near.translate", "[60, 0, 20]"), ("mesh.far.translate", "[0, 0, 60]")];
    let scene = load(FUSED, &off);
    for tracer in tracers(&device) {
        let ([surface, volume], counters) = shoot(&device, &scene, tracer);
        assert!(surface.iter().chain(&volume).all(|&v| v == 0), "{tracer}");
        let work = [counters.rays, counters.segments, counters.candidates];
        assert_eq!(work, [0; 3], "{tracer}");
    }
}

/// An oblique plate of bone in front of the masks: sound goes straight through it, in the time that the probe
/// assumes, absorbed along its path and weakened twice by 1 - R.
#[test]
fn a_plate_in_front_of_the_mask_weakens_what_is_heard_and_moves_nothing() {
    let device = test_device();
    let (angle, thickness) = (25.0_f64, 2.0);
    let plate = "[tissues.hard]\nbased_on = \"fetal_bone\"\nattenuation = \"3 dB/cm/MHz\"\n\
        [[mesh]]\nname = \"bone\"\ntissue = \"hard\"\npriority = 2\n\
        shape = { box = { size = [60, 60, 2] } }\n\
        rotate = { axis = [0, 1, 0], angle = \"25 deg\" }\ntranslate = [3, 0, 4]\n";
    let far = [
        ("mesh.plate.translate", "[0, 0, 200]"),
        ("mesh.near.translate", "[4.1, 0.3, 22.2]"),
        ("mesh.far.translate", "[3.2, -0.4, 32.1]"),
    ];
    let (clear, behind) = (load(FUSED, &far), load(&format!("{plate}{FUSED}"), &far));
    let rows = tables::tissues(&behind);
    let bone = behind.instances.last().expect("the plate is the last").tissue;
    let (around, bone) = (rows[behind.background], rows[bone]);
    let along = thickness / angle.to_radians().cos();
    let reflected = (bone.impedance - around.impedance) / (bone.impedance + around.impedance);
    let passed = (1.0 - f64::from(reflected * reflected)).powi(2);
    let expected = passed * (-f64::from(bone.absorption - around.absorption) * along).exp();
    assert!((0.05..0.5).contains(&expected), "{expected}");
    for tracer in tracers(&device) {
        let ([_, clear], _) = shoot(&device, &clear, tracer);
        let ([_, shadowed], _) = shoot(&device, &behind, tracer);
        let places = inside(&behind);
        let sum = |a: &[i32], b: &[i32]| -> f64 {
            places.iter().map(|&i| f64::from(a[i]) * f64::from(b[i])).sum()
        };
        let level = sum(&clear, &shadowed) / sum(&clear, &clear);
        let alike =
            sum(&clear, &shadowed) / (sum(&clear, &clear) * sum(&shadowed, &shadowed)).sqrt();
        // Fixed point rounds each sample; phases as above.
        assert!((level / expected - 1.0).abs() < 2e-3, "{tracer}: {level} for {expected}");
        assert!(alike > 0.999, "{tracer}: {alike}");
    }
}

#[test]
fn origin_and_trace_of_a_fused_frame_equal_their_twins() {
    let device = test_device();
    let library = Library::embedded();
    // Reflections, and the face that sends some of them back into the mask.
    let more = [
        ("simulation.max_reflections", "3"),
        ("simulation.face_reflection", "true"),
        ("probe.scanlines", "24"),
    ];
    let scene = load(FUSED, &more);
    let mut simulator =
        Simulator::new(&device, &library, &scene, Tracer::Bvh).expect("a simulator");
    simulator.frame(&scene, 0).expect("a frame");
    let folder = tempfile::tempdir().expect("a folder");
    dump::frame(&mut simulator, &scene, folder.path()).expect("dumped");
    for name in ["origin", "trace"] {
        for check in insonify_tools::harness::dump::check(&device, &library, folder.path(), name) {
            assert!(check.passed(), "{name}: {check}");
        }
    }
}
