//! Volumes over time: places of their values in each format, and the time between them.

use super::*;

/// Value of a voxel at a time.
fn value([i, j, k]: [usize; 3], time: usize) -> i16 {
    (1000 * time + 100 * k + 10 * j + i) as i16 - 1500
}

/// The values of one time, first axis fastest.
fn at(time: usize) -> Vec<i16> {
    let places = (0..24).map(|n| [n % 4, n / 4 % 3, n / 12]);
    places.map(|p| value(p, time)).collect()
}

/// Values of three times in a file whose axes follow in this order: `x`, `y`, `z`, `t`, and `c` for a
/// second value of each voxel.
fn series(order: &str, big: bool) -> Vec<u8> {
    let size = |axis| match axis {
        'x' => 4,
        'y' | 't' => 3,
        _ => 2,
    };
    let count: usize = order.chars().map(size).product();
    let mut out = Vec::new();
    for n in 0..count {
        let mut rest = n;
        let (mut place, mut time, mut channel) = ([0; 3], 0, 0);
        for axis in order.chars() {
            let at = rest % size(axis);
            rest /= size(axis);
            match axis {
                't' => time = at,
                'c' => channel = at,
                _ => place["xyz".find(axis).expect("of space")] = at,
            }
        }
        let value = value(place, time) + 7 * channel as i16;
        out.extend(if big { value.to_be_bytes() } else { value.to_le_bytes() });
    }
    out
}

/// The fault of a volume that should be the three of these tests.
fn wrong(volume: &Volume, interval: Option<f64>) -> Option<String> {
    let size = (volume.size, volume.volumes().count());
    if size != (SIZE, 3) {
        return Some(format!("{size:?}"));
    }
    for (time, voxels) in volume.volumes().enumerate() {
        if *voxels != Voxels::I16(at(time)) {
            return Some(format!("time {time}: {voxels:?}"));
        }
    }
    let range = (volume.statistics.min, volume.statistics.max);
    if range != (-1500.0, 2000.0 + 100.0 + 20.0 + 3.0 - 1500.0) {
        return Some(format!("{range:?}"));
    }
    (volume.interval != interval).then(|| format!("{:?}", volume.interval))
}

fn nifti_4d(big: bool, pace: f32, units: u8) -> Vec<u8> {
    let mut out = nifti(big, true);
    out.truncate(352);
    let mut put = |at: usize, mut bytes: Vec<u8>| {
        if big {
            bytes.reverse();
        }
        out[at..at + bytes.len()].copy_from_slice(&bytes);
    };
    for (i, d) in [4i16, 4, 3, 2, 3].iter().enumerate() {
        put(40 + 2 * i, d.to_le_bytes().to_vec());
    }
    put(92, pace.to_le_bytes().to_vec());
    out[123] = units;
    out.extend(series("xyzt", big));
    out
}

fn meta_4d(spacing: &str, more: &str, data: &[u8]) -> Vec<u8> {
    let mut out = format!(
        "ObjectType = Image\nNDims = 4\nDimSize = 4 3 2 3\nElementSpacing = 0.5 1.25 2 {spacing}\n\
         ElementType = MET_SHORT\n{more}\n"
    )
    .into_bytes();
    out.extend(data);
    out
}

fn nrrd_4d(sizes: &str, more: &str, data: &[u8]) -> Vec<u8> {
    let n = sizes.split(' ').count();
    let mut out = format!(
        "NRRD0005\ntype: short\ndimension: {n}\nspace: LPS\nsizes: {sizes}\nencoding: raw\n{more}\n\n"
    )
    .into_bytes();
    out.extend(data);
    out
}

