//! `insonify import` of folders of meshes, DICOM segmentations, and what PLUS writes.

#[path = "common/program.rs"]
mod program;
#[path = "common/shared_data.rs"]
mod shared_data;

use std::fmt::Write as _;
use std::path::Path;

use glam::{DAffine3, DMat3, DQuat, DVec3};
use insonify::import::LabelMap;
use insonify::scene::{Mesh, Scene, shapes};
use insonify::volume::track;
use program::insonify;
use shared_data::shared_data;

fn obj(mesh: &Mesh, shift: DVec3) -> String {
    let mut out = String::new();
    for p in &mesh.positions {
        let p = DVec3::from(p.map(f64::from)) + shift;
        writeln!(out, "v {} {} {}", p.x, p.y, p.z).expect("text");
    }
    for [a, b, c] in &mesh.triangles {
        writeln!(out, "f {} {} {}", a + 1, b + 1, c + 1).expect("text");
    }
    out
}

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
    write("portal_vein.obj", obj(&ball(9.0), DVec3::new(40.0, 10.0, 30.0)));
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
    let liver = scene.instances.iter().find(|i| i.name == "Liver").expect("a liver");
    let mesh = &scene.meshes[liver.mesh];
    let left = mesh.positions.iter().map(|p| p[0]).fold(f32::INFINITY, f32::min);
    assert!((left + 90.0).abs() < 0.1, "{left}");
    // The skin is made up 15 mm around all of it.
    let skin = scene.instances.iter().find(|i| i.name == "skin").expect("a skin");
    let front =
        scene.meshes[skin.mesh].positions.iter().map(|p| p[1]).fold(f32::INFINITY, f32::min);
    assert!((-99.0..-95.0).contains(&front), "{front}");

    std::fs::write(organs.join("bad.obj"), "v 0 0 0\nv 1 0 0\nf 1 2 9\n").expect("written");
    let (done, said) = insonify(folder, &["import", "organs", "-o", "b"]);
    assert!(!done && said.contains("bad.obj") && said.contains("do not exist yet"), "{said}");
    std::fs::create_dir(folder.join("empty")).expect("made");
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

/// Pixels to the marker on the probe: uneven sizes of pixels, oblique.
fn image_to_probe() -> DAffine3 {
    let turn = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, -1.0).normalize(), 1.1);
    let sizes = DMat3::from_diagonal(DVec3::new(0.0861, 0.0852, 0.0861));
    DAffine3::from_mat3_translation(turn * sizes, DVec3::new(12.0, -7.0, 30.0))
}

fn probe_to_tracker(second: f64) -> DAffine3 {
    let turn = DQuat::from_axis_angle(DVec3::new(0.3, 1.0, 0.2).normalize(), 0.4 + 0.1 * second);
    DAffine3::from_rotation_translation(turn, DVec3::new(50.0 + second, 20.0, -10.0))
}

fn reference_to_tracker() -> DAffine3 {
    DAffine3::from_rotation_translation(DQuat::from_rotation_y(0.7), DVec3::new(5.0, 6.0, 7.0))
}

/// Sixteen numbers, row by row.
fn sixteen(t: DAffine3) -> String {
    let rows = (0..3).map(|r| {
        let [x, y, z] = t.matrix3.row(r).to_array();
        format!("{x:.17} {y:.17} {z:.17} {:.17} ", t.translation[r])
    });
    rows.collect::<String>() + "0 0 0 1"
}

