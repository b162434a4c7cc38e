//! Volumes from tracked frames, compared with the source of the frames, and the command. The comparison with a
//! volume of PLUS: tests/plus.rs.

use std::collections::BTreeMap;
use std::path::Path;

use glam::{DAffine3, DMat3, DVec3};
use insonify::volume::{
    Compounding, Filling, Interpolation, Pose, Sequence, Settings, TrackedFrame, Transforms,
    Volume, Voxels, reconstruct,
};

use crate::common::program::insonify;

/// Frames of several sizes of pixels, as after a change of depth while PLUS records: told by `check`, and no volume.
#[test]
fn a_change_of_depth_is_told_and_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut frames = sweep([13, 9], calibration(), &planes(6, 2.0));
    let mut said = Vec::new();
    for later in ["0.1 0.0386 1", "0.2 0.0772 1", "0.10000000000000000555 0.03860000000000000042 1"]
    {
        for (index, frame) in frames.frames.iter_mut().enumerate() {
            let size = if index < 3 { "0.1 0.0386 1" } else { later };
            frame.fields = vec![("ElementSpacing".to_owned(), size.to_owned())];
        }
        frames.write(&folder.path().join("s.seq.mha")).expect("written");
        let (done, report) = insonify(folder.path(), &["check", "s.seq.mha"]);
        assert!(done, "{report}");
        let args = ["reconstruct", "s.seq.mha", "-o", "v.mha", "--image-to-probe"];
        let args = [&args[..], &["0.5 0 0 0 0 0.25 0 0 0 0 1 0 0 0 0 1"]].concat();
        let (made, error) = insonify(folder.path(), &args);
        said.push((report, made, error.split_whitespace().collect::<Vec<_>>().join(" ")));
    }
    for (report, made, error) in [&said[0], &said[2]] {
        assert!(
            *made && report.contains("frames state pixels of 0.1 x 0.0386 mm pose"),
            "{report} {error}"
        );
    }
    let told = "pixels of 0.1 x 0.0386 mm, from frame 3 on of 0.2 x 0.0772 mm";
    let (report, made, error) = &said[1];
    assert!(report.contains(told), "{report}");
    assert!(
        !made && error.contains("from frame 3 on of 0.2") && error.contains("of their own"),
        "{error}"
    );
}

/// A field linear in space.
fn field(at: DVec3) -> f64 {
    20.0 + 3.0 * at.x - 2.0 * at.y + 5.0 * at.z
}

/// Frames of `size` pixels that show `field` at their poses.
fn sweep(size: [usize; 2], image_to_probe: DAffine3, poses: &[DAffine3]) -> Sequence {
    let mut pixels = Vec::new();
    for pose in poses {
        for y in 0..size[1] {
            for x in 0..size[0] {
                let at = DVec3::new(x as f64, y as f64, 0.0);
                pixels.push(field((*pose * image_to_probe).transform_point3(at)) as f32);
            }
        }
    }
    let frame = |pose: &DAffine3| TrackedFrame {
        poses: BTreeMap::from([("ProbeToReference".to_owned(), Pose::ok(*pose))]),
        ..TrackedFrame::default()
    };
    Sequence {
        size,
        spacing: [1.0, 1.0],
        orientation: None,
        pixels: Voxels::F32(pixels),
        frames: poses.iter().map(frame).collect(),
        fields: vec![],
    }
}

fn poses(sequence: &Sequence, image_to_probe: DAffine3) -> Vec<Option<DAffine3>> {
    let mut known = Transforms::default();
    known.add("Image", "Probe", image_to_probe);
    known.of_frames(sequence, "Image", "Reference").expect("joined")
}

/// Pixels of 0.5 x 0.25 mm.
fn calibration() -> DAffine3 {
    DAffine3::from_scale(DVec3::new(0.5, 0.25, 1.0))
}

