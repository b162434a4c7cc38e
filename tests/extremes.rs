//! Values within the documented ranges never panic: they are refused with a remedy or pictured, and every picture
//! consists of numbers. Both ends of every key of `docs/scenes.md` alone, two of them at a time, and all keys at once.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use insonify::gpu::{Device, test_device};
use insonify::scene::Scene;
use insonify::sim::shaders::Library;
use insonify::sim::{Simulator, Tracer, tables};
use insonify::view::Model;
use insonify::view::model::File;

use crate::common::signal::Random;

/// A scene with every table, small enough that a picture takes some milliseconds.
const SCENE: &str = r#"
[probe]
preset = "PRESET"
scanlines = 4
elevation_layers = 2
samples = 64
[simulation]
paths = 2
cell = "0.3 mm"
[imaging]
image_height = 32
[[transform]]
name = "moving"
rotate = { axis = [0, 0, 1], angle = 0 }
motion = { kind = "sine", period = 1, translate = [1, 0, 0], rotate = { axis = [0, 0, 1], angle = 0 } }
[[mesh]]
name = "one"
parent = "moving"
tissue = "own"
shape = { box = { size = [20, 20, 20] } }
rotate = { axis = [0, 0, 1], angle = 0 }
translate = [0, 0, 20]
[[mesh]]
name = "skin"
tissue = "fat"
shape = { sphere = { radius = 60, subdivisions = 2 } }
translate = [0, 0, 55]
priority = -1
[[wire]]
from = [-3, 0, 9]
to = [3, 0, 9]
[tissues.own]
based_on = "liver"
[contact]
mesh = ["skin"]
[live]
[model]
rotate = { axis = [0, 0, 1], angle = 0 }
MORE
"#;

/// The tables of a fused image.
const FUSED: &str = r#"
[volume]
file = "volume.mha"
rotate = { axis = [0, 0, 1], angle = 0 }
[fusion]
mask = ["one"]
background_shadows = true
"#;

const VOLUME: &str = "NDims = 3\nDimSize = 2 2 2\nElementSpacing = 60 60 60\nElementType = MET_UCHAR\n\
                      ElementDataFile = LOCAL\n01234567";

/// A key that takes numbers, with its ends as in a scene file.
struct Key {
    path: String,
    kind: String,
    ends: [f64; 2],
}

impl Key {
    /// A value as in a scene file: one number, or several equal ones.
    fn written(&self, value: f64) -> String {
        if self.kind == "integer" {
            return format!("{}", value.round() as i64);
        }
        let one = match self.kind.contains("angle") {
            true => format!("\"{value} rad\""),
            false => format!("{value:?}"),
        };
        // "3 lengths", "number or 3 numbers".
        match self.kind.split(' ').find_map(|word| word.parse::<usize>().ok()) {
            Some(count) => format!("[{}]", vec![one; count].join(", ")),
            None => one,
        }
    }

    fn set(&self, value: f64) -> (String, String) {
        (self.path.clone(), self.written(value))
    }

    /// A value within the range, over its powers of ten where it has some; now and then an end.
    fn any(&self, random: &mut Random) -> f64 {
        let [low, high] = self.ends.map(|end| end.clamp(-1e6, 1e6));
        match random.uniform() {
            u if u < 0.1 => self.ends[0],
            u if u < 0.2 => self.ends[1],
            _ if low > 0.0 => low * (high / low).powf(random.uniform()),
            _ => low + (high - low) * random.uniform().powi(3),
        }
    }
}

/// The ends of a range such as "0.1 to 100 MHz (more)" or "at least 1".
fn range(cell: &str) -> Option<[f64; 2]> {
    let words: Vec<_> = cell.split_whitespace().collect();
    match words.as_slice() {
        ["at", "least", least, ..] => Some([least.parse().ok()?, f64::INFINITY]),
        [least, "to", most, ..] => Some([least.parse().ok()?, most.parse().ok()?]),
        _ => None,
    }
}

/// All keys with a range that may stand in the scene above.
fn keys() -> Vec<Key> {
    let document = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/scenes.md");
    let document = std::fs::read_to_string(document).expect("the reference");
    let (mut table, mut out) = ("", Vec::new());
    for line in document.lines() {
        if line.starts_with('#') {
            table = line.split('`').nth(1).unwrap_or_default().trim_matches(['[', ']']);
        }
        let cells: Vec<_> = line.split('|').map(|c| c.trim().trim_matches('`')).collect();
        let &["", key, kind, _, stated, _, ""] = cells.as_slice() else { continue };
        let Some(ends) = range(stated) else { continue };
        let place = match table {
            "mesh" => "mesh.0",
            "transform" => "transform.0",
            "transform.motion" => "transform.0.motion",
            "wire" => "wire.0",
            "tissues.NAME" => "tissues.own",
            "probe" | "simulation" | "imaging" | "model" | "volume" | "fusion" | "contact"
            | "live" => table,
            _ => continue,
        };
        let path = format!("{place}.{key}");
        out.push(Key { path, kind: kind.to_owned(), ends });
    }
    out
}

