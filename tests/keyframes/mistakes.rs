//! Mistakes in animated files: each is refused with cause, place and remedy.

use std::path::Path;

use insonify::scene::Issue;
use insonify::scene::mesh::{Choice, Options, Units, load_animated, load_keyframes};
use serde_json::{Value, json};

use crate::keyframes::made::{bending, tree, written};

/// One mistake: the change, the requested animation, and the message.
struct Mistake {
    change: fn(&mut Value),
    animation: Option<&'static str>,
    said: &'static [&'static str],
}

fn said(json: &Value, mistake: &Mistake) -> String {
    let folder = tempfile::tempdir().expect("temporary folder");
    let path = written(folder.path(), json);
    let options = Options { units: Units::named("cm"), ..Options::default() };
    let choice = mistake.animation.map_or(Choice::First, Choice::Named);
    let issues = load_animated(&path, &options, choice).expect_err("a mistake");
    let errors = issues.iter().filter(|i| i.is_error());
    errors.map(|i| format!("{i}\n")).collect()
}

fn refused(sound: &Value, mistakes: &[Mistake]) {
    for mistake in mistakes {
        let mut json = sound.clone();
        (mistake.change)(&mut json);
        let found = said(&json, mistake);
        for part in mistake.said.iter().chain(&["made.gltf: "]) {
            assert!(found.contains(part), "{part}:\n{found}");
        }
    }
}

/// Replaces the data of an accessor by floats.
fn overwrite(json: &mut Value, accessor: &Value, values: &[f32]) {
    let accessor = &json["accessors"][accessor.as_u64().expect("an index") as usize];
    let view = accessor["bufferView"].as_u64().expect("an index") as usize;
    let buffers = json["buffers"].as_array_mut().expect("buffers");
    let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
    let uri = crate::keyframes::document::to_base64(&bytes);
    buffers.push(json!({ "byteLength": bytes.len(),
        "uri": format!("data:application/octet-stream;base64,{uri}") }));
    let buffer = buffers.len() - 1;
    json["bufferViews"][view] = json!({ "buffer": buffer, "byteLength": bytes.len() });
}

#[test]
fn mistakes_in_moving_nodes_are_refused() {
    refused(
        &tree(),
        &[
            Mistake {
                change: |json| drop(json.as_object_mut().map(|o| o.remove("animations"))),
                animation: None,
                said: &["has no animation", "load it as a mesh without animation"],
            },
            Mistake {
                change: |_| {},
                animation: Some("al"),
                said: &["has no animation `al`", "did you mean `all`?"],
            },
            Mistake {
                change: |_| {},
                animation: Some("jump"),
                said: &["choose one of `still`, `all`"],
            },
            Mistake {
                change: |_| {},
                animation: None,
                said: &["animation `still` moves no mesh", "choose one of `all`"],
            },
            Mistake {
                change: |json| {
                    let times = json["animations"][1]["samplers"][0]["input"].clone();
                    overwrite(json, &times, &[0.5, 0.5, 1.0]);
                },
                animation: Some("all"),
                said: &[
                    "/animations/1/channels/0: keyframe 1 is not later than the one before",
                    "sort the keyframes by time",
                ],
            },
            Mistake {
                change: |json| {
                    let turns = json["animations"][1]["samplers"][1]["output"].clone();
                    let mut values = [0.0; 12];
                    values[3] = 1.0;
                    overwrite(json, &turns, &values);
                },
                animation: Some("all"),
                said: &["/animations/1/channels/1: keyframe 1 is a zero quaternion"],
            },
            Mistake {
                change: |json| {
                    let scales = json["animations"][1]["samplers"][2]["output"].clone();
                    overwrite(json, &scales, &[1.0, 1.0, 1.0, 1.0, 0.0, 1.0, 1.0, 1.0, 1.0]);
                },
                animation: Some("all"),
                said: &["/nodes/2: `turn`: the scale is zero", "leave it a small scale"],
            },
            Mistake {
                change: |json| json["nodes"][3]["scale"] = json!([1, 0, 1]),
                animation: Some("all"),
                said: &["/nodes/3: `bar`: its matrix is singular"],
            },
            Mistake {
                change: |json| {
                    let turns = json["animations"][1]["samplers"][2]["output"].clone();
                    overwrite(json, &turns, &[f32::NAN; 9]);
                },
                animation: Some("all"),
                said: &["keyframe 0 is not finite"],
            },
            Mistake {
                change: |json| json["animations"][1]["channels"][0]["target"]["node"] = json!(0),
                animation: Some("all"),
                said: &["moves node 0, which has a matrix"],
            },
            Mistake {
                change: |json| json["animations"][1]["channels"][0]["target"]["node"] = json!(9),
                animation: Some("all"),
                said: &["/animations/1/channels/0/target/node: names nodes[9]"],
            },
            Mistake {
                change: |json| json["animations"][1]["channels"][0]["sampler"] = json!(7),
                animation: Some("all"),
                said: &["/animations/1/channels/0/sampler: names samplers[7]"],
            },
            Mistake {
                change: |json| {
                    json["animations"][1]["channels"][1]["target"]["path"] = json!("translation");
                },
                animation: Some("all"),
                said: &["translations must be of type VEC3"],
            },
            Mistake {
                change: |json| {
                    json["animations"][1]["channels"][2]["target"]["node"] = json!(1);
                    json["animations"][1]["channels"][2]["target"]["path"] = json!("translation");
                },
                animation: Some("all"),
                said: &["channels/2: moves what another channel moves"],
            },
            Mistake {
                change: |json| {
                    json["animations"][1]["channels"][2]["target"]["path"] = json!("weights");
                },
                animation: Some("all"),
                said: &["weighs morph targets of node 2, which has none"],
            },
            Mistake {
                change: |json| {
                    json["animations"][1]["samplers"][2]["interpolation"] = json!("CUBICSPLINE")
                },
                animation: Some("all"),
                said: &["3 values for 3 times"],
            },
        ],
    );
}

