//! Bad input: every mesh at hand and scenes with planted mistakes, through the program itself.

#[path = "common/limited.rs"]
mod limited;
#[path = "common/shared_data.rs"]
mod shared_data;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use assert_cmd::Command;
use limited::{Outcome, check, files, limited};
use shared_data::shared_data;

/// Files that look like meshes, readable or not, in a fixed order.
fn meshes(folder: &Path) -> Vec<PathBuf> {
    let kinds = ["obj", "stl", "gltf", "glb", "ply", "off"];
    files(folder, |path| {
        let extension = path.extension().and_then(|e| e.to_str());
        kinds.contains(&extension.unwrap_or_default().to_ascii_lowercase().as_str())
    })
}

impl Outcome {
    fn has(&self, kind: &str) -> bool {
        self.text.lines().any(|line| line.starts_with(kind))
    }
}

/// The fault of an outcome, if there is one.
fn verdict(path: &Path, outcome: &Outcome) -> Option<String> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let names_file = |kind: &str| {
        let mut lines = outcome.text.lines().filter(|l| l.starts_with(kind));
        lines.all(|line| line.contains(name.as_ref()) && line.len() > name.len() + kind.len() + 4)
    };
    match outcome.code {
        Some(0) if outcome.has("error:") => Some("errors, but success".to_owned()),
        Some(1) if !outcome.has("error:") => Some("failed without an error".to_owned()),
        Some(0 | 1) if names_file("error:") && names_file("warning:") => None,
        Some(0 | 1) => Some("a finding does not name the file".to_owned()),
        code => Some(format!("ended with {code:?} (crash, memory or time)")),
    }
}

#[test]
fn every_mesh_is_loaded_or_refused_with_a_reason() {
    let Some(data) = shared_data() else { return };
    let mut counts: BTreeMap<String, [usize; 3]> = BTreeMap::new();
    let mut bad = Vec::new();
    let mut animated = 0;
    for path in meshes(&data) {
        let outcome = check(&path);
        animated += usize::from(outcome.text.contains(" animation `"));
        let inside = path.strip_prefix(&data).expect("inside");
        let set = inside.components().next().expect("a folder").as_os_str();
        let kind = match (outcome.has("error:"), outcome.has("warning:")) {
            (true, _) => 2,
            (false, true) => 1,
            _ => 0,
        };
        counts.entry(set.to_string_lossy().into_owned()).or_default()[kind] += 1;
        if let Some(cause) = verdict(&path, &outcome) {
            bad.push(format!("{}: {cause}\n{}", inside.display(), outcome.text));
        }
    }
    // Nearly all are samples of the size of a house; that is found after all shapes are made.
    println!("{animated} files with animations on which something is said");
    assert!(animated >= 15, "animations are tried");
    println!("{:30} clean, warnings, refused", "set");
    for (set, [clean, warned, refused]) in &counts {
        println!("{set:30} {clean:5} {warned:9} {refused:8}");
    }
    assert!(bad.is_empty(), "{}", bad.join("\n"));
    let real = ["liver-scikit-surgery", "heart-4d-bivme", "baby-makehuman"];
    for set in real {
        assert!(counts[set][0] + counts[set][1] > 0, "{set} holds readable meshes");
    }
}

/// Khronos' validator stores its verdict beside each file.
#[test]
fn files_that_the_gltf_validator_refuses_are_not_loaded_silently() {
    let Some(data) = shared_data() else { return };
    let (mut refused, mut silent) = (0, Vec::new());
    for path in meshes(&data.join("corpus-gltf-validator")) {
        let mut report = path.clone().into_os_string();
        report.push(".report.json");
        let Ok(text) = std::fs::read_to_string(&report) else {
            continue;
        };
        let report: serde_json::Value = serde_json::from_str(&text).expect("a report");
        if report["issues"]["numErrors"].as_u64() == Some(0) {
            continue;
        }
        refused += 1;
        let outcome = check(&path);
        // These tiny files hold no triangles, but that is not the reason.
        let reasons = outcome.text.lines().filter(|line| {
            (line.starts_with("error:") || line.starts_with("warning:"))
                && !line.contains("holds no triangles")
        });
        if reasons.count() == 0 {
            silent.push(format!("{}\n{}", path.display(), outcome.text));
        }
    }
    println!("{refused} files with errors of the validator, {} silent", silent.len());
    assert!(refused > 200, "the corpus is there");
    assert!(silent.is_empty(), "{}", silent.join("\n"));
}

