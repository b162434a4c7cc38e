//! Contact sheets as a user makes them: their content, their order, and equality with `render`.

use std::path::PathBuf;
use std::process::{Command, Output};
use std::sync::OnceLock;

use image::{GrayImage, imageops};
use serde::Deserialize;

mod directions;

/// Speckle of one tissue down to a plate at 30 mm in which nothing scatters.
const SCENE: &str = r#"
name = "A plate in speckle"
background = "own"
[probe]
preset = "linear"
bandwidth = 0.77
width = "12 mm"
scanlines = 64
elevation_layers = 3
samples = 800
frequency = "5 MHz"
depth = "40 mm"
[simulation]
paths = 4
[imaging]
gain = "10 dB"
noise = -inf
image_height = 800
[tissues.own]
based_on = "liver"
texture_depth = 0.0
[tissues.plate]
based_on = "own"
echogenicity = "-inf dB"
density = "1200 kg/m3"
[[mesh]]
name = "plate"
tissue = "plate"
shape = { box = { size = [60, 60, 12] } }
translate = [0, 0, 36]
"#;

const FUSED: &str = r#"
[volume]
file = "volume.mha"
translate = [-25, -13, 1]
[fusion]
mask = ["plate"]
blend = "smooth"
"#;

const VOLUME: &str = "NDims = 3\nDimSize = 5 4 3\nElementSpacing = 12 9 17\n\
    ElementType = MET_UCHAR\nElementDataFile = LOCAL\n";

#[derive(Debug, Deserialize, PartialEq)]
struct Row {
    image: usize,
    parameter: String,
    value: String,
    own: String,
    unit: String,
    set: String,
    file: String,
    x: u32,
    y: u32,
    width: u32,
    height: u32,
    mean_grey: f64,
    sd_grey: f64,
    black_percent: f64,
    white_percent: f64,
}

/// A folder with the scene and results.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new(scene: &str) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join("scene.toml"), scene).expect("written");
        let voxels: Vec<u8> = (0..60).map(|i| (i * 4) as u8).collect();
        let volume = [VOLUME.as_bytes(), &voxels].concat();
        std::fs::write(folder.path().join("volume.mha"), volume).expect("written");
        Self(folder)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn run(&self, command: &str, args: &[&str]) -> Output {
        Command::new(env!("CARGO_BIN_EXE_insonify"))
            .current_dir(self.0.path())
            .args([command, "scene.toml", "--tracer", "bvh"])
            .args(args)
            .output()
            .expect("the program starts")
    }

    fn vary(&self, args: &[&str]) {
        let out = self.run("vary", &[&["--validate"], args].concat());
        let said = String::from_utf8_lossy(&out.stderr).into_owned();
        assert!(out.status.success() && said.is_empty(), "{said}");
    }

    fn rows(&self, name: &str) -> Vec<Row> {
        let mut reader = csv::Reader::from_path(self.path(name)).expect("a table");
        let rows: Result<_, _> = reader.deserialize().collect();
        rows.expect("sound rows")
    }

    fn image(&self, name: &str) -> GrayImage {
        image::open(self.path(name)).expect("a PNG").into_luma8()
    }

    fn bytes(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.path(name)).expect("a file")
    }

    /// The image by `render` of the scene with the entries of a row.
    fn render(&self, set: &str) -> GrayImage {
        let entries = set.split_whitespace().flat_map(|entry| ["--set", entry]);
        let args: Vec<_> = ["-o", "single.png"].into_iter().chain(entries).collect();
        let out = self.run("render", &args);
        assert!(out.status.success(), "{set}");
        self.image("single.png")
    }
}

/// The contact sheet of the scene's parameters with its single images; made once.
fn swept() -> &'static Folder {
    static MADE: OnceLock<Folder> = OnceLock::new();
    MADE.get_or_init(|| {
        let folder = Folder::new(SCENE);
        folder.vary(&["-o", "all"]);
        folder
    })
}

