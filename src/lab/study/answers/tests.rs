//! Files of answers: accepted ones, refused ones, and reasons.

use serde_json::{Value, json};

use super::super::key::tests::small;
use super::*;

/// Answers to all questions of the key's six cases.
pub(in crate::study) fn content() -> Value {
    let choice = |image: usize| json!({ "image": image, "agreement": 4, "remark": "" });
    json!({
        "response": "0123456789abcdef",
        "saved": "2026-01-02T03:04:05.678Z",
        "assessor": { "name": "A. \u{e4}\u{2028}\u{7f}\"\\\u{1}\u{1f600}", "experience": "" },
        "cases": Vec::from([1, 2, 1, 2, 1, 1].map(choice)),
        "rankings": [
            { "cases": [1, 3, 5], "ranks": [3, 1, 2] },
            { "cases": [2, 4, 6], "ranks": [1, 2, 3] },
        ],
        "remark": "",
    })
}

/// A file as the form would save it.
pub(in crate::study) fn file(key: &Key, content: &Value) -> Value {
    json!({
        "format": FORMAT,
        "version": VERSION,
        "study": key.id(),
        "checksum": crc32(content.to_string().as_bytes()),
        "content": content,
    })
}

fn read(file: &Value) -> Result<Answers, FileError> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("answers.json");
    std::fs::write(&path, serde_json::to_string_pretty(file).expect("JSON")).expect("written");
    Answers::read(&path, &small())
}

fn with(path: &str, value: Value) -> Value {
    let mut content = content();
    *content.pointer_mut(path).expect(path) = value;
    content
}

#[test]
fn answers_are_read_as_they_were_saved() {
    let answers = read(&file(&small(), &content())).expect("sound");
    assert_eq!(answers.cases[1].image, Some(2));
    assert_eq!(answers.rankings[0].complete(), Some(vec![3, 1, 2]));
    assert_eq!(answers.missing(), [0; 3]);
}

#[test]
fn unanswered_questions_are_counted() {
    let mut content = content();
    content["cases"][0] = json!({ "image": null, "agreement": null, "remark": "blurred" });
    content["cases"][1]["agreement"] = Value::Null;
    content["rankings"][0]["ranks"] = json!([null, null, null]);
    content["rankings"][1]["ranks"] = json!([1, null, 2]);
    let answers = read(&file(&small(), &content)).expect("sound");
    assert_eq!(answers.missing(), [1, 1, 2]);
    assert_eq!(answers.rankings[1].complete(), None);
}

#[test]
fn files_that_no_form_saves_are_refused() {
    let key = small();
    let sound = file(&key, &content());
    let outer = |name: &str, value: Value| {
        let mut file = sound.clone();
        file[name] = value;
        file
    };
    let inner = |path: &str, value: Value| file(&key, &with(path, value));
    // Edited by hand: the checksum is the old one.
    let edited = outer("content", with("/cases/0/agreement", json!(5)));
    for (file, cause) in [
        (json!({ "a": 1 }), "not a file of answers"),
        (json!([1, 2]), "not a file of answers"),
        (outer("format", json!("other")), "calls itself `other`"),
        (outer("version", json!(2)), "version 2, this program reads 1"),
        (outer("study", json!("0000000000000000")), "the key is that of"),
        (edited, "was changed after it was saved"),
        (inner("/cases/0/image", json!(3)), "case 1 has no image 3"),
        (inner("/cases/0/image", json!(0)), "case 1 has no image 0"),
        (inner("/cases/0/image", json!(-1)), "does not fit: cases[0].image"),
        (inner("/cases/0/image", Value::Null), "case 1: no image was chosen"),
        (inner("/cases/5/agreement", json!(6)), "case 6: there is no degree 6"),
        (inner("/cases", json!([])), "holds 0 cases, the study has 6"),
        (inner("/rankings/0/ranks", json!([1, 1, 2])), "the ranks of the cases [1, 3, 5]"),
        (inner("/rankings/0/ranks", json!([1, 2, 4])), "the ranks of the cases"),
        (inner("/rankings/0/ranks", json!([1, 2])), "the ranks of the cases"),
        (inner("/rankings/0/cases", json!([1, 3, 4])), "ranks other cases"),
        (inner("/rankings", json!([])), "ranks other cases"),
        (inner("/response", json!("")), "which form"),
        (inner("/assessor", json!({ "name": "A" })), "does not fit: assessor"),
    ] {
        let error = read(&file).expect_err(cause);
        assert!(error.message.contains(cause), "{cause}: {error}");
        assert!(!error.remedy.is_empty(), "{cause}");
    }
    let missing = Answers::read(Path::new("no.json"), &key).expect_err("no file");
    assert!(missing.message.contains("cannot be read"), "{missing}");
}

#[test]
fn a_form_counts_once() {
    let key = small();
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, content: &Value| {
        let path = folder.path().join(name);
        std::fs::write(&path, file(&key, content).to_string()).expect("written");
        path
    };
    let early = write("early.json", &content());
    let late = write("late.json", &with("/saved", json!("2026-01-03T00:00:00.000Z")));
    let other = write("other.json", &with("/response", json!("fedcba9876543210")));
    let both = read_all(&[early.clone(), other.clone()], &key).expect("two forms");
    assert_eq!(both.len(), 2);
    for pair in [[&early, &late], [&late, &early]] {
        let error = read_all(&pair.map(PathBuf::clone), &key).expect_err("one form twice");
        assert!(error.message.contains("the same form"), "{error}");
        assert!(error.remedy.contains("late.json was saved later"), "{}", error.remedy);
    }
    let error = read_all(&[early.clone(), early], &key).expect_err("one file twice");
    assert!(error.message.contains("the same form"), "{error}");
}
