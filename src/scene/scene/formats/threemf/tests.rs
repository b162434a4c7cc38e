use std::io::Write as _;

use zip::ZipWriter;
use zip::write::SimpleFileOptions;

use super::*;

/// An archive of these files.
fn archive(files: &[(&str, &str)]) -> Vec<u8> {
    let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, content) in files {
        writer.start_file(*name, SimpleFileOptions::default()).expect("memory");
        writer.write_all(content.as_bytes()).expect("memory");
    }
    writer.finish().expect("memory").into_inner()
}

const RELATIONS: &str = "<Relationships><Relationship Target=\"/3D/a.model\" Id=\"rel0\" \
    Type=\"http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel\"/></Relationships>";
const MESH: &str = "<mesh><vertices><vertex x=\"0\" y=\"0\" z=\"0\"/><vertex x=\"1\" y=\"0\" \
    z=\"0\"/><vertex x=\"0\" y=\"1\" z=\"0\"/></vertices><triangles><triangle v1=\"0\" v2=\"1\" \
    v3=\"2\"/></triangles></mesh>";

/// A triangle placed by an item, and twice by components of an object, once mirrored.
fn model() -> String {
    format!(
        "<?xml version=\"1.0\"?><model unit=\"centimeter\" xmlns:p=\"production\"><resources>\
         <object id=\"1\" type=\"model\" name=\"a &amp; b\">{MESH}</object>\
         <object id=\"2\"><components><component objectid=\"1\" \
         transform=\"0 1 0 -1 0 0 0 0 1 5 0 0\"/><component objectid=\"1\" \
         transform=\"-1 0 0 0 1 0 0 0 1 0 0 0\"/></components></object>\
         <object id=\"9\" type=\"support\">{MESH}</object></resources>\
         <build><item objectid=\"1\"/><item objectid=\"2\" \
         transform=\"2 0 0 0 2 0 0 0 2 0 0 7\"/><item objectid=\"9\"/></build></model>"
    )
}

fn load(model: &str) -> Result<Parts, Vec<Issue>> {
    let files = [("_rels/.rels", RELATIONS), ("3D/a.model", model)];
    read(Path::new("x.3mf"), &archive(&files))
}

#[test]
fn items_and_components_are_placed() {
    let parts = load(&model()).unwrap_or_else(|e| panic!("{e:?}"));
    assert_eq!(parts.units, Some(Units(10.0)));
    assert_eq!(parts.issues.len(), 1, "{:?}", parts.issues);
    let soups = parts.parts.iter().map(|s| (s.name.as_str(), s.positions[1], s.triangles[0]));
    let soups: Vec<_> = soups.collect();
    // A quarter of a turn about z and 5 along x, then twice as large and 7 up.
    let turned = ("a & b", [10.0, 2.0, 7.0], [0, 1, 2]);
    let mirrored = ("a & b", [-2.0, 0.0, 7.0], [0, 2, 1]);
    assert_eq!(soups, [("a & b", [1.0, 0.0, 0.0], [0, 1, 2]), turned, mirrored]);
}

#[test]
fn objects_may_lie_in_another_model() {
    let root = "<model><build><item objectid=\"4\" p:path=\"/3D/b.model\"/></build></model>";
    let other = format!("<model><resources><object id=\"4\">{MESH}</object></resources></model>");
    let files = [("3D/3dmodel.model", root), ("3D/b.model", &other)];
    let parts = read(Path::new("x.3mf"), &archive(&files)).expect("readable");
    assert_eq!((parts.parts[0].triangles.len(), parts.units), (1, Some(Units(1.0))));
}

#[test]
fn planted_faults_are_named() {
    let model = model();
    for (from, to, cause) in [
        ("centimeter", "ell", "`ell` is no unit"),
        ("v3=\"2\"", "v3=\"3\"", "vertex 3, counted from 0, and there are 3"),
        ("v3=\"2\"", "v3=\"-2\"", "`-2` is no number"),
        ("v3=\"2\"", "", "lacks `v3`"),
        ("item objectid=\"1\"", "item objectid=\"7\"", "object 7"),
        ("component objectid=\"1\"", "component objectid=\"2\"", "object 2, which does not stand"),
        ("2 0 0 0 2 0 0 0 2 0 0 7", "2 0 0 0 2 0 0 0 2 0 0", "no transform of 12 numbers"),
        ("</mesh>", "</mash>", "is not valid XML"),
    ] {
        let broken = model.replace(from, to);
        assert_ne!(broken, model, "{from}");
        let message = load(&broken).expect_err(cause)[0].to_string();
        assert!(message.contains(cause), "{cause}: {message}");
    }
    assert!(read(Path::new("x.3mf"), b"PK\x03\x04").is_err());
    assert!(read(Path::new("x.3mf"), &archive(&[])).is_err());
    let many = b"PK\x01\x02".repeat(MAX_FILES + 1);
    assert!(read(Path::new("x.3mf"), &many).expect_err("many")[0].message.contains("files"));
}

/// Each object holds ten of the one before: 10^30 triangles in a few kilobytes.
#[test]
fn components_do_not_multiply_without_bound() {
    let mut text = format!("<model><resources><object id=\"0\">{MESH}</object>");
    for id in 1..=30 {
        let one = format!("<component objectid=\"{}\"/>", id - 1);
        text +=
            &format!("<object id=\"{id}\"><components>{}</components></object>", one.repeat(10));
    }
    let end =
        |text: &str| format!("{text}</resources><build><item objectid=\"30\"/></build></model>");
    let issues = load(&end(&text)).expect_err("a bomb");
    assert!(issues[0].message.contains("too many"), "{issues:?}");
    // Without triangles they are as many objects.
    let issues = load(&end(&text.replace(MESH, ""))).expect_err("a bomb");
    assert!(issues[0].message.contains("places"), "{issues:?}");
}
