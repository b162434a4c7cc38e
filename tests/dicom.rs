//! DICOM files that are cut, changed or hostile, and those of scanners that are no volumes. The content of
//! sound files is compared in tests/volumes.rs.

use std::io::Write;
use std::path::{Path, PathBuf};

use flate2::Compression;
use flate2::write::DeflateEncoder;
use insonify::volume::{Volume, Voxels};

use crate::common::limited::{Outcome, check, files};
use crate::common::shared_data::shared_data;

fn shipped() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/volumes");
    files(&folder, |p| p.extension().is_some_and(|e| e == "dcm"))
}

fn explicit() -> Vec<u8> {
    let path = shipped().into_iter().find(|p| p.ends_with("explicit_u8.dcm"));
    std::fs::read(path.expect("it ships")).expect("readable")
}

/// Places of the values of an element with written types, little endian.
fn places(file: &[u8], group: u16, element: u16, kind: &str) -> Vec<usize> {
    let head = [&group.to_le_bytes()[..], &element.to_le_bytes(), kind.as_bytes()].concat();
    let short = !["OB", "OW", "SQ"].contains(&kind);
    let starts = file.windows(6).enumerate().filter(|(_, w)| *w == head);
    starts.map(|(at, _)| at + if short { 8 } else { 12 }).collect()
}

struct Folder(tempfile::TempDir);

impl Folder {
    fn load(&self, bytes: &[u8]) -> Result<Volume, String> {
        let path = self.0.path().join("a.dcm");
        std::fs::write(&path, bytes).expect("written");
        let error = |e: insonify::issue::FileError| {
            assert!(!e.remedy.is_empty(), "{e}");
            e.to_string()
        };
        Volume::load(&path).map(|(volume, _)| volume).map_err(error)
    }

    fn refused(&self, bytes: &[u8], cause: &str) {
        let error = self.load(bytes).expect_err(cause);
        assert!(error.contains(cause), "{error}, not {cause}");
    }

    /// Asserts that the program itself refuses the file within its bounds of memory and time.
    fn refused_within_bounds(&self, bytes: &[u8], cause: &str) {
        let path = self.0.path().join("b.dcm");
        std::fs::write(&path, bytes).expect("written");
        let Outcome { code, text } = check(&path);
        let text = text.replace("│ ", "").split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(code == Some(1) && text.contains(cause), "{code:?} {text}, not {cause}");
    }
}

fn folder() -> Folder {
    Folder(tempfile::tempdir().expect("a folder"))
}

