//! Fusion from the scene file to the frame: refusals, echoes, dumps.

use std::path::Path;
use std::sync::Arc;

use glam::{DAffine3, DVec3};
use insonify::gpu::{Device, Image, ImageDim, ImageFormat, test_device};
use insonify::scene::{Acquired, Scene, SceneError, Strategy, shapes};
use insonify::settings::{Loss, Words};
use insonify::sim::dump;
use insonify::sim::fusion::Tint;
use insonify::sim::shaders::Library;
use insonify::sim::{Outputs, Shot, Simulator, Tracer};
use insonify::volume::Voxels;

use crate::common::shared_data::shared_data;
use crate::common::tracers::tracers;

/// A ball around a depth of 25 mm, and a block of higher priority from its middle to the left: the
/// ball's surface lies within the block there. No refraction: all sound is equally fast.
const SCENE: &str = r#"
background = "around"
[probe]
preset = "linear"
bandwidth = 0.77
scanlines = 48
elevation_layers = 1
samples = 800
depth = "40 mm"
speed = "1540 m/s"
[simulation]
paths = 1
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
[tissues.lighter]
based_on = "around"
density = "1000 kg/m3"
[[mesh]]
name = "ball"
tissue = "denser"
shape = { sphere = { radius = 8 } }
translate = [1.1, 0.3, 22.2]
[[mesh]]
name = "block"
tissue = "lighter"
priority = 1
shape = { box = { size = [16, 30, 14] } }
translate = [-8.3, 0.2, 21.7]
[[wire]]
from = [12, 0, 20]
amplitude = -30
[[wire]]
from = [3, 0, 27]
amplitude = -30
"#;

const VOLUME: &str = "NDims = 3\nDimSize = 5 4 3\nElementSpacing = 12 9 17\nOffset = -25 -13 1\n\
    ElementType = MET_UCHAR\nElementDataFile = LOCAL\n";

/// A triangle that encloses nothing.
const OPEN: &str = "v 0 0 0\nv 9 0 0\nv 0 9 0\nf 1 2 3\n";

/// Loads SCENE with `more` behind it, beside a volume and an open mesh.
fn load(more: &str) -> Result<Scene, SceneError> {
    let folder = tempfile::tempdir().expect("a folder");
    write(folder.path(), more);
    Scene::load(&folder.path().join("scene.toml"), &[]).map(|(scene, _)| scene)
}

fn write(folder: &Path, more: &str) {
    let file = |name: &str, bytes: &[u8]| {
        std::fs::write(folder.join(name), bytes).expect("written");
    };
    let voxels: Vec<u8> = (0..60).map(|i| (i * 4) as u8).collect();
    file("scene.toml", format!("{SCENE}{more}").as_bytes());
    file("volume.mha", &[VOLUME.as_bytes(), &voxels].concat());
    file("open.obj", OPEN.as_bytes());
}

const FUSED: &str = "[volume]\nfile = \"volume.mha\"\n[fusion]\nmask = [\"ball\"]\n";

