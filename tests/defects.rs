//! Files and scenes that once took memory or time without bound, were misread in silence, or were refused with a
//! word about something else.

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use tempfile::TempDir;

use crate::common::limited;
use crate::common::limited::{Outcome, check};

/// A folder for the files of a test.
fn folder() -> TempDir {
    tempfile::tempdir().expect("a folder")
}

/// `insonify check` on a file of this content.
fn checked(folder: &TempDir, name: &str, content: impl AsRef<[u8]>) -> Outcome {
    let path = folder.path().join(name);
    fs::write(&path, content).expect("written");
    check(&path)
}

/// A file of `size` zeros behind `head`, which takes no room on the disk.
fn sparse(folder: &TempDir, name: &str, head: &[u8], size: u64) -> PathBuf {
    let path = folder.path().join(name);
    let mut file = fs::File::create(&path).expect("created");
    file.write_all(head).expect("written");
    file.set_len(head.len() as u64 + size).expect("sized");
    path
}

/// Asserts that a file is refused, and that all of `words` are said about it.
fn refused(outcome: &Outcome, words: &[&str]) {
    assert_eq!(outcome.code, Some(1), "{}", outcome.text);
    for word in words {
        assert!(outcome.text.contains(word), "`{word}` is not in:\n{}", outcome.text);
    }
}

#[test]
fn buffers_of_gltf_are_files_in_its_folder() {
    let folder = folder();
    for uri in ["%2Fdev%2Fzero", "file:/dev/zero", "file:../../../dev/zero", "..%2fa", "%2e%2e/a"] {
        let text = format!(
            r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"byteLength":4,"uri":"{uri}"}}]}}"#
        );
        let outcome = checked(&folder, "zero.gltf", text);
        refused(&outcome, &["which is not beside the file"]);
    }
}

/// PLUS writes 880 bytes for a frame; a quarter of an hour has 27,000.
#[test]
fn headers_of_long_sequences_are_read() {
    let folder = folder();
    let frames = 27_000;
    let mut text = format!(
        "ObjectType = Image\nNDims = 3\nDimSize = 2 2 {frames}\nElementSpacing = 1 1 1\n\
         ElementType = MET_UCHAR\nKinds = domain domain list\n"
    );
    for frame in 0..frames {
        for name in ["ProbeToTracker", "ReferenceToTracker", "StylusToTracker"] {
            text += &format!(
                "Seq_Frame{frame:04}_{name}Transform = 1.000000 0.000000 0.000000 10.000000 \
                 0.000000 1.000000 0.000000 20.000000 0.000000 0.000000 1.000000 30.000000 0 0 0 1\n\
                 Seq_Frame{frame:04}_{name}TransformStatus = OK\n"
            );
        }
        text += &format!("Seq_Frame{frame:04}_Timestamp = {}\n", f64::from(frame) / 30.0);
    }
    text += "ElementDataFile = LOCAL\n";
    assert!(text.len() > 16 << 20, "{}", text.len());
    let mut bytes = text.into_bytes();
    bytes.resize(bytes.len() + 4 * frames as usize, 7);
    let outcome = checked(&folder, "long.igs.mha", &bytes);
    assert_eq!(outcome.code, Some(0), "{}", outcome.text);
    assert!(outcome.text.contains("27000"), "{}", outcome.text);
    // Without an end, the reason is the length, and only so much is read.
    let endless = sparse(&folder, "endless.mha", b"NDims = 3\n", 8 << 30);
    refused(&check(&endless), &["the header does not end within 64 MB"]);
    let lines = [&b"NDims = 3\n"[..], &b"a =\n".repeat(2 << 20)].concat();
    refused(&checked(&folder, "lines.mha", lines), &["the header does not end within"]);
}