#[test]
fn mistakes_in_skins_and_morph_targets_are_refused() {
    refused(
        &bending(),
        &[
            Mistake {
                change: |json| json["skins"][0]["joints"] = json!([2, 9]),
                animation: None,
                said: &["/skins/0/joints/1: names nodes[9], which does not exist"],
            },
            Mistake {
                change: |json| json["skins"][0]["joints"] = json!([2]),
                animation: None,
                said: &["12 vertices are bound to joints that the skin does not have (1)"],
            },
            Mistake {
                change: |json| json["skins"][0]["joints"] = json!([2, 3, 1]),
                animation: None,
                said: &["/skins/0: has 2 inverse bind matrices for 3 joints"],
            },
            Mistake {
                change: |json| {
                    let bind = json["skins"][0]["inverseBindMatrices"].clone();
                    let mut values = [0.0; 32];
                    (values[15], values[31]) = (1.0, 1.0);
                    overwrite(json, &bind, &values);
                },
                animation: None,
                said: &["the inverse bind matrix of joint 0 is singular"],
            },
            Mistake {
                change: |json| {
                    let attributes = &mut json["meshes"][0]["primitives"][0]["attributes"];
                    drop(attributes.as_object_mut().map(|o| o.remove("WEIGHTS_0")));
                },
                animation: None,
                said: &["bearer: has only one of JOINTS_0 and WEIGHTS_0"],
            },
            Mistake {
                change: |json| {
                    let attributes = &json["meshes"][0]["primitives"][0]["attributes"];
                    let weights = attributes["WEIGHTS_0"].clone();
                    overwrite(json, &weights, &[0.0; 16]);
                },
                animation: None,
                said: &["bearer: 16 vertices have no weights"],
            },
            Mistake {
                change: |json| json["nodes"][0]["weights"] = json!([1, 2]),
                animation: None,
                said: &["/nodes/0: has 2 weights for 1 morph targets"],
            },
            Mistake {
                change: |json| {
                    let target = json["meshes"][0]["primitives"][0]["targets"][0].clone();
                    json["meshes"][0]["primitives"][0]["targets"] = json!([target, {}]);
                    json["meshes"][0]["weights"] = json!([0, 0]);
                },
                animation: None,
                said: &["has 6 weights; 2 morph targets at 2 keyframes make 12"],
            },
            Mistake {
                change: |json| {
                    let target = &json["meshes"][0]["primitives"][0]["targets"][0]["POSITION"];
                    let target = target.as_u64().expect("an index") as usize;
                    json["accessors"][target]["count"] = json!(17);
                },
                animation: None,
                said: &["morph target 0 has 17 displacements for 16 vertices"],
            },
            Mistake {
                change: |json| {
                    let times = json["animations"][0]["samplers"][1]["input"].as_u64();
                    json["accessors"][times.expect("an index") as usize]["count"] =
                        json!(40_000_000);
                },
                animation: None,
                said: &["its animation has more than 16000000 numbers", "reduce keyframes"],
            },
        ],
    );
}

#[test]
fn animations_of_other_formats_are_refused() {
    let issues = load_animated(Path::new("a.obj"), &Options::default(), Choice::First);
    let issues: Vec<Issue> = issues.expect_err("no animation in OBJ");
    assert!(issues[0].message.contains("only .gltf and .glb files"), "{issues:?}");
}

const TENT: &str = "v 0 0 0\nv 9 0 0\nv 0 9 0\nv 2 2 HIGH\nv 2 2 HIGH\n\
    f 1 3 2\nf 1 2 4\nf 2 3 5\nf 1 4 3\n";

