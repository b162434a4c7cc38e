//! Folders of meshes.

use glam::DVec3;
use insonify::output::lock::{Hold, LOCK};
use insonify::scene::{Scene, shapes};

use crate::common::program::insonify;
use crate::common::shared_data::shared_data;
use crate::import::obj;

fn priority(scene: &Scene, name: &str) -> i32 {
    let found = scene.instances.iter().find(|i| i.name == name);
    found.unwrap_or_else(|| panic!("no mesh {name}")).priority
}

#[test]
fn a_folder_of_meshes_becomes_a_scene() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let folder = folder.path();
    let organs = folder.join("organs");
    std::fs::create_dir(&organs).expect("made");
    let write =
        |name: &str, text: String| std::fs::write(organs.join(name), text).expect("written");
    let ball = |radius| shapes::sphere(radius, 3);
    // In RAS: the liver is on the patient's right, which is +x there.
    write("Liver.obj", obj(&ball(50.0), DVec3::new(40.0, 10.0, 0.0)));
    // A file that states its frame is turned once, whatever --frame says.
    let vein = obj(&ball(9.0), DVec3::new(40.0, 10.0, 30.0));
    write("portal_vein.obj", format!("# 3D Slicer output. SPACE=RAS\n{vein}"));
    // A clot in the vein: by its name below vessels, by where it is above.
    write("clot.obj", obj(&ball(4.0), DVec3::new(40.0, 10.0, 32.0)));
    write("rib_right_7.obj", obj(&ball(7.0), DVec3::new(40.0, 75.0, 0.0)));
    write("readme.txt", "not a mesh".to_owned());
    let args = ["import", "organs", "-o", "out", "--frame", "ras", "--look-at", "liver"];
    let (done, said) = insonify(folder, &args);
    assert!(done, "{said}");
    assert!(said.contains("1 structures had no tissue and were given muscle: clot"), "{said}");
    let (passed, said) = insonify(folder, &["check", "out/scene.toml"]);
    assert!(passed && said.contains("0 errors, 0 warnings"), "{said}");
    let (scene, _) = Scene::load(&folder.join("out/scene.toml"), &[]).expect("sound");
    let ranks =
        ["skin", "Liver", "portal_vein", "clot", "rib_right_7"].map(|n| priority(&scene, n));
    assert!(ranks.is_sorted() && ranks[3] < ranks[4], "{ranks:?}");
    for (name, expected) in [("Liver", -90.0), ("portal_vein", -49.0)] {
        let organ = scene.instances.iter().find(|i| i.name == name).expect("an organ");
        let mesh = &scene.meshes[organ.mesh];
        let left = mesh.positions.iter().map(|p| p[0]).fold(f32::INFINITY, f32::min);
        assert!((left - expected).abs() < 0.1, "{name}: {left}");
    }
    // The skin is made up 15 mm around all of it.
    let skin = scene.instances.iter().find(|i| i.name == "skin").expect("a skin");
    let front =
        scene.meshes[skin.mesh].positions.iter().map(|p| p[1]).fold(f32::INFINITY, f32::min);
    assert!((-99.0..-95.0).contains(&front), "{front}");

    std::fs::write(organs.join("bad.obj"), "v 0 0 0\nv 1 0 0\nf 1 2 9\n").expect("written");
    let (done, said) = insonify(folder, &["import", "organs", "-o", "b"]);
    assert!(!done && said.contains("bad.obj") && said.contains("do not exist yet"), "{said}");
    std::fs::create_dir(folder.join("empty")).expect("made");
    let (done, said) = insonify(folder, &["import", "organs", "-o", "b.toml"]);
    assert!(!done && said.contains("names a folder") && said.contains("`-o b`"), "{said}");
    assert!(!folder.join("b.toml").exists());
    let (done, said) = insonify(folder, &["import", "empty", "-o", "b"]);
    assert!(!done && said.contains("holds no mesh"), "{said}");
}

