//! Enhanced US Volumes: what `acquire` writes lies where its MetaImage lies, for pydicom, for our reader, and by the rules
//! of the reader that 3D Slicer has.

use std::path::Path;
use std::process::Command;

use glam::{DAffine3, DMat3, DMat4, DVec3};
use insonify::output::dicom::{self, Motion, Transducer};
use insonify::scene::Scene;
use insonify::volume::Volume;
use serde_json::Value;

use crate::common::program::insonify;
use crate::loops::python::{errors, numbers, python, run};

const KIND: &str = "EnhancedUltrasoundVolume";

/// A probe that lies across all axes of the patient.
const SCENE: &str = "background = \"liver\"\n[probe]\npreset = \"linear\"\ndepth = \"30 mm\"\n\
    scanlines = 40\nsamples = 300\nelevation_layers = 1\n[probe.pose]\nposition = [12, -30, 250]\n\
    direction = [-1, 2, 2]\nlateral = [2, 2, -1]\n[imaging]\nimage_height = 90\n";

const POSES: &str = "time_s,x_mm,y_mm,z_mm,qw,qx,qy,qz\n0,0,0,0,1,0,0,0\n0.5,0,1,0,1,0,0,0\n\
    1.5,0,2,0,0.999,0.04,0,0\n";

const READ: &str = r#"
import json, sys, numpy, pydicom
d = pydicom.dcmread(sys.argv[1])
if len(sys.argv) > 2:
    d.pixel_array.tofile(sys.argv[2])
s = d.SharedFunctionalGroupsSequence[0]
m = s.PixelMeasuresSequence[0]
own = lambda name, value: [list(f[name][0][value].value) for f in d.PerFrameFunctionalGroupsSequence]
code = lambda name: [d[name][0].CodingSchemeDesignator, d[name][0].CodeValue]
# GDCM does not look into the groups of this class: spacing, orientation and position of the file itself, planes along
# the product of row and column.
x, y = numpy.array(d.ImageOrientationPatient, float).reshape(2, 3)
step = [float(v) for v in (d.PixelSpacing[1], d.PixelSpacing[0], d.SpacingBetweenSlices)]
gdcm = [x * step[0], y * step[1], numpy.cross(x, y) * step[2], numpy.array(d.ImagePositionPatient, float)]
json.dump({
    "class": d.SOPClassUID.name, "shape": [d.NumberOfFrames, d.Rows, d.Columns],
    "spacing": [float(v) for v in [*m.PixelSpacing, m.SpacingBetweenSlices, m.SliceThickness]],
    "orientation": [float(v) for v in s.PlaneOrientationSequence[0].ImageOrientationPatient],
    "of_volume": list(s.PlaneOrientationVolumeSequence[0].ImageOrientationVolume),
    "places": [[float(v) for v in p] for p in own("PlanePositionSequence", "ImagePositionPatient")],
    "corners": own("PlanePositionVolumeSequence", "ImagePositionVolume"),
    "indices": [f.FrameContentSequence[0].DimensionIndexValues for f in d.PerFrameFunctionalGroupsSequence],
    "mapping": list(d.VolumeToTransducerMappingMatrix), "moves": d.VolumeToTransducerRelationship,
    "geometry": d.UltrasoundAcquisitionGeometry, "duration": d.AcquisitionDuration,
    "focus": d.DepthsOfFocus, "depth": int(d.DepthOfScanField), "gdcm": [list(v) for v in gdcm],
    "codes": [code("TransducerGeometryCodeSequence"), code("TransducerBeamSteeringCodeSequence"), code("ViewCodeSequence")],
    "organization": d.DimensionOrganizationType, "type": list(d.ImageType),
    "uids": len({d.FrameOfReferenceUID, d.VolumeFrameOfReferenceUID, d.SOPInstanceUID, d.StudyInstanceUID, d.SeriesInstanceUID}),
}, sys.stdout)
"#;