#[test]
fn mistakes_name_line_cause_and_remedy() {
    let line = SCENE.lines().count() + 1;
    let volume = "[volume]\nfile = \"volume.mha\"\n";
    let open = "[[mesh]]\nname = \"sheet\"\ntissue = \"around\"\nfile = \"open.obj\"\n";
    for (more, at, cause, remedy) in [
        (volume.to_owned(), line, "no [fusion]", "add [fusion]"),
        ("[fusion]\nmask = [\"ball\"]\n".to_owned(), line, "the scene has none", "add [volume]"),
        (format!("{volume}[fusion]\nmask = []\n"), line + 3, "no mesh", "name the closed mesh"),
        (
            format!("{volume}[fusion]\nmask = [\"ball\", \"blok\"]\n"),
            line + 3,
            "no mesh `blok`",
            "`block`",
        ),
        (
            format!("{open}{volume}[fusion]\nmask = [\"sheet\"]\n"),
            line + 7,
            "3 of its edges are open",
            "cap_openings",
        ),
        (format!("{FUSED}blur = 0\n"), line + 4, "blur is 0", "between 1 and 512"),
        (FUSED.replace("volume.mha", "nothing.mha"), line + 1, "cannot be used", "insonify check"),
        (
            FUSED.replace("[fusion]", "black = 7\nwhite = 7\n[fusion]"),
            line + 2,
            "the same stored value",
            "two different",
        ),
        (
            FUSED.replace("[fusion]", "white = nan\n[fusion]"),
            line + 2,
            "white is NaN",
            "stored values",
        ),
    ] {
        let error = load(&more).map(|_| ()).expect_err(cause);
        let help = error.remedy.clone().unwrap_or_default();
        assert_eq!(error.line, at, "{error}");
        assert!(error.message.contains(cause), "{error}");
        assert!(help.contains(remedy), "{cause}: {help}");
    }
    let closed = format!("{open}{FUSED}").replace("open.obj\"", "open.obj\"\ncap_openings = true");
    let closed = closed.replace("[\"ball\"]", "[\"sheet\"]");
    load(&closed).expect("a sheet whose opening is closed by another has an inside");
}

/// Echoes (surface, volume) and pixels.
fn shoot(device: &Arc<Device>, scene: &Scene, tracer: Tracer) -> ([Vec<i32>; 2], Vec<u8>) {
    let library = Library::embedded();
    let mut simulator = Simulator::new(device, &library, scene, tracer).expect("a simulator");
    simulator.frame(scene, 0).expect("a frame");
    let pixels = simulator.pixels().expect("pixels").2;
    (simulator.echoes().expect("echoes"), pixels)
}

/// Distance to which an echo is heard beside its place, mm: the cells that the beam covers, and a sample to
/// either side.
const REACH: f64 = 0.4;
/// Tolerance as a share of the loudest echo: a stretch cut at the mask's border starts elsewhere, and single
/// precision rounds its distances and phases (400 cycles of the carrier) anew.
const ROUNDING: f64 = 1e-3;

/// Number of echoes of `masked` outside the ball, of samples inside it at which they differ from `whole`, and of
/// echoes of `whole` outside.
fn compare(scene: &Scene, masked: &[Vec<i32>; 2], whole: &[Vec<i32>; 2]) -> [usize; 3] {
    let ball = scene.instances[0].world_from_object.translation;
    let (mut stray, mut other, mut silenced) = (0, 0, 0);
    for (masked, whole) in masked.iter().zip(whole) {
        let loudest = whole.iter().map(|v| v.abs()).max().unwrap_or(0);
        let allowed = (ROUNDING * f64::from(loudest)) as i32;
        for l in 0..scene.probe.scanlines {
            let (o, d) = scene.probe.ray(l, 0);
            for k in 0..scene.probe.samples {
                let p = o + f64::from(k) * scene.probe.sample_pitch() * d;
                let at = 2 * (l * scene.probe.samples + k) as usize;
                let depth = p.distance(ball) - 8.0;
                let (masked, whole) = (&masked[at..at + 2], &whole[at..at + 2]);
                if depth > REACH {
                    stray += usize::from(masked != [0, 0]);
                    silenced += usize::from(whole != [0, 0]);
                } else if depth < -REACH {
                    let far = |i: usize| masked[i].abs_diff(whole[i]) > allowed.unsigned_abs();
                    other += usize::from(far(0) || far(1));
                }
            }
        }
    }
    [stray, other, silenced]
}

