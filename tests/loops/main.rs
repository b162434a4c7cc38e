//! Loops in DICOM, read back by pydicom and held to the standard by dciodvfy.

#[path = "common/program.rs"]
mod program;
#[path = "common/skip.rs"]
mod skip;

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use insonify::output::dicom::{About, Loop};
use insonify::scene::Scene;
use program::insonify;
use serde_json::Value;
use skip::{Lacking, skip};

/// A Python that has pydicom, in a folder of the build; none where it cannot be had. Made once, whoever asks first.
fn python() -> Option<PathBuf> {
    static MADE: OnceLock<Option<PathBuf>> = OnceLock::new();
    let made = MADE.get_or_init(make).clone();
    if made.is_none() {
        // From the network, like data.
        skip(Lacking::Data, "no pydicom");
    }
    made
}

fn make() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("pydicom");
    let python = folder.join("bin/python");
    let runs = |command: &mut Command| command.output().is_ok_and(|out| out.status.success());
    let ready = || runs(Command::new(&python).args(["-c", "import numpy, pydicom"]));
    if !ready() {
        let made = runs(Command::new("python3").args(["-m", "venv"]).arg(&folder));
        let install = ["-m", "pip", "install", "--quiet", "pydicom==3.0.1", "numpy"];
        if !(made && runs(Command::new(&python).args(install)) && ready()) {
            return None;
        }
    }
    Some(python)
}

const READ: &str = r#"
import json, sys, pydicom
d = pydicom.dcmread(sys.argv[1])
r = d.SequenceOfUltrasoundRegions[0]
p = d.pixel_array
json.dump({
    "class": d.file_meta.MediaStorageSOPClassUID.name, "same": d.file_meta.MediaStorageSOPInstanceUID == d.SOPInstanceUID,
    "size": [d.Columns, d.Rows], "frames": d.NumberOfFrames, "time": float(d.FrameTime),
    "pointer": str(d.FrameIncrementPointer), "photometric": d.PhotometricInterpretation, "shape": p.shape,
    "delta": [r.PhysicalDeltaX, r.PhysicalDeltaY], "units": [r.PhysicalUnitsXDirection, r.PhysicalUnitsYDirection],
    "box": [r.RegionLocationMinX0, r.RegionLocationMinY0, r.RegionLocationMaxX1, r.RegionLocationMaxY1],
    "reference": [r.ReferencePixelX0, r.ReferencePixelY0], "at": [r.ReferencePixelPhysicalValueX, r.ReferencePixelPhysicalValueY],
    "kilohertz": r.TransducerFrequency, "modality": d.Modality, "pixels": p.reshape(-1)[:int(sys.argv[2])].tolist(),
    "sum": int(p.astype("int64").sum()), "valid": d.SOPInstanceUID.is_valid,
}, sys.stdout)
"#;

fn read(python: &Path, file: &Path, pixels: usize) -> Value {
    let out = Command::new(python).args(["-c", READ]).arg(file).arg(pixels.to_string()).output();
    let out = out.expect("Python starts");
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    // Warnings of pydicom are faults of ours.
    assert_eq!(String::from_utf8_lossy(&out.stderr), "");
    serde_json::from_slice(&out.stdout).expect("JSON")
}

/// The errors that dicom3tools' validator finds; none where there is no validator.
fn errors(file: &Path) -> Option<Vec<String>> {
    let Ok(out) = Command::new("dciodvfy").arg(file).output() else {
        skip(Lacking::Data, "no dciodvfy (Debian's dicom3tools)");
        return None;
    };
    let text = String::from_utf8_lossy(&[out.stdout, out.stderr].concat()).into_owned();
    assert!(text.contains("USMultiFrameImage"), "{text}");
    Some(text.lines().filter(|l| l.starts_with("Error")).map(str::to_owned).collect())
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().expect("a list").iter().map(|v| v.as_f64().expect("a number")).collect()
}

