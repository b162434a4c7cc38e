//! DICOM segmentations.

use glam::DVec3;
use insonify::import::LabelMap;

use crate::common::program::insonify;

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

fn short(tag: (u16, u16), value: u16) -> Vec<u8> {
    element(tag, "US", &value.to_le_bytes())
}

/// A file of segments 1 and 7: class, size of its planes, bits of a pixel and what says their kind, frames, pixels.
fn file(
    class: &str,
    size: [usize; 3],
    (bits, about): (u16, Vec<u8>),
    frames: &[Vec<u8>],
    pixels: &[u8],
) -> Vec<u8> {
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
        element((0x0008, 0x0016), "UI", class.as_bytes()),
        element((0x0028, 0x0008), "IS", frames.len().to_string().as_bytes()),
        short((0x0028, 0x0010), size[1] as u16),
        short((0x0028, 0x0011), size[0] as u16),
        short((0x0028, 0x0100), bits),
        about,
        items((0x0062, 0x0002), &segments),
        items((0x5200, 0x9229), &[shared]),
        items((0x5200, 0x9230), frames),
        element((0x7fe0, 0x0010), "OB", pixels),
    ];
    [vec![0; 128], b"DICM".to_vec(), meta, root.concat()].concat()
}

/// The position of plane `k`, as a frame has it.
fn position(k: usize) -> Vec<u8> {
    let position = format!("-10\\20\\{}", 100.0 + 2.5 * k as f64);
    items((0x0020, 0x9113), &[element((0x0020, 0x0032), "DS", position.as_bytes())])
}

/// How pixels of a segmentation say that they belong to their segment.
#[derive(Clone, Copy)]
enum Pixels {
    Bits,
    /// Bytes: what is inside, what is outside; what the file calls a whole pixel, if it does.
    Shares {
        inside: u8,
        outside: u8,
        most: Option<u16>,
    },
}

/// Two balls as segments 1 and 7 in planes 2.5 mm apart, frames only where there are pixels.
fn segmentation(
    size: [usize; 3],
    pixels: Pixels,
    inside: impl Fn(usize, DVec3) -> bool,
) -> Vec<u8> {
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
            let of = items((0x0062, 0x000a), &[short((0x0062, 0x000b), number)]);
            frames.push([position(k), of].concat());
        }
    }
    let packed: Vec<u8> = match pixels {
        Pixels::Bits => bits
            .chunks(8)
            .map(|bits| bits.iter().enumerate().map(|(n, bit)| u8::from(*bit) << n).sum())
            .collect(),
        Pixels::Shares { inside, outside, .. } => {
            bits.iter().map(|bit| if *bit { inside } else { outside }).collect()
        }
    };
    let (kind, most, each) = match pixels {
        Pixels::Bits => ("BINARY", None, 1),
        Pixels::Shares { most, .. } => ("FRACTIONAL", most, 8),
    };
    let most = most.map_or_else(Vec::new, |most| short((0x0062, 0x000e), most));
    let about = [element((0x0062, 0x0001), "CS", kind.as_bytes()), most].concat();
    file("1.2.840.10008.5.1.4.1.1.66.4", size, (each, about), &frames, &packed)
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
    let bytes = segmentation(size, Pixels::Bits, inside);
    std::fs::write(folder.join("s.dcm"), &bytes).expect("written");
    let map = LabelMap::load(&folder.join("s.dcm")).expect("a segmentation");
    assert_eq!(map.layers.len(), 2, "they overlap");
    let merged = map.merged(&[20, 30], &mut |_, _, _| ()).expect("layers");
    let (grid, covered) = (merged.grid, merged.covered);
    assert_eq!((covered.len(), covered[0].label, covered[0].by), (1, 0, 1));
    assert!((0.01..0.2).contains(&covered[0].share), "{covered:?}");
    // Empty planes at either end are not in the file.
    assert_eq!(&grid.size[..2], &size[..2]);
    let first = grid.world_from_voxel.transform_point3(DVec3::ZERO);
    let offset = ((first.z - 100.0) / 2.5).round();
    assert!(first.distance(DVec3::new(-10.0, 20.0, 100.0 + 2.5 * offset)) < 1e-9, "{first}");
    assert!(grid.spacing().distance(DVec3::new(1.5, 2.0, 2.5)) < 1e-9);
    for (at, &label) in grid.voxels.iter().enumerate() {
        let [x, y, _] = grid.size;
        let p = DVec3::new((at % x) as f64, (at / x % y) as f64, (at / (x * y)) as f64 + offset);
        // Where they overlap the higher priority counts.
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
    let (passed, said) = insonify(folder, &["check", "s.dcm"]);
    assert!(passed && said.contains("in 2 layers, 2 segments: Big one, "), "{said}");
    assert!(said.contains("0 errors, 0 warnings"), "{said}");
    // Cut anywhere it is an error, and no panic.
    for end in (132..bytes.len()).step_by(97) {
        std::fs::write(folder.join("cut.dcm"), &bytes[..end]).expect("written");
        let found = LabelMap::load(&folder.join("cut.dcm"));
        assert!(found.is_err(), "cut at {end}");
    }
}

