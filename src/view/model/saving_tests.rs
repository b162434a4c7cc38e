use std::path::Path;
use std::time::Instant;

use super::{File, Model};
use crate::probe::{Kind, Probe};
use crate::scene::fusion::{Blend, MaskSpeed, Surroundings};
use crate::scene::settings::{Coherence, Sampling, ScatterMode, Sequence, TextureSpace};
use crate::scene::{Scene, Strategy};
use crate::sim::Tracer;
use crate::view::catalogue;
use crate::view::model::{Axis, Settings};

/// Everything of a scene file that a setting can depend on: keys of a preset, a stated impedance, a
/// tissue on another one, shapes that one selector switches, surfaces with and without an inside.
const SCENE: &str = r#"
# Two cubes.
background = "liver"

[probe]
preset = "linear"
width = "40 mm" # wider

[tissues.soft]
based_on = "fat"
speed = "1500 m/s"
impedance = "1.38 MRayl"

[tissues."very soft"]
based_on = "soft"
density = 0.9

[fusion]
mask = ["still"]
surroundings = "none"

[[selector]]
name = "beat"
period = 1

[[mesh]]
name = "a.b"
parent = "beat"
tissue = "soft"
keyframes = ["cube.obj", "cube.obj"]

[[mesh]]
name = "other"
parent = "beat"
tissue = "fat"
keyframes = ["cube.obj", "cube.obj"]

[[mesh]]
name = "still"
file = "cube.obj"
tissue = "very soft"
inside = { roughness = 3 }
"#;

const CUBE: &str = "v 0 0 0\nv 10 0 0\nv 10 10 0\nv 0 10 0\nv 0 0 10\nv 10 0 10\nv 10 10 10\n\
    v 0 10 10\nf 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

/// A folder with the scene.
struct Desk {
    folder: tempfile::TempDir,
}

impl Desk {
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join("cube.obj"), CUBE).expect("written");
        let desk = Self { folder };
        desk.write("scene.toml", SCENE);
        desk
    }

    fn write(&self, name: &str, text: &str) {
        std::fs::write(self.folder.path().join(name), text).expect("written");
    }

    fn text(&self, name: &str) -> String {
        std::fs::read_to_string(self.folder.path().join(name)).expect("there")
    }

    fn scene(&self, name: &str, overrides: &[(String, String)]) -> Scene {
        let loaded = Scene::load(&self.folder.path().join(name), overrides);
        loaded.unwrap_or_else(|e| panic!("{e}\n{}", self.text(name))).0
    }

    fn model(&self, overrides: &[(&str, &str)]) -> Model {
        let owned = |&(path, value): &(&str, &str)| (path.to_owned(), value.to_owned());
        let overrides: Vec<_> = overrides.iter().map(owned).collect();
        let scene = self.scene("scene.toml", &overrides);
        let file = File::new(self.folder.path().join("scene.toml"), overrides, &scene);
        Model::new(&scene, file, Tracer::Bvh, 0.0, Instant::now())
    }

    /// The settings that the saved file gives.
    fn saved(&self) -> Settings {
        Settings::of(&self.scene("scene.toml", &[]), Tracer::Bvh)
    }
}

/// Changes a setting, taking values from the range of a key.
type Change = fn(&mut Settings, &mut dyn FnMut(&str) -> f64);