/// Poses of a tracker at 0, 1, 2 and 3 s, the third of them not valid, without images.
fn tracker_only(folder: &Path) {
    let mut text =
        String::from("ObjectType = Image\nNDims = 3\nDimSize = 0 0 4\nElementType = MET_OTHER\n");
    for frame in 0..4 {
        let time = f64::from(frame);
        let key = format!("Seq_Frame{frame:04}_");
        for (name, pose) in [
            ("ProbeToTracker", probe_to_tracker(time)),
            ("ReferenceToTracker", reference_to_tracker()),
        ] {
            let status = if frame == 2 { "INVALID" } else { "OK" };
            writeln!(text, "{key}{name}Transform = {}", sixteen(pose)).expect("text");
            writeln!(text, "{key}{name}TransformStatus = {status}").expect("text");
        }
        writeln!(text, "{key}Timestamp = {}\n{key}ImageStatus = INVALID", 100.0 + time)
            .expect("text");
    }
    text += "ElementDataFile = LOCAL\n";
    std::fs::write(folder.join("track.igs.mha"), text).expect("written");
}

const RADIUS: f64 = 8.0;

/// From the ball's own coordinates to its object's frame, which is the reference.
fn model_to_object() -> DAffine3 {
    let middle = world_from_image().transform_point3(DVec3::new(420.0, 330.0, 25.0));
    DAffine3::from_rotation_translation(DQuat::from_rotation_x(0.5), middle)
}

fn world_from_image() -> DAffine3 {
    reference_to_tracker().inverse() * probe_to_tracker(0.0) * image_to_probe()
}

fn device_set(folder: &Path) {
    std::fs::write(folder.join("ball.obj"), obj(&shapes::sphere(RADIUS, 5), DVec3::ZERO))
        .expect("written");
    let text = format!(
        r#"<PlusConfiguration version="2.3">
  <DataCollection>
    <DeviceSet Name="A ball in a bath" />
    <Device Id="VideoDevice" Type="UsSimulator">
      <vtkPlusUsSimulatorAlgo ImageCoordinateFrame="Image" ReferenceCoordinateFrame="Reference"
          NumberOfScanlines="128" NumberOfSamplesPerScanline="1000" FrequencyMhz="5">
        <SpatialModel Name="Bath" DensityKgPerM3="1000" SoundVelocityMPerSec="1540" AttenuationCoefficientDbPerCmMhz="0.5" />
        <SpatialModel Name="Ball" ObjectCoordinateFrame="Reference" ModelFile="ball.obj" ModelToObjectTransform="{}"
            DensityKgPerM3="1060" SoundVelocityMPerSec="1540" AttenuationCoefficientDbPerCmMhz="0.7" />
        <SpatialModel Name="Needle" ObjectCoordinateFrame="NeedleTip" ModelFile="ball.obj" />
        <RfProcessing>
          <ScanConversion TransducerGeometry="LINEAR" ImagingDepthMm="60.0" TransducerWidthMm="40.0"
            OutputImageSizePixel="820 616" TransducerCenterPixel="410 5" OutputImageSpacingMmPerPixel="0.084 0.087"/>
        </RfProcessing>
      </vtkPlusUsSimulatorAlgo>
    </Device>
  </DataCollection>
  <CoordinateDefinitions>
    <Transform From="Image" To="Probe" Matrix="{}" />
  </CoordinateDefinitions>
</PlusConfiguration>
"#,
        sixteen(model_to_object()),
        sixteen(image_to_probe())
    );
    std::fs::write(folder.join("set.xml"), text).expect("written");
}