#[test]
fn every_format_holds_the_same_volumes_over_time() {
    let folder = Folder::new();
    let same = |name: &str, bytes: &[u8], interval: Option<f64>| {
        let (volume, warnings) = folder.load(name, bytes).expect(name);
        assert_eq!(wrong(&volume, interval), None, "{name}");
        warnings
    };
    for big in [false, true] {
        for (pace, units, interval) in [
            (0.05, 2 | 8, Some(0.05)),
            (50.0, 2 | 16, Some(0.05)),
            (50_000.0, 2 | 24, Some(0.05)),
            (0.0, 2 | 8, None),
            // A frequency is no time.
            (50.0, 2 | 32, None),
        ] {
            let file = nifti_4d(big, pace, units);
            assert!(same("a.nii", &file, interval).is_empty());
            assert!(same("a.nii.gz", &gzip(&file), interval).is_empty());
        }
        let assumed = same("a.nii", &nifti_4d(big, 2.0, 2), Some(2.0));
        assert!(assumed[0].message.contains("seconds are assumed"));

        let order = if big { BIG } else { LOCAL };
        let data = series("xyzt", big);
        assert!(same("a.mha", &meta_4d("0.05", order, &data), Some(0.05)).is_empty());
    }
    let packed = zlib(&series("xyzt", false));
    same("z.mha", &meta_4d("0.05", ZLIB, &packed), Some(0.05));

    // Without spacings a MetaImage has no interval.
    let bare = String::from_utf8(meta_4d("1", LOCAL, b"")).expect("text");
    let bare = bare.replacen("ElementSpacing = 0.5 1.25 2 1\n", "", 1);
    let bare = [bare.into_bytes(), series("xyzt", false)].concat();
    same("b.mha", &bare, None);
}

/// Time as the fourth dimension of the space, as SimpleITK writes it.
#[test]
fn a_space_of_four_dimensions_has_time() {
    let folder = Folder::new();
    let file = |space: &str, sizes: &str, directions: &str, order: &str| {
        let text = format!(
            "NRRD0004\ntype: short\ndimension: 4\n{space}\nsizes: {sizes}\nspace directions: {directions}\n\
             kinds: domain domain domain domain\nendian: little\nencoding: raw\nspace origin: (1,2,3,0)\n\n"
        );
        [text.into_bytes(), series(order, false)].concat()
    };
    let (still, ms) =
        ("(0.5,0,0,0) (0,1.25,0,0) (0,0,2,0)", "space units: \"mm\" \"mm\" \"mm\" \"ms\"");
    for (space, sizes, directions, order, stated) in [
        (
            "space dimension: 4".to_owned(),
            "4 3 2 3",
            format!("{still} (0,0,0,0.05)"),
            "xyzt",
            false,
        ),
        (
            "space: left-posterior-superior-time".to_owned(),
            "4 3 2 3",
            format!("{still} (0,0,0,0.05)"),
            "xyzt",
            true,
        ),
        (format!("space: LPST\n{ms}"), "4 3 2 3", format!("{still} (0,0,0,50)"), "xyzt", true),
        (
            format!("space: scanner-xyz-time\n{ms}"),
            "3 4 3 2",
            format!("(0,0,0,50) {still}"),
            "txyz",
            false,
        ),
    ] {
        let (volume, warnings) =
            folder.load("a.nrrd", &file(&space, sizes, &directions, order)).expect(&space);
        assert_eq!(wrong(&volume, Some(0.05)), None, "{space}");
        assert_eq!(volume.spacing(), DVec3::new(0.5, 1.25, 2.0), "{space}");
        assert_eq!(volume.world_from_voxel.translation, DVec3::new(1.0, 2.0, 3.0), "{space}");
        assert_eq!(warnings.is_empty(), stated, "{warnings:?}");
    }
    let mixed =
        file("space: LPST", "4 3 2 3", "(0.5,0,0,1) (0,1.25,0,0) (0,0,2,0) (0,0,0,1)", "xyzt");
    folder.refused("m.nrrd", &mixed, "an axis lies in space and in time");
    let backwards = file("space: LPST", "4 3 2 3", &format!("{still} (0,0,0,-1)"), "xyzt");
    folder.refused("b.nrrd", &backwards, "a finite number above zero");
    let five = file("space: LPST", "4 3 2 3", &format!("{still} (0,0,0,0,1)"), "xyzt");
    folder.refused("f.nrrd", &five, "is no list of vectors");
}

