//! Volumes of other programs: values and positions compared with ITK's from the same files, and the program on
//! every file at hand, also cut and changed.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};

use bzip2::write::BzEncoder;
use flate2::write::GzEncoder;
use insonify::volume::{Sequence, Volume, Voxels, is_volume};

use crate::common::limited::{Outcome, check, files};
use crate::common::shared_data::shared_data;

const SETS: [&str; 3] = ["corpus-nrrd-nifti", "us-plus", "us-itkultrasound"];

fn volumes(folder: &Path) -> Vec<PathBuf> {
    files(folder, is_volume)
}

/// ITK's results by file: `size=(..)`, `comp=1`, `sp=(..)`, `origin=(..)`, `min=`, `max=`, `mean=`.
fn facts(data: &Path) -> BTreeMap<PathBuf, String> {
    let mut out = BTreeMap::new();
    for set in SETS {
        let text = std::fs::read_to_string(data.join(set).join("facts-volume.txt"));
        for line in text.expect("facts").lines() {
            let (path, facts) = line.split_once(": ").expect("`path: facts`");
            let path = path.strip_prefix("keep/").unwrap_or(path);
            out.insert(data.join(path), facts.to_owned());
        }
    }
    out
}

fn numbers(facts: &str, key: &str) -> Vec<f64> {
    let rest = facts.split_once(&format!(" {key}=")).expect(key).1;
    let value = match rest.strip_prefix('(') {
        Some(inner) => inner.split(')').next(),
        None => rest.split(' ').next(),
    };
    let words = value.expect("a value").split(',').map(str::trim);
    words.filter_map(|w| w.parse().ok()).collect()
}

/// The difference of a volume from ITK's results for its file, with this error planted.
fn difference(volume: &Volume, facts: &str, planted: f64) -> Option<String> {
    let facts = format!(" {facts}");
    let mut size = volume.size.map(|n| n as f64).to_vec();
    let mut spacing = volume.spacing().to_array().to_vec();
    if !volume.later.is_empty() {
        size.push(volume.volumes().count() as f64);
        spacing.extend(volume.interval);
    }
    let origin = volume.world_from_voxel.translation.to_array().to_vec();
    let values = volume.statistics;
    // The facts are rounded: lengths to 1e-3 or five digits, means to 1e-3; single precision
    // adds 6e-8 of a value.
    for (key, found, tolerance) in [
        ("size", size, 0.0),
        ("sp", spacing, 1e-5),
        ("origin", origin, 6e-4),
        ("min", vec![values.min], 1e-2),
        ("max", vec![values.max], 1e-2),
        ("mean", vec![values.mean], 6e-4),
    ] {
        let expected = numbers(&facts, key);
        if found.len() < expected.len() && ["size", "sp"].contains(&key) && expected.len() > 3 {
            return Some(format!("{key}: {found:?}, ITK reads {expected:?}"));
        }
        for (found, expected) in found.iter().zip(expected) {
            if (found + planted - expected).abs() > tolerance + 1e-7 * expected.abs() {
                return Some(format!("{key}: {found}, ITK reads {expected}"));
            }
        }
    }
    None
}

#[test]
fn values_and_positions_are_those_that_itk_reads() {
    let Some(data) = shared_data() else { return };
    let (mut compared, mut over_time, mut bad) = (0, 0, Vec::new());
    for (path, facts) in facts(&data) {
        let loaded = Volume::load(&path);
        if facts.contains("ERROR") || facts.contains("zero-size") {
            // Four axes of which three are of space, and bzip2: ITK refuses them, the format
            // allows them.
            let fine = ["test_simple4d_raw.nrrd", "BallBinary30x30x30_bz2.nrrd"];
            let fine = fine.iter().any(|name| path.ends_with(name));
            assert_eq!(loaded.is_ok(), fine, "{}", path.display());
            continue;
        }
        let (volume, _) = loaded.unwrap_or_else(|e| panic!("{e}"));
        if !facts.contains("comp=1 ") {
            // Only the first channel is read: values over all are not comparable.
            continue;
        }
        compared += 1;
        over_time += usize::from(!volume.later.is_empty());
        bad.extend(difference(&volume, &facts, 0.0).map(|d| format!("{}: {d}", path.display())));
        assert!(difference(&volume, &facts, 0.02).is_some());
    }
    println!("{compared} volumes compared, {over_time} of them over time");
    assert_eq!(over_time, 2, "all over time");
    assert!(bad.is_empty(), "{}", bad.join("\n"));
    assert!(compared >= 30, "{compared}");
}

