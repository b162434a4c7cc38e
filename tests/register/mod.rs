//! `insonify register`: known displacements found again through the command and its scene file, in both
//! directions, and the messages for mistakes.

use std::path::Path;

use glam::{DAffine3, DQuat, DVec3};
use insonify::scene::{Scene, mesh};

use crate::common::tracers;

mod case;
mod live;
mod mistakes;

use case::{Case, SCENE, apex, model, obj, vtp_in_ras};

const SURFACE: [&str; 4] = ["--surface", "model", "--points", "points.csv"];

fn far_off() -> Case {
    Case::new(model(), 1.0, DVec3::new(-290.0, 120.0, 40.0))
}

#[test]
fn a_volume_is_laid_onto_the_model_from_landmarks_ten_millimetres_off() {
    let case = far_off();
    case.landmarks();
    let landmarks = ["--landmarks", "landmarks.csv"];
    for (sigma, share, most) in [(0.0, 0.0, 0.05), (0.3, 0.0, 0.3), (0.3, 0.2, 0.3)] {
        case.points(sigma, share);
        let text = case.register(&[&SURFACE[..], &landmarks, &["-o", "new.toml"]].concat());
        let (off, angle, scale) = case.error(&case.placement("new.toml"));
        assert!(off < most && angle < 0.3 && scale < 1e-9, "{off} {angle} {scale}: {text}");
        assert!(text.contains("landmarks: 6, rms"), "{text}");
    }
    // Planted: the comparison notices the placement before, the landmarks alone, and the inverse.
    let (off, angle, _) = case.error(&case.present);
    assert!(off > 300.0 && angle > 8.9, "{off} {angle}");
    case.register(&[&landmarks[..], &["-o", "alone.toml"]].concat());
    let (off, _, _) = case.error(&case.placement("alone.toml"));
    assert!(off > 5.0, "{off}");
    let inverse = case.placement("new.toml").inverse();
    assert!(case.error(&inverse).0 > 50.0);
    // From the scene's placement, hundreds of mm off, nothing is guessed.
    let (ok, text) = case.run(&SURFACE);
    assert!(!ok && text.contains("mm off the surface") && text.contains("--landmarks"), "{text}");
    let text = case.register(&[&SURFACE[..], &["--start", "centroids", "-o", "new.toml"]].concat());
    let (off, angle, _) = case.error(&case.placement("new.toml"));
    assert!(off < 0.5 && angle < 0.5, "{off} {angle}: {text}");
}

/// The voxel that shows the bump lies on the bump, by the file's own header and not by any transform of the
/// registration.
#[test]
fn the_voxel_of_the_bump_comes_to_lie_on_the_bump() {
    let case = Case::new(model(), 1.0, DVec3::ZERO);
    case.points(0.1, 0.1);
    let lps = case.lps_from_model().transform_point3(apex());
    // LPS = Offset + 7 mm (i a + j b + k c), the rows of TransformMatrix.
    let from_first = lps - DVec3::new(-128.0, 65.0, -193.0);
    let voxel = DVec3::new(from_first.y, -from_first.x, from_first.z) / 7.0;
    let off = |scene: &Scene| {
        let shown = scene.volume.as_ref().expect("placed").world_from_voxel;
        let model = scene.instances[0].world_from_object.transform_point3(apex());
        shown.transform_point3(voxel).distance(model)
    };
    assert!(off(&case.load("scene.toml")) > 8.0);
    case.register(&[&SURFACE[..], &["-o", "volume.toml"]].concat());
    assert!(off(&case.load("volume.toml")) < 0.3);
    // In the other direction the volume stays, and the model moves, with its parent.
    case.register(&[&SURFACE[..], &["--move", "womb", "-o", "womb.toml"]].concat());
    case.register(&[&SURFACE[..], &["--move", "model", "-o", "model.toml"]].concat());
    for name in ["womb.toml", "model.toml"] {
        let scene = case.load(name);
        let volume = scene.volume.as_ref().expect("placed").world_from_lps;
        assert_eq!(volume, case.present, "{name}");
        assert!(off(&scene) < 0.3, "{name}");
        let wanted = case.present * case.lps_from_model();
        let found = scene.instances[0].world_from_object;
        let (_, p, _) = found.to_scale_rotation_translation();
        let (_, q, _) = wanted.to_scale_rotation_translation();
        assert!(p.angle_between(q).to_degrees() < 0.3, "{name}");
    }
    let text = case.read("womb.toml");
    let changed = text.lines().zip(SCENE.lines()).filter(|(a, b)| a != b).count();
    assert!(changed > 0 && text.contains("motion = { kind = \"sine\""), "{text}");
    // At another time the parent has moved on, and the model's own placement compensates.
    case.register(
        &[&SURFACE[..], &["--move", "model", "--time", "1 s", "-o", "later.toml"]].concat(),
    );
    let mut scene = case.load("later.toml");
    assert!(off(&scene) > 1.0);
    scene.set_time(1.0);
    assert!(off(&scene) < 0.3);
}

