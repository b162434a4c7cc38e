//! Label maps that this file writes: scenes that `check` finds clean and `render` shows; and bad input.

use std::path::Path;

use glam::DVec3;
use insonify::scene::Scene;
use insonify::volume::is_volume;

use crate::common::limited::{check, files, limited};
use crate::common::program::insonify;
use crate::common::shared_data::shared_data;

/// A NIfTI-1 file of labels: RAS, voxels of these sizes in mm, its first voxel at `origin` (RAS, mm).
fn nifti(
    size: [usize; 3],
    spacing: [f32; 3],
    origin: [f32; 3],
    label: impl Fn(DVec3) -> u8,
) -> Vec<u8> {
    let mut bytes = vec![0u8; 352];
    let mut put = |at: usize, value: &[u8]| bytes[at..at + value.len()].copy_from_slice(value);
    put(0, &348i32.to_le_bytes());
    for (n, dim) in [3, size[0], size[1], size[2], 1, 1, 1, 1].into_iter().enumerate() {
        put(40 + 2 * n, &(dim as i16).to_le_bytes());
    }
    put(70, &2i16.to_le_bytes());
    put(72, &8i16.to_le_bytes());
    put(108, &352f32.to_le_bytes());
    put(252, &0i16.to_le_bytes());
    put(254, &1i16.to_le_bytes());
    put(123, &[2]);
    for axis in 0..3 {
        put(76 + 4 * (axis + 1), &spacing[axis].to_le_bytes());
        put(280 + 16 * axis + 4 * axis, &spacing[axis].to_le_bytes());
        put(280 + 16 * axis + 12, &origin[axis].to_le_bytes());
    }
    put(344, b"n+1\0");
    for k in 0..size[2] {
        for j in 0..size[1] {
            bytes.extend((0..size[0]).map(|i| label(DVec3::new(i as f64, j as f64, k as f64))));
        }
    }
    bytes
}

/// A trunk of 216 x 168 x 120 mm, by the values of TotalSegmentator and 200 for the body: liver with a vessel, right
/// kidney, vertebra, two ribs.
fn trunk(p: DVec3) -> u8 {
    let within = |middle: DVec3, radii: DVec3| ((p - middle) / radii).length() < 1.0;
    // RAS: x to the right is -x here; y to the front.
    if within(DVec3::new(30.0, 30.0, 20.0), DVec3::new(3.0, 3.0, 60.0)) {
        64
    } else if within(DVec3::new(27.0, 29.0, 20.0), DVec3::new(14.0, 12.0, 14.0)) {
        5
    } else if within(DVec3::new(24.0, 13.0, 14.0), DVec3::new(5.0, 5.0, 9.0)) {
        2
    } else if within(DVec3::new(36.0, 9.0, 20.0), DVec3::new(5.0, 5.0, 60.0)) {
        31
    } else if (p.z - 12.0).abs() < 1.5
        && (18.0..20.0).contains(&(p.truncate() - DVec3::new(27.0, 29.0, 0.0).truncate()).length())
        && p.x < 27.0
    {
        112
    } else if within(DVec3::new(36.0, 28.0, 20.0), DVec3::new(34.0, 26.0, 300.0)) {
        200
    } else {
        0
    }
}

fn write_trunk(folder: &Path) {
    let bytes = nifti([72, 56, 40], [3.0; 3], [-108.0, -84.0, 0.0], trunk);
    std::fs::write(folder.join("trunk.nii"), bytes).expect("written");
    std::fs::write(folder.join("t.csv"), "value,name\n200,body\n").expect("written");
}