/// NRRD's axes come in any order; axes outside space are known by their kind, or by their place.
#[test]
fn the_axis_of_time_may_stand_anywhere() {
    let folder = Folder::new();
    let (d, none) = ("domain", "???");
    for (order, sizes, kinds, spacings, units) in [
        ("xyzt", "4 3 2 3", [d, d, d, "time"], "1 1 1 0.05", ""),
        ("xyzt", "4 3 2 3", [d, d, d, "list"], "1 1 1 50", "ms"),
        ("xyzt", "4 3 2 3", [d, d, d, d], "1 1 1 50000", "us"),
        ("xyzt", "4 3 2 3", [d, d, d, none], "1 1 1 nan", ""),
        ("txyz", "3 4 3 2", ["list", d, d, d], "50 1 1 1", "ms"),
        ("xtyz", "4 3 3 2", [d, "time", d, d], "1 0.05 1 1", "s"),
        ("xytz", "4 3 3 2", ["space", d, "Time", d], "1 1 0.05 1", ""),
    ] {
        for big in [false, true] {
            let time = order.find('t').expect("it has one");
            let unit = |axis| if axis == time { units } else { "mm" };
            let units: Vec<_> = (0..4).map(|a| format!("{:?}", unit(a))).collect();
            let more = format!(
                "endian: {}\nkinds: {}\nspacings: {spacings}\nunits: {}",
                if big { "big" } else { "little" },
                kinds.join(" "),
                units.join(" ")
            );
            let file = nrrd_4d(sizes, &more, &series(order, big));
            let (volume, warnings) = folder.load("a.nrrd", &file).expect(order);
            let interval = (!spacings.contains("nan")).then_some(0.05);
            assert_eq!(wrong(&volume, interval), None, "{order} {kinds:?}");
            assert_eq!(volume.spacing(), DVec3::ONE);
            assert!(warnings.is_empty(), "{warnings:?}");
            // The comparison sees another order.
            let planted = nrrd_4d(sizes, &more, &series("tzyx", big));
            let (planted, _) = folder.load("a.nrrd", &planted).expect(order);
            assert!(wrong(&planted, interval).is_some());
        }
    }
    // Directions show the axes of space; values of a voxel beside them are no volumes over time.
    let directions = "none (0.5,0,0) (0,1.25,0) (0,0,2) none";
    let more = format!(
        "endian: little\nkinds: vector domain domain domain list\nspace directions: {directions}\n\
         spacings: nan nan nan nan 0.05"
    );
    let file = nrrd_4d("2 4 3 2 3", &more, &series("cxyzt", false));
    let (volume, warnings) = folder.load("a.nrrd", &file).expect("readable");
    assert_eq!(wrong(&volume, Some(0.05)), None);
    assert_eq!(volume.spacing(), SPACING);
    assert!(warnings[0].message.contains("2 values per voxel"));
    // The same in the fifth axis of NIfTI, behind time.
    let mut file = nifti_4d(false, 0.05, 10);
    file[40..42].copy_from_slice(&5i16.to_le_bytes());
    file[50..52].copy_from_slice(&2i16.to_le_bytes());
    file.truncate(352);
    file.extend(series("xyztc", false));
    let (volume, warnings) = folder.load("a.nii", &file).expect("readable");
    assert_eq!(wrong(&volume, Some(0.05)), None);
    assert!(warnings[0].message.contains("2 values per voxel"));
}

