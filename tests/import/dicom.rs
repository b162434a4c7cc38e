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