#[test]
fn a_label_map_becomes_a_scene_that_is_clean_and_renders() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let folder = folder.path();
    write_trunk(folder);
    let args =
        ["import", "trunk.nii", "-o", "out", "--labels", "t.csv", "--classes", "totalsegmentator"];
    let (done, said) = insonify(folder, &args);
    assert!(done, "{said}");
    assert!(said.contains("the probe looks at liver"), "{said}");
    assert!(said.contains("no bone and no gas on the way"), "{said}");
    let (passed, said) = insonify(folder, &["check", "out/scene.toml"]);
    assert!(passed && said.contains("0 errors, 0 warnings"), "{said}");
    let (scene, warnings) = Scene::load(&folder.join("out/scene.toml"), &[]).expect("sound");
    assert!(warnings.is_empty(), "{warnings:?}");
    // LPS: the liver, whose middle is at (-27, 3, 60) in RAS, is to the patient's right.
    let liver = scene.instances.iter().find(|i| i.name == "liver").expect("a liver");
    let mesh = &scene.meshes[liver.mesh];
    let count = mesh.positions.len() as f64;
    let middle =
        mesh.positions.iter().map(|p| DVec3::from(p.map(f64::from))).sum::<DVec3>() / count;
    assert!(middle.distance(DVec3::new(27.0, -3.0, 60.0)) < 6.0, "{middle}");
    // The vessel in it wins, the body comes last.
    let priority = |name: &str| {
        scene.instances.iter().find(|i| i.name == name).unwrap_or_else(|| panic!("{name}")).priority
    };
    assert!(priority("portal_vein_and_splenic_vein") > priority("liver"));
    assert_eq!(priority("skin"), 0);
    let quick = [
        "--set",
        "probe.scanlines=32",
        "--set",
        "simulation.paths=1",
        "--set",
        "probe.elevation_layers=1",
    ];
    let args = [&["render", "out/scene.toml", "-o", "a.png"], &quick[..]].concat();
    let (done, said) = insonify(folder, &args);
    assert!(done, "{said}");
    let image = image::open(folder.join("a.png")).expect("a PNG").into_luma8();
    let bright = image.pixels().filter(|p| p.0[0] > 60).count();
    assert!(bright * 10 > (image.width() * image.height()) as usize, "{bright} bright pixels");
    // A second import does not destroy the first unasked.
    let args = ["import", "trunk.nii", "-o", "out"];
    let (done, said) = insonify(folder, &args);
    assert!(!done && said.contains("is there already") && said.contains("--force"), "{said}");
}

#[test]
fn without_an_outline_a_skin_is_made_up_and_unknown_names_are_told() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let folder = folder.path();
    let bytes = nifti([72, 56, 40], [3.0; 3], [0.0; 3], |p| trunk(p) % 200);
    std::fs::write(folder.join("a.nii"), bytes).expect("written");
    let (done, said) = insonify(folder, &["import", "a.nii", "-o", "out", "--look-at", "label 2"]);
    assert!(done, "{said}");
    assert!(said.contains("5 structures had no tissue and were given muscle: label 5"), "{said}");
    assert!(said.contains("looks at label 2"), "{said}");
    let text = std::fs::read_to_string(folder.join("out/scene.toml")).expect("a scene");
    assert!(text.contains("made up: the convex hull"), "{text}");
    let (passed, said) = insonify(folder, &["check", "out/scene.toml"]);
    assert!(passed && said.contains("0 errors, 0 warnings"), "{said}");
    let (done, said) = insonify(folder, &["import", "a.nii", "-o", "b", "--look-at", "heart"]);
    assert!(!done && said.contains("no structure `heart`"), "{said}");
    let (done, said) = insonify(folder, &["import", "a.nii", "-o", "b", "--spacing", "6"]);
    assert!(done, "{said}");
}