#[test]
fn a_scale_is_found_where_it_may_change() {
    let case = Case::new(model(), 1.07, DVec3::ZERO);
    case.points(0.3, 0.2);
    let args = [&SURFACE[..], &["--transformation", "similarity", "-o", "new.toml"]].concat();
    let text = case.register(&args);
    let (off, angle, scale) = case.error(&case.placement("new.toml"));
    assert!(off < 0.5 && angle < 0.3 && scale < 0.005, "{off} {angle} {scale}: {text}");
    // Planted: a rigid fit keeps the scene's scale, and both the comparison and the program notice.
    let text = case.register(&[&SURFACE[..], &["-o", "rigid.toml"]].concat());
    let (off, _, scale) = case.error(&case.placement("rigid.toml"));
    assert!(off > 1.0 && scale > 0.06, "{off} {scale}");
    assert!(case.read("rigid.toml").contains("scale = 0.9\n") && text.contains("scale 1.0000"));
}

#[test]
fn a_segmented_mesh_does_as_well_in_either_frame() {
    let case = Case::new(model(), 1.0, DVec3::ZERO);
    let placed = case.lps_from_model();
    let lps = obj(&case.mesh, |p| placed.transform_point3(p));
    let ras = obj(&case.mesh, |p| placed.transform_point3(p) * DVec3::new(-1.0, -1.0, 1.0));
    case.write("lps.obj", &lps);
    case.write("said.obj", &format!("# written by 3D Slicer SPACE=RAS\n{ras}"));
    case.write("ras.obj", &ras);
    let turned = |p| placed.transform_point3(p) * DVec3::new(-1.0, -1.0, 1.0);
    case.write("said.vtp", &vtp_in_ras(&case.mesh, turned));
    let common = ["--surface", "model", "-o", "new.toml", "--samples", "2000"];
    for args in [
        &["--volume-surface", "lps.obj"][..],
        &["--volume-surface", "said.obj"],
        &["--volume-surface", "said.vtp"],
        &["--volume-surface", "said.vtp", "--frame", "ras"],
        &["--volume-surface", "ras.obj", "--frame", "ras"],
    ] {
        case.register(&[&common[..], args].concat());
        let (off, angle, _) = case.error(&case.placement("new.toml"));
        assert!(off < 0.05 && angle < 0.05, "{off} {angle}");
    }
    // Planted: without the frame it is somewhere else, and the message names the volume's box.
    let (ok, text) = case.run(&[&common[..], &["--volume-surface", "ras.obj"]].concat());
    assert!(text.contains("0 % of the points lie in the volume; with x and y turned"), "{text}");
    assert!(!ok || case.error(&case.placement("new.toml")).0 > 10.0);
}

