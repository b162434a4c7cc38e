//! Segmentations whose structures overlap, in layers as 3D Slicer writes them, old and new.

use std::path::Path;

use glam::DVec3;

use crate::common::program::insonify;

/// Voxels along each axis.
const SIZE: [usize; 3] = [48, 40, 30];

/// A `.seg.nrrd` of voxels of 4 mm: lines about the segments, and for each layer the value of a voxel.
fn nrrd(about: &str, layers: &[&dyn Fn(DVec3) -> u8]) -> Vec<u8> {
    let [x, y, z] = SIZE;
    let mut bytes = format!(
        "NRRD0004\ntype: unsigned char\ndimension: 4\nspace: left-posterior-superior\nsizes: {} {x} {y} {z}\n\
         space directions: none (4,0,0) (0,4,0) (0,0,4)\nkinds: list domain domain domain\nencoding: raw\n\
         space origin: (-96,-80,0)\n{about}\n",
        layers.len()
    )
    .into_bytes();
    for k in 0..z {
        for j in 0..y {
            for i in 0..x {
                let p = DVec3::new(i as f64, j as f64, k as f64);
                bytes.extend(layers.iter().map(|layer| layer(p)));
            }
        }
    }
    bytes
}

fn ball(p: DVec3, middle: [f64; 3], radius: f64) -> bool {
    (p - DVec3::from(middle)).length() < radius
}

fn body(p: DVec3) -> bool {
    ((p - DVec3::new(24.0, 20.0, 15.0)) / DVec3::new(22.0, 18.0, 14.0)).length() < 1.0
}

fn liver(p: DVec3) -> bool {
    ball(p, [18.0, 18.0, 15.0], 8.0)
}

fn tumour(p: DVec3) -> bool {
    ball(p, [16.0, 17.0, 15.0], 3.0)
}

fn segment(number: usize, name: &str, place: Option<(usize, u8)>) -> String {
    let place = place.map(|(layer, value)| {
        format!("Segment{number}_Layer:={layer}\nSegment{number}_LabelValue:={value}\n")
    });
    format!(
        "Segment{number}_ID:=S{number}\nSegment{number}_Name:={name}\n{}",
        place.unwrap_or_default()
    )
}

fn imported(folder: &Path, bytes: &[u8]) -> String {
    std::fs::write(folder.join("s.seg.nrrd"), bytes).expect("written");
    let (done, said) = insonify(folder, &["import", "s.seg.nrrd", "-o", "out", "--force"]);
    assert!(done, "{said}");
    let (passed, report) = insonify(folder, &["check", "out/scene.toml"]);
    assert!(passed && report.contains("0 errors"), "{report}");
    said
}

/// The volume that is told of a mesh, ml.
pub fn volume(said: &str, name: &str) -> f64 {
    let after =
        format!(" {said}").split_once(&format!(" {name}: ")).map(|(_, after)| after.to_owned());
    let after = after.unwrap_or_else(|| panic!("no {name}: {said}"));
    let (before, _) = after.split_once(" ml").expect("a volume");
    before.rsplit(' ').next().and_then(|word| word.parse().ok()).unwrap_or_else(|| panic!("{said}"))
}

#[test]
fn no_order_of_layers_loses_an_organ() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let millilitres = |inside: &dyn Fn(DVec3) -> bool| {
        let [x, y, z] = SIZE;
        let all = (0..x * y * z).map(|at| [at % x, at / x % y, at / (x * y)]);
        let count = all.filter(|p| inside(DVec3::from(p.map(|n| n as f64)))).count();
        count as f64 * 0.064
    };
    let below: &dyn Fn(DVec3) -> u8 = &|p| u8::from(liver(p));
    let above: &dyn Fn(DVec3) -> u8 = &|p| if tumour(p) { 2 } else { u8::from(body(p)) };
    // As Slicer makes them: what came later, in a layer of its own, above or below.
    for (layers, [organ, others]) in [([below, above], [0, 1]), ([above, below], [1, 0])] {
        let about = [
            segment(0, "Liver", Some((organ, 1))),
            segment(1, "body", Some((others, 1))),
            segment(2, "liver tumour", Some((others, 2))),
            segment(3, "spleen", Some((others, 3))),
        ];
        let said = imported(folder.path(), &nrrd(&about.concat(), &layers));
        for (name, expected) in [
            ("Liver", millilitres(&|p| liver(p) && !tumour(p))),
            ("liver tumour", millilitres(&tumour)),
            ("skin", millilitres(&body)),
        ] {
            let found = volume(&said, name);
            assert!((found / expected - 1.0).abs() < 0.02, "{name}: {found} of {expected}: {said}");
        }
        let share = 100.0 * millilitres(&tumour) / millilitres(&liver);
        let told =
            format!("note: Liver: {share:.1} % of it overlaps others, liver tumour above all");
        assert!(said.contains(&told), "{told}: {said}");
        assert!(said.contains("note: spleen: has no voxel, and is no mesh"), "{said}");
    }
}

#[test]
fn a_structure_that_others_cover_is_told() {
    let folder = tempfile::tempdir().expect("temporary folder");
    // Two organs of one priority: what is small stays whole.
    let layers: [&dyn Fn(DVec3) -> u8; 2] =
        [&|p| u8::from(tumour(p)), &|p| u8::from(ball(p, [16.0, 17.0, 15.0], 3.0) || body(p))];
    let about = [segment(0, "tumour", Some((0, 1))), segment(1, "metastasis", Some((1, 1)))];
    let said = imported(folder.path(), &nrrd(&about.concat(), &layers));
    assert!(volume(&said, "tumour") > 5.0, "{said}");
    let same: [&dyn Fn(DVec3) -> u8; 2] = [&|p| u8::from(liver(p)), &|p| u8::from(liver(p))];
    let about = [segment(0, "tumour", Some((0, 1))), segment(1, "liver", Some((1, 1)))];
    let said = imported(folder.path(), &nrrd(&about.concat(), &same));
    assert!(
        said.contains("note: liver: all of it overlaps others, tumour above all: it is no mesh"),
        "{said}"
    );
}

#[test]
fn segments_of_slicer_before_4_11_keep_their_names() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let organ: &dyn Fn(DVec3) -> u8 = &|p| u8::from(liver(p));
    let inner: &dyn Fn(DVec3) -> u8 = &|p| u8::from(tumour(p));
    let said = imported(folder.path(), &nrrd(&segment(0, "Liver", None), &[organ]));
    assert!(said.contains("Liver: liver,") && !said.contains("no tissue"), "{said}");
    let about = [segment(0, "Liver", None), segment(1, "tumour", None)].concat();
    let said = imported(folder.path(), &nrrd(&about, &[organ, inner]));
    assert!(said.contains("Liver: liver,") && said.contains("tumour: tumour,"), "{said}");
    // Two layers are not called volumes over time and no more.
    let (passed, said) = insonify(folder.path(), &["check", "s.seg.nrrd"]);
    let named = "a segmentation in 2 layers, 2 segments: Liver, tumour; `insonify import`";
    assert!(passed && said.contains(named), "{said}");
}