#[test]
fn only_the_inside_of_the_mask_echoes_and_as_without_a_mask() {
    let device = test_device();
    // Along the scanline alone: others of the aperture pass beside the mask, where nobody follows them.
    let load = |more: &str| {
        let mut scene = load(more).expect("sound");
        scene.simulation.loss = Loss::Ray;
        scene
    };
    let plain = load("");
    for tracer in tracers(&device) {
        let (whole, pixels) = shoot(&device, &plain, tracer);
        for surroundings in ["volume", "none", "scatterers"] {
            let more = format!("{FUSED}surroundings = \"{surroundings}\"\n");
            let scene = load(&more);
            let (echoes, fused) = shoot(&device, &scene, tracer);
            if surroundings == "scatterers" {
                assert!(echoes == whole, "{tracer}: the echoes without fusion");
                assert!(fused == pixels, "{tracer}: the image without fusion");
                continue;
            }
            let [stray, other, silenced] = compare(&scene, &echoes, &whole);
            assert_eq!([stray, other], [0; 2], "{tracer} {surroundings}");
            assert!(silenced > 10_000, "{silenced}");
            // The same comparison notices a ball that is heard as a whole.
            assert!(compare(&scene, &whole, &whole)[0] > 10_000);
            assert!(fused != pixels, "{tracer} {surroundings}");
        }
    }
    assert_eq!(device.validation_messages(), Vec::<String>::new());
}

/// A mask whose keyframes are balls of 5 and 8 mm, swayed by up to 4 mm to the side and 3 mm down.
const MOVING: &str = r#"
[[transform]]
name = "sway"
translate = [0.7, 0.2, 20.3]
motion = { kind = "sine", period = 4, translate = [4, 0, 3] }
[[selector]]
name = "beat"
parent = "sway"
period = 2
strategy = "STRATEGY"
[[mesh]]
name = "sac"
parent = "beat"
tissue = "denser"
keyframes = ["small.obj", "large.obj"]
[volume]
file = "volume.mha"
[fusion]
mask = ["sac"]
"#;
const RADII: [f64; 2] = [5.0, 8.0];

/// Numbers of mask samples on the wrong side of the ball at `seconds`, except beside its surface; and inside it.
fn wrong_of_ball(scene: &Scene, prescan: &[f32], seconds: f64) -> (usize, usize) {
    let sway = (std::f64::consts::TAU * seconds / 4.0).sin();
    let centre = DVec3::new(0.7 + 4.0 * sway, 0.2, 20.3 + 3.0 * sway);
    let radius = RADII[(seconds / 1.0) as usize % 2];
    let (samples, pitch) = (scene.probe.samples, scene.probe.sample_pitch());
    let (mut wrong, mut inside) = (0, 0);
    for l in 0..scene.probe.scanlines {
        let (mut o, d) = scene.probe.ray(l, 0);
        o.y = 0.0;
        for k in 0..samples {
            let t = f64::from(k) * pitch;
            let within = |t: f64| (o + t * d).distance(centre) < radius;
            let found = prescan[2 * (l * samples + k) as usize] == 0.0;
            inside += usize::from(found);
            wrong += usize::from(![t - pitch, t, t + pitch].map(within).contains(&found));
        }
    }
    (wrong, inside)
}