#[test]
fn the_scene_file_keeps_all_else_and_says_how_well_it_fits() {
    let case = Case::new(model(), 1.0, DVec3::ZERO);
    let strays = case.points(0.3, 0.1);
    // Nothing is written unasked.
    for args in [&[][..], &["--dry-run"]] {
        let text = case.register(&[&SURFACE[..], args].concat());
        assert!(text.contains("volume.translate = ["), "{text}");
        assert_eq!(text.contains("nothing is written"), args.is_empty(), "{text}");
        assert_eq!(case.read("scene.toml"), SCENE);
    }
    let text = case.register(&[&SURFACE[..], &["--json", "r.json", "-o", "new.toml"]].concat());
    assert_eq!(case.read("scene.toml"), SCENE);
    let written = case.read("new.toml");
    let report: serde_json::Value = serde_json::from_str(&case.read("r.json")).expect("JSON");
    let surface = &report["surface"];
    assert_eq!(surface["points"], 2500);
    assert!((surface["rms_mm"].as_f64().expect("a number") - 0.3).abs() < 0.05, "{report}");
    // Strays that lie near the surface by chance stay.
    let trimmed = surface["trimmed_share"].as_f64().expect("a number");
    assert!((0.8 * strays..=strays).contains(&trimmed), "{trimmed} of {strays}");
    let note: Vec<_> = written.lines().filter(|l| l.contains("registered")).collect();
    let rms = format!("rms {:.3} mm", surface["rms_mm"].as_f64().expect("a number"));
    assert!(note.len() == 1 && note[0].starts_with("# registered: model, points.csv: 2500 points"));
    assert!(note[0].contains(&rms) && text.contains(&rms), "{note:?}");
    // Only the placement has changed.
    let other = |text: &str| -> Vec<String> {
        let ours = ["translate = [", "rotate = {", "# registered"];
        let lines = text.lines().filter(|l| !ours.iter().any(|o| l.starts_with(o)));
        lines.map(str::to_owned).collect()
    };
    assert_eq!(other(&written), other(SCENE));
    assert!(written.contains("# Placed by eye.\n# registered"), "{written}");
    assert!(written.lines().any(|l| l.starts_with("translate = [") && l.ends_with("# later")));
    // The file read again gives the result, to the digits written.
    let vector = |key: &str| {
        let all = report[key].as_array().expect("a list").iter();
        DVec3::from_slice(&all.map(|x| x.as_f64().expect("a number")).collect::<Vec<_>>())
    };
    let angle = report["rotate_angle_deg"].as_f64().expect("a number").to_radians();
    let said = DAffine3::from_scale_rotation_translation(
        DVec3::splat(0.9),
        DQuat::from_axis_angle(vector("rotate_axis").normalize(), angle),
        vector("translate_mm"),
    );
    let read = case.placement("new.toml");
    let far = DVec3::splat(300.0);
    assert!(read.transform_point3(far).distance(said.transform_point3(far)) < 1e-9);
    // In place, again: the same, with one note.
    case.write("scene.toml", &written);
    case.register(&[&SURFACE[..], &["--in-place"]].concat());
    let again = case.read("scene.toml");
    assert_eq!(again.matches("# registered").count(), 1);
    let (a, b) = (case.placement("scene.toml"), read);
    assert!(a.transform_point3(far).distance(b.transform_point3(far)) < 1e-3);
}

/// A surface that ships: the decidua of the fetus.
#[test]
fn a_shipped_surface_is_found() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/fetus/decidua.obj");
    let (mesh, _) = mesh::load(&file, &mesh::Options::default()).expect("sound");
    let case = Case::new(mesh, 1.0, DVec3::ZERO);
    case.landmarks();
    case.points(0.3, 0.2);
    let args = [&SURFACE[..], &["--landmarks", "landmarks.csv", "-o", "new.toml"]].concat();
    let text = case.register(&args);
    let (off, angle, _) = case.error(&case.placement("new.toml"));
    assert!(off < 1.0 && angle < 1.0, "{off} {angle}: {text}");
}