/// What the console can change, by the key that says it in a scene file.
#[rustfmt::skip]
const CHANGES: &[(&str, Change)] = &[
    ("probe.preset", |s, _| s.probe = Probe::cardiac()),
    ("probe.kind", |s, _| s.probe.kind = Kind::Phased { field_of_view: 1.234_567_891_234 }),
    ("probe.radius", |s, v| s.probe.kind = Kind::Convex { radius: v("probe.radius"), field_of_view: 1.0 }),
    ("probe.field_of_view", |s, v| {
        let angle = v("probe.field_of_view").min(std::f64::consts::PI);
        s.probe.kind = Kind::Phased { field_of_view: angle };
    }),
    ("probe.width", |s, v| s.probe.kind = Kind::Linear { width: v("probe.width") }),
    ("probe.scanlines", |s, v| s.probe.scanlines = v("probe.scanlines") as u32),
    ("probe.elevation_layers", |s, v| s.probe.elevation_layers = v("probe.elevation_layers") as u32),
    ("probe.samples", |s, v| s.probe.samples = v("probe.samples") as u32),
    ("probe.depth", |s, v| s.probe.depth = v("probe.depth")),
    ("probe.frequency", |s, v| {
        let before = s.probe.frequency;
        s.probe.frequency = v("probe.frequency");
        s.follow_frequency(before);
    }),
    ("probe.bandwidth", |s, v| s.probe.bandwidth = v("probe.bandwidth")),
    ("probe.speed", |s, v| s.probe.speed = v("probe.speed")),
    ("probe.focus", |s, v| s.probe.focus = v("probe.focus")),
    ("probe.f_number_transmit", |s, v| s.probe.f_number_transmit = v("probe.f_number_transmit")),
    ("probe.f_number_receive", |s, v| s.probe.f_number_receive = v("probe.f_number_receive")),
    ("probe.aperture", |s, v| s.probe.aperture = v("probe.aperture")),
    ("probe.elevation_focus", |s, v| s.probe.elevation_focus = v("probe.elevation_focus")),
    ("probe.elevation_height", |s, v| s.probe.elevation_height = v("probe.elevation_height")),
    ("probe.slice_thickness", |s, v| s.probe.slice_thickness = v("probe.slice_thickness")),
    ("simulation.paths", |s, v| s.simulation.paths = v("simulation.paths") as u32),
    ("simulation.sampling", |s, _| s.simulation.sampling = Sampling::SharedPrimary),
    ("simulation.sequence", |s, _| s.simulation.sequence = Sequence::Random),
    ("simulation.max_interactions", |s, v| s.simulation.max_interactions = v("simulation.max_interactions") as u32),
    ("simulation.max_reflections", |s, v| s.simulation.max_reflections = v("simulation.max_reflections") as u32),
    ("simulation.min_weight", |s, v| s.simulation.min_weight = v("simulation.min_weight")),
    ("simulation.coherence", |s, _| s.simulation.coherence = Coherence::Coherent),
    ("simulation.rough_transmission", |s, _| s.simulation.rough_transmission ^= true),
    ("simulation.face_reflection", |s, _| s.simulation.face_reflection ^= true),
    ("simulation.beam_footprint", |s, _| s.simulation.beam_footprint ^= true),
    ("simulation.origin_jitter", |s, v| s.simulation.origin_jitter = v("simulation.origin_jitter")),
    ("simulation.emission_lobe", |s, v| s.simulation.emission_lobe = v("simulation.emission_lobe")),
    ("simulation.beam_width", |s, v| s.simulation.beam_width = v("simulation.beam_width")),
    ("simulation.scatter_mode", |s, _| s.simulation.scatter_mode = ScatterMode::Voxel),
    ("simulation.cell", |s, v| s.simulation.cell = v("simulation.cell")),
    ("simulation.scatterers_per_resolution_cell", |s, v| s.simulation.scatterers_per_resolution_cell = v("simulation.scatterers_per_resolution_cell")),
    ("simulation.texture_space", |s, _| s.simulation.texture_space = TextureSpace::World),
    ("simulation.volume_floor", |s, v| s.simulation.volume_floor = v("simulation.volume_floor")),
    ("simulation.branch_floor", |s, v| s.simulation.branch_floor = v("simulation.branch_floor")),
    ("simulation.speckle_gain", |s, v| s.simulation.speckle_gain = v("simulation.speckle_gain")),
    ("simulation.surface_gain", |s, v| s.simulation.surface_gain = v("simulation.surface_gain")),
    ("simulation.density_scale", |s, v| s.set_density_scale(v("simulation.density_scale"))),
    ("simulation.roughness_scale", |s, v| s.simulation.roughness_scale = v("simulation.roughness_scale")),
    ("simulation.thickness_scale", |s, v| s.simulation.thickness_scale = v("simulation.thickness_scale")),
    ("simulation.seed", |s, _| s.simulation.seed = u32::MAX),
    ("imaging.gain", |s, v| s.imaging.gain = v("imaging.gain")),
    ("imaging.dynamic_range", |s, v| s.imaging.dynamic_range = v("imaging.dynamic_range")),
    ("imaging.tgc_attenuation", |s, v| s.imaging.tgc_attenuation = v("imaging.tgc_attenuation")),
    ("imaging.tgc_limit", |s, v| s.imaging.tgc_limit = v("imaging.tgc_limit")),
    ("imaging.tgc_sliders", |s, v| s.imaging.tgc_sliders = [0; 8].map(|_| v("imaging.tgc_sliders"))),
    ("imaging.noise", |s, v| s.imaging.noise = v("imaging.noise")),
    ("imaging.grey_gamma", |s, v| s.imaging.grey_gamma = v("imaging.grey_gamma")),
    ("imaging.psf_scale", |s, v| s.imaging.psf_scale = [0; 3].map(|_| v("imaging.psf_scale"))),
    ("imaging.image_height", |s, v| s.imaging.image_height = v("imaging.image_height") as u32),
    ("live.budget", |s, v| s.live.budget = Some(v("live.budget"))),
    ("fusion.surroundings", |s, _| s.fusion.as_mut().unwrap().surroundings = Surroundings::Scatterers),
    ("fusion.blur", |s, v| s.fusion.as_mut().unwrap().blur = v("fusion.blur") as u32),
    ("fusion.blend", |s, _| s.fusion.as_mut().unwrap().blend = Blend::Multiband),
    ("fusion.mask_speed", |s, _| s.fusion.as_mut().unwrap().mask_speed = MaskSpeed::Probe),
    ("fusion.background_shadows", |s, _| s.fusion.as_mut().unwrap().background_shadows ^= true),
    ("tissues.NAME.speed", |s, v| s.tissues[2].speed = v("tissues.NAME.speed")),
    ("tissues.NAME.density", |s, v| s.tissues[1].density = v("tissues.NAME.density")),
    ("tissues.NAME.attenuation", |s, v| s.tissues[0].attenuation = v("tissues.NAME.attenuation")),
    ("tissues.NAME.echogenicity", |s, v| s.tissues[1].echogenicity = v("tissues.NAME.echogenicity")),
    ("tissues.NAME.density_of_scatterers", |s, v| s.tissues[3].density_of_scatterers = v("tissues.NAME.density_of_scatterers")),
    ("tissues.NAME.mean_over_sigma", |s, v| s.tissues[1].mean_over_sigma = v("tissues.NAME.mean_over_sigma")),
    ("tissues.NAME.texture_depth", |s, v| s.tissues[2].texture_depth = v("tissues.NAME.texture_depth")),
    ("tissues.NAME.texture_length", |s, v| s.tissues[2].texture_length = v("tissues.NAME.texture_length")),
    ("selector.strategy", |s, _| s.strategies[1] = Some(Strategy::Interpolate)),
    ("mesh.roughness", |s, v| s.surfaces[0][0].roughness = v("mesh.roughness")),
    ("mesh.thickness", |s, v| s.surfaces[1][0].thickness = v("mesh.thickness")),
    ("mesh.specularity", |s, v| s.surfaces[2][0].specularity = v("mesh.specularity")),
    ("mesh.surface_gain", |s, v| s.surfaces[2][0].gain = v("mesh.surface_gain")),
    ("mesh.inside.roughness", |s, v| s.surfaces[2][1].roughness = v("mesh.inside.roughness")),
    ("mesh.inside.thickness", |s, v| s.surfaces[2][1].thickness = v("mesh.inside.thickness")),
    ("mesh.inside.specularity", |s, v| s.surfaces[0][1].specularity = v("mesh.inside.specularity")),
    ("mesh.inside.surface_gain", |s, v| s.surfaces[0][1].gain = v("mesh.inside.surface_gain")),
];