#[test]
fn a_mask_follows_its_transform_and_its_selector_by_every_strategy() {
    let device = test_device();
    let library = Library::embedded();
    let obj = |radius: f64| {
        let ball = shapes::sphere(radius, 4);
        let vertices = ball.positions.iter().map(|[x, y, z]| format!("v {x} {y} {z}\n"));
        let face = |t: &[u32; 3]| format!("f {} {} {}\n", t[0] + 1, t[1] + 1, t[2] + 1);
        let faces = ball.triangles.iter().map(face);
        vertices.chain(faces).collect::<String>()
    };
    for strategy in Strategy::ALL.iter().copied() {
        let folder = tempfile::tempdir().expect("a folder");
        write(folder.path(), &MOVING.replace("STRATEGY", &strategy.to_string()));
        for (name, radius) in [("small", RADII[0]), ("large", RADII[1])] {
            std::fs::write(folder.path().join(format!("{name}.obj")), obj(radius))
                .expect("written");
        }
        let (mut scene, _) = Scene::load(&folder.path().join("scene.toml"), &[]).expect("sound");
        for tracer in tracers(&device) {
            if (strategy, tracer) == (Strategy::Selector, Tracer::RayQuery) {
                continue;
            }
            scene.set_time(0.0);
            let mut simulator =
                Simulator::new(&device, &library, &scene, tracer).expect("a simulator");
            // Keyframes themselves, in the middle of their turns and at their begin: some strategies blend between.
            let times = [0.0, 1.0, 2.0, 3.0, 5.0];
            for (i, seconds) in times.into_iter().enumerate() {
                scene.set_time(seconds);
                simulator.frame(&scene, 0).expect("a frame");
                let steps = simulator.fusion_steps().expect("read").expect("fused");
                let (wrong, inside) = wrong_of_ball(&scene, &steps.prescan, seconds);
                // Triangles of a sphere of 5120 lie up to a thousandth of the radius inside.
                assert!(
                    wrong == 0 && inside > 1000,
                    "{strategy}, {tracer}, {seconds} s: {wrong} of {inside}"
                );
                let other = times[(i + 1) % times.len()];
                let (planted, _) = wrong_of_ball(&scene, &steps.prescan, other);
                assert!(
                    planted > 500,
                    "{strategy}, {tracer}: the ball of {other} s is another: {planted}"
                );
            }
        }
    }
    assert_eq!(device.validation_messages(), Vec::<String>::new());
}

#[test]
fn masks_off_the_image_are_found() {
    let off = |place: &str| {
        let text = FUSED.replace("ball", "far")
            + "[[mesh]]\nname = \"far\"\ntissue = \"denser\"\nshape = { sphere = { radius = 5 } }\n"
            + place;
        load(&text).expect("sound").masks_off_the_image().len()
    };
    for (place, lost) in [
        ("translate = [0, 0, 20]\n", 0),
        // Ends behind the face, around it, and begins before the image does.
        ("translate = [0, 0, -4.9]\n", 0),
        ("translate = [0, 0, -5.1]\n", 1),
        ("translate = [0, 0, 44.9]\n", 0),
        ("translate = [0, 0, 45.1]\n", 1),
        ("translate = [0, 5.1, 20]\n", 1),
        ("translate = [0, 4.9, 20]\n", 0),
        ("translate = [25, 0, 20]\n", 1),
        // Around the whole image.
        ("scale = 100\n", 0),
    ] {
        assert_eq!(off(place), lost, "{place}");
    }
}

#[test]
fn render_warns_of_a_mask_off_the_image_and_shows_the_steps() {
    let folder = tempfile::tempdir().expect("a folder");
    write(folder.path(), FUSED);
    let at = |name: &str| folder.path().join(name).display().to_string();
    let render = |more: &[&str]| {
        let (scene, image) = (at("scene.toml"), at("image.png"));
        let fixed = ["render", scene.as_str(), "-o", image.as_str(), "--tracer", "bvh"];
        let out = std::process::Command::new(env!("CARGO_BIN_EXE_insonify"))
            .args(fixed.iter().chain(more))
            .output()
            .expect("the program starts");
        let said = String::from_utf8_lossy(&out.stderr).into_owned();
        assert!(out.status.success(), "{said}");
        said
    };
    let said = render(&["--set", "mesh.ball.translate=[90, 0, 0]"]);
    assert!(said.contains("mask `ball` never meets the image"), "{said}");
    let said = render(&["--dump", &at("dump")]);
    assert!(!said.contains("warning"), "{said}");
    let level = |name: &str, x: u32, y: u32| {
        let image = image::open(folder.path().join("dump").join(name)).expect(name);
        image.to_luma8().get_pixel(x, y).0[0]
    };
    // In the middle of the ball, and in a corner: 5 pixels per mm.
    let places = [(95 + 5, 111), (10, 190)];
    let masks = places.map(|(x, y)| level("7_mask.png", x, y));
    assert_eq!(masks, [0, 255]);
    let fused = places.map(|(x, y)| level("5_bmode.png", x, y));
    assert_eq!(fused[0], level("9_simulation.png", 100, 111));
    assert_eq!(fused[1], level("6_background.png", 10, 190));
}

