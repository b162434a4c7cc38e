//! Sequences and volumes written and read back, and mistakes planted in entries of frames.

use std::collections::BTreeMap;

use super::*;

/// Three frames of 5 x 4 pixels with numbers that decimal fractions cannot represent.
fn sequence() -> Sequence {
    let pose = |angle: f64, status: Option<&str>| Pose {
        transform: DAffine3::from_mat3_translation(
            DMat3::from_rotation_y(angle) * DMat3::from_rotation_x(1.0 / 3.0),
            DVec3::new(angle * 1e-9, -1.0 / 7.0, 1e20 * angle),
        ),
        status: status.map(str::to_owned),
    };
    let frame = |i: i32| {
        let angle = 0.1 + f64::from(i) / 3.0;
        let status = ["OK", "INVALID", "OUT_OF_VIEW"][i as usize];
        TrackedFrame {
            timestamp: Some(1.0 / 3.0 + f64::from(i)),
            image: (i > 0).then_some(i == 1),
            poses: BTreeMap::from([
                ("ProbeToTracker".to_owned(), pose(angle, Some(status))),
                ("ReferenceToTracker".to_owned(), pose(-angle, None)),
            ]),
            fields: vec![("FrameNumber".to_owned(), i.to_string())],
        }
    };
    Sequence {
        size: [5, 4],
        spacing: [0.1, 1.0 / 3.0],
        orientation: Some("MFA".to_owned()),
        pixels: Voxels::U16((0..60).map(|i| i * 1000).collect()),
        frames: (0..3).map(frame).collect(),
        fields: vec![("UltrasoundImageType".to_owned(), "BRIGHTNESS".to_owned())],
    }
}

#[test]
fn sequences_read_back_equal() {
    let folder = Folder::new();
    let path = folder.0.path().join("a.igs.mha");
    let mut sequence = sequence();
    for pixels in [
        sequence.pixels.clone(),
        Voxels::U8((0..60).collect()),
        Voxels::I8((-30..30).collect()),
        Voxels::I16((0..60).map(|i| 500 * (i - 30)).collect()),
        Voxels::F32((0..60).map(|i| 1.0 / i as f32).collect()),
    ] {
        sequence.pixels = pixels;
        sequence.write(&path).expect("written");
        let (read, _) = Sequence::load(&path).expect("readable");
        assert_eq!(read, sequence);
        let path = folder.0.path().join("a.seq.nrrd");
        sequence.write(&path).expect("written");
        let (read, _) = Sequence::load(&path).expect("readable");
        assert_eq!(read, sequence);
        let summary = Summary::read(&path).expect("readable").expect("a sequence");
        assert_eq!((summary.frames, summary.poses["ProbeToTracker"]), (3, [3, 1]));
    }
    // The comparison notices the last bit of one number of one pose.
    let mut planted = sequence.clone();
    let pose = planted.frames[2].poses.get_mut("ProbeToTracker");
    let x = &mut pose.expect("a pose").transform.translation.x;
    *x = x.next_up();
    assert_ne!(planted, sequence);
    let summary = Summary::read(&path).expect("readable").expect("a sequence");
    assert_eq!(summary.frames, 3);
    assert_eq!(summary.poses["ProbeToTracker"], [3, 1]);
    assert_eq!(summary.poses["ReferenceToTracker"], [3, 3]);

    let error = sequence.write(&folder.0.path().join("a.nhdr"));
    assert!(error.expect_err("two files").message.contains("only MetaImage and NRRD"));
    let error = sequence.write(&folder.0.path().join("none/a.mha"));
    assert!(error.expect_err("no folder").message.contains("cannot be written"));
}

