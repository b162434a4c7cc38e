//! Data sets: the same bytes whole, in shards and resumed; what a mistake in a plan says; read by the libraries that they
//! are made for, as are renders.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use crate::common::program;

mod layouts;
mod made;
mod plans;
mod readers;
mod renders;
mod stopped;

/// A plate that rises and falls in one tissue, below a skin.
const SCENE: &str = r#"
background = "own"
[probe]
preset = "linear"
width = "12 mm"
scanlines = 32
elevation_layers = 1
samples = 256
frequency = "5 MHz"
depth = "20 mm"
[simulation]
paths = 1
[imaging]
image_height = 80
[contact]
mesh = ["skin"]
[tissues.own]
based_on = "liver"
[[mesh]]
name = "skin"
tissue = "skin"
shape = { box = { size = [200, 60, 2] } }
translate = [0, 0, 1]
[[transform]]
name = "breath"
motion = { kind = "sine", period = "4 s", translate = [0, 0, 2] }
[[mesh]]
name = "plate"
parent = "breath"
tissue = "fat"
shape = { box = { size = [8, 60, 4] } }
translate = [0, 0, 12]
"#;

/// Two scenes, of which the second needs another number of samples along its lines.
const PLAN: &str = r#"
title = "Plates"
seed = 3
segmentation = "true"
formats = ["folder", "webdataset"]
arrays = ["envelope", "iq"]
samples_per_part = 2
[variable]
thick = { uniform = [0, 1] }
[draw]
imaging.gain = { normal = ["0 dB", "3 dB"], limits = ["-6 dB", "6 dB"] }
probe.frequency = { follows = "thick", times = -1, plus = "6 MHz" }
simulation.density_scale = { log_uniform = [0.5, 1] }
tissues.fat.attenuation = { uniform = [0.4, 0.8], with = "imaging.gain", correlation = 0.5 }
[[scene]]
name = "first"
file = "scene.toml"
split = "train"
samples = 12
time = { uniform = ["0 s", "4 s"] }
[scene.pose]
lateral = { uniform = ["-2 mm", "2 mm"] }
tilt = { uniform = ["-10 deg", "10 deg"] }
[[scene]]
name = "second"
file = "scene.toml"
split = "test"
samples = 8
[scene.draw]
probe.samples = { choice = [200, 300] }
mesh.plate.tissue = { choice = ["fat", "muscle"], weights = [1, 2] }
[scene.pose]
skin = true
lateral = { uniform = ["-60 mm", "60 mm"] }
depth = "1 mm"
rotate = { uniform = ["-90 deg", "90 deg"] }
"#;

/// Samples and parts of the plan.
const SAMPLES: usize = 20;
const PARTS: usize = 10;

/// A folder with plan, scene and results.
struct Desk(tempfile::TempDir);

impl Desk {
    fn new() -> Self {
        let desk = Self(tempfile::tempdir().expect("a folder"));
        desk.write("scene.toml", SCENE);
        desk.write("plan.toml", PLAN);
        desk
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, text: &str) {
        std::fs::write(self.path(name), text).expect("written");
    }

    /// Runs `dataset`; returns whether it succeeded, and its output.
    fn make(&self, args: &[&str]) -> (bool, String) {
        let all = [&["dataset", "plan.toml", "--tracer", "bvh", "--validate"], args];
        program::insonify(self.0.path(), &all.concat())
    }

    fn made(&self, args: &[&str]) -> String {
        let (went_well, said) = self.make(args);
        assert!(went_well && !said.contains("warning"), "{said}");
        said
    }
}

/// The whole data set of the plan, in the folder `whole`; made once.
fn desk() -> &'static Desk {
    static MADE: OnceLock<Desk> = OnceLock::new();
    MADE.get_or_init(|| {
        let desk = Desk::new();
        desk.made(&["-o", "whole"]);
        desk
    })
}

/// All files below a folder by their path in it, without contact sheets, which are each shard's own.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut out = BTreeMap::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(&next).into_iter().flatten().flatten() {
            let path = entry.path();
            let name = path.strip_prefix(folder).expect("inside").to_string_lossy().into_owned();
            if path.is_dir() {
                folders.push(path);
            } else if !name.starts_with("sheet") {
                out.insert(name, std::fs::read(&path).expect("a file"));
            }
        }
    }
    out
}