/// The comparison of the tests above rejects what it should.
#[test]
fn planted_outcomes_are_rejected() {
    let path = Path::new("folder/a.obj");
    let outcome = |code, text: &str| Outcome { code, text: text.to_owned() };
    assert!(verdict(path, &outcome(Some(0), "0 errors")).is_none());
    assert!(verdict(path, &outcome(Some(1), "error: folder/a.obj: no triangles")).is_none());
    assert!(verdict(path, &outcome(Some(101), "panicked")).is_some());
    assert!(verdict(path, &outcome(None, "killed")).is_some());
    assert!(verdict(path, &outcome(Some(1), "0 errors")).is_some());
    assert!(verdict(path, &outcome(Some(0), "error: folder/a.obj: cause is here")).is_some());
    assert!(verdict(path, &outcome(Some(1), "error: something went wrong")).is_some());
}

/// Memory and time limits of the child hold.
#[test]
fn the_limits_of_memory_and_time_hold() {
    // `tail` keeps its input until a line ends; here none does.
    let hungry = limited("head -c 1200000000 /dev/zero | tail > /dev/null", Path::new("x"));
    assert_eq!(hungry.code, Some(1), "{}", hungry.text);
    assert!(verdict(Path::new("x"), &hungry).is_some());
    let slow = limited("exec sleep 60", Path::new("x"));
    assert!(verdict(Path::new("x"), &slow).is_some(), "{}", slow.text);
}

#[test]
fn a_file_that_is_too_large_is_not_read() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let path = folder.path().join("huge.stl");
    let file = std::fs::File::create(&path).expect("created");
    // Sparse on disk; larger than the limit for reading.
    file.set_len(600 << 20).expect("sized");
    let outcome = check(&path);
    assert_eq!(outcome.code, Some(1), "{}", outcome.text);
    assert!(outcome.text.contains("the limit is 256 MB"), "{}", outcome.text);
}

#[test]
fn scene_mistakes_show_file_line_column_and_remedy() {
    let cube = "v 0 0 0\nv 9 0 0\nv 0 9 0\nv 0 0 9\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";
    let mesh = "[[mesh]]\nname = \"organ\"\nfile = \"organ.obj\"\ntissue = \"liver\"\n";
    for (text, place, cause, remedy) in [
        ("[probe]\ndept = 3\n".to_owned(), "2:1", "unknown field `dept`", "did you mean `depth`"),
        ("[probe]\nfrequency = \"5 mm\"\n".to_owned(), "2:13", "`mm` does not fit", "`MHz`, `kHz`"),
        (mesh.replace("organ.obj", "orgn.obj"), "3:8", "orgn.obj", "check the path"),
        (mesh.replace("liver", "livre"), "4:10", "unknown tissue `livre`", "did you mean `liver`"),
        (
            format!("{mesh}[tissues.liver]\nimpedance = \"1.75 MRayl\"\n"),
            "6:13",
            "differs from density times speed",
            "2 % are allowed",
        ),
        ("[probe\n".to_owned(), "1:7", "unclosed table", ""),
    ] {
        let folder = tempfile::tempdir().expect("temporary folder");
        std::fs::write(folder.path().join("organ.obj"), cube).expect("written");
        std::fs::write(folder.path().join("s.toml"), &text).expect("written");
        let output = Command::new(env!("CARGO_BIN_EXE_insonify"))
            .args(["check", "s.toml"])
            .current_dir(folder.path())
            .output()
            .expect("started");
        assert_eq!(output.status.code(), Some(1));
        // The report wraps its lines to the terminal.
        let shown = String::from_utf8_lossy(&output.stderr);
        let shown: Vec<_> = shown.split(|c: char| c.is_whitespace() || c == '\u{2502}').collect();
        let shown = shown.into_iter().filter(|w| !w.is_empty()).collect::<Vec<_>>().join(" ");
        for wanted in [&format!("s.toml:{place}"), cause, remedy] {
            assert!(shown.contains(wanted), "{wanted}: {shown}");
        }
    }
}