#[test]
fn planted_mistakes_in_time_are_refused() {
    let folder = Folder::new();
    for (pace, cause) in [
        (f32::NAN, "pixdim[4] is NaN"),
        (f32::INFINITY, "pixdim[4] is inf"),
        (-0.05, "pixdim[4] is -0.05"),
    ] {
        let error = folder.refused("a.nii", &nifti_4d(false, pace, 10), cause);
        assert_eq!(error.place, Place::Byte(92));
        // For a single volume it has no meaning.
        let mut single = nifti(false, true);
        single[92..96].copy_from_slice(&pace.to_le_bytes());
        folder.load("b.nii", &single).expect("one volume");
    }
    for (size, cause) in
        [(-3i16, "dim[4] is -3"), (0, "dim[4] is 0"), (4, "is cut off"), (i16::MAX, "is cut off")]
    {
        for packed in [false, true] {
            let mut file = nifti_4d(false, 0.05, 10);
            file[48..50].copy_from_slice(&size.to_le_bytes());
            match packed {
                true => folder.refused("a.nii.gz", &gzip(&file), cause),
                false => folder.refused("a.nii", &file, cause),
            };
        }
    }
    // Seven axes of the largest sizes in 16 bits.
    let mut file = nifti_4d(false, 0.05, 10);
    for axis in 0..8 {
        let size = if axis == 0 { 7 } else { i16::MAX };
        file[40 + 2 * axis..42 + 2 * axis].copy_from_slice(&size.to_le_bytes());
    }
    folder.refused("a.nii", &file, "are more than 4 GB");
    let data = series("xyzt", false);
    for spacing in ["0", "-1", "NaN", "inf"] {
        let error = folder.refused("a.mha", &meta_4d(spacing, LOCAL, &data), "above zero");
        assert_eq!(error.place, Place::Line(4));
    }
    let times = |count: &str| {
        let text = String::from_utf8(meta_4d("1", LOCAL, b"")).expect("text");
        let text = text.replacen("4 3 2 3", &format!("4 3 2 {count}"), 1);
        [text.into_bytes(), data.clone()].concat()
    };
    folder.refused("a.mha", &times("0"), "holds no voxels");
    folder.refused("a.mha", &times("-3"), "no number that fits");
    folder.refused("a.mha", &times("60000"), "is cut off");
    let huge = u64::MAX.to_string();
    folder.refused("a.mha", &times(&huge), "over time are more than 65536");
    // Volumes of a byte would each take many more: of four billion in a file of some bytes none is read.
    let mut encoder = bzip2::write::BzEncoder::new(Vec::new(), bzip2::Compression::best());
    encoder.write_all(&vec![0; 1 << 20]).expect("memory");
    let tiny = nrrd_4d("1 1 1 4000000000", "", &encoder.finish().expect("memory"));
    let at = tiny.windows(3).position(|w| w == b"raw").expect("an encoding");
    let tiny = [&tiny[..at], b"bzip2", &tiny[at + 3..]].concat();
    let at = tiny.windows(5).position(|w| w == b"short").expect("a type");
    let tiny = [&tiny[..at], b"uint8", &tiny[at + 5..]].concat();
    folder.refused("t.nrrd", &tiny, "4000000000 volumes over time are more than 65536");
    let nrrd = |spacing: &str, unit: &str| {
        let more = format!(
            "endian: little\nkinds: domain domain domain time\nspacings: 1 1 1 {spacing}\n\
             units: \"mm\" \"mm\" \"mm\" \"{unit}\""
        );
        nrrd_4d("4 3 2 3", &more, &data)
    };
    for spacing in ["0", "-1", "inf"] {
        let error = folder.refused("a.nrrd", &nrrd(spacing, "s"), "time between volumes");
        assert_eq!(error.place, Place::Line(9));
    }
    let error = folder.refused("a.nrrd", &nrrd("1", "Hz"), "a unit of time");
    assert_eq!(error.place, Place::Line(10));
    // Cut anywhere, the file is refused; with any byte changed it is read or refused.
    for (name, whole) in [
        ("c.nii", nifti_4d(true, 0.05, 10)),
        ("c.mha", meta_4d("0.05", LOCAL, &data)),
        ("c.nrrd", nrrd("0.05", "s")),
    ] {
        for len in 0..whole.len() {
            assert!(folder.load(name, &whole[..len]).is_err(), "{name} at {len}");
        }
        for at in 0..whole.len() {
            for flip in [0x01, 0x80, 0xff] {
                let mut bad = whole.clone();
                bad[at] ^= flip;
                let _ = folder.load(name, &bad);
            }
        }
    }
}

/// Eight bits become four bytes where values are scaled: 2 GB of them are refused before anything is
/// read.
#[test]
fn memory_that_a_series_would_need_counts_too() {
    let folder = Folder::new();
    let mut file = nifti_4d(false, 0.05, 10);
    for (at, value) in [(42, 1024i16), (44, 1024), (46, 100), (48, 20), (70, 2), (72, 8)] {
        file[at..at + 2].copy_from_slice(&value.to_le_bytes());
    }
    folder.refused("a.nii", &file, "is cut off");
    file[112..116].copy_from_slice(&0.5f32.to_le_bytes());
    folder.refused("a.nii", &file, "are more than 4 GB");
}