/// Keys of those tables that are no settings: which meshes, and what else the anatomy is. A strategy
/// of a mesh is that of an animation in its file, which the ones of selectors stand for here.
const ANATOMY: [&str; 22] = [
    "fusion.mask",
    "tissues.NAME.based_on",
    "tissues.NAME.impedance",
    "tissues.NAME.source",
    "mesh.name",
    "mesh.parent",
    "mesh.tissue",
    "mesh.priority",
    "mesh.file",
    "mesh.keyframes",
    "mesh.animation",
    "mesh.phase",
    "mesh.loop",
    "mesh.rate",
    "mesh.strategy",
    "mesh.interpolation",
    "mesh.node",
    "mesh.units",
    "mesh.cap_openings",
    "mesh.shape",
    "mesh.scale",
    "mesh.translate",
];

/// Least, most, and numbers with many digits between, by turns.
fn values(seed: u64) -> impl FnMut(&str) -> f64 {
    let mut state = seed;
    move |key| {
        let [least, most] = catalogue::entry(key).range;
        // Knuth's MMIX generator: any sequence will do.
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let share = (state >> 11) as f64 / (1_u64 << 53) as f64;
        match (state >> 7) % 8 {
            0 => least,
            1 => most,
            _ => {
                let (low, high) = (least.max(-1e4), most.min(1e4));
                low + share * (high - low)
            }
        }
    }
}

