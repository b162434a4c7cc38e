//! Loops and volumes in DICOM, read back by pydicom and held to the standard by dciodvfy; loops with poses, read back by
//! our own importer. What 3D Slicer makes of them is computed by its rules (docs/volumes.md, "In 3D Slicer").

mod python;
mod sequences;
mod volumes;

use std::path::Path;

use insonify::output::dicom::{self, About, Loop, Patient, Study, Transducer};
use insonify::scene::Scene;
use python::{errors, numbers, python, run};
use serde_json::Value;

use crate::common::program::insonify;

/// Settings with which a frame takes a second.
const QUICK: [&str; 6] = [
    "--set",
    "simulation.paths=1",
    "--set",
    "probe.elevation_layers=1",
    "--set",
    "probe.scanlines=48",
];

const READ: &str = r#"
import json, sys, pydicom
# The size of a pixel in mm, by the rule of DICOMImageSequencePlugin.py.
def slicer(d):
    regions = d.get("SequenceOfUltrasoundRegions", [])
    r = regions[0] if len(regions) == 1 else None
    if d.Modality != "US" or r is None or r.RegionSpatialFormat != 1 or r.RegionDataType not in (1, 2):
        return None
    cm = r.PhysicalUnitsXDirection == 3 and r.PhysicalUnitsYDirection == 3
    return [10 * r.PhysicalDeltaX, 10 * r.PhysicalDeltaY] if cm else None
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
    "sum": int(p.astype("int64").sum()), "valid": d.SOPInstanceUID.is_valid, "slicer": slicer(d),
}, sys.stdout)
"#;

fn read(python: &Path, file: &Path, pixels: usize) -> Value {
    run(python, READ, &[&file.to_string_lossy(), &pixels.to_string()])
}

#[test]
fn a_rendered_loop_has_the_spacing_and_the_time_of_its_frames() {
    let Some(python) = python() else { return };
    let folder = tempfile::tempdir().expect("temporary folder");
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/phantom.toml");
    let path = scene.to_str().expect("a plain path");
    let args =
        [&["render", path, "--frames", "3", "--fps", "25", "-o", "a.dcm"], &QUICK[..]].concat();
    let (done, said) = insonify(folder.path(), &args);
    assert!(done, "{said}");
    let (done, said) =
        insonify(folder.path(), &[&["render", path, "-o", "a.png"], &QUICK[..]].concat());
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
    let slicer = numbers(&found["slicer"]);
    assert!(slicer.iter().all(|mm| (mm - 10.0 * expected).abs() < 1e-6), "{slicer:?} {expected}");
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
        transducer: Transducer::Curved,
        colours: None,
        study: None,
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
        if let Some(errors) = errors(&path, "USMultiFrameImage") {
            assert!(errors.is_empty(), "{name}: {errors:?}");
        }
        assert_eq!(found["kilohertz"], 3500);
        assert_eq!(found["photometric"], if frames.len() > 1 { "RGB" } else { "MONOCHROME2" });
    }
}

#[test]
fn an_image_and_a_loop_of_a_patient_are_sound() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let patient = Patient {
        name: "Müller^Anna".to_owned(),
        number: "77-a".to_owned(),
        born: "12.4.1990".to_owned(),
    };
    let mut typed = Study::begin(patient);
    typed.examiner = "Weiß".to_owned();
    typed.question = "Zyste?".to_owned();
    typed.exam = "abdomen".to_owned();
    let frame = [10, 10, 10, 255, 0, 0, 0, 0, 30, 30, 30, 255];
    for (name, study) in [("typed", typed), ("empty", Study::begin(Patient::default()))] {
        let about = About {
            name: "Liver".to_owned(),
            pitch: 0.2,
            corner: [-0.3, 0.05],
            frequency: 5.0,
            transducer: Transducer::Linear,
            colours: None,
            study: Some(study),
        };
        let [image, film] =
            ["image", "loop"].map(|kind| folder.path().join(name.to_owned() + kind));
        dicom::still(&image, about.clone(), [3, 1], &frame).expect("written");
        let mut made = Loop::new(&film, about);
        for _ in 0..3 {
            made.add(3, 1, &frame).expect("room");
        }
        made.finish_at(&[40.0, 100.0, 100.0 + 100.0 / 3.0]).expect("written");
        for (file, kind) in [(image, "USImage"), (film, "USMultiFrameImage")] {
            if let Some(errors) = errors(&file, kind) {
                assert!(errors.is_empty(), "{name} {kind}: {errors:?}");
            }
        }
    }
}