const PARAMETERS: [&str; 11] = [
    "frequency",
    "gain",
    "tgc_attenuation",
    "dynamic_range",
    "speckle_gain",
    "density_scale",
    "psf_lateral",
    "psf_axial",
    "surface_gain",
    "roughness_scale",
    "thickness_scale",
];

/// The part of a contact sheet at the place that a row states.
fn cell(sheet: &GrayImage, row: &Row) -> GrayImage {
    imageops::crop_imm(sheet, row.x, row.y, row.width, row.height).to_image()
}

#[test]
fn a_sheet_holds_the_scene_and_each_parameter_below_and_above() {
    let folder = swept();
    let rows = folder.rows("all/sheet.csv");
    let sheet = folder.image("all/sheet.png");
    let numbers: Vec<_> = rows.iter().map(|r| r.image).collect();
    assert_eq!(numbers, (1..=23).collect::<Vec<_>>());
    let found: Vec<_> = rows.iter().map(|r| r.parameter.as_str()).collect();
    let pairs = PARAMETERS.iter().flat_map(|p| [*p, *p]);
    assert_eq!(found, ["none"].into_iter().chain(pairs).collect::<Vec<_>>());
    for pair in rows[1..].chunks(2) {
        let number = |text: &str| text.parse::<f64>().expect("a number");
        let [below, above] = [0, 1].map(|i| number(&pair[i].value));
        let own = number(&pair[0].own);
        assert!(below < own && own < above, "{pair:?}");
        // The two images of a parameter stand side by side.
        assert!(pair[0].y == pair[1].y && pair[0].x < pair[1].x, "{pair:?}");
    }
    for row in &rows {
        let single = folder.image(&format!("all/{}", row.file));
        assert_eq!(single.dimensions(), (240, 800));
        assert!(cell(&sheet, row) == single, "{row:?}");
        let mean = single.pixels().map(|p| f64::from(p.0[0])).sum::<f64>() / (240.0 * 800.0);
        assert!((mean - row.mean_grey).abs() < 1e-3, "{row:?}: {mean}");
    }
    // The comparison notices a pixel's shift.
    let shifted = Row { x: rows[3].x + 1, ..folder.rows("all/sheet.csv").swap_remove(3) };
    assert!(cell(&sheet, &shifted) != cell(&sheet, &rows[3]));
}

#[test]
fn single_images_are_what_render_makes_of_the_entry_that_is_named() {
    let folder = swept();
    let rows = folder.rows("all/sheet.csv");
    let scene = folder.render("");
    assert!(scene == folder.image(&format!("all/{}", rows[0].file)));
    // One of each kind of setting: probe, image, lattice, scatterers, beam, surfaces.
    for row in [1, 3, 8, 11, 12, 13, 16, 17, 19, 22].map(|i| &rows[i]) {
        let image = folder.render(&row.set);
        assert!(image == folder.image(&format!("all/{}", row.file)), "{row:?}");
        assert!(image != scene, "{row:?} changes the image");
    }
}

