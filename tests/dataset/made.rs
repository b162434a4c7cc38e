//! What is made: the same bytes whole and in shards, the image that `render` makes, labels that fit it.

use std::path::Path;

use serde_json::Value;

use crate::dataset::{Desk, PARTS, PLAN, SAMPLES, desk, files, program};

#[test]
fn a_shard_alone_is_the_same_bytes_as_in_the_whole() {
    let desk = desk();
    let whole = files(&desk.path("whole"));
    // Five files a sample and one archive a part; the plan and the manifest.
    assert_eq!(whole.len(), 5 * SAMPLES + PARTS + 2);
    desk.made(&["-o", "alone", "--shard", "7/10"]);
    let alone = files(&desk.path("alone"));
    assert_eq!(alone.len(), 5 * 2 + 1 + 2);
    for (name, bytes) in &alone {
        assert!(whole.get(name) == Some(bytes), "{name}");
    }
    assert!(alone.contains_key("webdataset/test-000001.tar"), "{:?}", alone.keys());
    // Shards of one folder are the whole.
    for shard in ["2/3", "0/3", "1/3"] {
        desk.made(&["-o", "thirds", "--shard", shard]);
    }
    assert!(files(&desk.path("thirds")) == whole);
    let (went_well, said) = desk.make(&["-o", "none", "--shard", "10/11"]);
    assert!(went_well && said.contains("has none of them"), "{said}");
    for (shard, remedy) in [("10/10", "the last is 9/10"), ("x", "like 7/10"), ("0/0", "like 7/10")]
    {
        let (went_well, said) = desk.make(&["-o", "none", "--shard", shard]);
        assert!(!went_well && said.contains(remedy), "{said}");
    }
    assert!(!desk.path("none").exists());
}

fn facts(desk: &Desk, split: &str, number: usize) -> Value {
    let text = std::fs::read(desk.path(&format!("whole/folder/{split}/{number:06}.json")));
    serde_json::from_slice(&text.expect("written")).expect("JSON")
}

/// The value of an entry as `--set` takes it.
fn entry(path: &str, value: &Value) -> String {
    let list = |value: &Value| value.to_string();
    match value {
        Value::String(text) => format!("{path}={text}"),
        Value::Object(pose) => {
            let keys: Vec<_> =
                pose.iter().map(|(key, value)| format!("{key}={}", list(value))).collect();
            format!("{path}={{{}}}", keys.join(","))
        }
        other => format!("{path}={other}"),
    }
}

#[test]
fn render_makes_the_same_image_of_what_a_sample_says() {
    let desk = desk();
    for (split, number) in [("train", 0), ("train", 11), ("test", 12), ("test", 19)] {
        let facts = facts(desk, split, number);
        let set = facts["set"].as_object().expect("entries");
        let entries: Vec<String> = set.iter().map(|(path, value)| entry(path, value)).collect();
        let (time, seed) = (facts["time_s"].to_string(), facts["seed"].to_string());
        let mut args = vec![
            "render",
            "scene.toml",
            "--tracer",
            "bvh",
            "-o",
            "one.png",
            "--time",
            &time,
            "--seed",
            &seed,
        ];
        args.extend(entries.iter().flat_map(|entry| ["--set", entry]));
        let (went_well, said) = program::insonify(desk.path("").as_path(), &args);
        assert!(went_well, "{said}");
        let own = image::open(desk.path(&format!("whole/folder/{split}/{number:06}.png")));
        let rendered = image::open(desk.path("one.png")).expect("a PNG").into_luma8();
        assert!(own.expect("a PNG").into_luma8() == rendered, "{number}: {entries:?}");
    }
}

