//! Mistakes planted in files, each of which must be found.

use super::*;

#[test]
fn planted_mistakes_in_text_headers_name_line_and_cause() {
    let folder = Folder::new();
    let good = String::from_utf8(meta(LOCAL, b"")).expect("text");
    for (from, to, line, cause) in [
        ("0.5 1.25 2", "0.5 0 2", 4, "above zero"),
        ("0.5 1.25 2", "0.5 -1 2", 4, "above zero"),
        ("0.5 1.25 2", "0.5 NaN 2", 4, "above zero"),
        ("0.5 1.25 2", "0.5 1.25", 4, "2 values where 3"),
        ("4 3 2", "4 3 0", 3, "holds no voxels"),
        ("4 3 2", "4 3 -2", 3, "no number that fits"),
        ("NDims = 3", "NDims = 99", 2, "2 to 10 axes"),
        ("MET_SHORT", "MET_OTHER", 7, "this type cannot be read"),
        ("ObjectType = Image", "ObjectType = Mesh", 1, "no image"),
        ("NDims = 3", "NDims", 2, "`Key = value`"),
        ("ElementData", "BinaryDataByteOrderMSB = Talse\nElementData", 8, "neither True nor False"),
        ("ElementData", "CompressedData = on\nElementData", 8, "neither True nor False"),
        ("ElementData", "BinaryData =\nElementData", 8, "neither True nor False"),
        ("LOCAL", "LIST", 8, "one file per slice"),
        ("LOCAL", "/etc/passwd", 8, "in the folder of its header"),
        ("LOCAL", "../a.raw", 8, "in the folder of its header"),
        ("LOCAL", "missing.raw", 8, "there is no file"),
    ] {
        assert!(good.contains(from));
        let mut bad = good.replacen(from, to, 1).into_bytes();
        bad.extend(bytes(false));
        let error = folder.refused("a.mha", &bad, cause);
        assert_eq!(error.place, Place::Line(line), "{error}");
    }
    let good = String::from_utf8(nrrd("LPS", DVec3::ONE, RAW, b"")).expect("text");
    for (from, to, line, cause) in [
        ("raw", "zip", 10, "`zip`"),
        ("short", "block", 3, "this type"),
        ("LPS", "up-down", 5, "this space"),
        ("space directions: (", "space directions: ((", 7, "no list of vectors"),
        ("4 3 2", "4 3", 6, "2 values where 3"),
        ("little", "middle", 9, "no byte order"),
        ("NRRD0004", "NRRD0009", 1, "does not begin with NRRD"),
        ("raw\n", "raw\nbyte skip: -2\n", 11, "no number of bytes"),
        ("raw\n", "raw\nspace units: \"ell\"\n", 11, "one unit of length"),
    ] {
        assert!(good.contains(from), "{from}");
        let mut bad = good.replacen(from, to, 1).into_bytes();
        bad.extend(bytes(false));
        let error = folder.refused("a.nrrd", &bad, cause);
        assert_eq!(error.place, Place::Line(line), "{error}");
    }
}

#[test]
fn planted_mistakes_in_nifti_headers_name_the_byte() {
    let folder = Folder::new();
    let put = |at: usize, bytes: &[u8]| {
        let mut file = nifti(false, false);
        file[at..at + bytes.len()].copy_from_slice(bytes);
        file
    };
    for (at, bytes, cause) in [
        (0, &540i32.to_le_bytes()[..], "NIfTI-2"),
        (0, &[1, 2, 3, 4][..], "sizeof_hdr"),
        (344, &b"ni1\0"[..], "magic"),
        (40, &9i16.to_le_bytes()[..], "dim[0] is 9"),
        (44, &(-3i16).to_le_bytes()[..], "dim[2] is -3"),
        (70, &1536i16.to_le_bytes()[..], "datatype 1536"),
        (72, &8i16.to_le_bytes()[..], "bitpix is 8"),
        (80, &0.0f32.to_le_bytes()[..], "pixdim"),
        (80, &f32::NAN.to_le_bytes()[..], "pixdim"),
        (108, &f32::INFINITY.to_le_bytes()[..], "vox_offset"),
        (112, &f32::NAN.to_le_bytes()[..], "scl_slope"),
        (256, &2.0f32.to_le_bytes()[..], "longer than one"),
    ] {
        let error = folder.refused("a.nii", &put(at, bytes), cause);
        assert_eq!(error.place, Place::Byte(at as u64), "{error}");
    }
    folder.refused("a.nii", &put(108, &1e8f32.to_le_bytes()), "cut off");
}