/// Share of the acquired image, from the blurred mask.
fn weight(blurred: f32, is_smooth: bool) -> f64 {
    // Scan conversion may leave a mask a rounding above 1.
    let m = f64::from(blurred).min(1.0);
    if is_smooth { m * m * (3.0 - 2.0 * m) } else { m }
}

/// Number of pixels of a fused image that are not the mix of its whole steps, where a rounding either side of the middle
/// between two greys will do; and of those that are simulated, mixed and acquired.
fn unlike_the_steps(simulator: &mut Simulator, is_smooth: bool) -> (usize, [usize; 3]) {
    let (_, _, shown) = simulator.pixels().expect("pixels");
    let steps = simulator.fusion_steps().expect("read").expect("fused");
    let (mut wrong, mut kinds) = (0, [0; 3]);
    for (i, pixel) in shown.chunks_exact(4).enumerate() {
        let simulated = &steps.simulated[4 * i..][..4];
        if simulated[3] == 0 {
            wrong += usize::from(pixel != [0; 4]);
            continue;
        }
        let m = weight(steps.blurred[i], is_smooth);
        kinds[if m == 0.0 { 0 } else { 1 + usize::from(m == 1.0) }] += 1;
        let level =
            255.0 * m * f64::from(steps.background[i]) + (1.0 - m) * f64::from(simulated[0]);
        wrong += usize::from((level - f64::from(pixel[0])).abs() > 0.501 || pixel[3] != 255);
    }
    (wrong, kinds)
}

/// Frames convert and blur only what they show. The result is that of the whole images, whatever the probe and wherever
/// the mask's border lies in the image; what was shown before does not come back.
#[test]
fn a_fused_frame_is_the_mix_of_its_whole_steps() {
    let device = test_device();
    let library = Library::embedded();
    for preset in ["linear", "abdominal", "phased"] {
        for (blend, boxes) in [("linear", [1, 9, 32]), ("smooth", [2, 33, 150])] {
            let folder = tempfile::tempdir().expect("a folder");
            write(folder.path(), FUSED);
            let set = [("probe.preset", preset), ("fusion.blend", blend)];
            let set = set.map(|(key, value)| (key.to_owned(), value.to_owned()));
            let (scene, _) = Scene::load(&folder.path().join("scene.toml"), &set).expect("sound");
            let mut simulator =
                Simulator::new(&device, &library, &scene, Tracer::Bvh).expect("made");
            for (index, edge) in (0u32..).zip(boxes) {
                let mut scene = scene.clone();
                scene.fusion.as_mut().expect("fused").blur = edge;
                // Another place each time: tiles of the frame before have become others.
                scene.world_from_probe *=
                    DAffine3::from_translation(DVec3::new(3.7 * f64::from(index), 0.0, 0.0));
                simulator.frame(&scene, index).expect("a frame");
                let (wrong, kinds) = unlike_the_steps(&mut simulator, blend == "smooth");
                assert_eq!(wrong, 0, "{preset}, {blend}, {edge}");
                assert!(kinds[0] > 0 || edge > 100, "{preset}, {blend}, {edge}: {kinds:?}");
                assert!(kinds[1] > 0 && kinds[2] > 500, "{preset}, {blend}, {edge}: {kinds:?}");
                // The other curve is noticed where both images are mixed.
                let (planted, _) = unlike_the_steps(&mut simulator, blend != "smooth");
                assert!(planted > 100 || edge < 9, "{preset}, {blend}, {edge}: {planted}");
            }
        }
    }
    assert_eq!(device.validation_messages(), Vec::<String>::new());
}