#[test]
fn draws_lie_in_their_ranges_and_differ_from_sample_to_sample() {
    let desk = desk();
    let mut seen = Vec::new();
    for number in 0..SAMPLES {
        let split = if number < 12 { "train" } else { "test" };
        let facts = facts(desk, split, number);
        let drawn =
            |key: &str| facts["drawn"][key].as_f64().unwrap_or_else(|| panic!("{key}: {facts}"));
        assert!((-6.0..=6.0).contains(&drawn("imaging.gain")));
        assert!((0.5..=1.0).contains(&drawn("simulation.density_scale")));
        assert!((0.4..=0.8).contains(&drawn("tissues.fat.attenuation")) || split == "test");
        let thick = facts["variables"]["thick"].as_f64().expect("a number");
        assert!((drawn("probe.frequency") - (6.0 - thick)).abs() < 1e-5);
        assert!((0.0..=4.0).contains(&facts["time_s"].as_f64().expect("s")));
        if split == "test" {
            assert!([200.0, 300.0].contains(&drawn("probe.samples")));
            assert!(facts["contact"]["share"].as_f64().expect("on the skin") >= 0.7);
        }
        seen.push((drawn("imaging.gain").to_bits(), facts["seed"].clone()));
    }
    for (i, one) in seen.iter().enumerate() {
        assert!(!seen[..i].contains(one), "sample {i} is drawn twice");
    }
}

/// The plate of the first scene, which stands still beside its breath, is where its labels say.
#[test]
fn labels_are_the_tissue_at_each_pixel() {
    let desk = desk();
    for number in 0..12 {
        let facts = facts(desk, "train", number);
        let classes = &facts["classes"];
        let class = classes["fat"]["class"].as_u64().expect("the plate is seen") as u8;
        let path = desk.path(&format!("whole/folder/train/{number:06}.seg.png"));
        let bytes = std::fs::read(path).expect("written");
        let mut decoder = png::Decoder::new(std::io::Cursor::new(&bytes));
        decoder.set_transformations(png::Transformations::IDENTITY);
        let mut reader = decoder.read_info().expect("a PNG");
        assert_eq!(reader.info().color_type, png::ColorType::Grayscale);
        let (width, height) = (reader.info().width, reader.info().height);
        let mut pixels = vec![0; (width * height) as usize];
        reader.next_frame(&mut pixels).expect("pixels");
        let pixel = facts["image"]["pixel_mm"].as_f64().expect("mm");
        let [left, top] =
            ["left_mm", "top_mm"].map(|key| facts["image"][key].as_f64().expect("mm"));
        let rows: Vec<Vec<f64>> =
            serde_json::from_value(facts["world_from_probe"].clone()).expect("four rows");
        // The plate: 8 mm wide, from 10 mm to 14 mm and up to 2 mm off, by sine from time 0 on.
        let time = facts["time_s"].as_f64().expect("s");
        let middle = 12.0 + 2.0 * (std::f64::consts::TAU * time / 4.0).sin();
        let (mut both, mut either) = (0, 0);
        for row in 0..height {
            for column in 0..width {
                let x = left + (f64::from(column) + 0.5) * pixel;
                let z = top + (f64::from(row) + 0.5) * pixel;
                let at = |i: usize| rows[i][0] * x + rows[i][2] * z + rows[i][3];
                let inside = at(0).abs() < 4.0 && (at(2) - middle).abs() < 2.0;
                let labelled = pixels[(row * width + column) as usize] == class;
                both += u32::from(inside && labelled);
                either += u32::from(inside || labelled);
            }
        }
        let iou = f64::from(both) / f64::from(either);
        // Lines lie 0.375 mm apart and pixels 0.25 mm: a border of 24 mm is at most half a pixel off, of 32 mm2.
        assert!(iou > 0.93, "{number}: {iou}");
    }
}

#[test]
fn a_contact_sheet_shows_each_sample_with_its_labels() {
    let desk = desk();
    let sheet = image::open(desk.path("whole/sheet.png")).expect("a PNG").into_rgb8();
    let colored = sheet
        .pixels()
        .filter(|p| p.0[0].abs_diff(p.0[1]) > 8 || p.0[1].abs_diff(p.0[2]) > 8)
        .count();
    // Twenty images of 48 x 80 pixels are colored.
    assert!(colored > 20 * 48 * 80 / 2, "{colored}");
}