#[test]
fn a_device_set_of_plus_shows_its_surfaces_where_the_image_plane_cuts_them() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let folder = folder.path();
    device_set(folder);
    tracker_only(folder);
    let (done, said) = insonify(folder, &["import", "set.xml", "-o", "out"]);
    assert!(!done && said.contains("nothing leads from `Image` to `Reference`"), "{said}");
    assert!(said.contains("--sequence"), "{said}");
    let (done, said) =
        insonify(folder, &["import", "set.xml", "-o", "out", "--sequence", "track.igs.mha"]);
    assert!(done && said.contains("`Needle` is left out"), "{said}");
    let (passed, said) = insonify(folder, &["check", "out/scene.toml"]);
    assert!(passed && said.contains("0 errors, 0 warnings"), "{said}");
    // The anatomy along the scanlines, as our renderer has it.
    let args = [
        "render",
        "out/scene.toml",
        "-o",
        "a.png",
        "--dump",
        "stages",
        "--set",
        "simulation.labels=true",
        "--set",
        "simulation.paths=1",
        "--set",
        "probe.elevation_layers=1",
    ];
    let (done, said) = insonify(folder, &args);
    assert!(done, "{said}");
    let npy = std::fs::read(folder.join("stages/kernels/labels.npy")).expect("labels");
    let start = 10 + usize::from(u16::from_le_bytes([npy[8], npy[9]]));
    let words: Vec<u32> =
        npy[start..].as_chunks::<4>().0.iter().map(|b| u32::from_le_bytes(*b)).collect();
    let (lines, samples) = (128, 1000);
    assert_eq!(words.len(), 2 * lines * samples);
    // Where PLUS's scanlines are: vtkPlusUsScanConvertLinear lays them out in pixels from the middle of the face.
    let m = world_from_image();
    let [across, along] = [m.matrix3.x_axis.length(), m.matrix3.y_axis.length()];
    let depth = 60.0 / 0.087 * along;
    let middle = model_to_object().translation;
    let mut worst = 0.0f64;
    let mut borders = 0;
    for line in 0..lines {
        let column = 410.0 + (line as f64 / (lines - 1) as f64 - 0.5) * 40.0 / 0.084;
        let inside = |k: usize| words[2 * (line * samples + k)] != u32::MAX;
        for k in 1..samples {
            if inside(k) == inside(k - 1) {
                continue;
            }
            let z = (k as f64 - 0.5) * depth / samples as f64;
            let p = m.transform_point3(DVec3::new(column, 5.0 + z / along, 0.0));
            worst = worst.max((p.distance(middle) - RADIUS).abs());
            borders += 1;
        }
    }
    println!("{borders} borders, {worst:.3} mm off at most; pixels {across:.4} x {along:.4} mm");
    assert!(borders > 60 && worst < 0.2, "{borders} {worst}");
}

#[test]
fn tracked_poses_become_a_trajectory_with_and_without_a_transducer() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let folder = folder.path();
    device_set(folder);
    tracker_only(folder);
    let rows = |file: &str| -> Vec<Vec<f64>> {
        let text = std::fs::read_to_string(folder.join(file)).expect("a trajectory");
        let lines = text.lines().filter(|l| !l.starts_with('#')).skip(1);
        lines.map(|l| l.split(',').map(|c| c.parse().expect("a number")).collect()).collect()
    };
    let (done, said) = insonify(folder, &["import", "track.igs.mha", "-o", "tool.csv"]);
    assert!(done && said.contains("3 poses over 3.000 s, 1 frames left out"), "{said}");
    for row in rows("tool.csv") {
        let pose = reference_to_tracker().inverse() * probe_to_tracker(row[0]);
        let place = DVec3::new(row[1], row[2], row[3]);
        assert!(place.distance(pose.translation) < 1e-3, "{row:?}");
        let turn = DQuat::from_xyzw(row[5], row[6], row[7], row[4]);
        assert!((turn * DVec3::Z).distance(pose.transform_vector3(DVec3::Z)) < 1e-5, "{row:?}");
    }
    let args = ["import", "track.igs.mha", "-o", "face.csv", "--config", "set.xml", "--to-lps"];
    let (done, said) = insonify(folder, &args);
    assert!(done, "{said}");
    let first = &rows("face.csv")[0];
    let face = world_from_image().transform_point3(DVec3::new(410.0, 5.0, 0.0));
    assert!(
        DVec3::new(first[1], first[2], first[3]).distance(face * DVec3::new(-1.0, -1.0, 1.0))
            < 1e-3
    );
    // It is what `acquire` and `render` take.
    let loaded = insonify::scene::file::load_trajectory(&folder.join("face.csv")).expect("sound");
    assert!(loaded.translation.is_some() && loaded.rotation.is_some());
    let (done, said) =
        insonify(folder, &["import", "track.igs.mha", "-o", "x.csv", "--pose", "StylusToTracker"]);
    assert!(!done && said.contains("ProbeToTracker"), "{said}");
}