/// Values in a NRRD type, byte order and encoding.
fn encode(values: &[i16], kind: &str, big: bool, encoding: &str) -> Vec<u8> {
    if encoding == "ascii" {
        let words: Vec<_> = values.iter().map(i16::to_string).collect();
        return words.join(" ").into_bytes();
    }
    let one = |v: i16| {
        let mut bytes = match kind {
            "uint16" | "int16" => v.to_le_bytes().to_vec(),
            "int32" | "uint32" => i32::from(v).to_le_bytes().to_vec(),
            "float" => f32::from(v).to_le_bytes().to_vec(),
            _ => f64::from(v).to_le_bytes().to_vec(),
        };
        if big {
            bytes.reverse();
        }
        bytes
    };
    let bytes: Vec<u8> = values.iter().flat_map(|&v| one(v)).collect();
    match encoding {
        "gzip" => {
            let mut encoder = GzEncoder::new(Vec::new(), flate2::Compression::fast());
            encoder.write_all(&bytes).expect("memory");
            encoder.finish().expect("memory")
        }
        "bzip2" => {
            let mut encoder = BzEncoder::new(Vec::new(), bzip2::Compression::fast());
            encoder.write_all(&bytes).expect("memory");
            encoder.finish().expect("memory")
        }
        "hex" => {
            let rows = bytes.chunks(35).map(|row| {
                let digits: String = row.iter().map(|b| format!("{b:02x}")).collect();
                digits + "\n"
            });
            rows.collect::<String>().into_bytes()
        }
        _ => bytes,
    }
}

#[test]
fn every_encoding_of_the_ball_gives_the_same_voxels() {
    let Some(data) = shared_data() else { return };
    let folder = data.join("corpus-nrrd-nifti/pynrrd/nrrd/tests/data");
    let load = |name: &str| {
        let (volume, _) = Volume::load(&folder.join(format!("BallBinary30x30x30{name}")))
            .unwrap_or_else(|e| panic!("{e}"));
        volume.voxels
    };
    let plain = load(".nrrd");
    for name in [
        ".nhdr",
        ".nii.gz",
        "_byteskip_minus_one.nhdr",
        "_byteskip_minus_one_nifti.nhdr",
        "_bz2.nrrd",
        "_gz.nrrd",
        "_gz_byteskip_minus_one.nrrd",
        "_gz_lineskip.nrrd",
    ] {
        assert!(load(name) == plain, "{name}");
    }
    // Also written anew, from the voxels: every type that holds them, both byte orders, every encoding, in the
    // header's file and beside it.
    let Voxels::I16(ball) = &plain else { panic!("16 bits") };
    let folder = tempfile::tempdir().expect("a folder");
    for kind in ["uint16", "int16", "int32", "uint32", "float", "double"] {
        for (big, encoding) in [false, true]
            .into_iter()
            .flat_map(|big| ["raw", "gzip", "bzip2", "hex", "ascii"].map(|e| (big, e)))
        {
            let data = encode(ball, kind, big, encoding);
            let endian = if big { "big" } else { "little" };
            let header = format!(
                "NRRD0005\ntype: {kind}\ndimension: 3\nsizes: 30 30 30\nendian: {endian}\n\
                 encoding: {encoding}\n"
            );
            let within = [header.as_bytes(), b"\n", &data].concat();
            let beside = format!("{header}data file: ball.data\n");
            for (name, bytes) in [("ball.nrrd", &within[..]), ("ball.nhdr", beside.as_bytes())] {
                let path = folder.path().join(name);
                std::fs::write(&path, bytes).expect("written");
                std::fs::write(folder.path().join("ball.data"), &data).expect("written");
                let (volume, _) = Volume::load(&path).unwrap_or_else(|e| panic!("{e}"));
                let same = (0..ball.len()).all(|i| volume.voxels.get(i) == f64::from(ball[i]));
                assert!(same, "{name} {kind} {endian} {encoding}");
            }
        }
    }
    // Its header takes the header of the NIfTI file for voxels.
    assert!(load("_nifti.nhdr") != plain);
}