/// Holds the saved settings to those of the session. Sources of changed tissues say that they have
/// been changed; cells have been multiplied by a frequency and a cube root and divided by them, each
/// rounded to 1.1e-16; all else has to be the same to the last bit.
fn hold(desk: &Desk, mut wanted: Settings, what: &str) {
    let mut found = desk.saved();
    for (wanted, found) in wanted.tissues.iter_mut().zip(&found.tissues) {
        if wanted.source != found.source {
            assert!(found.source.starts_with("changed by the scene file"), "{what}");
            wanted.source.clone_from(&found.source);
        }
    }
    let cells = (wanted.simulation.cell, found.simulation.cell);
    assert!((cells.0 / cells.1 - 1.0).abs() < 1e-14, "{what}: {cells:?}");
    found.simulation.cell = cells.0;
    assert!(found == wanted, "{what}\n{found:#?}\n{wanted:#?}\n{}", desk.text("scene.toml"));
}

#[test]
fn every_setting_is_saved_and_loaded() {
    let tables =
        ["probe.", "simulation.", "imaging.", "live.", "fusion.", "tissues.NAME.", "mesh."];
    for key in catalogue::keys() {
        let nested = ["probe.pose.", "mesh.shape.", "mesh.rotate."];
        let is_setting = tables.iter().any(|t| key.starts_with(t))
            && !nested.iter().any(|t| key.starts_with(t))
            && !ANATOMY.contains(&key);
        let is_changed = CHANGES.iter().any(|c| c.0 == key);
        assert_eq!(is_setting || key == "selector.strategy", is_changed, "{key}");
    }
    for (key, change) in CHANGES {
        for seed in 0..4 {
            let desk = Desk::new();
            let mut model = desk.model(&[]);
            let before = model.settings.clone();
            change(&mut model.settings, &mut values(seed));
            model.note(&before, Instant::now());
            assert!(seed > 0 || model.is_modified(false), "{key}");
            model.save(None, false).unwrap_or_else(|e| panic!("{key}: {e}"));
            hold(&desk, model.settings.clone(), key);
            assert!(!model.is_modified(true));
        }
    }
}

#[test]
fn all_settings_at_once_are_saved_and_loaded_again_and_again() {
    let desk = Desk::new();
    let mut model = desk.model(&[]);
    for seed in 10..40 {
        let before = model.settings.clone();
        for (key, change) in CHANGES {
            // Every other one, so that what was set before has to stay.
            if (seed + key.len() as u64).is_multiple_of(2) {
                change(&mut model.settings, &mut values(seed * 1000 + key.len() as u64));
            }
        }
        // A lattice that nobody asks for leaves the range of its key.
        model.settings.simulation.cell = 0.1;
        model.note(&before, Instant::now());
        model.save(None, false).expect("saved");
        hold(&desk, model.settings.clone(), &format!("round {seed}"));
    }
    assert!(desk.text("scene.toml").contains("# Two cubes."));
}

#[test]
fn a_setting_that_is_not_written_is_noticed() {
    let desk = Desk::new();
    let mut wanted = desk.saved();
    wanted.imaging.tgc_sliders[7] = 1e-9;
    let held = std::panic::catch_unwind(|| hold(&desk, wanted, "planted"));
    assert!(held.is_err());
}

#[test]
fn only_what_differs_is_written() {
    let desk = Desk::new();
    let mut model = desk.model(&[]);
    model.save(None, false).expect("saved");
    assert_eq!(desk.text("scene.toml"), SCENE, "nothing has changed");
    model.settings.imaging.gain = 7.5;
    model.settings.tracer = Tracer::RayQuery;
    assert!(model.is_modified(false));
    model.save(None, false).expect("saved");
    let expected = format!("{SCENE}\n[imaging]\ngain = \"7.5 dB\"\n");
    assert_eq!(desk.text("scene.toml"), expected);
    model.settings.tracer = Tracer::Bvh;
    assert!(!model.is_modified(false), "the tracer is no matter of the file");
}

#[test]
fn a_preset_is_written_as_one() {
    let desk = Desk::new();
    let mut model = desk.model(&[]);
    model.settings.probe = Probe::abdominal();
    model.settings.simulation.cell = 1.05 / model.settings.probe.frequency;
    model.save(None, false).expect("saved");
    let text = desk.text("scene.toml");
    assert!(text.contains("preset = \"abdominal\"\n\n[tissues"), "{text}");
    hold(&desk, model.settings.clone(), "preset");
}

