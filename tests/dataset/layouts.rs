//! Finished data sets in the layouts of others.

use std::collections::BTreeMap;
use std::path::Path;

use serde_json::Value;

use crate::dataset::{Desk, SAMPLES, desk, files, program};

/// Writes the data set of a folder in a layout; returns whether that went well, and what was said.
fn lay(desk: &Desk, set: &str, layout: &str, to: &str, more: &[&str]) -> (bool, String) {
    let args = [&["dataset", set, "--layout", layout, "-o", to], more].concat();
    program::insonify(desk.path("").as_path(), &args)
}

fn laid(desk: &Desk, layout: &str, to: &str, more: &[&str]) -> BTreeMap<String, Vec<u8>> {
    let (went_well, said) = lay(desk, "whole", layout, to, more);
    assert!(went_well, "{said}");
    files(&desk.path(to))
}

fn json(bytes: &[u8]) -> Value {
    serde_json::from_slice(bytes).expect("JSON")
}

/// The classes of a sample's pixels, width first.
fn classes(path: &Path) -> image::GrayImage {
    image::open(path).expect("a PNG").into_luma8()
}

/// The split of a sample.
fn split(number: usize) -> &'static str {
    if number < 12 { "train" } else { "test" }
}

#[test]
fn nnunet_has_labels_from_one_on_and_tests_apart() {
    let desk = desk();
    let written = laid(desk, "nnunet", "nn", &["--licence", "cc-by-4.0"]);
    assert_eq!(written.len(), 2 * SAMPLES + 2, "{:?}", written.keys());
    let about = json(&written["dataset.json"]);
    assert_eq!(about["numTraining"], 12);
    assert_eq!(about["labels"]["background"], 0);
    let manifest = json(&std::fs::read(desk.path("whole/manifest.json")).expect("there"));
    let names = manifest["classes"].as_array().expect("a list");
    for (i, name) in names.iter().enumerate() {
        assert_eq!(about["labels"][name.as_str().expect("a name")], i + 1);
    }
    for number in 0..SAMPLES {
        let (own, end) = (split(number), if number < 12 { "Tr" } else { "Ts" });
        let image = &written[&format!("images{end}/insonify_{number:06}_0000.png")];
        let before = desk.path(&format!("whole/folder/{own}/{number:06}.png"));
        assert!(*image == std::fs::read(before).expect("there"), "{number}");
        let labels = classes(&desk.path(&format!("nn/labels{end}/insonify_{number:06}.png")));
        let own = classes(&desk.path(&format!("whole/folder/{own}/{number:06}.seg.png")));
        let shifted = own.pixels().map(|p| if p.0[0] == 255 { 0 } else { p.0[0] + 1 });
        assert!(labels.pixels().map(|p| p.0[0]).eq(shifted), "{number}");
    }
    let card = String::from_utf8(written["README.md"].clone()).expect("UTF-8");
    for part in
        ["license: cc-by-4.0", "- train: 12 samples", "- test: 8 samples", "n<1K", "| fat |"]
    {
        assert!(card.contains(part), "{part}: {card}");
    }
    let (went_well, said) = lay(desk, "whole", "coco", "nn", &[]);
    assert!(!went_well && said.contains("holds files already"), "{said}");
}

#[test]
fn coco_has_the_pixels_of_each_class() {
    let desk = desk();
    let written = laid(desk, "coco", "cc", &[]);
    let mut seen = 0;
    for name in ["train", "test"] {
        let about = json(&written[&format!("annotations/{name}.json")]);
        let images: BTreeMap<u64, &str> = (about["images"].as_array().expect("a list").iter())
            .map(|i| {
                (i["id"].as_u64().expect("a number"), i["file_name"].as_str().expect("a name"))
            })
            .collect();
        assert!(images.values().all(|file| written.contains_key(*file)), "{images:?}");
        let mut covered: BTreeMap<u64, usize> = BTreeMap::new();
        for one in about["annotations"].as_array().expect("a list") {
            let number = one["image_id"].as_u64().expect("a number");
            let own = classes(&desk.path(&format!("whole/folder/{name}/{number:06}.seg.png")));
            let class = one["category_id"].as_u64().expect("a number") - 1;
            let mut runs = one["segmentation"]["counts"].as_array().expect("runs").iter();
            let (mut inside, mut left) = (true, 0);
            let mut area = 0;
            for x in 0..own.width() {
                for y in 0..own.height() {
                    while left == 0 {
                        inside = !inside;
                        left = runs.next().and_then(Value::as_u64).expect("a run");
                    }
                    left -= 1;
                    area += u64::from(inside);
                    let is = u64::from(own.get_pixel(x, y).0[0]) == class;
                    assert_eq!(inside, is, "{name} {number} {class}: {x} {y}");
                }
            }
            assert_eq!(one["area"], area);
            *covered.entry(number).or_default() += area as usize;
        }
        for (number, pixels) in &covered {
            let own = classes(&desk.path(&format!("whole/folder/{name}/{number:06}.seg.png")));
            assert_eq!(*pixels, own.pixels().filter(|p| p.0[0] != 255).count());
        }
        seen += covered.len();
    }
    assert_eq!(seen, SAMPLES);
}

