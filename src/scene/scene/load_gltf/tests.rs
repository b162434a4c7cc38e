use gltf::mesh::Mode;

use super::surface::assemble;
use super::*;

/// A triangle (0,0,0) (1,0,0) (0,1,0) as little-endian floats in a data URI.
const TRIANGLE: &str =
    "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA";

fn file(node: &str, mode: u32, buffer: &str) -> String {
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[0]}}],"nodes":[{node}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"mode":{mode}}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3",
            "min":[0,0,0],"max":[1,1,0]}}],
        "bufferViews":[{{"buffer":0,"byteLength":36}}],
        "buffers":[{{"byteLength":36,"uri":"{buffer}"}}]}}"#
    )
}

fn load(text: &str) -> Result<Parts, Vec<Issue>> {
    read(Path::new("x.gltf"), text.as_bytes(), None)
}

fn triangle(parts: &Parts) -> [[f32; 3]; 3] {
    let soup = &parts.parts[0];
    soup.triangles[0].map(|i| soup.positions[i as usize])
}

#[test]
fn node_transforms_are_applied_and_mirroring_turns_the_winding() {
    let moved = r#"{"mesh":0,"translation":[1,2,3],"scale":[2,2,2]}"#;
    let parts = load(&file(moved, 4, TRIANGLE)).expect("readable");
    assert_eq!(triangle(&parts), [[1.0, 2.0, 3.0], [3.0, 2.0, 3.0], [1.0, 4.0, 3.0]]);

    let mirrored = load(&file(r#"{"mesh":0,"scale":[-1,1,1]}"#, 4, TRIANGLE)).expect("readable");
    // Seen from +z it still turns counter-clockwise.
    assert_eq!(triangle(&mirrored), [[0.0; 3], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]);
}

#[test]
fn metres_are_read_unless_a_unit_is_stated() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let path = folder.path().join("x.gltf");
    std::fs::write(&path, file(r#"{"mesh":0}"#, 4, TRIANGLE)).expect("written");
    let size = |units| {
        let options = mesh::Options { units, ..Default::default() };
        mesh::inspect(&path, &options).facts.size()
    };
    assert_eq!(size(None), 1000.0);
    assert_eq!(size(mesh::Units::named("mm")), 1.0);
}

#[test]
fn strips_and_fans_alternate_as_specified() {
    let (strip, _) = assemble(Mode::TriangleStrip, &[0, 1, 2, 3, 4]);
    assert_eq!(strip, [[0, 1, 2], [1, 3, 2], [2, 3, 4]]);
    let (fan, _) = assemble(Mode::TriangleFan, &[0, 1, 2, 3]);
    assert_eq!(fan, [[1, 2, 0], [2, 3, 0]]);
    let (list, left) = assemble(Mode::Triangles, &[0, 1, 2, 3]);
    assert_eq!((list.len(), left), (1, 1));
}

#[test]
fn planted_faults_are_errors() {
    let sound = file(r#"{"mesh":0}"#, 4, TRIANGLE);
    assert!(load(&sound).is_ok());
    for (from, to, cause) in [
        ("\"byteLength\":36,\"uri\"", "\"byteLength\":360,\"uri\"", "cut off"),
        ("\"count\":3", "\"count\":4", "beyond"),
        ("\"count\":3", "\"count\":4000000000", "too many"),
        ("data:", "http://somewhere/", "not beside"),
        ("data:application", "missing", "cannot be read"),
        ("data:application/octet-stream;base64,", "%2Fdev/zero", "not beside"),
        ("data:application/octet-stream;base64,", "..%2F", "not beside"),
        ("data:application/octet-stream;base64,", "a/%2e%2E/", "not beside"),
        ("data:application/octet-stream;base64,", "file%3A", "not beside"),
    ] {
        let broken = sound.replace(from, to);
        assert_ne!(broken, sound);
        let issues = load(&broken).err().unwrap_or_default();
        let all: String = issues.iter().map(ToString::to_string).collect();
        assert!(all.contains(cause), "{cause}: {all}");
    }
}

/// Whatever a file's address names, no more is read than it declares, and a pipe is not waited for.
#[test]
fn buffers_are_files_in_the_folder_read_as_far_as_declared() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.gltf");
    let read = |uri: &str| read(&path, file(r#"{"mesh":0}"#, 4, uri).as_bytes(), None);
    let bytes: Vec<u8> = [0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]
        .iter()
        .flat_map(|v| v.to_le_bytes())
        .collect();
    std::fs::create_dir(folder.path().join("in")).expect("made");
    for name in ["a b.bin", "in/b.bin"] {
        std::fs::write(folder.path().join(name), &bytes).expect("written");
    }
    assert!(read("a%20b.bin").is_ok() && read("./in/b.bin").is_ok());
    // Sparse, larger than memory, and too large for a file that is read whole.
    let huge = std::fs::File::create(folder.path().join("huge.bin")).expect("made");
    huge.set_len(1 << 40).expect("sized");
    assert!(read("huge.bin").is_ok());
    let pipe = std::process::Command::new("mkfifo").arg(folder.path().join("pipe.bin")).status();
    if pipe.is_ok_and(|status| status.success()) {
        let issues = read("pipe%2Ebin").expect_err("a pipe");
        assert!(issues[0].message.contains("is not a file"), "{issues:?}");
    }
}

#[test]
fn a_loop_of_nodes_ends_in_an_error() {
    let text = file(r#"{"mesh":0,"children":[1]},{"children":[0]}"#, 4, TRIANGLE);
    let issues = load(&text).err().unwrap_or_default();
    assert!(issues[0].message.contains("own ancestor"), "{issues:?}");
}

/// Findings on a sound file after one replacement.
fn spoiled(from: &str, to: &str) -> String {
    let sound = file(r#"{"mesh":0}"#, 4, TRIANGLE);
    let broken = sound.replacen(from, to, 1);
    assert_ne!(broken, sound, "{from}");
    let issues = load(&broken).map_or_else(|issues| issues, |parts| parts.issues);
    issues.iter().map(|i| format!("{i}\n")).collect()
}

#[test]
fn a_sound_file_has_no_findings() {
    let parts = load(&file(r#"{"mesh":0}"#, 4, TRIANGLE)).expect("readable");
    assert!(parts.issues.is_empty(), "{:?}", parts.issues);
}

#[test]
fn planted_breaches_of_the_specification_are_named_where_they_are() {
    for (from, to, finding) in [
        ("\"asset\"", "\"assett\":1,\"asset\"", "warning: x.gltf: /assett: is not a property"),
        ("{\"version\":\"2.0\"}", "{\"version\":\"3.0\"}", "error: x.gltf: /asset/version: is 3.0"),
        ("\"nodes\":[0]", "\"nodes\":[1]", "error: x.gltf: /scenes/0/nodes/0: names nodes[1]"),
        ("{\"mesh\":0}", "{\"mesh\":\"0\"}", "error: x.gltf: /nodes/0/mesh: is not an index"),
        ("5126", "5127", "error: x.gltf: /accessors/0/componentType: is 5127"),
        ("\"max\":[1,1,0]", "\"max\":[1,2,0]", "warning: x.gltf: /accessors/0: its max is stated"),
        ("\"max\":[1,1,0]", "\"max\":[1,1]", "error: x.gltf: /accessors/0/max: should have 3"),
        (
            "\"byteLength\":36}",
            "\"byteLength\":37}",
            "error: x.gltf: /bufferViews/0: ends at byte 37",
        ),
        (
            "{\"mesh\":0}",
            "{\"mesh\":0,\"rotation\":[0,0,0,0.5]}",
            "error: x.gltf: /nodes/0/rotation: has length",
        ),
        (
            "\"asset\"",
            "\"cameras\":[{\"type\":\"fisheye\"}],\"asset\"",
            "warning: x.gltf: /cameras/0/type",
        ),
        (
            "\"asset\"",
            "\"extensionsUsed\":[\"KHR_draco_mesh_compression\"],\"extensionsRequired\":[\"KHR_draco_mesh_compression\"],\"asset\"",
            "error: x.gltf: /meshes: the file requires the extension KHR_draco",
        ),
    ] {
        let found = spoiled(from, to);
        assert!(found.contains(finding), "{finding}:\n{found}");
    }
}

#[test]
fn broken_containers_are_errors() {
    let json = file(r#"{"mesh":0}"#, 4, TRIANGLE);
    let glb = |version: u32, length: i64, chunk: i64, kind: &[u8]| {
        let mut padded = json.clone().into_bytes();
        padded.resize(padded.len().next_multiple_of(4), b' ');
        let total = 20 + padded.len() as i64;
        let mut out = b"glTF".to_vec();
        out.extend(version.to_le_bytes());
        out.extend(((total + length) as u32).to_le_bytes());
        out.extend(((padded.len() as i64 + chunk) as u32).to_le_bytes());
        out.extend(kind);
        out.extend(padded);
        out
    };
    let load = |bytes: &[u8]| {
        let result = read(Path::new("x.glb"), bytes, None);
        result.map(|_| ()).map_err(|issues| issues[0].message.clone())
    };
    assert_eq!(load(&glb(2, 0, 0, b"JSON")), Ok(()));
    for (bytes, cause) in [
        (glb(1, 0, 0, b"JSON"), "version 1"),
        (glb(2, 9, 0, b"JSON"), "declares"),
        (glb(2, 0, 8, b"JSON"), "beyond the file"),
        (glb(2, 0, 0, b"BIN\0"), "not JSON"),
        (b"glTF".to_vec(), "cut off"),
        (b"gl".to_vec(), "not a GLB"),
    ] {
        let message = load(&bytes).expect_err(cause);
        assert!(message.contains(cause), "{cause}: {message}");
    }
}
