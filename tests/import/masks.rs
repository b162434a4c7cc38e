//! Folders of masks, one file for each structure, as TotalSegmentator and others write them.

use std::path::Path;

use glam::DVec3;

use super::segments::volume;
use crate::common::program::insonify;

/// Voxels along each axis, of 4 mm.
const SIZE: [usize; 3] = [48, 40, 30];

/// A mask whose voxels inside have this value.
fn nrrd(size: [usize; 3], kind: &str, inside: &dyn Fn(DVec3) -> Vec<u8>) -> Vec<u8> {
    let [x, y, z] = size;
    let mut bytes = format!(
        "NRRD0004\ntype: {kind}\ndimension: 3\nspace: left-posterior-superior\nsizes: {x} {y} {z}\n\
         space directions: (4,0,0) (0,4,0) (0,0,4)\nendian: little\nencoding: raw\nspace origin: (-96,-80,0)\n\n"
    )
    .into_bytes();
    for at in 0..x * y * z {
        bytes.extend(inside(DVec3::from([at % x, at / x % y, at / (x * y)].map(|n| n as f64))));
    }
    bytes
}

fn ball(middle: [f64; 3], radius: f64) -> impl Fn(DVec3) -> bool {
    move |p| (p - DVec3::from(middle)).length() < radius
}

fn byte(inside: impl Fn(DVec3) -> bool, value: u8) -> Vec<u8> {
    nrrd(SIZE, "uchar", &|p| vec![value * u8::from(inside(p))])
}

fn millilitres(inside: impl Fn(DVec3) -> bool) -> f64 {
    let [x, y, z] = SIZE;
    let all = (0..x * y * z).map(|at| [at % x, at / x % y, at / (x * y)].map(|n| n as f64));
    all.filter(|p| inside(DVec3::from(*p))).count() as f64 * 0.064
}

fn imported(folder: &Path) -> (bool, String) {
    insonify(folder, &["import", "masks", "-o", "out", "--force"])
}

#[test]
fn a_folder_of_masks_becomes_a_scene() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let folder = folder.path();
    std::fs::create_dir(folder.join("masks")).expect("made");
    let write = |name: &str, bytes: &[u8]| {
        std::fs::write(folder.join("masks").join(name), bytes).expect("written");
    };
    let (liver, gallbladder) = (ball([18.0, 18.0, 15.0], 9.0), ball([12.0, 12.0, 15.0], 3.5));
    // Within the liver, and known to no table.
    let finding = ball([20.0, 20.0, 15.0], 3.0);
    write("liver.nrrd", &byte(&liver, 1));
    // Other values, names that say their format twice, numbers with decimals that scaling has left.
    write("gallbladder.seg.nrrd", &byte(&gallbladder, 255));
    let off = |p| (1.000_01 * f32::from(u8::from(finding(p)))).to_le_bytes().to_vec();
    write("finding.nrrd", &nrrd(SIZE, "float", &off));
    write("spleen.nrrd", &byte(|_| false, 1));
    write(".hidden.nrrd", b"nothing of this");
    write("readme.txt", b"not a mask");
    let (done, said) = imported(folder);
    assert!(done, "{said}");
    for (name, expected) in [
        ("liver", millilitres(|p| liver(p) && !finding(p) && !gallbladder(p))),
        ("gallbladder", millilitres(&gallbladder)),
        ("finding", millilitres(&finding)),
    ] {
        let found = volume(&said, name);
        assert!((found / expected - 1.0).abs() < 0.02, "{name}: {found} of {expected}: {said}");
    }
    let lost = millilitres(|p| liver(p) && (finding(p) || gallbladder(p))) / millilitres(&liver);
    let told = format!("note: liver: {:.1} % of it overlaps others", 100.0 * lost);
    assert!(said.contains(&told), "{told}: {said}");
    assert!(said.contains("note: spleen: has no voxel, and is no mesh"), "{said}");
    assert!(said.contains("liver: liver,") && said.contains("gallbladder: bile,"), "{said}");
    let text = std::fs::read_to_string(folder.join("out/scene.toml")).expect("there");
    assert!(text.contains("# gallbladder.seg.nrrd"), "{text}");
    let (passed, said) = insonify(folder, &["check", "out/scene.toml"]);
    assert!(passed && said.contains("0 errors"), "{said}");

    // What is no mask of this folder stops it, with a remedy that helps when it is followed.
    let other_grid = nrrd([48, 40, 29], "uchar", &|_| vec![1]);
    let image = nrrd(SIZE, "float", &|p| ((p.x * 0.37) as f32).to_le_bytes().to_vec());
    let map = nrrd(SIZE, "uchar", &|p| vec![u8::from(liver(p)) + u8::from(finding(p))]);
    for (name, bytes, message, remedy) in [
        (
            "x.nrrd",
            other_grid,
            "has 48 x 40 x 29 voxels, not 48 x 40 x 30",
            "take it out of the folder",
        ),
        ("ct.nrrd", image, "an image and no label map", "take this one out of the folder"),
        ("z.nrrd", map, "has 2 values (1, 2 ...), and is no mask", "import it by itself"),
    ] {
        write(name, &bytes);
        let (done, said) = imported(folder);
        let said = said.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(!done && said.contains(name), "{said}");
        assert!(said.contains(message) && said.contains(remedy), "{said}");
        std::fs::remove_file(folder.join("masks").join(name)).expect("it was there");
    }
    assert!(imported(folder).0);
}