#[test]
fn a_patients_organs_become_a_scene() {
    let Some(data) = shared_data() else { return };
    let folder = tempfile::tempdir().expect("temporary folder");
    let source = data.join("liver-scikit-surgery/obj");
    let source = source.to_str().expect("a plain path");
    let (done, said) = insonify(folder.path(), &["import", source, "-o", "out"]);
    assert!(done, "{said}");
    assert!(said.contains("the probe looks at liver"), "{said}");
    let (scene, _) = Scene::load(&folder.path().join("out/scene.toml"), &[]).expect("sound");
    for vessel in ["hepatic_veins", "portal_vein", "arteries"] {
        assert!(priority(&scene, vessel) > priority(&scene, "liver"), "{vessel}");
    }
    for lump in ["liver_tumours", "liver_cysts"] {
        assert!(priority(&scene, lump) > priority(&scene, "portal_vein"), "{lump}");
    }
    let (passed, said) = insonify(folder.path(), &["check", "out/scene.toml"]);
    assert!(passed && said.contains("0 errors"), "{said}");
}

/// Skins of scans end where the scan ends, at the top and at the bottom.
#[test]
fn an_open_skin_is_closed_so_that_a_probe_can_be_held_to_it() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let folder = folder.path();
    let organs = folder.join("organs");
    std::fs::create_dir(&organs).expect("made");
    let write =
        |name: &str, text: String| std::fs::write(organs.join(name), text).expect("written");
    let mut tube = shapes::cylinder(120.0, 300.0, 64);
    let inner = |t: &[u32; 3]| {
        let ends = t.iter().filter(|&&i| tube.positions[i as usize][..2] == [0.0, 0.0]);
        ends.count() == 0
    };
    tube.triangles = tube.triangles.iter().copied().filter(|t| inner(t)).collect();
    write("skin.obj", obj(&tube, DVec3::ZERO));
    write("liver.obj", obj(&shapes::sphere(40.0, 3), DVec3::new(0.0, 30.0, 0.0)));
    let (done, said) = insonify(folder, &["import", "organs", "-o", "out"]);
    assert!(done && said.contains("the skin had 2 openings, which were closed flat"), "{said}");
    let (passed, said) = insonify(folder, &["check", "out/scene.toml"]);
    assert!(passed && said.contains("0 errors"), "{said}");
}

/// Volumes that no organ has, and a folder that another import writes.
#[test]
fn implausible_volumes_are_told_with_their_cause_and_two_imports_do_not_mix() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let folder = folder.path();
    let organs = folder.join("organs");
    std::fs::create_dir(&organs).expect("made");
    // 1.4 l and 0.1 l, in cm.
    for (name, radius, left) in [("liver.obj", 6.95, -8.0), ("spleen.obj", 2.9, 6.0)] {
        let ball = obj(&shapes::sphere(radius, 3), DVec3::new(left, 0.0, 0.0));
        std::fs::write(organs.join(name), ball).expect("written");
    }
    let (done, said) = insonify(folder, &["import", "organs", "-o", "right", "--units", "cm"]);
    assert!(done && !said.contains("ICRP 89"), "{said}");
    let (done, said) = insonify(folder, &["import", "organs", "-o", "wrong"]);
    assert!(done, "{said}");
    for name in ["liver", "spleen"] {
        let cause = ["ml, and adults have", "ten times too small", "--units cm"];
        let warned = said.split("warning: ").find(|part| part.starts_with(&format!("{name}: ")));
        let warned = warned.unwrap_or_else(|| panic!("{name}: {said}"));
        assert!(cause.iter().all(|part| warned.contains(part)), "{warned}");
    }
    let held = Hold::take(&folder.join("right").join(LOCK)).expect("room").expect("nobody's");
    let again = ["import", "organs", "-o", "right", "--force", "--units", "cm"];
    let (done, said) = insonify(folder, &again);
    assert!(
        !done && said.contains("right") && said.contains("written by another import"),
        "{said}"
    );
    drop(held);
    assert!(insonify(folder, &again).0);
    assert!(!folder.join("right").join(LOCK).exists());
}