/// A scene in a folder of its own.
struct Case {
    preset: &'static str,
    set: Vec<(String, String)>,
}

impl Case {
    /// A case with a preset that has the keys, in turns.
    fn new(set: Vec<(String, String)>, turn: usize) -> Self {
        let has = |key: &str| set.iter().any(|(path, _)| path == key);
        let preset = match (has("probe.width"), has("probe.radius")) {
            (true, _) => "linear",
            (_, true) => "abdominal",
            _ if has("probe.field_of_view") => ["abdominal", "phased"][turn % 2],
            _ => ["linear", "abdominal", "phased"][turn % 3],
        };
        Self { preset, set }
    }

    fn fused(&self) -> bool {
        self.set.iter().any(|(path, _)| path.starts_with("volume") || path.starts_with("fusion"))
    }

    /// Returns whether only probe, simulation and image differ.
    fn is_setting(&self) -> bool {
        let tables = ["probe.", "simulation.", "imaging."];
        self.set.iter().all(|(path, _)| tables.iter().any(|table| path.starts_with(table)))
    }

    fn says(&self) -> String {
        let set = self.set.iter().map(|(path, value)| format!(" {path}={value}"));
        format!("{}{}", self.preset, set.collect::<String>())
    }

    /// The scene, or a message with a remedy.
    fn load(&self, folder: &Path) -> Result<Scene, String> {
        let more = if self.fused() { FUSED } else { "" };
        let text = SCENE.replace("PRESET", self.preset).replace("MORE", more);
        let file = folder.join("scene.toml");
        std::fs::write(&file, text).expect("written");
        match Scene::load(&file, &self.set) {
            Ok((scene, _)) => Ok(scene),
            Err(error) if error.remedy.is_none() => Err(format!("no remedy: {error}")),
            Err(error) => Err(format!("refused: {error}")),
        }
    }
}

/// Makes all tables of a scene before a picture; returns the name of one that has a value that is no number.
fn tabled(scene: &Scene) -> Option<&'static str> {
    let frame = tables::frame(scene, 0);
    let (rows, tissues) = (tables::rows(scene), tables::tissues(scene));
    let (surfaces, points) = (tables::surfaces(scene), tables::points(scene));
    let grey = tables::grey_map(&scene.imaging);
    let nan = |bytes: &[u8]| {
        let words: Vec<f32> = bytemuck::pod_collect_to_vec(bytes);
        words.iter().any(|v| v.is_nan() && v.to_bits() != u32::MAX)
    };
    let _ = (grey, tables::scanlines(&scene.probe));
    [
        ("frame", nan(bytemuck::bytes_of(&frame))),
        ("rows", nan(bytemuck::cast_slice(&rows))),
        ("tissues", nan(bytemuck::cast_slice(&tissues))),
        ("surfaces", nan(bytemuck::cast_slice(&surfaces))),
        ("points", nan(bytemuck::cast_slice(&points))),
    ]
    .into_iter()
    .find_map(|(name, nan)| nan.then_some(name))
}

/// Asserts that the window opens it, and that its saved file can be loaded.
fn saved(case: &Case, folder: &Path, scene: &Scene) {
    let file = File::new(folder.join("scene.toml"), case.set.clone(), scene);
    let mut model = Model::new(scene, file, Tracer::Bvh, 0.0, Instant::now());
    let _ = (model.order(), model.view3d.sight([64, 64]));
    let copy = folder.join("copy.toml");
    model.save(Some(&copy), true).unwrap_or_else(|error| panic!("not saved: {error}"));
    Scene::load(&copy, &[]).unwrap_or_else(|error| panic!("not loaded again: {error}"));
}

/// Returns whether a picture of it takes a moment only.
fn is_small(scene: &Scene) -> bool {
    let probe = &scene.probe;
    let lines = u64::from(probe.scanlines) * u64::from(probe.elevation_layers);
    let height = u64::from(scene.imaging.image_height);
    let points = tables::points(scene).len();
    lines * u64::from(scene.simulation.paths) < 4096
        && u64::from(probe.scanlines * probe.samples) < 1 << 16
        && height < 512
        && points < 1 << 16
}

/// A simulator of each preset's own scene, for settings with which the window keeps its simulator.
type Kept = BTreeMap<&'static str, Simulator>;

