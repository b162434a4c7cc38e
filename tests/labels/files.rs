//! What `render --labels` writes.

use std::io::Read;
use std::path::Path;

use serde_json::Value;

use super::program::insonify;

fn scene() -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/phantom.toml").display().to_string()
}

const SMALL: [&str; 8] = [
    "--set",
    "probe.scanlines=24",
    "--set",
    "probe.samples=256",
    "--set",
    "imaging.image_height=90",
    "--set",
    "simulation.paths=1",
];

fn render(folder: &Path, args: &[&str]) -> (bool, String) {
    let scene = scene();
    insonify(folder, &[&["render", &scene, "-o", "a.png"], &SMALL[..], args].concat())
}

#[test]
fn arrays_and_their_legend_are_in_one_file_per_frame() {
    let dir = tempfile::tempdir().expect("a folder");
    let (well, said) = render(dir.path(), &["--labels", "out.npz", "--frames", "2"]);
    assert!(well && said.contains("out.0000.npz to out.0001.npz"), "{said}");
    let file = std::fs::File::open(dir.path().join("out.0001.npz")).expect("written");
    let mut archive = zip::ZipArchive::new(file).expect("a ZIP");
    let mut text = String::new();
    archive.by_name("legend.json").expect("a legend").read_to_string(&mut text).expect("text");
    let legend: Value = serde_json::from_str(&text).expect("JSON");
    let tissues = legend["tissues"].as_array().expect("tissues");
    assert!(tissues.iter().any(|tissue| tissue["name"] == "anechoic"));
    assert_eq!(legend["arrays"]["loss"]["unit"], "dB");
    assert_eq!(legend["samples"]["shape"], serde_json::json!([24, 256]));
    assert_eq!(archive.len(), 2 * 11 + 1);
    for (name, shape) in [
        ("tissue.npy", "(24, 256,)"),
        ("position.npy", "(24, 256, 3,)"),
        ("pixel_true_instance.npy", "(90, "),
        ("pixel_displacement.npy", ", 3,)"),
    ] {
        let mut bytes = Vec::new();
        archive.by_name(name).expect(name).read_to_end(&mut bytes).expect(name);
        let header = String::from_utf8_lossy(&bytes[10..100]).into_owned();
        assert!(header.contains(shape), "{name}: {header}");
    }
}

#[test]
fn an_image_of_indices_shows_the_tissues() {
    let dir = tempfile::tempdir().expect("a folder");
    let (well, said) = render(dir.path(), &["--labels", "seen.png"]);
    assert!(well, "{said}");
    let plain = image::open(dir.path().join("seen.png")).expect("a PNG");
    assert_eq!(plain.color(), image::ColorType::L8, "numbers that no reader takes for colours");
    let mut numbers = plain.into_luma8().into_raw();
    numbers.sort_unstable();
    numbers.dedup();
    assert!(numbers.len() > 4 && numbers.last() == Some(&255), "{numbers:?}");
    let shown = image::open(dir.path().join("seen.colours.png")).expect("a PNG").into_rgba8();
    assert_eq!(shown.height(), 90);
    assert_eq!(shown.get_pixel(0, 0).0[3], 0, "outside the sector");
    let mut colours: Vec<_> = shown.pixels().filter(|p| p.0[3] == 255).map(|p| p.0).collect();
    colours.sort_unstable();
    colours.dedup();
    assert_eq!(colours.len(), numbers.len() - 1, "{colours:?} {numbers:?}");
}

#[test]
fn a_mistake_is_told_before_anything_is_made() {
    let dir = tempfile::tempdir().expect("a folder");
    std::fs::write(dir.path().join("file"), "").expect("written");
    for (name, what) in [("out.csv", ".npz"), ("file/out.npz", "folder cannot be made")] {
        let (well, said) = render(dir.path(), &["--labels", name]);
        assert!(!well && said.contains(what), "{said}");
        assert!(!dir.path().join("a.png").exists(), "{name}");
    }
}