/// The one that is written is so, and what PLUS and 3D Slicer make otherwise is read too.
#[test]
fn lists_of_planes_are_sequences_and_other_lists_are_not() {
    let folder = Folder::new();
    let path = folder.0.path().join("a.nrrd");
    let mut sequence = sequence();
    sequence.pixels = Voxels::U8((0..60).collect());
    let pose = Pose::ok(DAffine3::from_mat3_translation(
        DMat3::from_cols(DVec3::X * 0.3, DVec3::Z * 0.3, DVec3::NEG_Y * 0.3),
        DVec3::new(-7.0, 0.0, 1.5),
    ));
    for frame in &mut sequence.frames {
        frame.poses.insert("ImageToProbe".to_owned(), pose.clone());
    }
    sequence.write(&path).expect("written");
    let whole = std::fs::read(&path).expect("readable");
    let end = whole.windows(2).position(|w| w == b"\n\n").expect("a header") + 2;
    let header = std::str::from_utf8(&whole[..end]).expect("text").to_owned();
    let (written, _) = Sequence::load(&path).expect("readable");
    assert_eq!((&written.frames, &written.pixels), (&sequence.frames, &sequence.pixels));
    // The plane lies in the frame of the probe, and has its size there.
    assert_eq!(written.spacing, [0.3; 2]);
    let directions = "space directions: (0.3,0,0) (0,0,0.3) (0,-0.3,0) none";
    assert!(header.contains(directions) && header.contains("space origin: (-7,0,1.5)"), "{header}");
    // Two axes and a list, without a space: PLUS.
    let plain = |text: &str| {
        text.replace("dimension: 4", "dimension: 3")
            .replace("sizes: 5 4 1 3", "sizes: 5 4 3")
            .replace("kinds: domain domain domain list", "kinds: domain domain list")
            .replace("labels: \"\" \"\" \"\" \"time\"\nunits: \"\" \"\" \"\" \"s\"\n", "")
            .replace("space: right-anterior-superior", "space dimension: 2")
            .replace(directions, "space directions: (1,0) (0,1) none")
            .replace("space origin: (-7,0,1.5)", "space origin: (0,0)")
    };
    let load = |text: String| {
        let path = folder.write("b.nrrd", &[text.as_bytes(), &whole[end..]].concat());
        Sequence::load(&path).map(|(read, _)| read)
    };
    let read = load(plain(&header)).expect("readable");
    assert_eq!((&read.frames, &read.pixels), (&sequence.frames, &sequence.pixels));
    for (from, to, cause) in [
        ("5 4 1 3", "5 2 2 3", "each frame is a volume"),
        ("5 4 1 3", "5 2 6 1", "each frame is a volume"),
        ("5 4 1 3", "5 4 1 2", "there are 2 frames"),
        ("5 4 1 3", "5 4 1 4", "is cut off"),
        ("5 4 1 3", "5 4 1 18446744073709551615", "are more than"),
        ("Frame0002_Time", "Frame_Time", "names no frame"),
    ] {
        assert!(header.contains(from), "{from}");
        let error = load(header.replacen(from, to, 1)).expect_err(cause);
        assert!(error.to_string().contains(cause), "{error}, not {cause}");
    }
    let solid = header.replace("5 4 1 3", "5 4 3 1").replace("domain list", "domain ???");
    let error = load(solid).expect_err("no list").to_string();
    assert!(error.contains("is a volume, not a sequence"), "{error}");
    // The last eight bytes are a sum and a length.
    for len in (0..whole.len() - 8).step_by(7) {
        let cut = folder.write("c.nrrd", &whole[..len]);
        assert!(Sequence::load(&cut).is_err(), "cut at {len}");
    }
    for at in (0..whole.len()).step_by(3) {
        let mut bad = whole.clone();
        bad[at] ^= 0x15;
        let path = folder.write("d.nrrd", &bad);
        let _ = (Sequence::load(&path), Summary::read(&path), track(&path), Volume::load(&path));
    }
}

/// 3D Slicer stops at the first line of more than 1000 characters, and shows frames of one time as one.
#[test]
fn times_of_frames_stay_apart_and_follow_the_poses() {
    let folder = Folder::new();
    let path = folder.0.path().join("a.nrrd");
    let mut sequence = sequence();
    let values = |sequence: &Sequence| {
        sequence.write(&path).expect("written");
        let whole = String::from_utf8_lossy(&std::fs::read(&path).expect("readable")).into_owned();
        let lines: Vec<_> = whole.lines().take_while(|line| !line.is_empty()).collect();
        let last = lines.last().expect("a line");
        last.strip_prefix("axis 3 index values:=").map(str::to_owned)
    };
    assert_eq!(values(&sequence).as_deref(), Some("0.333 1.333 2.333"));
    sequence.frames[1].timestamp = Some(1.0 / 3.0 + 1e-5);
    assert_eq!(values(&sequence).expect("times").split(' ').nth(1), Some("0.3333433333333333"));
    sequence.frames[2].timestamp = None;
    assert_eq!(values(&sequence), None);
}