/// PLUS's own sequences are read, and written so that they read back equal; poses that it marked as lost are
/// marked here.
#[test]
fn sequences_of_plus_are_written_back_equal() {
    let Some(data) = shared_data() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let copy = folder.path().join("copy.igs.mha");
    let (mut read, mut refused) = (0, Vec::new());
    for path in files(&data.join("us-plus/TestImages"), |p| {
        let name = p.to_string_lossy();
        name.ends_with(".igs.mha") || name.ends_with(".igs.mhd")
    }) {
        let name = path.file_name().expect("a name").to_string_lossy().into_owned();
        match Sequence::load(&path) {
            Ok((sequence, _)) => {
                sequence.write(&copy).expect("written");
                let (again, _) = Sequence::load(&copy).expect("readable");
                assert!(again == sequence, "{name}");
                read += 1;
            }
            Err(_) => refused.push(name),
        }
    }
    // Poses only, and a file whose pixels are missing.
    assert_eq!(
        refused,
        [
            "EightLandmarkPointsTrackedForPhantomRegistration.igs.mha",
            "MetaImageSequenceIOTest1.igs.mhd",
            "ReferenceToRASCalibration.igs.mha",
        ]
    );
    assert!(read >= 18, "{read}");
    let nwires = data.join("us-plus/TestImages/NwirePhantomFreehand.igs.mha");
    let (sequence, _) = Sequence::load(&nwires).expect("readable");
    let poses: Vec<_> = sequence.frames.iter().flat_map(|f| f.poses.values()).collect();
    let ok = poses.iter().filter(|p| p.is_ok()).count();
    assert_eq!((sequence.frames.len(), poses.len(), ok), (97, 291, 194));
    // Numbers of the header, as written there.
    let first = &sequence.frames[0];
    assert_eq!(first.timestamp, Some(345.627957));
    let probe = first.poses["ProbeToTracker"].transform;
    assert_eq!(probe.matrix3.col(1).x, -0.263308);
    assert_eq!(probe.translation.x, -190.886);
}

/// Small files written by SimpleITK and pydicom, with the values that these read from them
/// (tools/oracle/volumes.py): every format, type and encoding, oblique and mirrored directions,
/// anisotropic spacing.
#[test]
fn files_written_by_others_give_their_voxels_and_places() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/volumes");
    let text = std::fs::read_to_string(folder.join("expected.json")).expect("readable");
    let all: BTreeMap<String, serde_json::Value> = serde_json::from_str(&text).expect("JSON");
    for (name, expected) in &all {
        let numbers = |key: &str| -> Vec<f64> {
            let list = expected[key].as_array().expect(key);
            list.iter().map(|v| v.as_f64().expect("a number")).collect()
        };
        let (volume, _) = Volume::load(&folder.join(name)).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(volume.size.map(|n| n as f64).to_vec(), numbers("size"), "{name}");
        let found: Vec<_> = (0..volume.voxels.len()).map(|i| volume.voxels.get(i)).collect();
        // For JPEG the standard allows a decoder a grey level; all others are exact.
        let tolerance = f64::from(u8::from(name.starts_with("jpeg")));
        // Nine digits name a single-precision number.
        let values: Vec<_> = numbers("values").iter().map(|v| f64::from(*v as f32)).collect();
        let worst = found.iter().zip(&values).map(|(a, b)| (a - b).abs());
        let worst = worst.fold(0.0, f64::max);
        assert!(found.len() == values.len() && worst <= tolerance, "{name}: {worst}");
        // NIfTI holds positions in single precision and directions as a quaternion of it.
        let tolerance = if name.contains(".nii") { 1e-5 } else { 1e-9 };
        let (spacing, origin, direction) =
            (numbers("spacing"), numbers("origin"), numbers("direction"));
        let same = |flip: f64| {
            (0..3).all(|axis| {
                let step = volume.world_from_voxel.matrix3.col(axis).to_array();
                (0..3).all(|row| {
                    let expected = flip * direction[3 * row + axis] * spacing[axis];
                    let at = volume.world_from_voxel.translation[row] - origin[row];
                    (step[row] - expected).abs() < tolerance && at.abs() < tolerance
                })
            })
        };
        assert!(same(1.0), "{name}: {:?}", volume.world_from_voxel);
        assert!(!same(-1.0), "the comparison notices a flip");
    }
    assert!(all.len() >= 27, "{}", all.len());
}