#[test]
fn a_rendered_loop_has_the_spacing_and_the_time_of_its_frames() {
    let Some(python) = python() else { return };
    let folder = tempfile::tempdir().expect("temporary folder");
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/phantom.toml");
    let path = scene.to_str().expect("a plain path");
    let quick = [
        "--set",
        "simulation.paths=1",
        "--set",
        "probe.elevation_layers=1",
        "--set",
        "probe.scanlines=48",
    ];
    let args =
        [&["render", path, "--frames", "3", "--fps", "25", "-o", "a.dcm"], &quick[..]].concat();
    let (done, said) = insonify(folder.path(), &args);
    assert!(done, "{said}");
    let (done, said) =
        insonify(folder.path(), &[&["render", path, "-o", "a.png"], &quick[..]].concat());
    assert!(done, "{said}");
    let picture = image::open(folder.path().join("a.png")).expect("a PNG").into_luma8();
    let found = read(&python, &folder.path().join("a.dcm"), 0);
    assert_eq!(found["class"], "Ultrasound Multi-frame Image Storage");
    assert!(found["same"] == true && found["valid"] == true && found["modality"] == "US");
    assert_eq!(found["size"], serde_json::json!([picture.width(), picture.height()]));
    assert_eq!(found["shape"], serde_json::json!([3, picture.height(), picture.width()]));
    assert_eq!((&found["frames"], &found["time"]), (&3.into(), &40.0.into()));
    assert_eq!(found["pointer"], "(0018,1063)");
    assert_eq!(
        (&found["photometric"], &found["units"]),
        (&"MONOCHROME2".into(), &serde_json::json!([3, 3]))
    );
    assert!(found["sum"].as_i64() > Some(100_000), "{found}");
    // The image is as high as its pixels, and the face's middle is where the region says.
    let (loaded, _) = Scene::load(&scene, &[]).expect("sound");
    let [left, top, right, bottom] = loaded.probe.bounds();
    let pitch = numbers(&found["delta"]);
    assert_eq!(pitch[0], pitch[1]);
    let expected = (bottom - top) / f64::from(picture.height()) / 10.0;
    assert!((pitch[1] - expected).abs() < 1e-6, "{pitch:?} {expected}");
    let wide = (right - left) / f64::from(picture.width()) / 10.0;
    assert!((pitch[0] / wide - 1.0).abs() < 0.01, "{pitch:?} {wide}");
    let (reference, at) = (numbers(&found["reference"]), numbers(&found["at"]));
    for (n, middle) in
        [f64::from(picture.width()) / 2.0, -top / 10.0 / pitch[1]].into_iter().enumerate()
    {
        // Where 0 cm is, pixels from the left or upper edge.
        let zero = reference[n] + 0.5 - at[n] / pitch[n];
        assert!((zero - middle).abs() < 0.6, "axis {n}: {zero}, {middle}");
    }
    assert_eq!(
        numbers(&found["box"])[2..],
        [f64::from(picture.width() - 1), f64::from(picture.height() - 1)]
    );
}

#[test]
fn colours_and_odd_sizes_are_read_back() {
    let Some(python) = python() else { return };
    let folder = tempfile::tempdir().expect("temporary folder");
    let about = About {
        name: "a\\b^c=d".to_owned(),
        pitch: 0.123_456_789,
        corner: [-0.3, 0.05],
        frequency: 3.5,
        transducer: "CURVED LINEAR",
    };
    let grey = [10, 10, 10, 255, 0, 0, 0, 0, 30, 30, 30, 255];
    let color = [10, 20, 30, 255, 9, 9, 9, 0, 200, 0, 100, 255];
    for (name, frames, expected) in [
        ("grey.dcm", vec![grey], vec![10, 0, 30]),
        (
            "color.dcm",
            vec![grey, color],
            vec![10, 10, 10, 0, 0, 0, 30, 30, 30, 10, 20, 30, 0, 0, 0, 200, 0, 100],
        ),
    ] {
        let path = folder.path().join(name);
        let mut made = Loop::new(&path, about.clone());
        for frame in &frames {
            made.add(3, 1, frame).expect("room");
        }
        made.finish(1000.0 / 30.0).expect("written");
        let found = read(&python, &path, expected.len());
        assert_eq!(found["pixels"], serde_json::json!(expected), "{name}");
        assert_eq!(numbers(&found["delta"]), [0.012_345_678_9; 2]);
        assert!((found["time"].as_f64().expect("ms") - 33.333_333).abs() < 1e-5);
        if let Some(errors) = errors(&path) {
            assert!(errors.is_empty(), "{name}: {errors:?}");
        }
        assert_eq!(found["kilohertz"], 3500);
        assert_eq!(found["photometric"], if frames.len() > 1 { "RGB" } else { "MONOCHROME2" });
    }
}