#[test]
fn kernels_of_the_fusion_run_alone_on_what_a_frame_dumped() {
    let device = test_device();
    let library = Library::embedded();
    let bands = format!("{FUSED}blend = \"multiband\"\nbackground_shadows = true\n");
    let plain = load(FUSED).expect("sound");
    let mut simulator =
        Simulator::new(&device, &library, &plain, Tracer::Bvh).expect("a simulator");
    // Both may be switched on later.
    for (scene, names) in [
        (plain, &["mask", "tiles", "convert", "blur", "fuse"][..]),
        (
            load(&bands).expect("sound"),
            &["mask", "shadow", "darken", "tiles", "convert", "difference", "fuse"],
        ),
    ] {
        simulator.frame(&scene, 0).expect("a frame");
        let folder = tempfile::tempdir().expect("a folder");
        dump::frame(&mut simulator, &scene, folder.path()).expect("dumped");
        for name in names {
            for check in
                insonify_tools::harness::dump::check(&device, &library, folder.path(), name)
            {
                assert!(check.passed(), "{name}: {check}");
            }
        }
    }
}

/// One voxel more along an axis than the device's images have texels: pairs are averaged, and a linear
/// function stays in place.
#[test]
fn a_volume_beyond_the_devices_limit_is_averaged_with_a_warning() {
    let device = test_device();
    let long = device.limits().max_image_3d as usize + 1;
    let pitch = 60.0 / long as f64;
    let mut scene = load(FUSED).expect("sound");
    let value = |x: f64| 0.5 + x / 100.0;
    let voxels = (0..4 * long).map(|i| value((i % long) as f64 * pitch - 30.0) as f32);
    scene.volume = Some(Acquired {
        size: [long, 2, 2],
        volumes: vec![Arc::new(Voxels::F32(voxels.collect()))],
        now: 0,
        sequence: None,
        world_from_voxel: DAffine3::from_translation(DVec3::new(-30.0, -30.0, -30.0))
            * DAffine3::from_scale(DVec3::new(pitch, 60.0, 90.0)),
        world_from_lps: DAffine3::IDENTITY,
        black: 0.0,
        white: 1.0,
    });
    let library = Library::embedded();
    let mut simulator =
        Simulator::new(&device, &library, &scene, Tracer::Bvh).expect("a simulator");
    let warning = simulator.warning().expect("a warning").to_owned();
    assert!(warning.contains("averaged to"), "{warning}");
    simulator.frame(&scene, 0).expect("a frame");
    let steps = simulator.fusion_steps().expect("read").expect("fused");
    for l in 0..scene.probe.scanlines {
        let at = 2 * (l * scene.probe.samples + 300) as usize + 1;
        let expected = value(scene.probe.ray(l, 0).0.x);
        // Places among thousands of texels are good to 1e-4 of one, 1e-7 of grey; the rest is rounding.
        let error = f64::from(steps.prescan[at]) - expected;
        assert!(error.abs() < 2e-6, "line {l}: {error}");
    }
    assert_eq!(device.validation_messages(), Vec::<String>::new());
}