#[test]
fn only_what_is_dicom_is_read_as_dicom() {
    let folder = folder();
    let zeros = sparse(&folder, "zeros.dcm", b"", 5 << 30);
    refused(&check(&zeros), &["is no DICOM file"]);
    let mut head = vec![0; 128];
    head.extend(b"DICM");
    let big = sparse(&folder, "big.dcm", &head, 5 << 30);
    refused(&check(&big), &["is 5120 MB, the limit is 2048 MB"]);
}

/// 560 MB of address space leave no room for a second copy of 300.
#[test]
fn a_volume_is_in_memory_once() {
    let folder = folder();
    let head = "ObjectType = Image\nNDims = 3\nDimSize = 670 670 670\nElementType = MET_UCHAR\n\
                ElementDataFile = LOCAL\n";
    let volume = sparse(&folder, "volume.mha", head.as_bytes(), 670 * 670 * 670);
    let outcome = limited::limited("ulimit -v 560000; exec \"$0\" check \"$1\"", &volume);
    assert_eq!(outcome.code, Some(0), "{}", outcome.text);
}

/// Files of a few bytes that declare as much as the limits allow, and more.
#[test]
fn declared_counts_take_no_memory() {
    let folder = folder();
    let ply = |format: &str, count: &str| {
        format!(
            "ply\nformat {format} 1.0\nelement vertex {count}\nproperty float x\nproperty float y\n\
             property float z\nelement face {count}\nproperty list uint int vertex_indices\nend_header\n1 2"
        )
    };
    let vtk = |form: &str, rest: &str| {
        format!("# vtk DataFile Version 5.1\nt\n{form}\nDATASET POLYDATA\n{rest}")
    };
    let vtp = |count: u64| {
        format!(
            "<VTKFile type=\"PolyData\" byte_order=\"LittleEndian\" compressor=\"vtkZLibDataCompressor\">\
             <PolyData><Piece NumberOfPoints=\"{count}\" NumberOfPolys=\"{count}\"><Points><DataArray \
             type=\"Float32\" format=\"binary\">/////////////////////w==</DataArray></Points></Piece>"
        )
    };
    let list = "POLYGONS 20000000 20000000\nOFFSETS vtktypeint64\n";
    for (name, content) in [
        ("a.ply", ply("ascii", "4000000")),
        ("b.ply", ply("binary_little_endian", "4000000")),
        ("c.ply", ply("binary_little_endian", "18446744073709551615")),
        ("a.off", "OFF\n4000000 4000000 0\n1 2 3\n".to_owned()),
        ("a.vtk", vtk("ASCII", "POINTS 4000000 double\n1 2")),
        ("b.vtk", vtk("BINARY", "POINTS 4000000 double\n1 2")),
        ("c.vtk", vtk("BINARY", list)),
        ("d.vtk", vtk("ASCII", "FIELD f 9000000000\na 1 9000000000 string\n")),
        ("a.vtp", vtp(4_000_000)),
        ("b.vtp", vtp(u64::MAX)),
        ("a.3mf", "PK\u{3}\u{4}".to_owned()),
    ] {
        let outcome = checked(&folder, name, content);
        refused(&outcome, &["error: ", "; "]);
        assert!(!outcome.text.contains("holds no triangles"), "{}", outcome.text);
    }
}

const LINEAR: &str = "[probe]\npreset = \"linear\"\n";

/// `check` and `render` say the same about what would never end, before anything is made.
#[test]
fn totals_of_a_scene_are_bounded() {
    let folder = folder();
    let spheres = (0..200).map(|i| {
        format!(
            "[[mesh]]\nname = \"s{i}\"\ntissue = \"fat\"\nshape = {{ sphere = {{ radius = 3, \
             subdivisions = 8 }} }}\n"
        )
    });
    let cells =
        "[simulation]\ncell = 0.01\ndensity_scale = 100\nscatterers_per_resolution_cell = 0\n";
    let fine = "background = \"liver\"\n".to_owned() + LINEAR + cells;
    for (text, words) in [
        (
            "[[wire]]\nfrom = [0, 0, 1]\nto = [0, 100000, 1]\nspacing = 0.001\n".to_owned(),
            ["points", "spacing"],
        ),
        (spheres.collect(), ["triangles; it may have 16000000", "lower `subdivisions`"]),
        (fine, ["lattice cells of scatterers", "enlarge simulation.cell"]),
    ] {
        refused(&checked(&folder, "totals.toml", &text), &words);
        // The device has its own memory: only the time is limited for it.
        let path = folder.path().join("scene.toml");
        fs::write(&path, &text).expect("written");
        let mut command = assert_cmd::Command::new(env!("CARGO_BIN_EXE_insonify"));
        command.arg("render").arg(&path).args(["-o", "/dev/null", "--tracer", "bvh"]);
        let output =
            command.timeout(std::time::Duration::from_secs(240)).output().expect("started");
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        refused(&Outcome { code: output.status.code(), text }, &words);
    }
}