#[test]
fn hugging_face_finds_its_files_and_the_table_has_a_row_for_each() {
    let desk = desk();
    let written = laid(desk, "huggingface", "hf", &[]);
    for (name, count) in [("train", 12), ("test", 8)] {
        let text = String::from_utf8(written[&format!("{name}/metadata.jsonl")].clone());
        let text = text.expect("UTF-8");
        assert_eq!(text.lines().count(), count);
        for line in text.lines() {
            let line = json(line.as_bytes());
            for key in ["file_name", "segmentation_file_name"] {
                let file = format!("{name}/{}", line[key].as_str().expect("a name"));
                assert!(written.contains_key(&file), "{file}");
            }
        }
    }
    let (went_well, said) = lay(desk, "whole", "table", "all.csv", &[]);
    assert!(went_well, "{said}");
    let table = std::fs::read_to_string(desk.path("all.csv")).expect("written");
    let mut rows = csv::Reader::from_reader(table.as_bytes());
    let head = rows.headers().expect("a head").clone();
    let column = |name: &str| head.iter().position(|h| h == name).expect(name);
    let rows: Vec<csv::StringRecord> = rows.records().map(|row| row.expect("a row")).collect();
    assert_eq!(rows.len(), SAMPLES);
    for (number, row) in rows.iter().enumerate() {
        let facts = json(
            &std::fs::read(desk.path(&format!("whole/folder/{}/{number:06}.json", split(number))))
                .expect("there"),
        );
        assert_eq!(row[column("sample")], number.to_string());
        assert_eq!(row[column("imaging.gain")], facts["drawn"]["imaging.gain"].to_string());
        let fat = &facts["classes"]["fat"]["pixels"];
        let fat = if fat.is_null() { "0".to_owned() } else { fat.to_string() };
        assert_eq!(row[column("pixels fat")], fat);
    }

    // From archives alone it is the same.
    let all = files(&desk.path("whole"));
    for (name, bytes) in all.iter().filter(|(name, _)| !name.starts_with("folder/")) {
        let file = desk.path(&format!("tars/{name}"));
        std::fs::create_dir_all(file.parent().expect("a folder")).expect("made");
        let text = String::from_utf8_lossy(bytes).replace("\"folder\",", "");
        let bytes = if name == "manifest.json" { text.as_bytes() } else { &bytes[..] };
        std::fs::write(file, bytes).expect("written");
    }
    let (went_well, said) = lay(desk, "tars", "table", "again.csv", &[]);
    assert!(went_well, "{said}");
    assert!(std::fs::read_to_string(desk.path("again.csv")).expect("written") == table);
}

#[test]
fn what_is_no_whole_data_set_is_refused() {
    let desk = Desk::new();
    let (went_well, said) = lay(&desk, ".", "coco", "out", &[]);
    assert!(!went_well && said.contains("manifest.json"), "{said}");
    let (went_well, said) = lay(&desk, ".", "cocoa", "out", &[]);
    assert!(!went_well && said.contains("coco"), "{said}");
    desk.made(&["-o", "part", "--shard", "1/10"]);
    let (went_well, said) = lay(&desk, "part", "coco", "out", &[]);
    assert!(!went_well && said.contains("has 2 of its 20 samples"), "{said}");
}

#[test]
fn a_check_tells_time_files_and_bytes() {
    let desk = desk();
    let said = desk.made(&["-o", "unmade", "--check"]);
    // Five files a sample in the folder, and an archive for each part.
    let (_, line) = said.split_once("about ").expect(&said);
    assert!(line.contains(&format!(" in {} files", 5 * SAMPLES + 10)), "{line}");
    let written: usize = files(&desk.path("whole")).values().map(Vec::len).sum();
    let told = line.split(", ").nth(1).and_then(|part| part.split(' ').next());
    let told: f64 = told.and_then(|number| number.parse().ok()).expect(line);
    assert!((told / (written as f64 / 1e6) - 1.0).abs() < 0.1, "{line}: {written}");
    assert!(!desk.path("unmade").exists());
}

#[test]
fn samples_in_folders_of_a_thousand_are_found() {
    let set = Desk::new();
    for (name, bytes) in
        files(&desk().path("whole")).into_iter().filter(|(n, _)| !n.starts_with("webdataset"))
    {
        // The first six as if they were those of another thousand.
        let deep = match name.strip_prefix("folder/train/") {
            Some(own) if own < "000006" => format!("folder/train/000/{own}"),
            _ => name,
        };
        let path = set.path("moved").join(deep);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("room");
        std::fs::write(path, bytes).expect("room");
    }
    let (went_well, said) = lay(&set, "moved", "huggingface", "hf", &[]);
    assert!(went_well, "{said}");
    let table = std::fs::read_to_string(set.path("hf/train/metadata.jsonl")).expect("there");
    let names: Vec<_> =
        table.lines().map(|line| json(line.as_bytes())["file_name"].to_string()).collect();
    assert_eq!(names.len(), 12);
    assert!(names.is_sorted(), "{names:?}");
}
