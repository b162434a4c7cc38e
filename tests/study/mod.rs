//! User studies: made with the same bytes, nothing revealed, resumed after a kill; and evaluated.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use insonify::study::key::{Key, Row};

use crate::common::program;

mod answered;
mod browser;
mod form;
mod plans;
mod stopped;

/// Speckle of one tissue down to a plate at 14 mm, in a volume.
const SCENE: &str = r#"
background = "own"
[probe]
preset = "linear"
width = "12 mm"
scanlines = 48
elevation_layers = 3
samples = 400
frequency = "5 MHz"
depth = "20 mm"
[simulation]
paths = 2
[imaging]
image_height = 120
[vary]
gain = [-6, 6]
speckle_gain = [9]
frequency = []
tgc_attenuation = []
dynamic_range = []
density_scale = []
psf_lateral = []
psf_axial = []
surface_gain = []
roughness_scale = []
thickness_scale = []
[tissues.own]
based_on = "liver"
[[mesh]]
name = "plate"
tissue = "fat"
shape = { box = { size = [8, 60, 6] } }
translate = [0, 0, 15]
[volume]
file = "volume.mha"
translate = [-25, -13, 1]
[fusion]
mask = ["plate"]
blur = 5
"#;

const VOLUME: &str = "NDims = 3\nDimSize = 5 4 3\nElementSpacing = 12 9 17\n\
    ElementType = MET_UCHAR\nElementDataFile = LOCAL\n";

const PLAN: &str = r#"
title = "Two plates"
introduction = "Look at them."
backgrounds = ["volume", "scatterers"]
[question]
choose = "Which is best?"
statement = "It is good."
rank = "In which order?"
[[scenario]]
name = "firstscene"
title = "A plate"
scene = "one.toml"
[[scenario.slice]]
name = "ownslice"
title = "from above"
[[scenario]]
name = "secondscene"
scene = "two.toml"
[[scenario.slice]]
name = "movedslice"
translate = [1, 0, 0]
rotate = { axis = [0, 0, 1], angle = "30 deg" }
"#;

/// 2 scenes, a slice each, 2 backgrounds, 4 images.
const IMAGES: usize = 16;

/// A folder with plan, scenes and results.
struct Desk(tempfile::TempDir);

impl Desk {
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let write = |name: &str, bytes: &[u8]| {
            std::fs::write(folder.path().join(name), bytes).expect("written");
        };
        let voxels: Vec<u8> = (0..60).map(|i| (i * 4) as u8).collect();
        write("volume.mha", &[VOLUME.as_bytes(), &voxels].concat());
        write("one.toml", SCENE.as_bytes());
        write("two.toml", SCENE.replace("0, 0, 15", "2, 0, 13").as_bytes());
        write("plan.toml", PLAN.as_bytes());
        Self(folder)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Runs `study make`; returns whether it succeeded, and its output.
    fn make(&self, args: &[&str]) -> (bool, String) {
        let all = [&["study", "make", "plan.toml", "--tracer", "bvh", "--validate"], args];
        program::insonify(self.0.path(), &all.concat())
    }

    fn made(&self, args: &[&str]) {
        let (went_well, said) = self.make(args);
        assert!(went_well && !said.contains("warning"), "{said}");
    }

    fn key(&self, name: &str) -> Key {
        Key::read(&self.path(name).join("key.csv")).expect("a sound key")
    }
}

/// A study of the plan; made once.
fn desk() -> &'static Desk {
    static MADE: OnceLock<Desk> = OnceLock::new();
    MADE.get_or_init(|| {
        let desk = Desk::new();
        desk.made(&["-o", "first"]);
        desk
    })
}

/// All files below a folder at this moment.
fn paths(folder: &Path) -> Vec<PathBuf> {
    let mut out = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(&next).into_iter().flatten().flatten() {
            match entry.path() {
                path if path.is_dir() => folders.push(path),
                path => out.push(path),
            }
        }
    }
    out
}

/// All files below a folder by their path in it.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let named = |path: PathBuf| {
        let name = path.strip_prefix(folder).expect("inside");
        let bytes = std::fs::read(&path).expect("a file");
        (name.to_string_lossy().into_owned(), bytes)
    };
    paths(folder).into_iter().map(named).collect()
}

#[test]
fn the_same_seed_makes_the_same_bytes() {
    let desk = desk();
    desk.made(&["-o", "again"]);
    desk.made(&["-o", "other", "--seed", "5"]);
    let [first, again, other] = ["first", "again", "other"].map(|name| files(&desk.path(name)));
    assert!(first == again);
    assert_eq!(first.len(), IMAGES + 4);
    // Another seed is another order, too.
    let order = |name: &str| {
        let key = desk.key(name);
        let row = |r: &Row| (r.scenario.clone(), r.background.clone(), r.set.clone());
        key.rows().iter().map(row).collect::<Vec<_>>()
    };
    assert!(order("first") != order("other"));
    assert!(first["form/form.html"] != other["form/form.html"]);
}