#[test]
fn a_seed_shuffles_and_says_nothing_on_the_sheet() {
    let folder = Folder::new(SCENE);
    let plain = swept();
    let values = "vary.tgc_attenuation=[0.1, 0.9]";
    let small = ["--set", "imaging.image_height=200", "--set", values];
    let blind = |seed: &str, to: &str| {
        folder.vary(&[&["--shuffle", seed, "-o", to], &small[..]].concat());
    };
    blind("7", "first");
    blind("7", "again");
    blind("8", "other");
    folder.vary(&[&["-o", "plain"], &small[..]].concat());
    for name in ["sheet.png", "sheet.csv"] {
        let of = |to: &str| folder.bytes(&format!("{to}/{name}"));
        assert!(of("first") == of("again"), "{name}");
        assert!(of("first") != of("other"), "{name}");
    }
    let rows = folder.rows("first/sheet.csv");
    let images = |rows: &[Row]| {
        let mut all: Vec<_> = rows.iter().map(|r| r.set.clone()).collect();
        all.sort();
        all
    };
    let plain_rows = folder.rows("plain/sheet.csv");
    assert_eq!(images(&rows), images(&plain_rows));
    for (number, row) in (1..).zip(&rows) {
        assert_eq!((row.image, row.file.as_str()), (number, &*format!("{number:02}.png")));
        let same = plain_rows.iter().find(|r| r.set == row.set).expect("there");
        let [shuffled, unshuffled] = [("first", row), ("plain", same)]
            .map(|(to, row)| folder.bytes(&format!("{to}/{}", row.file)));
        assert!(shuffled == unshuffled, "{row:?}");
    }
    // Captions are numbers only: less ink below the images than with labels, and no panel.
    let ink = |folder: &Folder, to: &str| {
        let sheet = folder.image(&format!("{to}/sheet.png"));
        let rows = folder.rows(&format!("{to}/sheet.csv"));
        let caption = |row: &Row| {
            let y = row.y + row.height + 2;
            let strip = imageops::crop_imm(&sheet, row.x, y, row.width, 12).to_image();
            strip.pixels().filter(|p| p.0[0] < 128).count()
        };
        rows.iter().map(caption).max().expect("rows")
    };
    assert!(2 * ink(&folder, "first") < ink(plain, "all"));
    // In rows of four without a gap, where a labelled contact sheet has its panel second.
    assert_eq!(rows[1].y, rows[0].y);
    let step = rows[1].x - rows[0].x;
    assert_eq!([rows[2].x - rows[1].x, plain_rows[1].x - plain_rows[0].x], [step, 2 * step]);
}

#[test]
fn steps_surroundings_and_blends_are_what_render_makes() {
    let folder = Folder::new(&format!("{SCENE}{FUSED}"));
    for (show, parameter, values) in [
        (
            "steps",
            "step",
            &["volume", "simulation", "mask", "composed", "blurred-mask", "fused"][..],
        ),
        ("surroundings", "surroundings", &["volume", "none", "scatterers"]),
        ("blends", "blend", &["linear", "smooth", "multiband"]),
    ] {
        folder.vary(&["--show", show, "-o", show]);
        let rows = folder.rows(&format!("{show}/sheet.csv"));
        let sheet = folder.image(&format!("{show}/sheet.png"));
        let found: Vec<_> = rows.iter().map(|r| r.value.as_str()).collect();
        // There may be more methods of blending than the paper's.
        assert!(found.starts_with(values), "{found:?}");
        for row in &rows {
            assert_eq!(row.parameter, parameter);
            let single = folder.image(&format!("{show}/{}", row.file));
            assert!(cell(&sheet, row) == single, "{row:?}");
            if !row.set.is_empty() || row.value == "fused" {
                assert!(folder.render(&row.set) == single, "{row:?}");
            }
        }
    }
    let step = |name: &str| folder.image(&format!("steps/{name}.png"));
    let out = folder.run("render", &["-o", "x.png", "--dump", "dump"]);
    assert!(out.status.success());
    for (name, dumped) in [
        ("01-volume", "6_background"),
        ("02-simulation", "9_simulation"),
        ("03-mask", "7_mask"),
        ("05-blurred-mask", "8_blurred_mask"),
    ] {
        assert!(step(name) == folder.image(&format!("dump/{dumped}.png")), "{name}");
    }
}

#[test]
fn mistakes_are_explained() {
    let folder = Folder::new(&format!("{SCENE}[vary]\ngain = [3, 999]\n"));
    let line = format!("scene.toml:{}:", SCENE.lines().count() + 2);
    let told = |args: &[&str]| {
        // The command's old name.
        let out = folder.run("sweep", args);
        assert!(!out.status.success(), "{args:?}");
        String::from_utf8_lossy(&out.stderr).into_owned()
    };
    let said = told(&[]);
    for part in [line.as_str(), "gain", "999 dB", "between -200 and 200 dB"] {
        assert!(said.contains(part), "{part}: {said}");
    }
    let said = told(&["--set", "vary.gain=[3]", "--show", "steps"]);
    assert!(said.contains("no acquired volume") && said.contains("[volume]"), "{said}");
    let said = told(&["--set", "vary.gain=[3]", "-o", "scene.toml/sheet.png"]);
    assert!(said.contains("folder cannot be made"), "{said}");
}