fn tents(heights: &[&str]) -> Result<(Vec<insonify::scene::Mesh>, Vec<Issue>), Vec<Issue>> {
    let folder = tempfile::tempdir().expect("temporary folder");
    let paths: Vec<_> =
        (0..heights.len()).map(|k| folder.path().join(format!("tent_{k}.obj"))).collect();
    for (path, height) in paths.iter().zip(heights) {
        std::fs::write(path, TENT.replace("HIGH", height)).expect("written");
    }
    load_keyframes(&paths, &Options::default())
}

#[test]
fn mistakes_in_files_of_keyframes_are_reported() {
    let (meshes, issues) = tents(&["9", "5", "1"]).expect("sound");
    assert!(issues.is_empty(), "{issues:?}");
    assert!(meshes.iter().all(|m| m.shares_topology(&meshes[0])));
    // Four corners, each with three creases.
    assert_eq!(meshes[2].positions.len(), 12);
    assert_eq!(tents(&[]).expect("nothing").0.len(), 0);

    // Flat and turned inside out: reported with the name of the file.
    let (_, issues) = tents(&["9", "0", "-4"]).expect("readable");
    let said: Vec<String> = issues.iter().map(ToString::to_string).collect();
    let about = |file: &str, what: &str| said.iter().any(|s| s.contains(file) && s.contains(what));
    assert!(about("tent_1.obj", "is inside out"), "{said:?}");
    assert!(about("tent_2.obj", "is inside out"), "{said:?}");
    assert!(!about("tent_0.obj", ""), "{said:?}");

    let found = tents(&["9", "nan"]).expect_err("not finite");
    assert!(found[0].to_string().contains("tent_1.obj"), "{found:?}");
    let found = tents(&["9", "9000"]).expect_err("too large");
    let text = found.iter().map(ToString::to_string).collect::<String>();
    assert!(text.contains("tent_1.obj: is 9000"), "{text}");
}

#[test]
fn files_of_different_topology_are_loaded_each_on_its_own() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let (first, second) = (folder.path().join("a.obj"), folder.path().join("b.obj"));
    std::fs::write(&first, TENT.replace("HIGH", "9")).expect("written");
    // The base in three triangles instead of one.
    let other = TENT.replace("HIGH", "9").replace("f 1 3 2", "v 1 1 0\nf 6 1 3\nf 6 3 2\nf 6 2 1");
    std::fs::write(&second, other).expect("written");
    let (meshes, _) = load_keyframes(&[first, second], &Options::default()).expect("sound");
    assert_eq!(meshes.len(), 2);
    assert!(!meshes[0].shares_topology(&meshes[1]));
}

/// A seam that opens: vertices that coincide at first, but not always, stay apart.
#[test]
fn vertices_that_separate_later_are_not_welded() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let (first, second) = (folder.path().join("a.obj"), folder.path().join("b.obj"));
    std::fs::write(&first, TENT.replace("HIGH", "9")).expect("written");
    let parted = TENT.replacen("HIGH", "9", 1).replacen("HIGH", "8", 1);
    std::fs::write(&second, parted).expect("written");
    let (meshes, issues) = load_keyframes(&[first, second], &Options::default()).expect("loads");
    assert!(meshes[0].shares_topology(&meshes[1]));
    let heights = |mesh: &insonify::scene::Mesh| {
        let mut z: Vec<_> = mesh.positions.iter().map(|p| p[2]).filter(|&z| z > 0.0).collect();
        z.dedup();
        z
    };
    assert_eq!(heights(&meshes[0]), [9.0]);
    assert_eq!(heights(&meshes[1]).iter().filter(|z| **z == 8.0).count(), 1);
    assert!(issues.iter().any(|i| i.message.contains("open edges")), "{issues:?}");
}

/// Damaged copies of sound files are read or refused, none panics.
#[test]
fn random_damage_never_panics() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let mut state = 7u64;
    let mut random = move |below: usize| {
        // Knuth's MMIX generator.
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 33) as usize % below
    };
    for sound in [tree(), bending()] {
        let sound = sound.to_string().into_bytes();
        let path = folder.path().join("made.gltf");
        let options = Options { units: Units::named("cm"), ..Options::default() };
        let mut refused = 0;
        for _ in 0..1500 {
            let mut bytes = sound.clone();
            for _ in 0..=random(3) {
                let at = random(bytes.len());
                match random(3) {
                    0 => bytes[at] ^= 1 << random(8),
                    1 => bytes[at] = b"0123456789-,.[]{}ABC\xff"[random(21)],
                    _ => {
                        let copy = bytes[at..(at + 9).min(bytes.len())].to_vec();
                        bytes.splice(at..at, copy);
                    }
                }
            }
            std::fs::write(&path, &bytes).expect("written");
            for number in [0, 1] {
                let choice = Choice::Number(number);
                refused += usize::from(load_animated(&path, &options, choice).is_err());
            }
        }
        println!("{refused} of 3000 readings of damaged copies were refused");
        assert!(refused < 3000, "some damage does no harm");
    }
}
