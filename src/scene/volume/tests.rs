//! Tests of the readers; the files are written here by other code than the readers'.

use std::io::Write;
use std::path::PathBuf;

use flate2::Compression;
use flate2::write::{GzEncoder, ZlibEncoder};
use glam::{DAffine3, DMat3, DVec3};
use tempfile::TempDir;

use super::*;
use crate::issue::Place;

mod planted;
mod sequences;
mod series;

const SIZE: [usize; 3] = [4, 3, 2];
/// An oblique orthonormal frame: a rotation by 0.3 about z after one by 0.5 about x.
fn direction() -> DMat3 {
    DMat3::from_rotation_z(0.3) * DMat3::from_rotation_x(0.5)
}
const SPACING: DVec3 = DVec3::new(0.5, 1.25, 2.0);
const ORIGIN: DVec3 = DVec3::new(-12.5, 30.0, 7.75);

fn placement() -> DAffine3 {
    DAffine3::from_mat3_translation(direction() * DMat3::from_diagonal(SPACING), ORIGIN)
}

fn values() -> Vec<i16> {
    (0..24).map(|i| i * 1000 - 12_000).collect()
}

fn bytes(big: bool) -> Vec<u8> {
    let bytes = |v: i16| {
        if big { v.to_be_bytes() } else { v.to_le_bytes() }
    };
    values().into_iter().flat_map(bytes).collect()
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(bytes).expect("memory");
    encoder.finish().expect("memory")
}

fn zlib(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(bytes).expect("memory");
    encoder.finish().expect("memory")
}

fn meta(more: &str, data: &[u8]) -> Vec<u8> {
    let d = direction().to_cols_array().map(|v| v.to_string()).join(" ");
    let mut out = format!(
        "ObjectType = Image\nNDims = 3\nDimSize = 4 3 2\nElementSpacing = 0.5 1.25 2\n\
         Offset = -12.5 30 7.75\nTransformMatrix = {d}\nElementType = MET_SHORT\n{more}\n"
    )
    .into_bytes();
    out.extend(data);
    out
}

/// A NRRD file in `space`, with the signs that turn its coordinates into LPS.
fn nrrd(space: &str, signs: DVec3, more: &str, data: &[u8]) -> Vec<u8> {
    let vector = |v: DVec3| format!("({},{},{})", v.x * signs.x, v.y * signs.y, v.z * signs.z);
    let m = placement().matrix3;
    let mut out = format!(
        "NRRD0004\n# comment\ntype: short\ndimension: 3\nspace: {space}\nsizes: 4 3 2\n\
         space directions: {} {} {}\nspace origin: {}\n{more}\n\n",
        vector(m.x_axis),
        vector(m.y_axis),
        vector(m.z_axis),
        vector(ORIGIN)
    )
    .into_bytes();
    out.extend(data);
    out
}

/// NIfTI-1 with qform or sform.
fn nifti(big: bool, sform: bool) -> Vec<u8> {
    let mut out = vec![0; 352];
    let mut put = |at: usize, mut bytes: Vec<u8>| {
        if big {
            bytes.reverse();
        }
        out[at..at + bytes.len()].copy_from_slice(&bytes);
    };
    put(0, 348i32.to_le_bytes().to_vec());
    for (i, d) in [3i16, 4, 3, 2].iter().enumerate() {
        put(40 + 2 * i, d.to_le_bytes().to_vec());
    }
    put(70, 4i16.to_le_bytes().to_vec());
    put(72, 16i16.to_le_bytes().to_vec());
    put(if sform { 254 } else { 252 }, 1i16.to_le_bytes().to_vec());
    let mut float = |at: usize, v: f64| put(at, (v as f32).to_le_bytes().to_vec());
    float(76, 1.0);
    for i in 0..3 {
        float(80 + 4 * i, SPACING[i]);
    }
    float(108, 352.0);
    let ras = DMat3::from_diagonal(DVec3::new(-1.0, -1.0, 1.0));
    let (m, t) = (ras * placement().matrix3, ras * ORIGIN);
    if sform {
        for row in 0..3 {
            for column in 0..3 {
                float(280 + 16 * row + 4 * column, m.col(column)[row]);
            }
            float(292 + 16 * row, t[row]);
        }
    } else {
        // Half turns of RAS against LPS about z, then the two rotations, as quaternions by hand:
        // (0,0,1) (cos .15, 0,0,sin .15) (cos .25, sin .25,0,0), its real part made positive.
        let ((s, c), (sx, cx)) = (0.15f64.sin_cos(), 0.25f64.sin_cos());
        let q = [-s * cx, -s * sx, c * sx, c * cx];
        for i in 0..3 {
            float(256 + 4 * i, -q[i + 1]);
            float(268 + 4 * i, t[i]);
        }
        assert!(q[0] < 0.0);
    }
    out[344..348].copy_from_slice(b"n+1\0");
    out.extend(bytes(big));
    out
}

struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().expect("a folder"))
    }

    fn write(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.0.path().join(name);
        std::fs::write(&path, bytes).expect("written");
        path
    }

    fn load(&self, name: &str, bytes: &[u8]) -> Result<(Volume, Vec<Warning>), FileError> {
        Volume::load(&self.write(name, bytes))
    }

    /// Loads what must be the one volume of these tests, placed within `tolerance` mm.
    fn same(&self, name: &str, bytes: &[u8], tolerance: f64) {
        let (volume, warnings) = self.load(name, bytes).expect(name);
        assert!(warnings.is_empty(), "{name}: {warnings:?}");
        assert_eq!(volume.size, SIZE, "{name}");
        assert_eq!(volume.voxels, Voxels::I16(values()), "{name}");
        assert_eq!(volume.value([3, 1, 1]), f64::from(values()[19]), "{name}");
        let index = DVec3::new(3.0, 1.0, 1.0);
        for at in [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z, index] {
            let found = volume.world_from_voxel.transform_point3(at);
            let expected = placement().transform_point3(at);
            assert!(found.distance(expected) < tolerance, "{name}: {found} {expected}");
        }
    }

    fn refused(&self, name: &str, bytes: &[u8], cause: &str) -> FileError {
        let error = self.load(name, bytes).expect_err(cause);
        let text = error.to_string();
        assert!(text.contains(cause) && text.contains(name), "{text}, not {cause}");
        assert!(!error.remedy.is_empty(), "{text}");
        error
    }
}

const LOCAL: &str = "ElementDataFile = LOCAL";
const BIG: &str = "BinaryDataByteOrderMSB = True\nElementDataFile = LOCAL";
const ZLIB: &str = "CompressedData = True\nElementDataFile = LOCAL";
const RAW: &str = "endian: little\nencoding: raw";
const GZIP: &str = "endian: big\nencoding: gzip";
const RAS: DVec3 = DVec3::new(-1.0, -1.0, 1.0);

#[test]
fn every_format_and_encoding_is_the_same_volume() {
    let folder = Folder::new();
    folder.write("a.raw", &[b"x\n".to_vec(), bytes(false)].concat());
    let text = values().iter().map(i16::to_string).collect::<Vec<_>>().join("\n");
    let meta_text = "BinaryData = False\nElementDataFile = LOCAL";
    let beside = "HeaderSize = -1\nElementDataFile = a.raw";
    let detached = "endian: little\nencoding: raw\nline skip: 1\ndata file: ./a.raw";
    let (lps, las) = ("left-posterior-superior", DVec3::new(1.0, -1.0, 1.0));
    // Decimal text repeats an f64 exactly; only a product is rounded.
    let exact = 1e-12;
    folder.same("a.mha", &meta(LOCAL, &bytes(false)), exact);
    folder.same("b.mha", &meta(BIG, &bytes(true)), exact);
    folder.same("z.mha", &meta(ZLIB, &zlib(&bytes(false))), exact);
    folder.same("t.mha", &meta(meta_text, text.as_bytes()), exact);
    folder.same("d.mhd", &meta(beside, b""), exact);
    folder.same("a.nrrd", &nrrd(lps, DVec3::ONE, RAW, &bytes(false)), exact);
    folder.same("g.nrrd", &nrrd("RAS", RAS, GZIP, &gzip(&bytes(true))), exact);
    let ascii = nrrd("LAS", las, "encoding: ascii", text.as_bytes());
    folder.same("t.nrrd", &ascii, exact);
    folder.same("d.nhdr", &nrrd("LPS", DVec3::ONE, detached, b""), exact);
    // Placement in NIfTI-1 is single precision: 30 mm to 2e-6, a quaternion to 1e-7 of 8 mm.
    for (name, big, sform) in
        [("a.nii", false, true), ("b.nii", true, true), ("q.nii", false, false)]
    {
        folder.same(name, &nifti(big, sform), 1e-5);
    }
    folder.same("a.nii.gz", &gzip(&nifti(true, false)), 1e-5);
}

