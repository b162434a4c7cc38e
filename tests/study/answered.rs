//! `insonify study answers`, on files in the form's format.

use std::path::Path;

use insonify::study::answers::{FORMAT, VERSION};
use insonify::study::key::{Key, crc32};
use serde_json::{Value, json};

use crate::common::program::insonify;
use crate::study::{desk, files};

/// Answers of an assessor who always takes the scene itself, agrees by 4 and puts the volume first.
fn saved(key: &Key, response: &str) -> Value {
    let plain = |case: usize| {
        let place = key.images(case).iter().position(|r| r.parameter == "none");
        place.expect("one of them") + 1
    };
    let rank = |&case: &usize| 1 + usize::from(key.background(case) != "volume");
    let cases = 1..=key.cases();
    let content = json!({
        "response": response,
        "saved": "2026-01-02T03:04:05.678Z",
        "assessor": { "name": response, "experience": "" },
        "cases": cases.map(|c| json!({ "image": plain(c), "agreement": 4, "remark": "" })).collect::<Vec<_>>(),
        "rankings": key.groups().iter().map(|group| json!({
            "cases": group,
            "ranks": group.iter().map(rank).collect::<Vec<_>>(),
        })).collect::<Vec<_>>(),
        "remark": "",
    });
    json!({
        "format": FORMAT,
        "version": VERSION,
        "study": key.id(),
        "checksum": crc32(content.to_string().as_bytes()),
        "content": content,
    })
}

fn evaluate(folder: &Path, args: &[&str]) -> (bool, String) {
    insonify(folder, &[&["study", "answers"], args].concat())
}

#[test]
fn tables_are_written_and_printed() {
    let key = desk().key("first");
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: String| {
        std::fs::write(folder.path().join(name), text).expect("written");
    };
    write("key.csv", key.text());
    write("a.json", saved(&key, "a").to_string());
    write("b.json", saved(&key, "b").to_string());
    let both = ["a.json", "b.json", "--key", "key.csv"];
    let (went_well, said) = evaluate(folder.path(), &[&both[..], &["-o", "t.csv"]].concat());
    assert!(went_well, "{said}");
    for part in [
        "Filled forms: 2.",
        "firstscene volume 2 0 1.00",
        "all scenarios scatterers 0 4 2.00",
        "all scenarios volume 0 0 0 4 0 4.00",
        "none changed 0 8 0 8",
        "Images chosen: 8, of them with no parameter changed: 8; by lot it would be 2.0.",
        "backgrounds 4 4.00 0.1250 1.00",
        "volume, scatterers 4 0 0.1250 0.1250",
    ] {
        assert!(said.contains(part), "{part}: {said}");
    }
    let table = std::fs::read_to_string(folder.path().join("t.csv")).expect("written");
    assert!(table.contains("Friedman's test,,backgrounds,p,0.125\n"), "{table}");
    let more = ["-o", "t.md", "--ratings", "r.csv"];
    assert!(evaluate(folder.path(), &[&both[..], &more].concat()).0);
    let table = std::fs::read_to_string(folder.path().join("t.md")).expect("written");
    assert!(table.contains("| secondscene | scatterers | 0 | 2 | 2.00 |"), "{table}");
    let rows = std::fs::read_to_string(folder.path().join("r.csv")).expect("written");
    assert_eq!(rows.lines().count(), 9);
}

#[test]
fn mistakes_are_explained_and_nothing_is_written() {
    let desk = desk();
    let key = desk.key("first");
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: String| {
        std::fs::write(folder.path().join(name), text).expect("written");
    };
    write("key.csv", key.text());
    write("edited.csv", key.text().replacen("volume", "none", 1));
    // The key of a study whose backgrounds are the other way around.
    let swapped = key.rows().iter().map(|row| insonify::study::key::Row {
        background: match row.background.as_str() {
            "volume" => "scatterers".to_owned(),
            _ => "volume".to_owned(),
        },
        ..row.clone()
    });
    write("swapped.csv", Key::new(swapped.collect()).expect("a study").text());
    write("a.json", saved(&key, "a").to_string());
    let edited = saved(&key, "b").to_string().replacen("\"agreement\":4", "\"agreement\":5", 1);
    write("b.json", edited);
    for (args, parts) in [
        (
            &["a.json", "-k", "swapped.csv"][..],
            &["the key is that of", "written with its form"][..],
        ),
        (&["a.json", "-k", "edited.csv"], &["edited.csv", "as `insonify study make` wrote it"]),
        (&["b.json", "-k", "key.csv"], &["b.json", "changed after it was saved"]),
        (&["a.json", "a.json", "-k", "key.csv"], &["the same form"]),
        (&["key.csv", "-k", "key.csv"], &["not a file of answers"]),
        (&["none.json", "-k", "key.csv"], &["none.json", "cannot be read"]),
        (&["a.json", "-k", "key.csv", "-o", "t.xls"], &["`xls`", "NAME.csv or NAME.md"]),
        (&["a.json", "-k", "key.csv", "-o", "key.csv/t.md"], &["key.csv/t.md"]),
        (&["-k", "key.csv"], &["<ANSWERS>"]),
    ] {
        let (went_well, said) = evaluate(folder.path(), args);
        assert!(!went_well, "{args:?}: {said}");
        for part in parts {
            assert!(said.contains(part), "{part}: {said}");
        }
    }
    assert_eq!(files(folder.path()).len(), 5);
}