#[test]
fn counts_that_a_quality_chose_stay_out_of_the_file() {
    use crate::scene::settings::{Machine, Quality};
    let desk = Desk::new();
    let mut scene = desk.scene("scene.toml", &[]);
    let file = File::new(desk.folder.path().join("scene.toml"), Vec::new(), &scene);
    scene.simulation.set_quality(Quality::Draft, Machine::Software);
    let mut model = Model::new(&scene, file, Tracer::Bvh, 0.0, Instant::now());
    // The lattice follows the wavelength, in the session and in the file.
    let before = model.settings.probe.frequency;
    model.settings.probe.frequency = 5.0;
    model.settings.simulation.cell *= before / 5.0;
    model.save(None, false).expect("saved");
    let text = desk.text("scene.toml");
    assert!(text.contains("frequency = \"5 MHz\"") && !text.contains("cell"), "{text}");
    assert_eq!(desk.saved().simulation.paths, 8);
    // What is set by hand is meant.
    model.settings.simulation.cell = 0.3;
    model.settings.simulation.paths = 5;
    model.save(None, false).expect("saved");
    let saved = desk.saved().simulation;
    assert!((saved.cell - 0.3).abs() < 1e-15, "{}", saved.cell);
    assert_eq!(saved.paths, 5);
}

#[test]
fn what_the_command_line_said_is_written() {
    let desk = Desk::new();
    let mut model = desk.model(&[("mesh.still.tissue", "fat"), ("imaging.gain", "3 dB")]);
    model.settings.imaging.dynamic_range = 70.0;
    model.save(None, false).expect("saved");
    hold(&desk, model.settings.clone(), "overrides");
    assert!(desk.text("scene.toml").contains("gain = \"3 dB\""));
}

#[test]
fn the_pose_is_written_where_it_is_wanted() {
    let desk = Desk::new();
    let mut model = desk.model(&[]);
    let now = Instant::now();
    for (axis, amount) in [(Axis::Rock, 0.3), (Axis::Lateral, 12.3), (Axis::Rotate, -0.7)] {
        model.move_probe(axis, amount, now);
    }
    assert!(model.is_modified(true) && !model.is_modified(false));
    model.save(None, false).expect("saved");
    assert_eq!(desk.text("scene.toml"), SCENE);
    model.save(None, true).expect("saved");
    assert!(!model.is_modified(true));
    let found = desk.scene("scene.toml", &[]).world_from_probe;
    // Half a unit of the last digit written: 1e-4 mm, and 1e-7 of each of two axes.
    assert!(found.translation.distance(model.pose.translation) < 1e-4);
    assert!(found.matrix3.abs_diff_eq(model.pose.matrix3, 2e-7));
    assert_eq!(model.home, model.pose);
}

#[test]
fn a_file_that_cannot_be_written_changes_nothing() {
    let desk = Desk::new();
    let mut model = desk.model(&[]);
    model.settings.imaging.gain = 7.5;
    let nowhere = desk.folder.path().join("gone/scene.toml");
    let error = model.save(Some(&nowhere), false).expect_err("no folder");
    assert!(error.remedy.is_some(), "{error}");
    assert!(model.is_modified(false));
    assert_eq!(model.file.path, desk.folder.path().join("scene.toml"));
    // Another file becomes the session's.
    let copy = desk.folder.path().join("copy.toml");
    model.save(Some(&copy), false).expect("saved");
    assert_eq!((&model.file.path, model.is_modified(false)), (&copy, false));
    assert_eq!(desk.text("scene.toml"), SCENE);
    assert!(desk.text("copy.toml").contains("7.5 dB"));
}

#[test]
fn settings_of_another_file_are_taken_and_undone() {
    let desk = Desk::new();
    let now = Instant::now();
    let mut model = desk.model(&[]);
    let gain = |model: &mut Model, gain| {
        let before = model.settings.clone();
        model.settings.imaging.gain = gain;
        model.note(&before, now);
    };
    gain(&mut model, 1.0);
    let before = model.settings.clone();
    desk.write("other.toml", "[probe]\npreset = \"phased\"\n[probe.pose]\nposition = [9, 9, 9]\n");
    let pose = model.pose;
    model.load_settings(&desk.folder.path().join("other.toml"), now).expect("taken");
    assert_eq!(model.settings.probe, Probe::phased());
    assert_eq!((model.settings.imaging.gain, model.pose), (1.0, pose), "not spoken of");
    let cell = 1.05 / Probe::phased().frequency;
    assert!((model.settings.simulation.cell / cell - 1.0).abs() < 1e-14);
    gain(&mut model, 2.0);
    model.undo(now);
    assert_eq!(model.settings.imaging.gain, 1.0);
    model.undo(now);
    assert_eq!(model.settings, before, "one step, whatever came before at the same moment");

    desk.write("other.toml", "[imaging]\ngain = \"5 mm\"\n");
    let error = model.load_settings(Path::new(&desk.folder.path().join("other.toml")), now);
    let error = error.expect_err("no level");
    assert_eq!(error.line, 2);
    assert_eq!(model.settings, before);
}