/// Thousands of meshes and of groups.
#[test]
fn check_is_linear_in_meshes_and_deep_nesting_is_refused() {
    let folder = folder();
    let many = |count: u32| {
        (0..count).map(|i| {
            format!(
                "[[mesh]]\nname = \"m{i}\"\ntissue = \"fat\"\nshape = {{ box = {{ size = [1, 1, 1] }} }}\n\
                 translate = [{}, {}, {}]\n",
                i % 40 * 2, i / 40 % 40 * 2, i / 1600 * 2
            )
        })
    };
    let text: String = many(8000).collect();
    let outcome = checked(&folder, "many.toml", text);
    assert_eq!(outcome.code, Some(0), "{}", outcome.text.lines().last().unwrap_or_default());
    let mut deep = "[[group]]\nname = \"g0\"\n".to_owned();
    for i in 1..20_000 {
        deep += &format!("[[group]]\nname = \"g{i}\"\nparent = \"g{}\"\n", i - 1);
    }
    let outcome = checked(&folder, "deep.toml", deep);
    refused(&outcome, &["has more than 100 nodes above it"]);
    assert!(outcome.text.len() < 2000, "{}", outcome.text.len());
}

/// Two cubes with a wall between them, of three triangles at its edges.
#[test]
fn an_inner_wall_leaks_and_has_no_volume() {
    let folder = folder();
    let corners = "v 0 0 0\nv 10 0 0\nv 20 0 0\nv 0 10 0\nv 10 10 0\nv 20 10 0\nv 0 0 10\nv 10 0 10\n\
        v 20 0 10\nv 0 10 10\nv 10 10 10\nv 20 10 10\n";
    let outer = "f 1 4 5 2\nf 2 5 6 3\nf 7 8 11 10\nf 8 9 12 11\nf 1 2 8 7\nf 2 3 9 8\nf 4 10 11 5\n\
        f 5 11 12 6\nf 1 7 10 4\nf 3 6 12 9\n";
    let outcome = checked(&folder, "wall.obj", format!("{corners}{outer}f 2 5 11 8\n"));
    let (told, words) = (&outcome.text, ["open (4 edges)", "4 edges at which an inner wall ends"]);
    assert!(words.iter().all(|word| told.contains(word)), "{told}");
    assert!(!told.contains(" ml"), "{told}");
    let outcome = checked(&folder, "box.obj", format!("{corners}{outer}"));
    assert!(
        outcome.text.contains("2.000 ml") && outcome.text.contains("0 warnings"),
        "{}",
        outcome.text
    );
}