/// The image of a row of the key.
fn image(desk: &Desk, study: &str, row: &Row) -> image::GrayImage {
    let name = format!("{study}/form/cases/{:02}/{:02}.png", row.case, row.image);
    image::open(desk.path(&name)).expect("a PNG").into_luma8()
}

#[test]
fn images_are_what_the_key_says() {
    let desk = desk();
    let key = desk.key("first");
    assert_eq!((key.cases(), key.rows().len()), (4, IMAGES));
    let mut seen = Vec::new();
    for row in key.rows() {
        let scene = if row.scenario == "firstscene" { "one.toml" } else { "two.toml" };
        let set = row.set.split_whitespace().flat_map(|entry| ["--set", entry]);
        let args = ["render", scene, "-o", "single.png", "--tracer", "bvh"];
        let args: Vec<_> = args.into_iter().chain(set).collect();
        let (went_well, said) = program::insonify(desk.0.path(), &args);
        assert!(went_well, "{said}");
        let rendered = image::open(desk.path("single.png")).expect("a PNG").into_luma8();
        let shown = image(desk, "first", row);
        assert!(rendered == shown, "{row:?}");
        assert!(!seen.contains(&shown), "{row:?} is an image of its own");
        seen.push(shown);
    }
    let mut all: Vec<_> = key.rows().iter().map(|r| (&r.scenario, &r.background, &r.set)).collect();
    all.sort();
    all.dedup();
    assert_eq!(all.len(), IMAGES);
}

#[test]
fn larger_images_are_reduced() {
    let desk = Desk::new();
    let plan = PLAN.replacen("[question]", "image_height = 30\n[question]", 1);
    std::fs::write(desk.path("plan.toml"), plan).expect("written");
    desk.made(&["-o", "small"]);
    let whole = self::desk();
    let (small, key) = (desk.key("small"), whole.key("first"));
    for (a, b) in small.rows().iter().zip(key.rows()) {
        let (a, b) = (image(&desk, "small", a), image(whole, "first", b));
        assert_eq!(a.dimensions(), (b.width() / 4, 30));
        let mean = |i: &image::GrayImage| {
            i.pixels().map(|p| f64::from(p.0[0])).sum::<f64>() / f64::from(i.width() * i.height())
        };
        assert!((mean(&a) - mean(&b)).abs() < 1.0, "{} {}", mean(&a), mean(&b));
    }
}

/// Words in the form's folder that it must not have: names of the plan, of parameters and of backgrounds.
fn told(folder: &Path) -> Vec<String> {
    let template = ["page.html", "style.css", "script.js"].map(|name| {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/lab/study/form").join(name);
        std::fs::read_to_string(path).expect("the template")
    });
    let template = template.concat().to_lowercase();
    let mut words: Vec<String> = ["volume", "scatterers", "none", "firstscene", "secondscene"]
        .into_iter()
        .chain(["ownslice", "movedslice", "one.toml", "two.toml", "speckle", "surface"])
        .map(str::to_owned)
        .collect();
    for parameter in insonify::scene::vary::Parameter::suggested() {
        words.extend([parameter.key(), parameter.name()].map(|word| word.to_lowercase()));
    }
    let mut found = Vec::new();
    for (name, bytes) in files(folder) {
        if name.ends_with(".png") {
            continue;
        }
        let text = String::from_utf8(bytes).expect("text").to_lowercase();
        // The images themselves may contain any letters.
        let mut bare = String::new();
        for (i, part) in text.split("base64,").enumerate() {
            bare.push_str(if i == 0 { part } else { part.split_once('"').expect("an end").1 });
        }
        let ours = if name.ends_with(".html") { template.as_str() } else { "" };
        for word in &words {
            if bare.matches(word.as_str()).count() > ours.matches(word.as_str()).count() {
                found.push(format!("{name}: {word}"));
            }
        }
    }
    found
}

#[test]
fn the_form_tells_nothing_of_the_key() {
    let desk = desk();
    assert_eq!(told(&desk.path("first/form")), [""; 0]);
    let html = std::fs::read_to_string(desk.path("first/form/form.html")).expect("a form");
    assert_eq!(html.matches("from above").count(), 1, "only where its cases are compared");
    // The key itself would be noticed.
    assert!(told(&desk.path("first")).len() > 5);
    for (name, bytes) in files(&desk.path("first/form")) {
        if !name.ends_with(".png") {
            continue;
        }
        let mut chunks = Vec::new();
        let mut rest = &bytes[8..];
        while rest.len() >= 12 {
            let length = u32::from_be_bytes(rest[..4].try_into().expect("four")) as usize;
            chunks.push(String::from_utf8_lossy(&rest[4..8]).into_owned());
            rest = &rest[12 + length..];
        }
        chunks.dedup();
        assert_eq!(chunks, ["IHDR", "IDAT", "IEND"], "{name}");
    }
    // No place is reserved for the scene itself.
    let key = desk.key("first");
    let places = (1..=4).map(|c| key.images(c).iter().position(|r| r.parameter == "none"));
    let mut places: Vec<_> = places.collect();
    places.dedup();
    assert!(places.len() > 1, "{places:?}");
}