/// A slope of zero means no scaling.
#[test]
fn slopes_of_nifti_are_applied_to_every_type() {
    let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/volumes");
    let folder = tempfile::tempdir().expect("a folder");
    for name in ["u8_coronal.nii", "i16_oblique.nii", "i32_mirrored.nii"] {
        let mut file = std::fs::read(shipped.join(name)).expect("readable");
        let (plain, _) = Volume::load(&shipped.join(name)).expect("sound");
        for (slope, intercept) in [(0.25f32, -3.5f32), (-2.0, 0.0), (1.0, 7.0), (0.0, 9.0)] {
            file[112..116].copy_from_slice(&slope.to_le_bytes());
            file[116..120].copy_from_slice(&intercept.to_le_bytes());
            let path = folder.path().join(name);
            std::fs::write(&path, &file).expect("written");
            let (scaled, _) = Volume::load(&path).expect("sound");
            for i in 0..plain.voxels.len() {
                let (value, found) = (plain.voxels.get(i), scaled.voxels.get(i));
                let expected = if slope == 0.0 {
                    value
                } else {
                    f64::from((f64::from(slope) * value + f64::from(intercept)) as f32)
                };
                assert_eq!(found, expected, "{name}");
            }
        }
    }
}

#[test]
fn check_describes_or_refuses_every_file() {
    let Some(data) = shared_data() else { return };
    let mut counts = [0; 2];
    for set in SETS.iter().chain(&["us-dicom-pydicom"]) {
        for path in volumes(&data.join(set)) {
            let Outcome { code, text } = check(&path);
            match code {
                Some(0) => assert!(text.contains("values ") && text.contains("0 errors"), "{text}"),
                Some(1) => assert!(text.contains("help:") && text.contains("1 error,"), "{text}"),
                _ => panic!("{}: {code:?}\n{text}", path.display()),
            }
            counts[usize::from(code == Some(1))] += 1;
        }
    }
    println!("{} described, {} refused", counts[0], counts[1]);
    assert!(counts[0] > 40 && counts[1] > 5, "{counts:?}");
}

#[test]
fn cut_and_changed_files_are_refused_within_bounds() {
    let Some(data) = shared_data() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let mut files = volumes(&data.join("corpus-nrrd-nifti"));
    files.push(data.join("us-plus/TestImages/SpinePhantomFreehandReconstructed.mha"));
    for path in files {
        let whole = std::fs::read(&path).expect("readable");
        let beside = path.extension().is_some_and(|e| e == "nhdr" || e == "mhd");
        let copy = folder.path().join(path.file_name().expect("a name"));
        for part in [0, 1, 200, whole.len() / 2, whole.len() - 9] {
            std::fs::write(&copy, &whole[..part.min(whole.len())]).expect("written");
            let refused = Volume::load(&copy).is_err();
            assert!(refused || beside, "{} cut at {part}", path.display());
        }
        // Huge sizes in place of the real ones; nothing may be allocated for them.
        let text = String::from_utf8_lossy(&whole[..whole.len().min(400)]).into_owned();
        for (key, huge) in [("sizes: ", "60000 60000 1"), ("DimSize = ", "1500 1500 1700")] {
            let Some(at) = text.find(key) else { continue };
            let end = at + text[at..].find('\n').expect("a line");
            let axes = text[at + key.len()..end].split_whitespace().count();
            let blown = huge.split(' ').take(axes).collect::<Vec<_>>().join(" ");
            let changed = [&whole[..at + key.len()], blown.as_bytes(), &whole[end..]].concat();
            std::fs::write(&copy, changed).expect("written");
            let Outcome { code, text } = check(&copy);
            assert_eq!(code, Some(1), "{}\n{text}", path.display());
        }
    }
}
