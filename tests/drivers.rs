//! Comparison of two Vulkan drivers: kernels against their twins, and pictures of two scenes. The second driver
//! is the one that `tools/setup.sh` unpacks into `target/second-driver`; without it these tests are skipped.

use std::path::{Path, PathBuf};
use std::process::Command;

use image::GrayImage;

use crate::common::skip::{Lacking, skip};

/// Share of a picture's pixels that may differ by more than one grey level between two drivers.
const APART: f64 = 1e-3;

/// Reduced sizes that are enough here; the full size is compared by hand (docs/kernels.md).
const SIZE: [&str; 2] = ["probe.scanlines=96", "probe.elevation_layers=3"];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The manifest of the second driver.
fn second_driver() -> Option<PathBuf> {
    let manifest = root().join("target/second-driver/vk_swiftshader_icd.json");
    if manifest.exists() {
        return Some(manifest);
    }
    skip(Lacking::Tool, "no second driver in target/second-driver (./tools/setup.sh unpacks one)");
    None
}

/// A program on the driver of `manifest`, or on the machine's default one.
fn on(manifest: Option<&Path>, program: &str) -> Command {
    let mut command = Command::new(program);
    if let Some(manifest) = manifest {
        // The second name is that of loaders before 1.3.207.
        command.env("VK_DRIVER_FILES", manifest).env("VK_ICD_FILENAMES", manifest);
    }
    command
}

fn output_of(command: &mut Command) -> String {
    let output = command.output().expect("started");
    let text = [output.stdout, output.stderr].concat();
    let text = String::from_utf8_lossy(&text).into_owned();
    assert!(output.status.success(), "{command:?}\n{text}");
    text
}

/// The picture of a shipped scene.
fn picture(manifest: Option<&Path>, scene: &str, folder: &Path, more: &[&str]) -> GrayImage {
    let file = folder.join("picture.png");
    let mut command = on(manifest, env!("CARGO_BIN_EXE_insonify"));
    command.arg("render");
    command.arg(root().join(format!("scenes/{scene}.toml")));
    // Both drivers have this tracer.
    command.args(["--tracer", "bvh", "--quality", "standard", "--output"]).arg(&file);
    command.arg("--validate").args(SIZE.iter().flat_map(|size| ["--set", size]));
    command.args(more);
    output_of(&mut command);
    image::open(file).expect("a PNG").into_luma8()
}

/// Share of pixels that differ by more than one grey level.
fn apart(a: &GrayImage, b: &GrayImage) -> f64 {
    assert_eq!(a.dimensions(), b.dimensions());
    let far = |(a, b): (&u8, &u8)| a.abs_diff(*b) > 1;
    a.iter().zip(b.iter()).filter(|&pair| far(pair)).count() as f64 / a.len() as f64
}

fn same_picture(scene: &str) {
    let Some(second) = second_driver() else {
        return;
    };
    let folder = tempfile::tempdir().expect("a folder");
    let first = picture(None, scene, folder.path(), &[]);
    let second = picture(Some(&second), scene, folder.path(), &[]);
    let share = apart(&first, &second);
    println!("{scene}: {:.4} % of the pixels more than a grey level apart", 100.0 * share);
    assert!(share < APART, "{scene}: {share}");
}

#[test]
fn the_phantom_is_the_same_picture_on_both() {
    same_picture("phantom");
}

#[test]
fn the_abdomen_is_the_same_picture_on_both() {
    same_picture("abdomen");
}