#[test]
fn sequences_of_trackers_of_others_are_read() {
    let Some(data) = shared_data() else { return };
    let plus = data.join("us-plus");
    for (file, name, frames) in [
        ("ConfigFiles/SlidingProbeTrackingData.igs.mha", "ProbeToTracker", 85),
        ("TestImages/Prostate10_tracker.igs.mha", "ToolToTracker", 10),
        ("TestImages/ReferenceToRASCalibration.igs.mha", "StylusToTracker", 0),
        ("TestImages/NwirePhantomFreehand.igs.nrrd", "ProbeToTracker", 97),
    ] {
        let found = track(&plus.join(file)).expect(file);
        let posed = found.iter().filter(|f| f.poses.contains_key(name)).count();
        assert!(frames == 0 || posed == frames, "{file}: {posed}");
        assert!(found.iter().any(|f| f.poses.values().any(|p| p.is_ok())), "{file}");
    }
}

/// One element with its type, in little endian.
fn element(tag: (u16, u16), kind: &str, value: &[u8]) -> Vec<u8> {
    let mut value = value.to_vec();
    if !value.len().is_multiple_of(2) {
        value.push(if kind == "OB" || kind == "UI" { 0 } else { b' ' });
    }
    let mut out = [tag.0.to_le_bytes(), tag.1.to_le_bytes()].concat();
    out.extend(kind.as_bytes());
    match kind {
        "SQ" | "OB" => {
            out.extend([0, 0]);
            out.extend((value.len() as u32).to_le_bytes());
        }
        _ => out.extend((value.len() as u16).to_le_bytes()),
    }
    out.extend(value);
    out
}

fn items(tag: (u16, u16), items: &[Vec<u8>]) -> Vec<u8> {
    let mut value = Vec::new();
    for item in items {
        value.extend([0xfe, 0xff, 0x00, 0xe0]);
        value.extend((item.len() as u32).to_le_bytes());
        value.extend(item);
    }
    element(tag, "SQ", &value)
}

/// Two balls as segments 1 and 7 in planes 2.5 mm apart, frames only where there are pixels.
fn segmentation(size: [usize; 3], inside: impl Fn(usize, DVec3) -> bool) -> Vec<u8> {
    let short = |tag, value: u16| element(tag, "US", &value.to_le_bytes());
    let code =
        |tag, meaning: &str| items(tag, &[element((0x0008, 0x0104), "LO", meaning.as_bytes())]);
    let segments = [(1, "Big one", "Liver"), (7, "", "Neoplasm")].map(|(number, label, kind)| {
        [
            code((0x0062, 0x0003), "Anatomical Structure"),
            short((0x0062, 0x0004), number),
            element((0x0062, 0x0005), "LO", label.as_bytes()),
            code((0x0062, 0x000f), kind),
        ]
        .concat()
    });
    let (mut frames, mut bits) = (Vec::new(), Vec::new());
    for (n, number) in [1u16, 7].into_iter().enumerate() {
        // The planes of a segment need not be in order.
        for k in (0..size[2]).rev() {
            let plane: Vec<bool> = (0..size[0] * size[1])
                .map(|at| {
                    inside(n, DVec3::new((at % size[0]) as f64, (at / size[0]) as f64, k as f64))
                })
                .collect();
            if !plane.contains(&true) {
                continue;
            }
            bits.extend(plane);
            let position = format!("-10\\20\\{}", 100.0 + 2.5 * k as f64);
            frames.push(
                [
                    items(
                        (0x0020, 0x9113),
                        &[element((0x0020, 0x0032), "DS", position.as_bytes())],
                    ),
                    items((0x0062, 0x000a), &[short((0x0062, 0x000b), number)]),
                ]
                .concat(),
            );
        }
    }
    let packed: Vec<u8> = bits
        .chunks(8)
        .map(|bits| bits.iter().enumerate().map(|(n, bit)| u8::from(*bit) << n).sum())
        .collect();
    let shared = [
        items((0x0020, 0x9116), &[element((0x0020, 0x0037), "DS", b"1\\0\\0\\0\\1\\0")]),
        items(
            (0x0028, 0x9110),
            &[[
                element((0x0018, 0x0050), "DS", b"2.5"),
                element((0x0028, 0x0030), "DS", b"2\\1.5"),
            ]
            .concat()],
        ),
    ]
    .concat();
    let meta = element((0x0002, 0x0010), "UI", b"1.2.840.10008.1.2.1");
    let root = [
        element((0x0008, 0x0016), "UI", b"1.2.840.10008.5.1.4.1.1.66.4"),
        element((0x0028, 0x0008), "IS", frames.len().to_string().as_bytes()),
        short((0x0028, 0x0010), size[1] as u16),
        short((0x0028, 0x0011), size[0] as u16),
        short((0x0028, 0x0100), 1),
        items((0x0062, 0x0002), &segments),
        items((0x5200, 0x9229), &[shared]),
        items((0x5200, 0x9230), &frames),
        element((0x7fe0, 0x0010), "OB", &packed),
    ];
    [vec![0; 128], b"DICM".to_vec(), meta, root.concat()].concat()
}