fn planes(count: usize, step: f64) -> Vec<DAffine3> {
    let at = |i| DAffine3::from_translation(DVec3::new(-4.0, 2.0, i as f64 * step));
    (0..count).map(at).collect()
}

/// Largest difference from the field over the voxels that `wanted` accepts.
fn worst(volume: &Volume, wanted: impl Fn(DVec3) -> bool) -> f64 {
    let [x, y, z] = volume.size;
    let mut worst = 0.0f64;
    for (k, j, i) in (0..z).flat_map(|k| (0..y).flat_map(move |j| (0..x).map(move |i| (k, j, i)))) {
        let index = DVec3::new(i as f64, j as f64, k as f64);
        let at = volume.world_from_voxel.transform_point3(index);
        if wanted(at) {
            worst = worst.max((volume.value([i, j, k]) - field(at)).abs());
        }
    }
    worst
}

/// Pixels that fall on voxels: anisotropic, offset, and both methods of inserting them. Single precision holds
/// values up to 60 to 4e-6.
#[test]
fn pixels_on_voxels_are_kept() {
    let sweep = sweep([13, 9], calibration(), &planes(5, 2.0));
    let poses = poses(&sweep, calibration());
    let mut settings = Settings::new(DVec3::new(0.5, 0.25, 2.0));
    for mode in [Interpolation::Nearest, Interpolation::Linear] {
        settings.interpolation = mode;
        let made = reconstruct(&sweep, &poses, &settings).expect("made");
        assert_eq!((made.volume.size, made.frames, made.filled), ([13, 9, 5], 5, 0));
        assert_eq!(made.volume.world_from_voxel.translation, DVec3::new(-4.0, 2.0, 0.0));
        assert!(worst(&made.volume, |_| true) < 1e-5);
        // Planted: half a voxel to one side.
        let shifted =
            |p: &Option<DAffine3>| p.map(|p| p * DAffine3::from_translation(DVec3::X * 0.5));
        let shifted: Vec<_> = poses.iter().map(shifted).collect();
        settings.lattice = Some((DVec3::new(-4.0, 2.0, 0.0), [13, 9, 5]));
        let made = reconstruct(&sweep, &shifted, &settings).expect("made");
        assert!(worst(&made.volume, |_| true) > 0.7);
        settings.lattice = None;
    }
}

/// A fan of tilted planes: nearest voxels are off by half a voxel at most. Linear weights of a linear field, which
/// balance planes on both sides, are off only where one side has none.
#[test]
fn a_tilted_sweep_gives_the_field_back() {
    let tilt = |i: i32| {
        DAffine3::from_mat3_translation(DMat3::from_rotation_x(f64::from(i) * 0.02), DVec3::ZERO)
    };
    let tilts: Vec<_> = (-10..=10).map(tilt).collect();
    let sweep = sweep([41, 161], calibration(), &tilts);
    let poses = poses(&sweep, calibration());
    let mut settings = Settings::new(DVec3::splat(0.5));
    // Within the fan, away from its edges.
    let inside = |p: DVec3| {
        (1.0..19.0).contains(&p.x) && (10.0..38.0).contains(&p.y) && p.z.abs() < 0.15 * p.y
    };
    let mut errors = Vec::new();
    for mode in [Interpolation::Nearest, Interpolation::Linear] {
        settings.interpolation = mode;
        let made = reconstruct(&sweep, &poses, &settings).expect("made");
        // Planes are 0.8 mm apart at the far end: linear weights reach all voxels between them.
        assert_eq!(made.filled > 0, mode == Interpolation::Nearest);
        errors.push(worst(&made.volume, inside));
    }
    // Half a voxel along each axis: (3 + 2 + 5) / 4. A hole is filled between voxels as wrong, and
    // by weights of PLUS that are up to a tenth of the line off its middle.
    // Planes are s = 38 mm * 0.02 apart at most and reach a voxel of 0.5 mm: one alone is s - 0.5 mm away,
    // across which the field changes by 5 per mm.
    assert!(errors[0] < 2.5 * 1.25 && errors[1] < 5.0 * (38.0 * 0.02 - 0.5), "{errors:?}");
    // With nearest voxels the second bound is exceeded.
    assert!(errors[0] > 5.0 * (38.0 * 0.02 - 0.5), "{errors:?}");
    println!("largest difference: nearest {:.2}, linear {:.2}", errors[0], errors[1]);
}