#[test]
fn planted_mistakes_are_refused_with_their_cause() {
    let (folder, good) = (folder(), explicit());
    folder.load(&good).expect("sound");
    let double = |v: f64| v.to_le_bytes().to_vec();
    let uid = b"1.2.840.10008.1.2.7\0".to_vec();
    for (group, element, kind, which, value, cause) in [
        (0x0002, 0x0010, "UI", 0, uid, "is written in a transfer syntax that cannot be read"),
        (0x0028, 0x0010, "US", 0, vec![0xff, 0xff], "is cut off: 3 frames of 327675 bytes"),
        (0x0028, 0x0010, "US", 0, vec![0, 0], "5 x 0 pixels are no image"),
        (0x0028, 0x0008, "IS", 0, b"4 ".to_vec(), "but 3 frames are described"),
        (0x0028, 0x0008, "IS", 0, b"-1".to_vec(), "NumberOfFrames"),
        (0x0028, 0x0008, "IS", 0, b"x ".to_vec(), "NumberOfFrames"),
        (0x0028, 0x0004, "CS", 0, b"MONOCHROME1".to_vec(), "grow towards black"),
        (0x0028, 0x0004, "CS", 0, b"PALETTECOLO".to_vec(), "cannot be read"),
        (0x0028, 0x0002, "US", 0, vec![2, 0], "of 2 values per pixel"),
        (0x0028, 0x0100, "US", 0, vec![32, 0], "values of 32 bits"),
        (0x0028, 0x0101, "US", 0, vec![9, 0], "9 bits up to bit 7 of 8"),
        (0x0028, 0x0102, "US", 0, vec![6, 0], "8 bits up to bit 6 of 8"),
        (0x0028, 0x0030, "DS", 0, b"nan".to_vec(), "a spacing has to be above zero"),
        (0x0028, 0x0030, "DS", 0, b"0.0".to_vec(), "a spacing has to be above zero"),
        (0x0028, 0x0030, "DS", 0, b"0,5".to_vec(), "PixelSpacing"),
        (0x0020, 0x9301, "FD", 1, double(f64::NAN), "is not finite"),
        (0x0020, 0x9301, "FD", 1, double(9.0), "not evenly spaced"),
        (0x0020, 0x9302, "FD", 0, vec![0; 48], "has no normal"),
        (0x7fe0, 0x0010, "OB", 0, vec![], "is cut off"),
    ] {
        let mut bad = good.clone();
        let found = places(&good, group, element, kind);
        let at = *found.get(which).unwrap_or_else(|| panic!("{group:04x},{element:04x}"));
        if value.is_empty() {
            // Half of the pixels.
            bad[at - 4..at].copy_from_slice(&30u32.to_le_bytes());
            bad.truncate(at + 30);
        } else {
            bad[at..at + value.len()].copy_from_slice(&value);
        }
        folder.refused(&bad, cause);
    }
    // Two planes in one place, the third elsewhere.
    let at = places(&good, 0x0020, 0x9301, "FD");
    let mut bad = good.clone();
    bad.copy_within(at[0]..at[0] + 24, at[1]);
    folder.refused(&bad, "3 planes in 2 places");
    // All planes in one place: three volumes of one plane each.
    bad.copy_within(at[0]..at[0] + 24, at[2]);
    assert_eq!(folder.load(&bad).expect("planes").size, [5, 4, 1]);
    // The sequence of functional groups under another name: frames without places.
    let mut bad = good.clone();
    let at = places(&good, 0x5200, 0x9230, "SQ")[0];
    bad[at - 10] = 0x31;
    folder.refused(&bad, "is no volume: 3 frames of 5 x 4 pixels, without the position");
}

#[test]
fn check_says_type_place_and_range() {
    let path = shipped().into_iter().find(|p| p.ends_with("implicit_i16.dcm"));
    let Outcome { code, text } = check(&path.expect("it ships"));
    assert_eq!(code, Some(0), "{text}");
    for said in [
        "DICOM, 5 x 4 x 3 voxels, 16-bit signed integer",
        "spacing 0.2500 x 0.5000 x 0.7500 mm",
        "first voxel at (3.500, -20.250, 40.125) mm",
        "values ",
        "own frame of reference, taken for LPS",
        "0 errors, 1 warning",
    ] {
        assert!(text.contains(said), "{said}: {text}");
    }
}

#[test]
fn cut_and_changed_files_never_panic() {
    let folder = folder();
    for path in shipped() {
        let name = path.file_name().expect("a name").to_string_lossy().into_owned();
        let whole = std::fs::read(&path).expect("readable");
        // Of a deflated file the last bytes are an end and padding.
        let end = whole.len() - if name.starts_with("deflated") { 8 } else { 0 };
        // Every seventh place, and all of the last ones: an odd step, so that all fields are met.
        for len in (0..end).filter(|len| len % 7 == 0 || len + 20 > end) {
            assert!(folder.load(&whole[..len]).is_err(), "{name} cut at {len}");
        }
        for at in (128..whole.len()).step_by(5) {
            for flip in [0x01, 0x80, 0xff] {
                let mut bad = whole.clone();
                bad[at] ^= flip;
                let _ = folder.load(&bad);
            }
        }
    }
}