/// Messages once said something else than what is wrong, or not what to do.
#[test]
fn messages_say_cause_and_remedy() {
    let folder = folder();
    let utf16 = |text: &str| {
        let bytes = text.encode_utf16().flat_map(u16::to_le_bytes);
        [&[0xff, 0xfe][..], &bytes.collect::<Vec<_>>()].concat()
    };
    let cube = "v 0 0 0\nv 1e35 0 0\nv 0 1e35 0\nf 1 2 3\n";
    let gltf = |rest: &str| format!("{{\"asset\":{{\"version\":\"2.0\"}}{rest}}}");
    let old = "{\"asset\":{\"version\":\"1.0\"},\"accessors\":{},\"buffers\":{},\"meshes\":{},\"nodes\":{}}";
    let shape =
        "[[mesh]]\nname = \"a\"\ntissue = \"fat\"\nshape = { sphere = { radius = 1e300 } }\n";
    for (name, content, words) in [
        (
            "self.toml",
            b"[tissues.a]\nbased_on = \"a\"\n".to_vec(),
            ["`a` is based on itself", "leave `based_on` out"],
        ),
        ("utf16.toml", utf16("name = \"a\""), ["is text in UTF-16", "save it as UTF-8"]),
        (
            "latin.toml",
            b"name = 'a'\n# M\xe4r\n".to_vec(),
            ["not text in UTF-8: line 2", "save it as UTF-8"],
        ),
        (
            "null.toml",
            b"[probe]\ndepth = null\n".to_vec(),
            ["null.toml:2:9: `null` is no value", "leave the key out"],
        ),
        ("long.toml", shape.into(), ["radius is 1e300 mm", "between 0.001 and 10000"]),
        ("utf16.obj", utf16("v 0 0 0\n"), ["is text in UTF-16", "save it as UTF-8"]),
        ("large.obj", cube.into(), ["is 1.000e35 mm large", "scale it"]),
        (
            "small.obj",
            cube.replace("1e35", "0.1").into(),
            ["is 0.1000 mm large", "units = \"m\" in its [[mesh]]"],
        ),
        (
            "missing.gltf",
            gltf(",\"buffers\":[{\"byteLength\":4,\"uri\":\"b.bin\"}]").into(),
            ["`b.bin` cannot be read", "restore the file"],
        ),
        ("old.gltf", old.into(), ["is 1.0; glTF 2.0 can be read", "export it as glTF 2.0"]),
    ] {
        let outcome = checked(&folder, name, content);
        refused(&outcome, &words);
        assert!(outcome.text.matches("error: ").count() == 1, "{}", outcome.text);
    }
    for (path, word) in [("/", "is a folder"), ("/dev/zero", "is a pipe or a device")] {
        let path = Path::new(path);
        let link = folder.path().join("link.toml");
        let _ = fs::remove_file(&link);
        std::os::unix::fs::symlink(path, &link).expect("linked");
        refused(&check(&link), &[word]);
    }
    let large = sparse(&folder, "large.toml", b"", 100 << 20);
    refused(&check(&large), &["is 100 MB; a scene file may have 4"]);
}

/// `--set` on a list that the file does not have.
#[test]
fn an_element_of_no_list_is_told() {
    let folder = folder();
    let path = folder.path().join("empty.toml");
    fs::write(&path, LINEAR).expect("written");
    let outcome = limited::limited("exec \"$0\" render \"$1\" --set mesh.5.tissue=fat", &path);
    refused(&outcome, &["there is no mesh `5`: the file has no [[mesh]]"]);
}

/// Nobody reads what is said: the exit code is that of the work.
#[test]
fn a_closed_standard_error_is_no_panic() {
    let folder = folder();
    let path = folder.path().join("self.toml");
    fs::write(&path, "[tissues.a]\nbased_on = \"a\"\n").expect("written");
    let run = |args: &[&str], path: &Path| {
        let (reader, writer) = std::io::pipe().expect("a pipe");
        drop(reader);
        let mut command = Command::new(env!("CARGO_BIN_EXE_insonify"));
        command.args(args).arg(path).stdout(Stdio::null()).stderr(writer);
        command.status().expect("the program starts").code()
    };
    assert_eq!(run(&["check"], &path), Some(1));
    assert_eq!(run(&["render"], &path), Some(1));
    // A word on the way is dropped as well.
    let sound = folder.path().join("sound.toml");
    fs::write(&sound, "[tissues.a]\nbased_on = \"fat\"\n").expect("written");
    assert_eq!(run(&["check"], &sound), Some(0));
}