#[test]
fn nothing_in_a_folder_is_passed_over_in_silence() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let folder = folder.path();
    let masks = folder.join("masks");
    std::fs::create_dir(&masks).expect("made");
    std::fs::write(masks.join("slice.dcm"), b"").expect("written");
    let (done, said) = imported(folder);
    assert!(!done && said.contains("no mask that can be read, but 1 DICOM files"), "{said}");
    std::fs::write(masks.join("spleen.nrrd"), byte(|_| false, 1)).expect("written");
    let (done, said) = imported(folder);
    assert!(!done && said.contains("every voxel is 0"), "{said}");
    let mesh = insonify::scene::shapes::sphere(30.0, 3);
    std::fs::write(masks.join("liver.obj"), super::obj(&mesh, DVec3::ZERO)).expect("written");
    let (done, said) = imported(folder);
    assert!(done && said.contains("spleen.nrrd: is a volume beside meshes"), "{said}");
}

/// The names that TotalSegmentator's task `total` gives its files.
fn total_segmentator() -> Vec<&'static str> {
    let table = include_str!("../../src/lab/import/totalsegmentator.csv");
    let rows = table.lines().filter(|l| !l.starts_with('#')).skip(1);
    rows.map(|row| row.split(',').nth(1).expect("a name")).collect()
}

/// A folder as TotalSegmentator leaves it: 117 files, most of them small organs side by side, some that overlap, some empty.
#[test]
fn a_folder_of_all_names_of_total_segmentator_becomes_a_scene() {
    const GRID: [usize; 3] = [72, 60, 48];
    let folder = tempfile::tempdir().expect("temporary folder");
    let folder = folder.path();
    std::fs::create_dir(folder.join("masks")).expect("made");
    let names = total_segmentator();
    assert_eq!(names.len(), 117);
    let is_empty = |i: usize| i % 9 == 4;
    let place = |i: usize| {
        let cell = [i % 6, i / 6 % 5, i / 30].map(|n| 12.0 * n as f64 + 5.5);
        // The second of a pair reaches into the first.
        if i % 10 == 1 { [cell[0] - 5.0, cell[1], cell[2]] } else { cell }
    };
    let of = |i: usize| ball(place(i), 4.6);
    for (i, name) in names.iter().enumerate() {
        let inside = of(i);
        let mask = |p: DVec3| vec![u8::from(!is_empty(i) && inside(p))];
        std::fs::write(
            folder.join("masks").join(format!("{name}.nrrd")),
            nrrd(GRID, "uchar", &mask),
        )
        .expect("written");
    }
    let (done, said) = imported(folder);
    assert!(done, "{said}");
    assert!(!said.contains("had no tissue"), "{said}");
    let [x, y, z] = GRID;
    let all = || {
        (0..x * y * z).map(|at| DVec3::from([at % x, at / x % y, at / (x * y)].map(|n| n as f64)))
    };
    let mut overlaps = 0;
    for (i, name) in names.iter().enumerate() {
        let empty = format!("note: {name}: has no voxel");
        assert_eq!(said.contains(&empty), is_empty(i), "{name}: {said}");
        if is_empty(i) {
            continue;
        }
        // One of a pair has the voxels that both want, the other is told what it loses.
        let near = [i.wrapping_sub(1), i + 1].into_iter().filter(|&j| j < names.len());
        let near: Vec<_> = near.filter(|&j| !is_empty(j)).map(of).collect();
        let own = of(i);
        let count = |inside: &dyn Fn(DVec3) -> bool| all().filter(|p| inside(*p)).count() as f64;
        let whole = count(&own);
        let lost = count(&|p| own(p) && near.iter().any(|other| other(p)));
        let found = volume(&said, name) / 0.064;
        let told = said.contains(&format!("note: {name}: {:.1} % of it", 100.0 * lost / whole));
        let expected = if told { whole - lost } else { whole };
        overlaps += usize::from(told && lost > 0.0);
        assert!((found / expected - 1.0).abs() < 0.02, "{name}: {found} of {expected}: {said}");
    }
    assert!(overlaps >= 8, "{overlaps}");
    let (passed, said) = insonify(folder, &["check", "out/scene.toml"]);
    assert!(passed && said.contains("0 errors"), "{said}");
}
