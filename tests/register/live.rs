//! Volume, model and masks that change between two frames, as in the window.

use std::path::Path;
use std::sync::Arc;

use glam::{DAffine3, DQuat, DVec3};
use insonify::gpu::{Device, test_device};
use insonify::scene::Scene;
use insonify::sim::shaders::Library;
use insonify::sim::{Simulator, Tracer};

use super::tracers::tracers;

/// A ball that swings and a block of its own, in a volume that brightens to one side.
const SCENE: &str = r#"
background = "liver"
[probe]
preset = "linear"
scanlines = 32
elevation_layers = 1
samples = 512
depth = "40 mm"
[simulation]
paths = 2
[imaging]
noise = -inf
image_height = 120
[volume]
file = "volume.mha"
[fusion]
mask = ["ball"]
blur = 4
[[transform]]
name = "swing"
motion = { kind = "sine", period = "2 s", translate = [3, 0, 0] }
[[mesh]]
name = "ball"
parent = "swing"
tissue = "kidney"
shape = { sphere = { radius = 7 } }
translate = [1, 0, 18]
[[mesh]]
name = "block"
tissue = "fat"
priority = 1
shape = { box = { size = [8, 30, 6] } }
translate = [-9, 0, 26]
[[mesh]]
name = "plate"
tissue = "cortical_bone"
priority = 2
shape = { box = { size = [6, 30, 2] } }
translate = [9, 0, 31]
"#;

const VOLUME: &str = "NDims = 3\nDimSize = 5 4 3\nElementSpacing = 12 9 17\nOffset = -25 -13 1\n\
    ElementType = MET_UCHAR\nElementDataFile = LOCAL\n";

const TIME: f64 = 0.5;

/// The scene with these settings, at [`TIME`].
fn load(folder: &Path, settings: &[(&str, &str)]) -> Scene {
    let settings = settings.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned()));
    let settings: Vec<_> = settings.collect();
    let loaded = Scene::load(&folder.join("scene.toml"), &settings);
    let mut scene = loaded.expect("sound").0;
    scene.set_time(TIME);
    scene
}

fn pixels(simulator: &mut Simulator, scene: &Scene) -> Vec<u8> {
    simulator.frame(scene, 0).expect("a frame");
    simulator.pixels().expect("pixels").2
}

fn fresh(device: &Arc<Device>, scene: &Scene, tracer: Tracer) -> Vec<u8> {
    let simulator = Simulator::new(device, &Library::embedded(), scene, tracer);
    pixels(&mut simulator.expect("a simulator"), scene)
}

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("scene.toml"), SCENE).expect("written");
    let mut volume = VOLUME.as_bytes().to_vec();
    volume.extend((0..60_u8).map(|i| 4 * i));
    std::fs::write(folder.path().join("volume.mha"), volume).expect("written");
    folder
}

/// A change between two frames looks the same as if loaded.
#[test]
fn a_change_between_frames_is_as_if_the_file_had_said_it() {
    let device = test_device();
    let folder = folder();
    let at = |settings: &[(&str, &str)]| load(folder.path(), settings);
    let turn = "{ axis = [0, 1, 0], angle = \"8 deg\" }";
    let cases: [&[(&str, &str)]; 4] = [
        &[("model.translate", "[-2, 0.5, 3]"), ("model.rotate", turn)],
        &[("model.scale", "1.2"), ("model.translate", "[0, 0, -4]")],
        &[("volume.translate", "[4, 0, -2]"), ("volume.scale", "0.9"), ("volume.white", "120")],
        &[("fusion.mask", "[\"block\", \"plate\"]")],
    ];
    for tracer in tracers(&device) {
        let plain = at(&[]);
        let simulator = Simulator::new(&device, &Library::embedded(), &plain, tracer);
        let mut simulator = simulator.expect("a simulator");
        let before = pixels(&mut simulator, &plain);
        for settings in cases {
            let wanted = at(settings);
            let mut scene = plain.clone();
            scene.place_model(wanted.graph.world_from_model);
            scene.set_time(TIME);
            let display = wanted.volume.as_ref().expect("a volume").display();
            scene.volume.as_mut().expect("a volume").show(&display);
            scene.fusion.clone_from(&wanted.fusion);
            let live = pixels(&mut simulator, &scene);
            assert!(live != before, "{tracer} {settings:?}: nothing has changed");
            let off = |a: &[u8], b: &[u8]| a.iter().zip(b).filter(|(a, b)| a != b).count();
            let differ = off(&live, &fresh(&device, &wanted, tracer));
            assert_eq!(differ, 0, "{tracer} {settings:?} of {}", live.len());
            // The change undone.
            scene.place_model(DAffine3::IDENTITY);
            scene.set_time(TIME);
            let display = plain.volume.as_ref().expect("a volume").display();
            scene.volume.as_mut().expect("a volume").show(&display);
            scene.fusion.clone_from(&plain.fusion);
            assert!(pixels(&mut simulator, &scene) == before, "{tracer} {settings:?}: back");
        }
    }
    assert_eq!(device.validation_messages(), Vec::<String>::new());
}

/// The image stays the same if everything moves with the probe; it changes if one part stays behind.
#[test]
fn moving_everything_together_changes_no_image() {
    let device = test_device();
    let folder = folder();
    let turn = DQuat::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 0.7);
    let by = DAffine3::from_rotation_translation(turn, DVec3::new(30.0, -12.0, 5.0));
    let moved = |model: bool, volume: bool| {
        let mut scene = load(folder.path(), &[]);
        scene.world_from_probe = by * scene.world_from_probe;
        if model {
            scene.place_model(by);
            scene.set_time(TIME);
        }
        if volume {
            let volume = scene.volume.as_mut().expect("a volume");
            let mut display = volume.display();
            display.world_from_lps = by * display.world_from_lps;
            volume.show(&display);
        }
        fresh(&device, &scene, Tracer::Bvh)
    };
    let home = fresh(&device, &load(folder.path(), &[]), Tracer::Bvh);
    let far = |image: &[u8]| {
        let off = home.iter().zip(image).filter(|(a, b)| a.abs_diff(**b) > 8);
        off.count() as f64 / home.len() as f64
    };
    // Speckle goes with the meshes; single precision moves a few grains.
    let together = far(&moved(true, true));
    assert!(together < 0.01, "{together}");
    for (model, volume) in [(true, false), (false, true)] {
        let apart = far(&moved(model, volume));
        assert!(apart > 0.05, "{model} {volume}: {apart}");
    }
}