/// The scene with a real volume: both images are there, and meet at the mask.
#[test]
fn a_sac_in_a_real_acquired_volume() {
    if shared_data().is_none() {
        return;
    }
    let device = test_device();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/scenes/fusion.toml");
    let smaller =
        [("probe.scanlines", "96"), ("probe.samples", "1024"), ("imaging.image_height", "300")]
            .map(|(key, value)| (key.to_owned(), value.to_owned()));
    let (scene, warnings) = Scene::load(&path, &smaller).expect("sound");
    assert!(warnings.is_empty(), "{warnings:?}");
    assert!(scene.masks_off_the_image().is_empty());
    let mut images = Vec::new();
    for tracer in tracers(&device) {
        let library = Library::embedded();
        let mut simulator = Simulator::new(&device, &library, &scene, tracer).expect("made");
        simulator.frame(&scene, 0).expect("a frame");
        let (_, _, rgba) = simulator.pixels().expect("pixels");
        let steps = simulator.fusion_steps().expect("read").expect("fused");
        let mean = |weight: &dyn Fn(f32) -> bool| {
            let chosen = rgba.chunks_exact(4).zip(&steps.blurred).filter(|(_, m)| weight(**m));
            let (count, sum) =
                chosen.fold((0.0, 0.0), |(n, s), (p, _)| (n + 1.0, s + f64::from(p[0])));
            (count, sum / count)
        };
        let (inside, simulated) = mean(&|m| m == 0.0);
        let (outside, acquired) = mean(&|m| m == 1.0);
        let area = inside / (inside + outside);
        // An ellipse of 27 by 21 mm in an image of 38 by 46 mm, less half the ramp.
        assert!((0.15..0.26).contains(&area), "{tracer}: share simulated {area}");
        assert!(simulated > 15.0 && acquired > 15.0, "{tracer}: {simulated} {acquired}");
        images.push(rgba);
    }
    for other in &images[1..] {
        let differ = images[0].iter().zip(other).filter(|(a, b)| a.abs_diff(**b) > 1);
        assert!(differ.count() * 1000 < images[0].len(), "the tracers differ");
    }
}

/// The volume behind a bone is darker, and everything beside the mask stays as it was.
#[test]
fn a_bone_throws_its_shadow_into_a_real_acquired_volume() {
    if shared_data().is_none() {
        return;
    }
    let device = test_device();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/scenes/fusion_bone.toml");
    let smaller = [
        ("probe.scanlines", "96"),
        ("probe.samples", "768"),
        ("probe.elevation_layers", "1"),
        ("imaging.image_height", "300"),
    ]
    .map(|(key, value)| (key.to_owned(), value.to_owned()));
    let (with, warnings) = Scene::load(&path, &smaller).expect("sound");
    assert!(warnings.is_empty(), "{warnings:?}");
    let mut without = with.clone();
    let fusion = without.fusion.as_mut().expect("it is fused");
    fusion.background_shadows = false;
    let library = Library::embedded();
    let mut simulator = Simulator::new(&device, &library, &with, Tracer::Bvh).expect("a simulator");
    let mut shoot = |scene: &Scene| {
        simulator.frame(scene, 0).expect("a frame");
        let steps = simulator.fusion_steps().expect("read").expect("fused");
        steps.background
    };
    let (dark, clear) = (shoot(&with), shoot(&without));
    // Along the scanline alone; the aperture's penumbra reaches farther.
    let mut ray = with.clone();
    ray.simulation.loss = Loss::Ray;
    let sharp = shoot(&ray);
    let width = clear.len() / 300;
    // Pixels are 0.1 mm; the bone's middle lies at a depth of 5 mm, next to the middle of the image.
    let mean = |image: &[f32], x: std::ops::Range<usize>| -> f32 {
        let pixels = (80..110).flat_map(|j| x.clone().map(move |i| j * width + i));
        let values: Vec<f32> = pixels.map(|at| image[at]).collect();
        values.iter().sum::<f32>() / values.len() as f32
    };
    let behind = width / 2 - 12..width / 2 + 5;
    let (shaded, shown) = (mean(&dark, behind.clone()), mean(&clear, behind));
    // Bone of 3 mm at 6 MHz takes 15 dB more than muscle and its faces 8 dB, of 60 dB; beside its
    // middle less.
    let lost = shown - shaded;
    assert!((0.3..0.4).contains(&lost), "{shown} {shaded}");
    // Where nothing is lost a device may round the logarithm of 1 to 2^-21 of a neper, which is 7e-8 of the range.
    let beside = (0..clear.len()).filter(|at| (at % width).abs_diff(width / 2) > 80);
    for at in beside {
        assert!((sharp[at] - clear[at]).abs() < 1e-6, "{at}: {} {}", sharp[at], clear[at]);
    }
    assert!(sharp != dark, "a penumbra");
}

