//! Label maps of every type of number that writers take, values that are not quite whole, and headers that say two
//! places.

use std::path::Path;

use crate::common::program::insonify;

/// Voxels along each axis, of 4 mm.
const SIZE: [usize; 3] = [30, 26, 20];

/// Label 5 in a ball, 2 in a smaller one within it.
fn labels() -> Vec<i64> {
    let [x, y, z] = SIZE;
    let one = |at: usize| {
        let p = [at % x, at / x % y, at / (x * y)].map(|n| n as f64);
        let from = |middle: [f64; 3]| {
            p.iter().zip(middle).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
        };
        match (from([13.0, 13.0, 10.0]) < 3.0, from([15.0, 13.0, 10.0]) < 9.0) {
            (true, _) => 2,
            (_, true) => 5,
            _ => 0,
        }
    };
    (0..x * y * z).map(one).collect()
}

fn nrrd(kind: &str, values: &[u8]) -> Vec<u8> {
    let [x, y, z] = SIZE;
    let head = format!(
        "NRRD0004\ntype: {kind}\ndimension: 3\nspace: left-posterior-superior\nsizes: {x} {y} {z}\n\
         space directions: (4,0,0) (0,4,0) (0,0,4)\nendian: little\nencoding: raw\nspace origin: (0,0,0)\n\n"
    );
    [head.as_bytes(), values].concat()
}

fn meta(kind: &str, values: &[u8]) -> Vec<u8> {
    let [x, y, z] = SIZE;
    let head = format!(
        "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\n\
         TransformMatrix = 1 0 0 0 1 0 0 0 1\nOffset = 0 0 0\nElementSpacing = 4 4 4\nDimSize = {x} {y} {z}\n\
         ElementType = {kind}\nElementDataFile = LOCAL\n"
    );
    [head.as_bytes(), values].concat()
}

fn nifti(datatype: i16, bits: i16, values: &[u8]) -> Vec<u8> {
    let mut bytes = vec![0u8; 352];
    let mut put = |at: usize, value: &[u8]| bytes[at..at + value.len()].copy_from_slice(value);
    put(0, &348i32.to_le_bytes());
    for (n, dim) in [3, SIZE[0], SIZE[1], SIZE[2], 1, 1, 1, 1].into_iter().enumerate() {
        put(40 + 2 * n, &(dim as i16).to_le_bytes());
    }
    put(70, &datatype.to_le_bytes());
    put(72, &bits.to_le_bytes());
    put(108, &352f32.to_le_bytes());
    put(254, &1i16.to_le_bytes());
    put(123, &[2]);
    for axis in 0..3 {
        put(76 + 4 * (axis + 1), &4f32.to_le_bytes());
        put(280 + 16 * axis + 4 * axis, &4f32.to_le_bytes());
    }
    put(344, b"n+1\0");
    [&bytes[..], values].concat()
}

/// What `import` says of a file with these bytes.
fn imported(folder: &Path, name: &str, bytes: &[u8]) -> (bool, String) {
    std::fs::write(folder.join(name), bytes).expect("written");
    std::fs::write(folder.join("t.csv"), "value,name\n5,liver\n2,tumour\n").expect("written");
    insonify(folder, &["import", name, "-o", "out", "--force", "--labels", "t.csv"])
}

#[test]
fn every_type_of_number_gives_the_same_scene() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let all = labels();
    let of =
        |write: &dyn Fn(i64) -> Vec<u8>| all.iter().flat_map(|v| write(*v)).collect::<Vec<u8>>();
    let long = of(&|v| v.to_le_bytes().to_vec());
    let byte = of(&|v| vec![v as u8]);
    let float = of(&|v| (v as f32).to_le_bytes().to_vec());
    let (done, expected) = imported(folder.path(), "a.nrrd", &nrrd("uint8", &byte));
    assert!(
        done && expected.contains("liver: liver,") && expected.contains("tumour"),
        "{expected}"
    );
    for (name, bytes) in [
        ("a.nrrd", nrrd("long long int", &long)),
        ("b.nrrd", nrrd("uint64", &long)),
        ("c.nrrd", nrrd("int64_t", &long)),
        ("d.nrrd", nrrd("float", &float)),
        ("a.mha", meta("MET_LONG_LONG", &long)),
        ("b.mha", meta("MET_ULONG_LONG", &long)),
    ] {
        assert_eq!(imported(folder.path(), name, &bytes), (true, expected.clone()), "{name}");
    }
    // NIfTI counts x and y the other way.
    let (done, expected) = imported(folder.path(), "a.nii", &nifti(2, 8, &byte));
    assert!(done && expected.contains("liver: liver,"), "{expected}");
    for (name, datatype) in [("b.nii", 1024), ("c.nii", 1280)] {
        let found = imported(folder.path(), name, &nifti(datatype, 64, &long));
        assert_eq!(found, (true, expected.clone()), "{name}");
    }
    // A value that single precision does not have is no other label.
    for large in [(1 << 24) + 1, (1i64 << 60) + 1, -3] {
        let mut wrong = long.clone();
        wrong[8 * 4000..8 * 4001].copy_from_slice(&large.to_le_bytes());
        let (done, said) = imported(folder.path(), "w.nrrd", &nrrd("int64", &wrong));
        assert!(!done && said.contains("an image and no label map"), "{large}: {said}");
    }
}