fn vector(value: &Value) -> DVec3 {
    DVec3::from_slice(&numbers(value))
}

fn vectors(value: &Value) -> Vec<DVec3> {
    value.as_array().expect("a list").iter().map(vector).collect()
}

/// Largest distance of the planes' first voxels from those of the volume in MetaImage, whose second axis runs the other
/// way.
fn away(places: &[DVec3], volume: &Volume) -> f64 {
    let last = volume.size[1] - 1;
    let own = |plane: usize| DVec3::Y * (last - plane) as f64;
    let far = |(plane, place): (usize, &DVec3)| {
        place.distance(volume.world_from_voxel.transform_point3(own(plane)))
    };
    places.iter().enumerate().map(far).fold(0.0, f64::max)
}

#[test]
fn an_acquired_volume_lies_where_its_metaimage_lies() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("scene.toml"), SCENE).expect("written");
    let acquire = |more: &[&str]| {
        let args = [&["acquire", "scene.toml", "--spacing", "0.9,1.3,0.7"], more].concat();
        let (done, said) = insonify(folder.path(), &args);
        assert!(done, "{said}");
    };
    let sweep = ["--sweep", "linear:6mm", "--frames", "5", "--rate", "10"];
    acquire(&[&sweep[..], &["--volume", "a.mha"]].concat());
    acquire(&[&sweep[..], &["--volume", "a.dcm"]].concat());
    let (meta, _) = Volume::load(&at("a.mha")).expect("readable");
    let (own, warnings) = Volume::load(&at("a.dcm")).expect("readable");
    assert!(warnings.is_empty(), "{warnings:?}");
    let [lateral, elevation, depth] = meta.size;
    assert_eq!(own.size, [lateral, depth, elevation]);
    let same = |[i, j, k]: [usize; 3]| [i, elevation - 1 - k, j];
    let index = |[i, j, k]: [usize; 3]| DVec3::new(i as f64, j as f64, k as f64);
    let all = || {
        let pairs = (0..elevation).flat_map(|k| (0..depth).map(move |j| (j, k)));
        pairs.flat_map(|(j, k)| (0..lateral).map(move |i| [i, j, k]))
    };
    for voxel in all() {
        assert_eq!(own.value(voxel), meta.value(same(voxel)), "{voxel:?}");
        let here = own.world_from_voxel.transform_point3(index(voxel));
        let there = meta.world_from_voxel.transform_point3(index(same(voxel)));
        assert!(here.distance(there) < 1e-6, "{voxel:?}: {here} {there}");
    }
    assert!(meta.statistics.max > 60.0, "{:?}", meta.statistics);

    let Some(python) = python() else { return };
    let raw = at("a.raw");
    let found = run(&python, READ, &[&at("a.dcm").to_string_lossy(), &raw.to_string_lossy()]);
    assert_eq!(found["class"], "Enhanced US Volume Storage");
    assert_eq!(found["shape"], serde_json::json!([elevation, depth, lateral]));
    assert_eq!(found["geometry"], "PATIENT");
    assert_eq!((&found["organization"], &found["uids"]), (&"3D".into(), &5.into()));
    let expected = [0.7, 0.9, 1.3, 1.3];
    let spacing = numbers(&found["spacing"]);
    assert!(spacing.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{spacing:?}");
    let counted: Vec<_> = (1..=elevation).collect();
    assert_eq!(found["indices"], serde_json::json!(counted));
    let bytes = std::fs::read(raw).expect("written by numpy");
    assert_eq!(bytes.len(), lateral * elevation * depth);
    assert!(all().zip(bytes).all(|(voxel, byte)| f64::from(byte) == meta.value(same(voxel))));

    // Places of planes, in the patient and from the transducer, whose z is minus the probe's elevation.
    let places = vectors(&found["places"]);
    assert!(away(&places, &meta) < 1e-6, "{places:?}");
    let mut planted = places.clone();
    planted[1] += DVec3::new(0.0, 2e-6, 0.0);
    assert!(away(&planted, &meta) >= 1e-6);
    let (scene, _) = Scene::load(&at("scene.toml"), &[]).expect("sound");
    let transducer = DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::NEG_Y);
    let patient_from_transducer = scene.world_from_probe * DAffine3::from_mat3(transducer);
    for (corner, place) in vectors(&found["corners"]).into_iter().zip(&places) {
        assert!(patient_from_transducer.transform_point3(corner).distance(*place) < 1e-6);
    }
    let axes = patient_from_transducer.matrix3;
    let directions = numbers(&found["orientation"]);
    assert!(axes.x_axis.distance(DVec3::from_slice(&directions[..3])) < 1e-9, "{directions:?}");
    assert!(axes.y_axis.distance(DVec3::from_slice(&directions[3..])) < 1e-9, "{directions:?}");
    assert_eq!(numbers(&found["of_volume"]), [1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    assert_eq!(numbers(&found["mapping"]), DMat4::IDENTITY.to_cols_array());

    // 3D Slicer: IJK to LPS by GDCM, then half a turn to RAS.
    let [x, y, z, origin] = vectors(&found["gdcm"]).try_into().expect("four vectors");
    let gdcm = DAffine3::from_mat3_translation(DMat3::from_cols(x, y, z), origin);
    for voxel in [[0, 0, 0], [lateral - 1, depth - 1, elevation - 1], [3, 1, 2]] {
        let ras = DVec3::new(-1.0, -1.0, 1.0) * gdcm.transform_point3(index(voxel));
        let there = meta.world_from_voxel.transform_point3(index(same(voxel)));
        let there = scene.tracker.axes.to_ras().transform_point3(there);
        assert!(ras.distance(there) < 1e-6, "{voxel:?}: {ras} {there}");
    }

    std::fs::write(at("way.csv"), POSES).expect("written");
    for (name, sweep, moves, duration) in [
        ("a.dcm", "", "POSITION_VAR", 0.4),
        ("b.dcm", "tilt:8deg", "ORIENTATION_VAR", 0.1),
        ("c.dcm", "way.csv", "VARIABLE", 1.5),
    ] {
        if !sweep.is_empty() {
            let frames = if sweep.starts_with("tilt") { "3" } else { "4" };
            acquire(&["--sweep", sweep, "--frames", frames, "--volume", name]);
        }
        let found = run(&python, READ, &[&at(name).to_string_lossy()]);
        assert_eq!(found["moves"], moves, "{name}");
        let seconds = found["duration"].as_f64().expect("s");
        assert!((seconds - duration).abs() < 1e-9, "{name}: {seconds}");
        let errors = errors(&at(name), KIND).unwrap_or_default();
        assert!(errors.is_empty(), "{name}: {errors:?}");
    }
}

/// A volume of counted voxels, seen along an axis.
fn counted(size: [usize; 3], patient_from_transducer: DAffine3) -> dicom::Volume {
    dicom::Volume {
        name: "a\\b^c=d".to_owned(),
        size,
        voxels: (0..size.iter().product()).map(|n: usize| n as u8).collect(),
        spacing: DVec3::new(0.123_456_789, 2.0 / 3.0, 17.0),
        first: DVec3::new(-0.3, 1e-7, -123.456_789_012),
        patient_from_transducer,
        motion: Motion::None,
        duration: 0.0,
        transducer: Transducer::Curved,
        focus: 60.0,
        depth: 119.7,
    }
}

#[test]
fn every_transducer_and_view_is_sound() {
    let Some(python) = python() else { return };
    let folder = tempfile::tempdir().expect("temporary folder");
    let path = folder.path().join("a.dcm");
    let turned = |angle| DAffine3::from_rotation_x(angle) * DAffine3::from_rotation_y(0.1);
    for (transducer, codes, pose, view) in [
        (Transducer::Curved, ["125253", "125257"], DAffine3::IDENTITY, "62824007"),
        (Transducer::Linear, ["125252", "125257"], turned(1.5), "81654009"),
        (Transducer::Phased, ["125254", "125259"], turned(0.8), "21114003"),
        (Transducer::Phased, ["125254", "125259"], DAffine3::from_rotation_y(1.6), "30730003"),
    ] {
        // An odd number of bytes; one plane alone.
        for size in [[3, 5, 7], [3, 5, 1]] {
            let mut volume = counted(size, pose);
            volume.transducer = transducer;
            volume.write(&path).expect("written");
            let errors = errors(&path, KIND).unwrap_or_default();
            assert!(errors.is_empty(), "{transducer:?} {size:?}: {errors:?}");
            let found = run(&python, READ, &[&path.to_string_lossy()]);
            let [geometry, steering] = codes;
            let expected = [["DCM", geometry], ["DCM", steering], ["SCT", view]];
            assert_eq!(found["codes"], serde_json::json!(expected));
            assert_eq!(found["moves"], "FIXED");
            assert_eq!((&found["focus"], &found["depth"]), (&60.0.into(), &120.into()));
            let spacing = numbers(&found["spacing"]);
            assert!((spacing[1] - 0.123_456_789).abs() < 1e-12, "{spacing:?}");
            let corner = vectors(&found["corners"]).pop().expect("a plane");
            let far = corner - DVec3::new(-0.3, 1e-7, -123.456_789_012);
            assert!((far - DVec3::Z * 17.0 * (size[2] - 1) as f64).length() < 1e-12, "{far}");
            let place = vectors(&found["places"]).pop().expect("a plane");
            assert!(pose.transform_point3(corner).distance(place) < 1e-6, "{place}");
        }
    }
}

/// Without this a validator that finds nothing at all would pass every file.
#[test]
fn the_validator_finds_what_is_missing() {
    let Some(python) = python() else { return };
    let folder = tempfile::tempdir().expect("temporary folder");
    let path = folder.path().join("a.dcm");
    counted([3, 5, 7], DAffine3::IDENTITY).write(&path).expect("written");
    for name in ["ViewCodeSequence", "MechanicalIndex", "VolumeToTransducerMappingMatrix"] {
        let planted = folder.path().join("b.dcm");
        let script = "import sys, pydicom\nd = pydicom.dcmread(sys.argv[1])\n\
             delattr(d, sys.argv[3])\nd.save_as(sys.argv[2])";
        let mut command = Command::new(&python);
        let paths = [path.as_path(), &planted, Path::new(name)];
        let out = command.args(["-c", script]).args(paths).output().expect("Python starts");
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
        let Some(errors) = errors(&planted, KIND) else { return };
        assert!(errors.iter().any(|e| e.contains(name)), "{name}: {errors:?}");
    }
}

#[test]
fn what_cannot_be_written_is_said_before_the_work() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let path = folder.path().join("a.dcm");
    let error = counted([65_536, 1, 1], DAffine3::IDENTITY).write(&path).expect_err("too wide");
    assert!(error.to_string().contains("65535 a side"), "{error}");
    assert!(!path.exists());
    std::fs::write(folder.path().join("scene.toml"), SCENE).expect("written");
    for (more, cause) in [
        (&["-o", "a.dcm"][..], "write a volume by --volume NAME.dcm"),
        (&["-o", "a.png"], "tracked frames are MetaImage or NRRD"),
        (&["--volume", "a.nrrd"], "a volume is MetaImage in one file or DICOM"),
        (&["--volume", "scene.toml/a.dcm"], "folder cannot be made"),
        (
            &["--volume", "a.dcm", "--volumes", "3", "--period", "1s"],
            "volumes over time are MetaImage",
        ),
    ] {
        let args = [&["acquire", "scene.toml", "--sweep", "linear:6mm"], more].concat();
        let (done, said) = insonify(folder.path(), &args);
        assert!(!done && said.contains(cause), "{said}, not {cause}");
    }
}