/// The type and the data of a NumPy file of format 1.0.
fn array(path: &Path) -> (String, Vec<u8>) {
    let bytes = std::fs::read(path).expect("an array");
    let head = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let header = String::from_utf8_lossy(&bytes[10..head]).into_owned();
    (header.split('\'').nth(3).expect("a type").to_owned(), bytes[head..].to_vec())
}

#[test]
fn half_precision_keeps_the_numbers_in_half_the_bytes() {
    let desk = desk();
    let arrays = r#"arrays = ["envelope", "iq", "position", "true_tissue"]"#;
    let plan = PLAN.replace(r#"arrays = ["envelope", "iq"]"#, arrays);
    desk.write("single.toml", &plan);
    desk.write("half.toml", &format!("precision = \"half\"\n{plan}"));
    for name in ["single", "half"] {
        let args = ["dataset", &format!("{name}.toml"), "-o", name, "--shard", "0/10"];
        let (went_well, said) = program::insonify(&desk.path(""), &args);
        assert!(went_well, "{said}");
    }
    let path = |set: &str, end: &str| desk.path(&format!("{set}/folder/train/000001.{end}"));
    let facts: Value =
        serde_json::from_slice(&std::fs::read(path("half", "json")).unwrap()).unwrap();
    assert_eq!(facts["scales"].as_object().unwrap().len(), 3, "of the quantities");
    for name in ["envelope", "iq", "position"] {
        let end = format!("{name}.npy");
        let ((single, whole), (half, packed)) =
            (array(&path("single", &end)), array(&path("half", &end)));
        assert_eq!((single.as_str(), half.as_str()), ("<f4", "<f2"), "{name}");
        assert_eq!(whole.len(), 2 * packed.len(), "{name}");
        let scale = facts["scales"][name].as_f64().unwrap();
        let wanted =
            whole.chunks_exact(4).map(|b| f64::from(f32::from_le_bytes(b.try_into().unwrap())));
        let read =
            packed.chunks_exact(2).map(|b| f64::from(half::f16::from_le_bytes([b[0], b[1]])));
        let mut numbers = 0;
        for (wanted, read) in wanted.zip(read).filter(|(wanted, _)| !wanted.is_nan()) {
            // Eleven bits; below 2^-14 of what is stored, its steps of 2^-24.
            let step = (wanted.abs() / 2048.0).max(scale * 2_f64.powi(-24));
            assert!(
                (read * scale - wanted).abs() <= step,
                "{name}: {wanted} became {}",
                read * scale
            );
            numbers += usize::from(wanted != 0.0);
        }
        assert!(numbers > 1000, "{name}: {numbers}");
    }
    let (kind, tissues) = array(&path("half", "true_tissue.npy"));
    assert_eq!(kind, "<i2");
    let wanted = array(&path("single", "true_tissue.npy")).1;
    let wide = tissues
        .chunks_exact(2)
        .flat_map(|b| i32::from(i16::from_le_bytes([b[0], b[1]])).to_le_bytes());
    assert!(wide.eq(wanted));
}

#[test]
fn of_more_than_a_thousand_samples_a_thousand_share_a_folder() {
    let desk = Desk::new();
    desk.write("plan.toml", &PLAN.replace("samples = 12", "samples = 1200"));
    let last = ["-o", "large", "--shard", "599/604"];
    desk.made(&last);
    let folder = |number: &str| desk.path(&format!("large/folder/train/{number}"));
    for name in ["001198.png", "001199.seg.png", "001199.json", "001199.iq.npy"] {
        assert!(folder(&format!("001/{name}")).exists(), "{name}");
    }
    assert!(!folder("001199.png").exists());
    let before = files(&desk.path("large"));
    let draft = folder("001/.001199.png.1");
    std::fs::write(&draft, "half").unwrap();
    std::fs::remove_file(folder("001/001199.png")).unwrap();
    desk.made(&[&last[..], &["--resume"]].concat());
    assert!(!draft.exists() && files(&desk.path("large")) == before);
}