/// Angles of pixels with the largest error that a device's own sine may have.
#[cfg(feature = "compile")]
#[test]
fn a_sine_of_the_least_accuracy_that_vulkan_demands_is_noticed() {
    let folder = tempfile::tempdir().expect("a folder");
    let glsl = folder.path().join("glsl");
    std::fs::create_dir(&glsl).expect("a folder");
    for entry in std::fs::read_dir(root().join("glsl")).expect("sources") {
        let path = entry.expect("readable").path();
        let name = path.file_name().expect("a file");
        if name == "display.comp" || path.extension().is_some_and(|e| e == "glsl") {
            std::fs::copy(&path, glsl.join(name)).expect("copied");
        }
    }
    let angles = glsl.join("angles.glsl");
    let source = std::fs::read_to_string(&angles).expect("readable");
    let planted = source.replace(
        "return mix(angle, -angle, y < 0.0);",
        "return mix(angle, -angle, y < 0.0) + 1.0 / 2048.0;",
    );
    assert_ne!(planted, source);
    std::fs::write(&angles, planted).expect("written");
    let glsl = glsl.to_str().expect("a name");
    let right = picture(None, "phantom", folder.path(), &[]);
    let wrong = picture(None, "phantom", folder.path(), &["--glsl", glsl]);
    let share = apart(&right, &wrong);
    println!("planted: {:.2} % of the pixels more than a grey level apart", 100.0 * share);
    assert!(share > APART, "{share}");
}

// A driver of a GPU whose library is gone is passed over by the loader, and images come from the processor.
#[test]
fn drivers_that_cannot_be_loaded_are_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let broken = folder.path().join("gone_icd.json");
    let text = r#"{"file_format_version":"1.0.1","ICD":{"library_path":"libgone_vulkan.so.0","api_version":"1.4.303"}}"#;
    std::fs::write(&broken, text).expect("written");
    let png = folder.path().join("a.png");
    let run = |drivers: &str, args: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_insonify"));
        command.env("VK_DRIVER_FILES", drivers).env("VK_ICD_FILENAMES", drivers);
        let out = command.args(args).output().expect("it starts");
        let told =
            [out.stdout, out.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
        (out.status.success(), told.concat())
    };
    let broken = broken.display().to_string();
    let (went_well, told) = run(&broken, &["info"]);
    assert!(!went_well && told.contains("libgone_vulkan.so.0"), "{told}");
    assert!(told.contains("install a GPU driver"), "{told}");
    let Some(good) = second_driver() else { return };
    let both = format!("{broken}:{}", good.display());
    let (went_well, told) = run(&both, &["info"]);
    assert!(went_well && told.contains("a driver could not be loaded: libgone_vulkan"), "{told}");
    // The loader gives up on a description that is cut off, whatever stands beside it; newer ones pass over it.
    let cut = folder.path().join("cut_icd.json");
    std::fs::write(&cut, &text[..text.len() / 2]).expect("written");
    let beside = format!("{}:{}", cut.display(), good.display());
    let (went_well, told) = run(&beside, &["info"]);
    if !went_well {
        assert!(told.contains("cannot read the descriptions of drivers"), "{told}");
        // The command that is told names the file.
        let command = told.split('`').nth(1).expect("a command");
        let mut shell = Command::new("sh");
        shell.args(["-c", command]).env("VK_DRIVER_FILES", &beside).env("HOME", folder.path());
        let found = shell.output().expect("a shell").stdout;
        let cut = cut.display().to_string();
        assert!(String::from_utf8_lossy(&found).lines().any(|line| line == cut), "{told}");
    }
    let render = [
        "render",
        "scenes/phantom.toml",
        "--quality",
        "draft",
        "--set",
        "probe.scanlines=16",
        "-o",
    ];
    let render = [&render[..], &[png.to_str().expect("plain")]].concat();
    let (went_well, told) = run(&both, &render);
    assert!(went_well && told.contains("images are made on the processor"), "{told}");
    // Two of one name, and one by its number.
    let both = format!("{0}:{0}", good.display());
    let (_, list) = run(&both, &["info"]);
    if list.contains("\n1: ") {
        let (went_well, told) = run(&both, &[&render[..], &["--device", "swift"]].concat());
        assert!(went_well && told.contains("2 devices are called `swift`: number 0"), "{told}");
        let (went_well, told) = run(&both, &[&render[..], &["--device", "1"]].concat());
        assert!(went_well && !told.contains("devices are called"), "{told}");
    }
}