/// Pictures a case; returns the fault of the picture. A refusal by the device is no fault.
fn pictured(
    device: &Arc<Device>,
    case: &Case,
    scene: &Scene,
    kept: &mut Kept,
) -> Result<(), String> {
    let library = Library::embedded();
    let mut simulator = match kept.remove(case.preset) {
        Some(simulator) if case.is_setting() => simulator,
        _ => match Simulator::new(device, &library, scene, Tracer::Bvh) {
            Ok(simulator) => simulator,
            Err(_) => return Ok(()),
        },
    };
    let levels = simulator
        .fit(scene)
        .and_then(|_| simulator.frame(scene, 0))
        .and_then(|_| simulator.log_image());
    if case.is_setting() {
        kept.insert(case.preset, simulator);
    }
    match levels {
        Ok(levels) if !levels.iter().all(|v| (0.0..=1.0).contains(v)) => {
            Err("a level is no number from 0 to 1".to_owned())
        }
        _ => Ok(()),
    }
}

/// The fault of a case, if there is one.
fn examine(case: &Case, device: &Arc<Device>, folder: &Path, kept: &mut Kept) -> Option<String> {
    let began = Instant::now();
    let found = catch_unwind(AssertUnwindSafe(|| match case.load(folder) {
        Ok(scene) => match tabled(&scene) {
            Some(name) => Err(format!("a NaN in {name}")),
            None if is_small(&scene) => pictured(device, case, &scene, kept),
            None => Ok(()),
        },
        Err(said) if said.starts_with("refused") => Ok(()),
        Err(said) => Err(said),
    }));
    let took = began.elapsed().as_millis();
    println!("{took:5} ms {}", case.says());
    match found {
        Ok(Ok(())) => None,
        Ok(Err(fault)) => Some(format!("{}: {fault}", case.says())),
        Err(_) => Some(format!("{}: it panics", case.says())),
    }
}

/// A whole number from 0 to `count` - 1.
fn below(random: &mut Random, count: usize) -> usize {
    (random.uniform() * count as f64) as usize
}

fn examine_all(cases: impl IntoIterator<Item = Case>) {
    let device = test_device();
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("volume.mha"), VOLUME).expect("written");
    let mut kept = Kept::new();
    let faults: Vec<_> = cases
        .into_iter()
        .filter_map(|case| examine(&case, &device, folder.path(), &mut kept))
        .collect();
    drop(kept);
    assert!(faults.is_empty(), "{}", faults.join("\n"));
    assert_eq!(device.validation_messages(), Vec::<String>::new());
}

#[test]
fn both_ends_of_every_setting_are_pictured_or_refused() {
    let keys = keys();
    assert!(keys.len() > 70, "{}", keys.len());
    let one = |(turn, key): (usize, &Key)| key.ends.map(|end| Case::new(vec![key.set(end)], turn));
    examine_all(keys.iter().enumerate().flat_map(one).filter(Case::is_setting));
}

// Each of these has a simulator of its own, which takes a third of a second.
#[test]
fn two_ends_at_a_time_are_pictured_or_refused() {
    let (keys, mut random) = (keys(), Random(2));
    examine_all((0..40).map(|turn| {
        let mut end = || {
            let key = &keys[below(&mut random, keys.len())];
            key.set(key.ends[below(&mut random, 2)])
        };
        Case::new(vec![end(), end()], turn)
    }));
}

#[test]
fn any_values_are_tabled_and_saved_or_refused() {
    let (keys, mut random) = (keys(), Random(3));
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("volume.mha"), VOLUME).expect("written");
    let mut loaded = 0;
    let ends =
        keys.iter().flat_map(|key| key.ends.map(|end| vec![key.set(end)])).collect::<Vec<_>>();
    let many = (0..400).map(|_| {
        let share = random.uniform().powi(2);
        let chosen = keys.iter().filter(|_| random.uniform() < share).collect::<Vec<_>>();
        chosen.into_iter().map(|key| key.set(key.any(&mut random))).collect()
    });
    for (turn, set) in ends.into_iter().chain(many).enumerate() {
        let case = Case::new(set, turn);
        let found = catch_unwind(AssertUnwindSafe(|| match case.load(folder.path()) {
            Ok(scene) => {
                saved(&case, folder.path(), &scene);
                Ok(tabled(&scene))
            }
            Err(said) if said.starts_with("refused") => Err(()),
            Err(said) => panic!("{said}"),
        }));
        match found {
            Ok(Ok(fault)) => {
                assert_eq!(fault, None, "{}", case.says());
                loaded += 1;
            }
            Ok(Err(())) => {}
            Err(_) => panic!("{}: it panics", case.says()),
        }
    }
    assert!(loaded > 100, "{loaded}");
}