#[test]
fn values_that_scaling_left_beside_whole_numbers_are_these_and_told() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let all = labels();
    let scaled = |by: f32| {
        let bytes: Vec<u8> = all.iter().flat_map(|v| (*v as f32 * by).to_le_bytes()).collect();
        imported(folder.path(), "a.nrrd", &nrrd("float", &bytes))
    };
    let (done, expected) = scaled(1.0);
    assert!(done && !expected.contains("off whole numbers"), "{expected}");
    for by in [1.000_000_1, 1.000_02, 0.999_98, 1.0001, 1.009] {
        let (done, said) = scaled(by);
        assert!(done && said.contains("off whole numbers"), "{by}: {said}");
        let (before, after) = said.split_once("note: ").expect("a note");
        let (_, after) = after.split_once("labels ").expect("its end");
        assert_eq!(format!("{before}{after}"), expected, "{by}");
    }
    // Stretched over eight bits, as with a slope of 9 / 255.
    let bytes: Vec<u8> = (all.iter())
        .map(|v| (*v as f32 * 255.0 / 9.0).round() * 9.0 / 255.0)
        .flat_map(f32::to_le_bytes)
        .collect();
    let (done, said) = imported(folder.path(), "a.nrrd", &nrrd("float", &bytes));
    assert!(done && said.contains("off whole numbers") && said.contains("liver: liver,"), "{said}");
    // An image stays one.
    for by in [1.013, 0.5, 1.3] {
        let (done, said) = scaled(by);
        assert!(!done && said.contains("an image and no label map"), "{by}: {said}");
    }
}

#[test]
fn two_places_in_one_header_are_told() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let bytes: Vec<u8> = labels().iter().map(|v| *v as u8).collect();
    let plain = nifti(2, 8, &bytes);
    let with = |puts: &[(usize, &[u8])]| {
        let mut file = plain.clone();
        for (at, value) in puts {
            file[*at..at + value.len()].copy_from_slice(value);
        }
        imported(folder.path(), "a.nii", &file)
    };
    let code = &1i16.to_le_bytes()[..];
    let float = |v: f32| v.to_le_bytes();
    let (done, expected) = with(&[]);
    assert!(done && !expected.contains("note: "), "{expected}");
    // The same place twice, and one that rounding moved.
    assert_eq!(with(&[(252, code)]).1, expected);
    assert_eq!(with(&[(252, code), (268, &float(1.5))]).1, expected);
    let note = "note: sform and qform put the volume at places that differ by up to";
    // Moved by 25 mm; turned by ten degrees; mirrored.
    let turned = float((10f32.to_radians() / 2.0).sin());
    for (puts, off) in [
        (vec![(252, code), (268, &float(25.0)[..])], "25.0 mm"),
        (vec![(252, code), (264, &turned[..])], " mm"),
        (vec![(252, code), (76, &float(-1.0)[..])], "152.0 mm"),
    ] {
        let (done, said) = with(&puts);
        assert!(done && said.contains(note) && said.contains(off), "{said}");
    }
    let (done, said) = with(&[(80, &float(1.0))]);
    assert!(
        done && said.contains("note: pixdim says voxels of 1.000 x 4.000 x 4.000, sform of 4.000"),
        "{said}"
    );
    // An empty sform beside a good qform.
    let (done, said) = with(&[(252, code), (280, &[0; 48])]);
    assert!(done && said.contains("note: sform has no volume: qform is taken"), "{said}");
    let (done, said) = with(&[(280, &[0; 48])]);
    assert!(!done, "{said}");
}

/// Masks of one structure, as they are and divided by their largest value: what is to be done is said.
#[test]
fn masks_are_told_what_they_are_and_shares_how_they_become_one() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let folder = folder.path();
    let all = labels();
    let import = |bytes: Vec<u8>| {
        std::fs::write(folder.join("m.nrrd"), bytes).expect("written");
        insonify(folder, &["import", "m.nrrd", "-o", "mask", "--force"])
    };
    for inside in [1u8, 255] {
        let mask: Vec<u8> = all.iter().map(|v| if *v > 0 { inside } else { 0 }).collect();
        let (done, said) = import(nrrd("uint8", &mask));
        assert!(done, "{said}");
        for part in
            [&format!("{inside} is the only value besides 0"), "--labels", "folder of masks"]
        {
            assert!(said.contains(part), "{part}: {said}");
        }
    }
    for inside in [1.0 / 255.0, 0.5] {
        let share = |v: &i64| if *v > 0 { inside } else { 0f32 };
        let shares: Vec<u8> = all.iter().flat_map(|v| share(v).to_le_bytes()).collect();
        let (done, said) = import(nrrd("float", &shares));
        let remedy = said.contains("shares of voxels") && said.contains("give whole numbers");
        assert!(!done && remedy, "{inside}: {said}");
    }
}