#[test]
fn a_dicom_segmentation_becomes_a_scene() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let folder = folder.path();
    // Uneven counts, so that frames begin within bytes.
    let size = [41, 37, 22];
    let (big, small) = (DVec3::new(20.0, 18.0, 10.0), DVec3::new(24.0, 18.0, 11.0));
    let inside = |segment: usize, p: DVec3| match segment {
        0 => ((p - big) / DVec3::new(16.0, 12.0, 9.0)).length() < 1.0,
        _ => ((p - small) / DVec3::new(5.0, 4.0, 3.2)).length() < 1.0,
    };
    let bytes = segmentation(size, inside);
    std::fs::write(folder.join("s.dcm"), &bytes).expect("written");
    let map = LabelMap::load(&folder.join("s.dcm")).expect("a segmentation");
    // Empty planes at either end are not in the file.
    assert_eq!(&map.grid.size[..2], &size[..2]);
    let first = map.grid.world_from_voxel.transform_point3(DVec3::ZERO);
    let offset = ((first.z - 100.0) / 2.5).round();
    assert!(first.distance(DVec3::new(-10.0, 20.0, 100.0 + 2.5 * offset)) < 1e-9, "{first}");
    assert!(map.grid.spacing().distance(DVec3::new(1.5, 2.0, 2.5)) < 1e-9);
    for (at, &label) in map.grid.voxels.iter().enumerate() {
        let [x, y, _] = map.grid.size;
        let p = DVec3::new((at % x) as f64, (at / x % y) as f64, (at / (x * y)) as f64 + offset);
        // Where they overlap the later segment counts.
        let expected = if inside(1, p) { 2 } else { u8::from(inside(0, p)) };
        assert_eq!(label, expected, "{p}");
    }
    let (done, said) = insonify(folder, &["import", "s.dcm", "-o", "out"]);
    assert!(
        done && said.contains("Big one: liver,") && said.contains("Neoplasm: tumour,"),
        "{said}"
    );
    let (passed, said) = insonify(folder, &["check", "out/scene.toml"]);
    assert!(passed && said.contains("0 errors, 0 warnings"), "{said}");
    // Cut anywhere it is an error, and no panic.
    for end in (132..bytes.len()).step_by(97) {
        std::fs::write(folder.join("cut.dcm"), &bytes[..end]).expect("written");
        let found = LabelMap::load(&folder.join("cut.dcm"));
        assert!(found.is_err(), "cut at {end}");
    }
}