#[test]
fn compounding_lost_poses_and_orientation() {
    let plane = DAffine3::IDENTITY;
    let mut sweep = sweep([2, 2], plane, &[plane; 3]);
    sweep.pixels = Voxels::U8(vec![10, 20, 30, 40, 40, 20, 0, 10, 13, 20, 3, 40]);
    let mut settings = Settings::new(DVec3::ONE);
    settings.holes = vec![];
    let mut made = |sweep: &Sequence, mode| {
        settings.compounding = mode;
        let made = reconstruct(sweep, &poses(sweep, plane), &settings).expect("made");
        (made.volume.voxels, made.frames)
    };
    let u8 = |v: [u8; 4]| Voxels::U8(v.to_vec());
    assert_eq!(made(&sweep, Compounding::Mean), (u8([21, 20, 11, 30]), 3));
    assert_eq!(made(&sweep, Compounding::Maximum), (u8([40, 20, 30, 40]), 3));
    assert_eq!(made(&sweep, Compounding::Latest), (u8([13, 20, 3, 40]), 3));
    let lost = sweep.frames[1].poses.get_mut("ProbeToReference");
    lost.expect("a pose").status = Some("OUT_OF_VIEW".to_owned());
    assert_eq!(made(&sweep, Compounding::Maximum), (u8([13, 20, 30, 40]), 2));
    sweep.frames[2].image = Some(false);
    assert_eq!(made(&sweep, Compounding::Latest), (u8([10, 20, 30, 40]), 1));
    for (orientation, voxels) in
        [("UFA", [20, 10, 40, 30]), ("MN", [30, 40, 10, 20]), ("UN", [40, 30, 20, 10])]
    {
        sweep.orientation = Some(orientation.to_owned());
        assert_eq!(made(&sweep, Compounding::Latest), (u8(voxels), 1));
    }
}

/// Two planes of 0 and 90 with two empty ones between: a line has 4 voxels, and by the method's
/// weights the ends count 2/4 + 1/4 and 1/4 + 2/4 of it: 90/4 * (1 + 1) and so on.
#[test]
fn holes_are_filled_along_sticks_and_from_the_nearest() {
    let plane = DAffine3::IDENTITY;
    let far = DAffine3::from_translation(DVec3::Z * 3.0);
    let mut sweep = sweep([3, 3], plane, &[plane, far]);
    sweep.pixels = Voxels::F32([[0.0; 9], [90.0; 9]].concat());
    let mut settings = Settings::new(DVec3::ONE);
    let mut column = |way| {
        settings.holes = vec![way];
        let made = reconstruct(&sweep, &poses(&sweep, plane), &settings).expect("made");
        let column = [0, 1, 2, 3].map(|k| made.volume.value([1, 1, k]));
        (column, made.filled)
    };
    let stick = |length| Filling::Stick { length, count: 1 };
    assert_eq!(column(stick(4)), ([0.0, 45.0, 67.5, 90.0], 18));
    assert_eq!(column(stick(3)), ([0.0, 0.0, 0.0, 90.0], 0));
    let nearest = |share| Filling::Nearest { size: 3, share };
    // Of the cube of 27 voxels the middle of a plane sees 9, the sides 6, the corners 4.
    assert_eq!(column(nearest(0.3)), ([0.0, 0.0, 90.0, 90.0], 2));
    assert_eq!(column(nearest(0.2)), ([0.0, 0.0, 90.0, 90.0], 10));
    assert_eq!(column(nearest(0.4)), ([0.0, 0.0, 0.0, 90.0], 0));
}

