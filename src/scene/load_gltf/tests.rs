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
    assert_eq!(
        triangle(&parts),
        [[1.0, 2.0, 3.0], [3.0, 2.0, 3.0], [1.0, 4.0, 3.0]]
    );

    let mirrored = load(&file(r#"{"mesh":0,"scale":[-1,1,1]}"#, 4, TRIANGLE)).expect("readable");
    // Seen from +z it still turns counter-clockwise.
    assert_eq!(
        triangle(&mirrored),
        [[0.0; 3], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]
    );
}

#[test]
fn metres_are_read_unless_a_unit_is_stated() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let path = folder.path().join("x.gltf");
    std::fs::write(&path, file(r#"{"mesh":0}"#, 4, TRIANGLE)).expect("written");
    let size = |units| {
        let options = mesh::Options {
            units,
            ..Default::default()
        };
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
        (
            "\"byteLength\":36,\"uri\"",
            "\"byteLength\":360,\"uri\"",
            "cut off",
        ),
        ("\"count\":3", "\"count\":4", "beyond"),
        ("\"count\":3", "\"count\":4000000000", "too many"),
        ("data:", "http://somewhere/", "not beside"),
        ("data:application", "missing", "cannot be read"),
    ] {
        let broken = sound.replace(from, to);
        assert_ne!(broken, sound);
        let issues = load(&broken).err().unwrap_or_default();
        let all: String = issues.iter().map(ToString::to_string).collect();
        assert!(all.contains(cause), "{cause}: {all}");
    }
}

#[test]
fn a_loop_of_nodes_ends_in_an_error() {
    let text = file(r#"{"mesh":0,"children":[1]},{"children":[0]}"#, 4, TRIANGLE);
    let issues = load(&text).err().unwrap_or_default();
    assert!(issues[0].message.contains("reached twice"), "{issues:?}");
}