#[test]
fn cut_singular_huge_and_bomb_are_refused() {
    let folder = Folder::new();
    for (name, whole) in [
        ("a.mha", meta(LOCAL, &bytes(false))),
        ("z.mha", meta(ZLIB, &zlib(&bytes(false)))),
        ("a.nrrd", nrrd("LPS", DVec3::ONE, RAW, &bytes(false))),
        ("g.nrrd", nrrd("LPS", DVec3::ONE, GZIP, &gzip(&bytes(true)))),
        ("a.nii", nifti(false, true)),
        ("a.nii.gz", gzip(&nifti(false, true))),
    ] {
        // Cut anywhere, the file is refused; nothing panics.
        for len in 0..whole.len() {
            assert!(folder.load(name, &whole[..len]).is_err(), "{name} at {len}");
        }
        // A header with any byte changed is read or refused; nothing panics.
        for at in 0..whole.len() {
            for flip in [0x01, 0x80, 0xff] {
                let mut bad = whole.clone();
                bad[at] ^= flip;
                let _ = folder.load(name, &bad);
            }
        }
    }
    let text = |old: &str, new: &str, more: &str, data: &[u8]| {
        let file = nrrd("LPS", DVec3::ONE, more, b"");
        let mut file = String::from_utf8(file).expect("text").replacen(old, new, 1).into_bytes();
        file.extend(data);
        file
    };
    let huge = u64::MAX.to_string();
    for (size, cause) in [
        (format!("{huge} {huge} {huge}"), "are more than 4 GB"),
        ("2048 2048 1024".to_owned(), "are more than 4 GB"),
        ("1000 1000 1000".to_owned(), "cut off"),
    ] {
        let size = format!("sizes: {size}");
        folder.refused("a.nrrd", &text("sizes: 4 3 2", &size, RAW, &bytes(false)), cause);
        folder.refused("g.nrrd", &text("sizes: 4 3 2", &size, GZIP, &gzip(&bytes(true))), cause);
    }
    // 64 MB of zeros in 64 kB: with bytes to skip counted from the end it is not unpacked whole.
    let bomb = gzip(&vec![0; 64 << 20]);
    let from_end = format!("{GZIP}\nbyte skip: -1");
    folder.refused("b.nrrd", &text("", "", &from_end, &bomb), "precede the voxels");
    let (volume, warnings) = folder.load("b.nrrd", &text("", "", GZIP, &bomb)).expect("zeros");
    assert_eq!(volume.voxels.len(), 24);
    assert!(warnings[0].message.contains("data go on"));
    // And with bzip2, where 64 MB are 50 bytes: no more than the header declares is unpacked.
    let mut encoder = bzip2::write::BzEncoder::new(Vec::new(), bzip2::Compression::best());
    encoder.write_all(&vec![0; 64 << 20]).expect("memory");
    let bomb = encoder.finish().expect("memory");
    assert!(bomb.len() < 200, "{}", bomb.len());
    let small = GZIP.replace("gzip", "bzip2");
    let (volume, _) = folder.load("b.nrrd", &text("", "", &small, &bomb)).expect("zeros");
    assert_eq!(volume.voxels.len(), 24);
    let hex = GZIP.replace("gzip", "hex");
    folder.refused("h.nrrd", &text("", "", &hex, &[b'0'; 95]), "cut off");
    folder.refused("h.nrrd", &text("", "", &hex, &[b'x'; 96]), "no hexadecimal digit");

    let d = direction().to_cols_array().map(|v| v.to_string()).join(" ");
    let good = String::from_utf8(meta(LOCAL, b"")).expect("text");
    for flat in ["1 0 0 1 0 0 0 0 1", "1 0 0 0 1 0 nan 0 0", "0 0 0 0 1 0 0 0 1"] {
        let mut bad = good.replacen(&d, flat, 1).into_bytes();
        bad.extend(bytes(false));
        folder.load("s.mha", &bad).expect_err(flat);
    }
}

#[test]
fn dicom_and_strangers_are_refused_plainly() {
    let folder = Folder::new();
    folder.refused("a.dcm", b"", "is no DICOM file");
    folder.refused("a.gz", b"", "no volume by its extension");
    let error = Volume::load(&folder.0.path().join("none.mha")).expect_err("missing");
    assert!(error.to_string().contains("cannot be read"), "{error}");
}