#[test]
fn hostile_sizes_and_bombs_stay_within_bounds() {
    let (folder, good) = (folder(), explicit());
    let meta_end = places(&good, 0x0008, 0x0016, "UI")[0] - 8;
    // Elements that declare four gigabytes: of group 2, of text, of pixels.
    for (group, element, kind) in [(0x0002, 0x0001, "OB"), (0x7fe0, 0x0010, "OB")] {
        let mut bad = good.clone();
        let at = places(&good, group, element, kind)[0];
        bad[at - 4..at].copy_from_slice(&0xffff_fff0u32.to_le_bytes());
        let cause = if group == 2 { "TransferSyntaxUID" } else { "declares 4294967280 bytes" };
        folder.refused_within_bounds(&bad, cause);
    }
    // Rows and columns of 65535 in every encoding of pixels.
    for path in shipped() {
        let mut bad = std::fs::read(&path).expect("readable");
        for element in [0x0010, 0x0011] {
            let head = [0x28, 0x00, element, 0x00, b'U', b'S'];
            if let Some(at) = bad.windows(6).position(|w| w == head) {
                bad[at + 8..at + 10].copy_from_slice(&[0xff, 0xff]);
            }
        }
        let unchanged = std::fs::read(&path).expect("readable") == bad;
        if !unchanged {
            folder.refused_within_bounds(&bad, "1 error,");
        }
    }
    // Sequences in sequences, without an end.
    let mut nested = good[..meta_end].to_vec();
    for _ in 0..100_000 {
        nested.extend(*b"\x00\x52\x29\x92SQ\0\0\xff\xff\xff\xff\xfe\xff\x00\xe0\xff\xff\xff\xff");
    }
    folder.refused_within_bounds(&nested, "sequences are nested");
    // A million empty items.
    let mut items = good[..meta_end].to_vec();
    items.extend(*b"\x00\x52\x30\x92SQ\0\0\xff\xff\xff\xff");
    for _ in 0..1_000_000 {
        items.extend(*b"\xfe\xff\x00\xe0\0\0\0\0");
    }
    folder.refused_within_bounds(&items, "Rows");
    // 256 MB of zeros, deflated to one.
    let deflated = shipped().into_iter().find(|p| p.ends_with("deflated_i16.dcm"));
    let deflated = std::fs::read(deflated.expect("it ships")).expect("readable");
    let uid = places(&deflated, 0x0002, 0x0010, "UI")[0];
    let mut bomb = deflated[..uid + 22].to_vec();
    let mut encoder = DeflateEncoder::new(&mut bomb, Compression::fast());
    let zeros = vec![0; 1 << 20];
    for _ in 0..256 {
        encoder.write_all(&zeros).expect("memory");
    }
    encoder.finish().expect("memory");
    folder.refused_within_bounds(&bomb, "unpacks to more than 64 times its size");
}

/// Films and single images of scanners are no volumes, and each refusal gives the reason.
#[test]
fn files_of_scanners_are_refused_with_the_reason() {
    let Some(data) = shared_data() else { return };
    for (name, cause) in [
        ("examples_ybr_color.dcm", "is no volume: 30 frames of 320 x 240 pixels"),
        ("examples_palette.dcm", "`PALETTE COLOR` of 1 values per pixel"),
        ("examples_rgb_color.dcm", "has no position and orientation"),
        ("examples_jpeg2k.dcm", "JPEG 2000"),
        ("ExplVR_BigEnd.dcm", "has no position and orientation"),
    ] {
        let path = data.join("us-dicom-pydicom").join(name);
        let error = Volume::load(&path).expect_err(name).to_string();
        assert!(error.contains(cause), "{error}");
    }
}

/// Values of 12 bits in 16, with rubbish above them, signed and not.
#[test]
fn bits_above_those_stored_are_dropped() {
    let path = shipped().into_iter().find(|p| p.ends_with("rle_i16.dcm"));
    let path = path.expect("it ships");
    let whole = std::fs::read(&path).expect("readable");
    let (full, _) = Volume::load(&path).expect("sound");
    let mut twelve = whole.clone();
    for (element, value) in [(0x0101, 12), (0x0102, 11)] {
        let at = places(&whole, 0x0028, element, "US")[0];
        twelve[at] = value;
    }
    let found = folder().load(&twelve).expect("sound").voxels;
    let Voxels::I16(values) = full.voxels else { panic!("16 bits") };
    let low = |v: &i16| (i32::from(*v) & 0xfff) - if v & 0x800 == 0 { 0 } else { 0x1000 };
    let expected = values.iter().map(|v| low(v) as i16).collect();
    assert_eq!(found, Voxels::I16(expected));
}