#[test]
fn the_command_writes_a_volume_or_says_why_not() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
    let sweep = sweep([13, 9], calibration(), &planes(5, 2.0));
    sweep.write(Path::new(&at("a.igs.mha"))).expect("written");
    let matrix = "0.5 0 0 0 0 0.25 0 0 0 0 1 0 0 0 0 1";
    let config = |attributes: &str| {
        let text = format!(
            "<PlusConfiguration>\n<CoordinateDefinitions><Transform From=\"Image\" To=\"Probe\" \
             Matrix=\"{matrix}\"/></CoordinateDefinitions>\n<VolumeReconstruction \
             OutputSpacing=\"0.5 0.25 2\" {attributes}/></PlusConfiguration>"
        );
        std::fs::write(at("a.xml"), text).expect("written");
    };
    config("Interpolation=\"LINEAR\" CompoundingMode=\"LATEST\" FillHoles=\"OFF\"");
    let (source, xml, out) = (at("a.igs.mha"), at("a.xml"), at("a.mha"));
    let (fine, text) =
        insonify(folder.path(), &["reconstruct", &source, "--config", &xml, "-o", &out]);
    assert!(
        fine && text.contains("5 of 5 frames; 585 voxels reached, 0 filled, 0 empty"),
        "{text}"
    );
    let (volume, _) = Volume::load(Path::new(&out)).expect("readable");
    assert_eq!(volume.size, [13, 9, 5]);
    assert!(worst(&volume, |_| true) < 1e-5);
    let given = ["--image-to-probe", matrix, "--spacing", "0.5,0.25,2"];
    let extent = ["--extent", "-4,2,0,3,4,2", "--interpolation", "nearest", "--fill", "0"];
    let (fine, text) = insonify(
        folder.path(),
        &[&["reconstruct", &source, "-o", &out], &given[..], &extent].concat(),
    );
    assert!(fine && text.contains("3 x 4 x 2 voxels"), "{text}");
    let (fine, text) = insonify(folder.path(), &["check", &source]);
    assert!(fine && text.contains("pose ProbeToReference: 5, 5 of them OK"), "{text}");

    for (attributes, cause) in [
        ("CompoundingMode=\"IMPORTANCE_MASK\"", "cannot be done"),
        ("ClipRectangleOrigin=\"1\"", "write 2 numbers"),
        (
            "FillHoles=\"ON\"><HoleFillingElement Type=\"GAUSSIAN\"/></VolumeReconstruction><A",
            "cannot be done",
        ),
        ("FillHoles=\"ON", "is no XML"),
        (
            "ClipRectangleOrigin=\"90 0\" ClipRectangleSize=\"5 5\"",
            "lies outside the 13 x 9 pixels",
        ),
        ("OutputOrigin=\"0 0 0\" OutputExtent=\"0 99999 0 99999 0 99999\"", "or more than"),
    ] {
        config(attributes);
        let (fine, text) =
            insonify(folder.path(), &["reconstruct", &source, "--config", &xml, "-o", &out]);
        assert!(!fine && text.contains(cause) && text.contains("help:"), "{cause}: {text}");
    }
    for (more, cause) in [
        (&[][..], "nothing leads from `Image` to `Reference`; there is ProbeToReference"),
        (&["--image-to-probe", "1 0 0"], "does not have 16 numbers"),
        (&["--image-to-probe", matrix, "--spacing", "0"], "spacing above zero"),
        (&["--image-to-probe", matrix, "--spacing", "1e-9"], "or more than"),
        (&["--image-to-probe", matrix, "--reference", "Tracker"], "to `Tracker`"),
    ] {
        let (fine, text) =
            insonify(folder.path(), &[&["reconstruct", &source, "-o", &out], more].concat());
        assert!(!fine && text.contains(cause), "{cause}: {text}");
    }
}