#[test]
fn volumes_read_back_equal() {
    let folder = Folder::new();
    let file = nrrd("LPS", DVec3::ONE, RAW, &bytes(false));
    let (volume, _) = folder.load("a.nrrd", &file).expect("readable");
    let path = folder.0.path().join("b.mha");
    write_meta(&path, &volume).expect("written");
    let (read, warnings) = Volume::load(&path).expect("readable");
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_eq!((read.size, &read.voxels), (volume.size, &volume.voxels));
    // Steps are written as length times direction: a rounding of 64-bit numbers of 2 mm.
    let (a, b) = (read.world_from_voxel, volume.world_from_voxel);
    assert!(a.abs_diff_eq(b, 1e-15), "{a:?} {b:?}");
    assert_eq!(a.translation, b.translation);
}

#[test]
fn planted_mistakes_in_frames_name_line_and_cause() {
    let folder = Folder::new();
    let path = folder.0.path().join("a.mha");
    sequence().write(&path).expect("written");
    let whole = std::fs::read(&path).expect("readable");
    let end = whole.windows(6).position(|w| w == b"LOCAL\n").expect("a header") + 6;
    let header = std::str::from_utf8(&whole[..end]).expect("text");
    let refused = |from: &str, to: &str, cause: &str, at_line: bool| {
        assert!(header.contains(from), "{from}");
        let changed = header.replacen(from, to, 1);
        let bad = [changed.as_bytes(), &whole[end..]].concat();
        let error = Sequence::load(&folder.write("b.mha", &bad)).expect_err(cause);
        assert!(error.to_string().contains(cause), "{error}");
        let line = from.lines().last().expect("a line");
        let line = header.lines().position(|l| l.contains(line)).map(|l| Place::Line(l + 1));
        assert!(!at_line || Some(error.place) == line, "{error}");
    };
    for (to, cause) in [
        ("0 0 0\n", "does not have 16 numbers"),
        ("0 0 1 1\n", "no affine transform"),
        ("0 0 0 x\n", "no list of numbers"),
        ("0 0 nan 1\n", "is not finite"),
    ] {
        let pose = header.lines().position(|l| l.ends_with("0 0 0 1") && l.contains("Probe"));
        let line = header.lines().nth(pose.expect("a pose")).expect("a line");
        let from = format!("{line}\n");
        let to = from.replacen("0 0 0 1\n", to, 1);
        refused(&from, &to, cause, true);
    }
    for (from, to, cause) in [
        ("Frame0002_Time", "Frame0003_Time", "there are 3 frames"),
        ("Frame0002_Time", "Frame2000000000000000000_Time", "there are 3 frames"),
        ("Frame0002_Time", "Frame_Time", "names no frame"),
        ("Frame0002_Timestamp = ", "Frame0002_Timestamp = nan", "no number that fits"),
    ] {
        refused(from, to, cause, true);
    }
    refused("domain list", "domain domain", "of space", true);
    for (size, cause) in [
        ("5 4 18446744073709551615", "are more than 4 GB"),
        ("5 4 4", "is cut off"),
        ("0 0 3", "holds no voxels"),
    ] {
        refused("5 4 3", size, cause, false);
    }
    for len in (0..whole.len()).step_by(7) {
        let cut = folder.write("c.mha", &whole[..len]);
        assert!(Sequence::load(&cut).is_err(), "cut at {len}");
    }
    for at in (0..whole.len()).step_by(3) {
        let mut bad = whole.clone();
        bad[at] ^= 0x15;
        let _ = Sequence::load(&folder.write("d.mha", &bad));
    }
}