/// The comparison above would notice a frame that is not turned.
#[test]
fn a_wrong_frame_is_noticed() {
    let folder = Folder::new();
    let file = nrrd("LPS", RAS, RAW, &bytes(false));
    let (volume, _) = folder.load("a.nrrd", &file).expect("sound in itself");
    let away = volume.world_from_voxel.translation.distance(ORIGIN);
    assert!(away > 60.0, "{away}");
}

#[test]
fn bounds_spacing_and_values_are_those_of_whole_voxels() {
    let folder = Folder::new();
    let file = b"NRRD0004\ntype: double\ndimension: 4\nsizes: 2 2 1 3\nspacings: 1 2 3 nan\n\
        space origin: (1,1,1)\nencoding: text\n\n1 2 3 nan 5 6 7 8 9 10 11 12";
    let (volume, warnings) = folder.load("a.nrrd", file).expect("a volume");
    assert_eq!(volume.size, [2, 2, 1]);
    assert_eq!(volume.bounds(), (DVec3::new(0.5, 0.0, -0.5), DVec3::new(2.5, 4.0, 2.5)));
    assert_eq!(volume.spacing(), DVec3::new(1.0, 2.0, 3.0));
    let Statistics { min, max, mean, not_finite } = volume.statistics;
    // The values are those of all three volumes.
    assert_eq!((min, max, not_finite), (1.0, 12.0, 1));
    assert!((mean - 74.0 / 11.0).abs() < 1e-12, "{mean}");
    assert_eq!((volume.volumes().count(), volume.interval), (3, None));
    let text: Vec<_> = warnings.iter().map(ToString::to_string).collect();
    for cause in ["no anatomical frame", "1 voxels are not finite"] {
        assert!(text.iter().any(|t| t.contains(cause)), "{cause}: {text:?}");
    }
}

#[test]
fn directions_that_scale_are_warned_of() {
    let folder = Folder::new();
    let file = meta(LOCAL, &bytes(false));
    let text = String::from_utf8_lossy(&file[..]).into_owned();
    let row = text.lines().find(|line| line.starts_with("TransformMatrix")).expect("a direction");
    let (key, numbers) = row.split_once('=').expect("a key");
    let doubled: Vec<String> = numbers
        .split_whitespace()
        .map(|n| (2.0 * n.parse::<f64>().expect("a number")).to_string())
        .collect();
    let at = text.find(row).expect("there");
    let scaled = format!("{key}= {}", doubled.join(" "));
    let file = [&file[..at], scaled.as_bytes(), &file[at + row.len()..]].concat();
    let (_, warnings) = folder.load("scaled.mha", &file).expect("a volume");
    let text: Vec<_> = warnings.iter().map(ToString::to_string).collect();
    assert!(text.len() == 1 && text[0].contains("not of length 1"), "{text:?}");
}

#[test]
fn extra_keys_channels_and_trailing_bytes_are_warned_of() {
    let folder = Folder::new();
    let more =
        format!("Seq_Frame0000_Status = OK\nStrange = 1\nElementNumberOfChannels = 2\n{LOCAL}");
    let pairs: Vec<u8> = values().iter().flat_map(|v| [*v, 7]).flat_map(i16::to_le_bytes).collect();
    let (volume, warnings) =
        folder.load("a.mha", &meta(&more, &[pairs, vec![0]].concat())).expect("readable");
    assert_eq!(volume.voxels, Voxels::I16(values()));
    let text: Vec<_> = warnings.iter().map(ToString::to_string).collect();
    for cause in ["1 keys are not used", "tracked sequence", "2 values per voxel", "data go on"] {
        assert!(text.iter().any(|t| t.contains(cause)), "{cause}: {text:?}");
    }
}

#[test]
fn slope_and_intercept_of_nifti_are_applied() {
    let mut file = nifti(false, true);
    file[112..116].copy_from_slice(&0.5f32.to_le_bytes());
    file[116..120].copy_from_slice(&10.0f32.to_le_bytes());
    let (volume, _) = Folder::new().load("a.nii", &file).expect("readable");
    assert_eq!(volume.value([1, 0, 0]), 0.5 * -11_000.0 + 10.0);
}
