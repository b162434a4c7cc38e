//! Files of PLUS: device sets of its simulator, sequences of trackers.

use std::fmt::Write as _;
use std::path::Path;

use glam::{DAffine3, DMat3, DQuat, DVec3};
use insonify::scene::shapes;
use insonify::sim::layout::{Label, NONE};
use insonify::volume::track;

use crate::common::program::insonify;
use crate::common::shared_data::shared_data;
use crate::import::obj;

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
    let labels: Vec<Label> = bytemuck::pod_collect_to_vec(&npy[start..]);
    let (lines, samples) = (128, 1000);
    assert_eq!(labels.len(), lines * samples);
    // Positions of PLUS's scanlines: vtkPlusUsScanConvertLinear lays them out in pixels from the middle of the face.
    let m = world_from_image();
    let [across, along] = [m.matrix3.x_axis.length(), m.matrix3.y_axis.length()];
    let depth = 60.0 / 0.087 * along;
    let middle = model_to_object().translation;
    let mut worst = 0.0f64;
    let mut borders = 0;
    for line in 0..lines {
        let column = 410.0 + (line as f64 / (lines - 1) as f64 - 0.5) * 40.0 / 0.084;
        let inside = |k: usize| labels[line * samples + k].true_instance != NONE;
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

// PLUS takes coordinates as they are written: a frame that the mesh states is another program's.
#[test]
fn bodies_of_a_device_set_lie_where_it_says_whatever_frame_they_state_and_none_is_lost_unseen() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let folder = folder.path();
    device_set(folder);
    tracker_only(folder);
    let import = |out: &str| {
        insonify(folder, &["import", "set.xml", "-o", out, "--sequence", "track.igs.mha"])
    };
    let mesh = |out: &str| std::fs::read(folder.join(out).join("meshes/ball.obj")).expect("a mesh");
    let (done, said) = import("plain");
    assert!(done && !said.contains("RAS") && !said.contains("beside"), "{said}");
    let ball = std::fs::read_to_string(folder.join("ball.obj")).expect("there");
    for frame in ["RAS", "LPS"] {
        let text = format!("# 3D Slicer output. SPACE={frame}\n{ball}");
        std::fs::write(folder.join("ball.obj"), text).expect("written");
        let (done, said) = import(frame);
        assert!(done && said.contains("taken as it is written") == (frame == "RAS"), "{said}");
        assert!(mesh(frame) == mesh("plain"), "{frame}");
    }
    // Far from the image.
    let set = std::fs::read_to_string(folder.join("set.xml")).expect("there");
    let far = DAffine3::from_translation(DVec3::new(0.0, 400.0, 0.0)) * model_to_object();
    let far = set.replace(&sixteen(model_to_object()), &sixteen(far));
    std::fs::write(folder.join("set.xml"), far).expect("written");
    let (done, said) = import("far");
    assert!(done && said.contains("no mesh is in the image: the nearest, `Ball`"), "{said}");
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

/// Another device's transducer, a transform stated twice (PLUS takes the later one), bodies that are alike, letters in Latin-1.
#[test]
fn a_device_set_is_read_as_plus_reads_it() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let folder = folder.path();
    device_set(folder);
    tracker_only(folder);
    let plain = std::fs::read_to_string(folder.join("set.xml")).expect("text");
    let made = |text: &[u8]| -> String {
        std::fs::write(folder.join("set.xml"), text).expect("written");
        let args = ["import", "set.xml", "-o", "out", "--force", "--sequence", "track.igs.mha"];
        let (done, said) = insonify(folder, &args);
        assert!(done, "{said}");
        let (passed, said) = insonify(folder, &["check", "out/scene.toml"]);
        assert!(passed, "{said}");
        std::fs::read_to_string(folder.join("out/scene.toml")).expect("a scene")
    };
    let scene = made(plain.as_bytes());
    let other = r#"<Device Id="Other"><ScanConversion TransducerGeometry="CURVILINEAR" RadiusStartMm="14"
        RadiusStopMm="48" ThetaStartDeg="-36" ThetaStopDeg="36" TransducerCenterPixel="30 5"
        OutputImageSpacingMmPerPixel="0.2 0.2"/></Device><Device Id="VideoDevice""#;
    assert_eq!(made(plain.replace("<Device Id=\"VideoDevice\"", other).as_bytes()), scene);
    let wrong = sixteen(DAffine3::from_translation(DVec3::splat(90.0)));
    let twice = format!(
        "<Transform From=\"Image\" To=\"Probe\" Matrix=\"{wrong}\" /> <Transform From=\"Image\""
    );
    assert_eq!(made(plain.replace("<Transform From=\"Image\"", &twice).as_bytes()), scene);
    let begin = plain.find("<SpatialModel Name=\"Ball\"").expect("the ball");
    let end = begin + plain[begin..].find("/>").expect("its end") + 2;
    let alike = format!("{}{}{}", &plain[..end], &plain[begin..end], &plain[end..]);
    assert!(made(alike.as_bytes()).contains("[tissues.plus_ball_2]"));
    let latin = plain.replace("A ball in a bath", "K\u{fc}gelchen");
    let latin = format!("<?xml version=\"1.0\" encoding=\"ISO-8859-1\"?>\n{latin}");
    let bytes: Vec<u8> = latin.chars().map(|c| u8::try_from(c).expect("Latin-1")).collect();
    assert!(made(&bytes).contains("K\u{fc}gelchen"));
    // The same bytes without a word of their encoding.
    let undeclared = bytes.splitn(2, |&byte| byte == b'\n').nth(1).expect("a second line");
    std::fs::write(folder.join("set.xml"), undeclared).expect("written");
    let (done, said) = insonify(folder, &["import", "set.xml", "-o", "out", "--force"]);
    assert!(!done && said.contains("UTF-8") && said.contains("set.xml:3"), "{said}");
}

/// A fault of the simulator is no reason to write poses of something else.
#[test]
fn a_trajectory_by_a_device_set_with_a_fault_is_refused() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let folder = folder.path();
    device_set(folder);
    tracker_only(folder);
    let plain = std::fs::read_to_string(folder.join("set.xml")).expect("text");
    for (from, to, said_of) in [
        ("SoundVelocityMPerSec=\"1540\"", "SoundVelocityMPerSec=\"1.540\"", "SoundVelocityMPerSec"),
        ("ImagingDepthMm=\"60.0\"", "", "ImagingDepthMm"),
        ("<ScanConversion", "<ScanConverter", "ScanConversion"),
    ] {
        std::fs::write(folder.join("set.xml"), plain.replace(from, to)).expect("written");
        let args = ["import", "track.igs.mha", "-o", "way.csv", "--config", "set.xml"];
        let (done, said) = insonify(folder, &args);
        assert!(!done && said.contains(said_of), "{said}");
        assert!(!folder.join("way.csv").exists());
    }
}