/// Levels of a pixel under a colour; `share` of it is acquired, before the blend's curve.
fn tint_of(grey: &[u8], tint: &Tint, share: f32, is_smooth: bool) -> [f64; 3] {
    let m = weight(share, is_smooth);
    std::array::from_fn(|i| {
        let grey = f64::from(grey[i]);
        grey + f64::from(tint.opacity) * m * (f64::from(tint.colour[i]) - grey)
    })
}

/// Returns whether an opaque pixel shows these levels, rounded; 1e-4 from the middle between two either is right
/// (single precision of numbers to 255).
fn is_shown(pixel: &[u8], levels: [f64; 3]) -> bool {
    let near = |(byte, level): (&u8, f64)| (f64::from(*byte) - level).abs() < 0.5001;
    pixel[3] == 255 && pixel.iter().zip(levels).all(near)
}

#[test]
fn the_tint_marks_the_acquired_pixels_and_leaves_the_image_alone() {
    let device = test_device();
    for (settings, opacity, is_hard) in [
        ("blur = 1\n", 1.0, true),
        ("blur = 9\n", 0.35, false),
        ("blur = 9\nblend = \"smooth\"\n", 1.0, false),
        ("blur = 9\nblend = \"multiband\"\n", 0.6, true),
    ] {
        let tint = Tint { colour: [255, 0, 128], opacity };
        let scene = load(&format!("{FUSED}{settings}")).expect("sound");
        let library = Library::embedded();
        let mut simulator = Simulator::new(&device, &library, &scene, Tracer::Bvh).unwrap();
        simulator.frame(&scene, 0).unwrap();
        let plain = simulator.pixels().unwrap();
        assert_eq!(simulator.tinted_pixels().unwrap(), None, "nobody asked");
        let (dim, format) = (ImageDim::D2, ImageFormat::Rgba8Unorm);
        let extent = [plain.0, plain.1, 1];
        let image = Image::new(&device, "tinted", dim, extent, format).unwrap();
        let outputs = Outputs { tinted: Some((&image, tint)), ..Outputs::default() };
        simulator.frames_into(&scene, &[Shot::of(&scene, 0)], &outputs).unwrap();
        assert!(simulator.pixels().unwrap() == plain, "{settings}");
        let tinted = simulator.tinted_pixels().unwrap().expect("asked for");
        assert!(image.read_back().unwrap() == tinted);
        let steps = simulator.fusion_steps().unwrap().expect("fused");
        let (mut acquired, mut simulated, mut mixed) = (0, 0, 0);
        let pixels = plain.2.chunks_exact(4).zip(tinted.chunks_exact(4));
        for ((plain, tinted), &share) in pixels.zip(&steps.blurred) {
            if plain[3] == 0 {
                assert_eq!(tinted, plain, "outside the sector");
                continue;
            }
            let expected = tint_of(plain, &tint, share, settings.contains("smooth"));
            assert!(is_shown(tinted, expected), "{settings}: {tinted:?} {expected:?}");
            // A hundredth more of the colour is noticed, where it makes a level or more.
            let more = Tint { opacity: opacity + 0.01, ..tint };
            let planted = tint_of(plain, &more, share, settings.contains("smooth"));
            if (planted[1] - expected[1]).abs() > 1.01 {
                assert!(!is_shown(tinted, planted), "{settings}: {tinted:?} {planted:?}");
            }
            match share {
                0.0 => simulated += 1,
                1.0 => acquired += 1,
                _ => mixed += 1,
            }
        }
        assert!(acquired > 1000 && simulated > 1000, "{settings}");
        // A hard mask is mixed only where its border passes between two samples.
        assert_eq!(mixed > 2000, !is_hard, "{settings}: {mixed}");
        // Another frame without it is again the same.
        simulator.frame(&scene, 0).unwrap();
        assert!(simulator.pixels().unwrap() == plain);
    }
}