#[test]
fn the_real_scenes_are_sound() {
    if shared_data().is_none() {
        return;
    }
    for (name, triangles) in [("liver", 70_000), ("heart", 10_000), ("heart_rodero", 120_000)] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/scenes/{name}.toml"));
        let (scene, warnings) = insonify::scene::Scene::load(&path, &[]).expect(name);
        let total: usize = scene.meshes.iter().map(|m| m.triangles.len()).sum();
        println!(
            "{name}: {} meshes, {total} triangles, {} warnings",
            scene.meshes.len(),
            warnings.len()
        );
        assert!(total > triangles, "{name}: {total}");
        // Open organs would leak tissue into the picture.
        assert!(warnings.iter().all(|w| !w.message.contains("open edges")), "{warnings:?}");
    }
}

/// Damaged copies of sound files: every one is loaded or refused, none panics.
#[test]
fn damaged_files_never_panic() {
    use insonify::scene::{Scene, mesh};
    let folder = tempfile::tempdir().expect("temporary folder");
    let obj =
        "o a\nv 0 0 0\nv 9 0 0\nv 0 9 0\nv 0 0 9\nf 1/1 3/1 2\nf 1 2 4\nf -3 -2 -1\nf 1 4 3\n";
    let stl = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n\
        vertex 0 1 0\nendloop\nendfacet\nendsolid a\n";
    let mut binary = vec![0u8; 84];
    binary[80] = 2;
    binary.extend((0..100u8).map(|b| b.wrapping_mul(37)));
    let gltf = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],
        "nodes":[{"mesh":0,"scale":[1,2,3]}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1,"mode":5}]}],
        "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],
        "max":[1,1,0],"sparse":{"count":1,"indices":{"bufferView":1,"componentType":5121},
        "values":{"bufferView":0}}},{"bufferView":1,"componentType":5121,"count":3,"type":"SCALAR"}],
        "bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteLength":3}],"buffers":[{
        "byteLength":36,"uri":"data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}]}"#;
    let scene = "name = \"x\"\n[probe]\npreset = \"linear\"\ndepth = \"4 cm\"\n[probe.pose]\n\
        direction = [0, 0, 1]\n[[mesh]]\nname = \"a\"\nshape = { sphere = { radius = 3, \
        subdivisions = 1 } }\ntissue = \"fat\"\n[[wire]]\nfrom = [0, 0, 1]\n[tissues.fat]\n\
        speed = \"1450 m/s\"\n";
    let mut json = gltf.as_bytes().to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut glb = b"glTF\x02\0\0\0".to_vec();
    glb.extend((json.len() as u32 + 20).to_le_bytes());
    glb.extend((json.len() as u32).to_le_bytes());
    glb.extend(b"JSON");
    glb.extend(json);
    let mut state = 1u64;
    let mut random = move |below: usize| {
        // Knuth's MMIX generator.
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 33) as usize % below
    };
    for (name, sound) in [
        ("a.obj", obj.as_bytes()),
        ("a.stl", stl.as_bytes()),
        ("b.stl", &binary),
        ("a.gltf", gltf.as_bytes()),
        ("a.glb", &glb),
        ("a.toml", scene.as_bytes()),
    ] {
        let path = folder.path().join(name);
        let mut refused = 0;
        for _ in 0..1500 {
            let mut bytes = sound.to_vec();
            for _ in 0..=random(3) {
                let at = random(bytes.len());
                match random(4) {
                    0 => bytes.truncate(at.max(1)),
                    1 => bytes[at] ^= 1 << random(8),
                    2 => bytes[at] = b"0123456789-,.[]{}\"\n\xff"[random(20)],
                    _ => {
                        let copy = bytes[at..(at + 9).min(bytes.len())].to_vec();
                        bytes.splice(at..at, copy);
                    }
                }
            }
            std::fs::write(&path, &bytes).expect("written");
            refused += usize::from(match name {
                "a.toml" => Scene::load(&path, &[]).is_err(),
                _ => mesh::load(&path, &mesh::Options::default()).is_err(),
            });
        }
        println!("{name}: {refused} of 1500 damaged copies were refused");
    }
}
