//! Keys: read back as written, refused where changed.

use super::*;

/// Two slices of a scene before three backgrounds, two images each; cases shuffled by hand.
pub(in crate::study) fn small() -> Key {
    let order = [
        ("lying", "none"),
        ("standing", "volume"),
        ("lying", "volume"),
        ("standing", "scatterers"),
        ("lying", "scatterers"),
        ("standing", "none"),
    ];
    let row = |case: usize, image: usize| {
        let (slice, background) = order[case - 1];
        // In even cases the scene itself comes first.
        let plain = (case + image) % 2 == 1;
        let text = str::to_owned;
        Row {
            study: String::new(),
            case,
            image,
            scenario: "a, with a comma".to_owned(),
            slice: text(slice),
            background: text(background),
            parameter: text(if plain { UNPERTURBED } else { "gain" }),
            value: text(if plain { "" } else { "-6" }),
            own: text(if plain { "" } else { "0.5" }),
            unit: text(if plain { "" } else { "dB" }),
            set: "imaging.gain=-6".to_owned(),
            crc: crc32(&[case as u8, image as u8]),
            wording: crc32(b"Which?"),
        }
    };
    let rows = (1..=6).flat_map(|case| [row(case, 1), row(case, 2)]);
    Key::new(rows.collect()).expect("sound")
}

fn written(text: &str) -> (tempfile::TempDir, std::path::PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("key.csv");
    std::fs::write(&path, text).expect("written");
    (folder, path)
}

#[test]
fn a_key_is_read_back() {
    let key = small();
    let (_folder, path) = written(&key.text());
    assert_eq!(Key::read(&path).expect("sound"), key);
    assert_eq!(key.cases(), 6);
    assert_eq!(key.groups(), [[1, 3, 5], [2, 4, 6]]);
    assert_eq!(key.backgrounds(), ["volume", "scatterers", "none"]);
    assert_eq!((key.background(4), key.slice(4)), ("scatterers", "standing"));
    assert_eq!(key.images(6).len(), 2);
    assert_eq!(key.images(1)[0].direction(), -1);
    assert_eq!(key.images(1)[1].direction(), 0);
    // The check value of CRC-32 (ISO-HDLC).
    assert_eq!(crc32(b"123456789"), "cbf43926");
}

#[test]
fn a_changed_key_is_refused() {
    let text = small().text();
    let lines: Vec<&str> = text.lines().collect();
    let joined = |lines: &[&str]| lines.join("\n") + "\n";
    let mut swapped = lines.clone();
    // The same two images the other way around, numbers left in place.
    let second = lines[2].replacen(",1,2,", ",1,1,", 1);
    let first = lines[1].replacen(",1,1,", ",1,2,", 1);
    (swapped[1], swapped[2]) = (&second, &first);
    let column = lines[0].replacen("crc", "sum", 1);
    let headed = [&[column.as_str()], &lines[1..]].concat();
    for (text, cause) in [
        (joined(&swapped), "was changed"),
        (text.replacen(",volume,", ",none,", 1), "more than one background"),
        (text.replace("-6,0.5", "-6,0.50"), "was changed"),
        (joined(&lines[..11]), "not shown before each background"),
        (joined(&lines[..12]), "was changed"),
        (joined(&[&lines[..3], &lines[4..]].concat()), "image 2 of case 2 stands where image 1"),
        (joined(&lines[..1]), "there is no image"),
        (joined(&headed), "not the key of a study"),
        (String::new(), "there is no image"),
    ] {
        let (_folder, path) = written(&text);
        let error = Key::read(&path).expect_err(cause);
        assert!(error.message.contains(cause), "{cause}: {error}");
        assert!(!error.remedy.is_empty() && error.file.ends_with("key.csv"));
    }
    assert!(Key::read(Path::new("no/key.csv")).is_err());
}