#[test]
fn files_of_one_volume_each_make_a_series() {
    let folder = Folder::new();
    let bytes =
        |time: usize| -> Vec<u8> { at(time).into_iter().flat_map(i16::to_le_bytes).collect() };
    let file = |time: usize| {
        let more = format!("Strange = {time}\n{LOCAL}");
        folder.write(&format!("t{time}.mha"), &meta(&more, &bytes(time)))
    };
    let files: Vec<_> = (0..3).map(file).collect();
    let load = |more: PathBuf| Volume::load_series(&[files[0].clone(), files[1].clone(), more]);
    let (volume, warnings) = load(files[2].clone()).expect("a series");
    assert_eq!(wrong(&volume, None), None);
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    let (one, _) = Volume::load_series(&files[..1]).expect("a volume");
    assert!(one.later.is_empty());

    let header = String::from_utf8(meta(LOCAL, b"")).expect("text");
    let changed = |from: &str, to: &str, data: &[u8]| {
        let text = header.replacen(from, to, 1);
        let name = format!("{}.mha", std::fs::read_dir(folder.0.path()).expect("a folder").count());
        folder.write(&name, &[text.as_bytes(), data].concat())
    };
    let direction = direction().to_cols_array()[0].to_string();
    for (path, cause) in [
        (changed("4 3 2", "4 2 3", &bytes(2)), "has 4 x 2 x 3 voxels, not 4 x 3 x 2 as in"),
        (
            changed("MET_SHORT", "MET_USHORT", &bytes(2)),
            "16-bit unsigned integer, not 16-bit signed",
        ),
        (changed("Offset = -12.5", "Offset = -12.4", &bytes(2)), "voxels from where it does in"),
        (changed("0.5 1.25 2", "0.5 1.25 2.1", &bytes(2)), "up to 0.05 voxels"),
        (changed(&direction, "0.9", &bytes(2)), "voxels from where"),
        (folder.write("four.mha", &meta_4d("1", LOCAL, &series("xyzt", false))), "holds 3 volumes"),
        (changed("", "", &bytes(2)[..40]), "is cut off"),
    ] {
        let (number, error) = load(path.clone()).expect_err(cause);
        assert_eq!((number, &error.file), (2, &path));
        assert!(error.to_string().contains(cause), "{error}");
        assert!(!error.remedy.is_empty());
    }
    // A hundredth of a voxel is the rounding of files.
    let (volume, _) = load(changed("-12.5", "-12.501", &bytes(2))).expect("the same grid");
    assert_eq!(wrong(&volume, None), None);
    // More than fit into 4 GB are refused by the first: the others are not even looked for.
    let large = nrrd("LPS", DVec3::ONE, RAW, &vec![0; 2 * 64 * 64 * 16]);
    let at = large.windows(5).position(|w| w == b"4 3 2").expect("sizes");
    let large = [&large[..at], b"64 64 16", &large[at + 5..]].concat();
    let mut many = vec![folder.write("large.nrrd", &large)];
    many.resize(40_000, folder.0.path().join("none.nrrd"));
    let (number, error) = Volume::load_series(&many).expect_err("too large");
    assert_eq!(number, 0);
    let cause = "40000 volumes of 0.1 MB are more than 4 GB";
    assert!(error.to_string().contains(cause), "{error}");
}

#[test]
fn volumes_over_time_read_back_equal() {
    let folder = Folder::new();
    let (volume, _) = folder.load("a.nii", &nifti_4d(false, 0.05, 10)).expect("readable");
    let path = folder.0.path().join("b.mha");
    write_meta(&path, &volume).expect("written");
    let (read, warnings) = Volume::load(&path).expect("readable");
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_eq!(wrong(&read, Some(0.05)), None);
    let (a, b) = (read.world_from_voxel, volume.world_from_voxel);
    assert!(a.abs_diff_eq(b, 1e-14), "{a:?} {b:?}");
    let text = read.to_string();
    assert!(text.contains("3 volumes over time, one every 0.05 s"), "{text}");
    assert!(text.contains("values -1500 to 623"), "{text}");
}