/// Half of what the file calls a whole pixel decides, whatever that is.
#[test]
fn shares_count_from_half_of_a_whole_pixel_on() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let file = folder.path().join("s.dcm");
    let inside = |segment: usize, p: DVec3| {
        let middle = DVec3::new(if segment == 0 { 8.0 } else { 22.0 }, 8.0, 6.0);
        (p - middle).length() < 4.5
    };
    let count = |pixels: Pixels| {
        std::fs::write(&file, segmentation([30, 16, 12], pixels, inside)).expect("written");
        let map = LabelMap::load(&file).map_err(|error| error.to_string())?;
        let voxels = |label: u8| map.layers.iter().flatten().filter(|v| **v == label).count();
        Ok::<_, String>([voxels(1), voxels(2)])
    };
    let whole = count(Pixels::Bits).expect("bits");
    assert!(whole[0] > 300 && whole[0] == whole[1], "{whole:?}");
    let shares = |inside, outside, most| Pixels::Shares { inside, outside, most };
    for (inside, outside, most) in [
        (255, 0, Some(255)),
        (100, 0, Some(100)),
        (60, 49, Some(100)),
        (33, 23, Some(48)),
        (110, 99, Some(200)),
        (80, 79, Some(160)),
        (1, 0, Some(1)),
        // Where it does not say it: bits in bytes, or shares of 255.
        (1, 0, None),
        (200, 127, None),
    ] {
        let found = count(shares(inside, outside, most));
        assert_eq!(found, Ok(whole), "{inside}, {outside} of {most:?}");
    }
    // Below half everywhere nothing is there, and that is an error, whose remedy has the numbers of the file.
    let import = |pixels: Pixels| {
        std::fs::write(&file, segmentation([30, 16, 12], pixels, inside)).expect("written");
        insonify(folder.path(), &["import", "s.dcm", "-o", "out"])
    };
    for (largest, most, parts) in [
        (49, Some(100), ["49 at most, and count from 50 on", "half of 100"]),
        (1, Some(255), ["1 at most, and count from 128 on", "(0062,000E) to 1"]),
        (9, None, ["9 at most, and count from 128 on", "has no MaximumFractionalValue"]),
        (0, Some(255), ["has a pixel: all are 0", "drawn in it"]),
    ] {
        let (done, said) = import(shares(largest, 0, most));
        assert!(!done && parts.iter().all(|part| said.contains(part)), "{said}");
    }
}

/// The pixels of a label map are the numbers of its segments.
#[test]
fn label_maps_have_the_names_of_their_segments() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let size = [30, 24, 16];
    let number = |at: usize, k: usize| {
        let p = DVec3::new((at % size[0]) as f64, (at / size[0]) as f64, k as f64);
        let within = |middle: DVec3, radius: f64| (p - middle).length() < radius;
        match within(DVec3::new(12.0, 12.0, 7.0), 3.0) {
            true => 7u16,
            false => u16::from(within(DVec3::new(14.0, 12.0, 8.0), 7.0)),
        }
    };
    let planes: Vec<u16> =
        (0..size[2]).flat_map(|k| (0..size[0] * size[1]).map(move |at| number(at, k))).collect();
    let frames: Vec<_> = (0..size[2]).map(position).collect();
    let bytes: Vec<u8> = planes.iter().map(|n| *n as u8).collect();
    let words: Vec<u8> = planes.iter().flat_map(|n| n.to_le_bytes()).collect();
    let mut wrong = bytes.clone();
    wrong[500] = 3;
    let kind = || element((0x0062, 0x0001), "CS", b"LABELMAP");
    let class = "1.2.840.10008.5.1.4.1.1.66.7";
    for (name, bits, pixels) in [("a.dcm", 8, &bytes), ("b.dcm", 16, &words)] {
        let whole = file(class, size, (bits, kind()), &frames, pixels);
        std::fs::write(folder.path().join(name), whole).expect("written");
        let (done, said) = insonify(folder.path(), &["import", name, "-o", "out", "--force"]);
        let named = said.contains("Big one: liver,") && said.contains("Neoplasm: tumour,");
        assert!(done && named, "{said}");
    }
    std::fs::write(folder.path().join("c.dcm"), file(class, size, (8, kind()), &frames, &wrong))
        .expect("written");
    let (done, said) = insonify(folder.path(), &["import", "c.dcm", "-o", "out", "--force"]);
    assert!(!done && said.contains("segment 3, which is not described"), "{said}");
}