#[test]
fn bad_input_is_refused_within_bounds() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let folder = folder.path();
    let sound =
        nifti([12; 3], [3.0; 3], [0.0; 3], |p| u8::from(p.distance(DVec3::splat(6.0)) < 4.0));
    let noise = nifti([40; 3], [1.0; 3], [0.0; 3], |p| (p.x * 40.0 + p.y * 7.0 + p.z) as u8);
    let empty = nifti([12; 3], [3.0; 3], [0.0; 3], |_| 0);
    let floats = {
        let mut bytes = nifti([12; 3], [3.0; 3], [0.0; 3], |_| 0);
        bytes[112..116].copy_from_slice(&0.5f32.to_le_bytes());
        bytes[352] = 1;
        bytes
    };
    // 1600 x 1600 x 1600 voxels of a checkerboard are declared, and 12 x 12 x 12 are there.
    let huge = {
        let mut bytes = sound.clone();
        for n in 1..4 {
            bytes[40 + 2 * n..42 + 2 * n].copy_from_slice(&1600i16.to_le_bytes());
        }
        bytes
    };
    let far = nifti([12; 3], [3.0; 3], [1e9, 0.0, 0.0], |p| {
        u8::from(p.distance(DVec3::splat(6.0)) < 4.0)
    });
    let cases: [(&str, &[u8], &str); 8] = [
        ("far.nii", &far, "the first voxel is 1.000e9 mm away"),
        ("noise.nii", &noise, "more than 254 different values"),
        ("empty.nii", &empty, "every voxel is 0"),
        ("floats.nii", &floats, "voxels of 0.5"),
        ("huge.nii", &huge, "cut off"),
        ("cut.nii", &sound[..900], "cut off"),
        ("text.nii", b"not a volume", ""),
        ("what.docx", b"", "no volume by its extension"),
    ];
    for (name, bytes, cause) in cases {
        let path = folder.join(name);
        std::fs::write(&path, bytes).expect("written");
        let outcome = limited("exec \"$0\" import \"$1\" -o \"$1.out\"", &path);
        let said = outcome.text.replace("│ ", "").split_whitespace().collect::<Vec<_>>().join(" ");
        assert_eq!(outcome.code, Some(1), "{name}: {said}");
        assert!(said.contains(cause), "{name}: {said}");
        assert!(!path.with_extension("nii.out").exists(), "{name} left something behind");
    }
    // Every cut of a small file, and changed bytes: an answer, whatever it is.
    let path = folder.join("changed.nii");
    for n in (0..352).step_by(7) {
        let mut bytes = sound.clone();
        bytes[n] ^= 0xff;
        std::fs::write(&path, bytes).expect("written");
        let outcome = limited("exec \"$0\" import \"$1\" -o \"$1.out\" --force", &path);
        assert!(
            matches!(outcome.code, Some(0 | 1)),
            "byte {n}: {:?} {}",
            outcome.code,
            outcome.text
        );
    }
}

#[test]
fn the_table_that_ships_can_be_read_and_given_back() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let folder = folder.path();
    let out = std::process::Command::new(env!("CARGO_BIN_EXE_insonify"))
        .args(["import", "--print-table"])
        .output()
        .expect("the program starts");
    let text =
        String::from_utf8(out.stdout).expect("text").replace("liver,liver,", "liver,spleen,");
    std::fs::write(folder.join("mine.csv"), text).expect("written");
    let bytes =
        nifti([12; 3], [3.0; 3], [0.0; 3], |p| 5 * u8::from(p.distance(DVec3::splat(6.0)) < 4.0));
    std::fs::write(folder.join("a.nii"), bytes).expect("written");
    let args =
        ["import", "a.nii", "-o", "o", "--labels", "mine.csv", "--classes", "totalsegmentator"];
    let (done, said) = insonify(folder, &args);
    assert!(done && said.contains("liver: spleen,"), "{said}");
}

#[test]
fn volumes_of_others_are_scenes_or_refused_within_bounds() {
    let Some(data) = shared_data() else { return };
    let out = tempfile::tempdir().expect("temporary folder");
    let mut made = 0;
    let all = ["corpus-nrrd-nifti", "us-plus", "us-dicom-pydicom"]
        .map(|set| files(&data.join(set), is_volume));
    for (n, file) in all.concat().iter().enumerate() {
        let scene = out.path().join(n.to_string());
        let script = format!("exec \"$0\" import \"$1\" -o {}", scene.display());
        let outcome = limited(&script, file);
        let (file, said) = (file.display(), &outcome.text);
        assert!(matches!(outcome.code, Some(0 | 1)), "{file}: {:?} {said}", outcome.code);
        if outcome.code == Some(0) {
            made += 1;
            let checked = check(&scene.join("scene.toml"));
            assert_eq!(checked.code, Some(0), "{file}: {}", checked.text);
            assert!(checked.text.contains("0 errors, 0 warnings"), "{file}: {}", checked.text);
        }
    }
    println!("{made} scenes of {} volumes", all.concat().len());
    // The balls of pynrrd, at the least.
    assert!(made >= 5, "{made}");
}
