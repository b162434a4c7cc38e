//! Bad input: every mesh at hand and scenes with planted mistakes, through the program itself.

use std::collections::BTreeMap;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use assert_cmd::Command;

use crate::common::limited::{Outcome, check, files, limited, limited_to};
use crate::common::shared_data::shared_data;
use crate::common::skip::{Lacking, skip};

/// Files that look like meshes, readable or not, in a fixed order.
fn meshes(folder: &Path) -> Vec<PathBuf> {
    let kinds = ["obj", "stl", "gltf", "glb", "ply", "off", "vtk", "vtp", "3mf"];
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

/// PLY, OFF and STL files have the triangles and boxes that an independent reader (trimesh) finds.
#[test]
fn meshes_are_read_as_trimesh_reads_them() {
    let Some(data) = shared_data() else { return };
    let facts = std::fs::read_to_string(data.join("corpus-trimesh/facts-mesh.tsv"));
    let facts = facts.expect("the facts");
    let (mut compared, mut wrong) = (BTreeMap::new(), Vec::new());
    for line in facts.lines() {
        let Some((name, facts)) = line.split_once('\t') else { continue };
        let path = data.join("corpus-trimesh").join(name);
        let kind = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_lowercase();
        if !["ply", "off", "stl"].contains(&kind.as_str()) {
            continue;
        }
        let Some(wanted) = trimesh(facts) else { continue };
        let millimetres = insonify::scene::mesh::Units(1.0);
        let options =
            insonify::scene::mesh::Options { units: Some(millimetres), ..Default::default() };
        let found = insonify::scene::mesh::inspect(&path, &options).facts;
        *compared.entry(kind).or_insert(0) += 1;
        if let Some(difference) = unlike(&wanted, &found) {
            wrong.push(format!("{name}: {difference}\n{facts}\n{found:?}"));
        }
    }
    println!("compared: {compared:?}");
    assert!(compared.get("ply").is_some_and(|n| *n >= 10), "{compared:?}");
    assert!(compared.contains_key("off") && compared.contains_key("stl"), "{compared:?}");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Triangles and box that trimesh states: `F=12 bbox=[0, 0, 0]..[1, 1, 1] degen=0`.
struct Trimesh {
    triangles: usize,
    corners: [Vec<f64>; 2],
}

fn trimesh(facts: &str) -> Option<Trimesh> {
    let number = |key: &str| facts.split_once(key)?.1.split_whitespace().next()?.parse().ok();
    let triangles: usize = number(" F=")?;
    let degenerate: usize = number("degen=")?;
    let (_, rest) = facts.split_once("bbox=[")?;
    let (low, rest) = rest.split_once("]..[")?;
    let (high, _) = rest.split_once(']')?;
    let corner = |text: &str| text.split(", ").map(|v| v.parse().ok()).collect::<Option<Vec<_>>>();
    Some(Trimesh { triangles: triangles - degenerate, corners: [corner(low)?, corner(high)?] })
}

/// The difference between what trimesh states, in four digits, and what was found. Doubled triangles, which it does
/// not count, may be fewer.
fn unlike(wanted: &Trimesh, found: &insonify::scene::check::Facts) -> Option<String> {
    if found.triangles > wanted.triangles || found.triangles * 20 < wanted.triangles * 19 {
        return Some(format!("{} triangles of {}", found.triangles, wanted.triangles));
    }
    let corners = wanted.corners.iter().zip([found.min, found.max]);
    let size = found.size();
    let off =
        corners.flat_map(|(w, f)| w.iter().zip(f).map(|(w, f)| (w - f).abs()).collect::<Vec<_>>());
    let off = off.fold(0.0, f64::max);
    (off > 0.01 * size + 0.006).then(|| format!("a corner is {off} away"))
}

#[test]
fn planted_differences_to_trimesh_are_noticed() {
    let wanted = trimesh("V=8 F=12 bbox=[0, 0, 0]..[1, 2, 3] degen=0 vol=6").expect("facts");
    let facts = |triangles, z| insonify::scene::check::Facts {
        triangles,
        max: [1.0, 2.0, z],
        ..Default::default()
    };
    assert_eq!(unlike(&wanted, &facts(12, 3.0)), None);
    for found in [facts(11, 3.0), facts(13, 3.0), facts(12, 3.1), facts(0, 3.0)] {
        assert!(unlike(&wanted, &found).is_some());
    }
}

/// The same organs as OBJ and as legacy VTK.
#[test]
fn organs_are_alike_in_both_formats() {
    use insonify::scene::mesh::{self, Options};
    let Some(data) = shared_data() else { return };
    let folder = data.join("liver-scikit-surgery");
    let vtk = files(&folder.join("orig"), |path| path.extension().is_some_and(|e| e == "vtk"));
    let mut compared = 0;
    for path in vtk {
        let found = mesh::inspect(&path, &Options::default());
        assert!(found.mesh.is_some(), "{}: {:?}", path.display(), found.issues);
        let name = path.file_stem().expect("a name");
        let obj = folder.join("obj").join(name).with_extension("obj");
        if !obj.is_file() {
            continue;
        }
        compared += 1;
        let other = mesh::inspect(&obj, &Options::default());
        let (a, b) = (&found.facts, &other.facts);
        println!("{}: {a:?}\n{b:?}", path.display());
        assert_eq!(a.triangles, b.triangles, "{}", path.display());
        let volumes = a.volume.unwrap_or_default() - b.volume.unwrap_or_default();
        assert!(volumes.abs() < 1e-3 * a.volume.unwrap_or(1.0), "{}: {volumes}", path.display());
        let far = (0..3).map(|i| (a.min[i] - b.min[i]).abs().max((a.max[i] - b.max[i]).abs()));
        assert!(far.fold(0.0, f64::max) < 1e-3, "{}", path.display());
    }
    assert!(compared > 5, "{compared}");
}

/// Files with which the program once failed in one way or another.
#[test]
fn files_of_defects_are_right_or_refused_with_a_reason() {
    let Some(data) = shared_data() else { return };
    let defects = data.join("../defects");
    let wanted = |path: &Path| path.extension().is_some_and(|e| e != "md");
    let paths = if defects.is_dir() { files(&defects, wanted) } else { Vec::new() };
    if paths.is_empty() {
        skip(Lacking::Data, "no files of defects");
    }
    let wrong = |path: &PathBuf| {
        let outcome = check(path);
        let fault = match path.extension().and_then(|e| e.to_str()) {
            Some("stl") if outcome.code != Some(0) => Some("a sound STL is refused".to_owned()),
            // What a scene is told is of the meshes that it names.
            Some("toml") => (!matches!(outcome.code, Some(0 | 1))).then(|| "no end".to_owned()),
            _ => verdict(path, &outcome),
        };
        fault.map(|fault| format!("{}: {fault}\n{}", path.display(), outcome.text))
    };
    let wrong: Vec<_> = paths.iter().filter_map(wrong).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
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
    // Which code says so, each `tail` has its own.
    assert_ne!(hungry.code, Some(0), "{}", hungry.text);
    assert!(verdict(Path::new("x"), &hungry).is_some());
    let slow = limited_to(1, "while :; do :; done", Path::new("x"));
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
    let ply = |format: &str| {
        format!(
            "ply\nformat {format} 1.0\ncomment c\nelement vertex 3\nproperty float x\nproperty float y\n\
             property double z\nproperty list uchar short w\nelement face 1\n\
             property list uchar int vertex_indices\nend_header\n"
        )
    };
    let text_ply = ply("ascii") + "0 0 0 0\n9 0 0 1 7\n0 9 0 0\n4 0 1 2 0\n";
    let mut binary_ply = ply("binary_big_endian").into_bytes();
    for [x, y, w] in [[0.0, 0.0, 0.0], [9.0, 0.0, 1.0], [0.0, 9.0, 0.0f32]] {
        binary_ply.extend([x, y].iter().flat_map(|v| v.to_be_bytes()));
        binary_ply.extend([0; 8]);
        binary_ply.push(w as u8);
        binary_ply.extend(vec![0; 2 * w as usize]);
    }
    binary_ply.extend([3, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 2]);
    let off = "COFF\n# c\n4 2 0\n0 0 0 1 1 1 1\n9 0 0\n0 9 0\n0 0 9\n4 0 1 2 3\n3 0 2 1 0.5\n";
    let vtk = "# vtk DataFile Version 4.2\nt\nASCII\nDATASET POLYDATA\nFIELD FieldData 2\na 1 2 int\n\
        1 2\nb 1 1 string\nc d\nPOINTS 4 float\n0 0 0 9 0 0 0 9 0 0 0 9\nPOLYGONS 2 9\n4 0 1 2 3\n\
        3 0 2 1\nTRIANGLE_STRIPS 1 5\n4 0 1 2 3\nPOINT_DATA 4\n";
    let mut vtk5 =
        b"# vtk DataFile Version 5.1\nt\nBINARY\nDATASET POLYDATA\nFIELD F 1\nb 1 1 string\n\
        \xc1cPOINTS 3 float\n"
            .to_vec();
    let corners = [0.0f32, 0.0, 0.0, 9.0, 0.0, 0.0, 0.0, 9.0, 0.0];
    vtk5.extend(corners.iter().flat_map(|v| v.to_be_bytes()));
    vtk5.extend(b"\nMETADATA\nINFORMATION 0\n\nPOLYGONS 2 3\nOFFSETS vtktypeint64\n");
    vtk5.extend([0i64, 3].iter().flat_map(|v| v.to_be_bytes()));
    vtk5.extend(b"\nCONNECTIVITY vtktypeint64\n");
    vtk5.extend([0i64, 1, 2].iter().flat_map(|v| v.to_be_bytes()));
    let array = |kind: &str, name: &str, rest: &str| {
        format!("<DataArray type=\"{kind}\" Name=\"{name}\" {rest}</DataArray>")
    };
    let vtp = |points: &str, more: &str| {
        format!(
            "<VTKFile type=\"PolyData\" byte_order=\"LittleEndian\" {more}><PolyData><Piece \
             NumberOfPoints=\"3\" NumberOfStrips=\"0\" NumberOfPolys=\"1\"><Points>{}</Points><Polys>{}{}\
             </Polys></Piece></PolyData>",
            array("Float32", "Points", points),
            array("Int32", "connectivity", "format=\"ascii\">0 1 2"),
            array("Int32", "offsets", "format=\"binary\">BAAAAAMAAAA=")
        )
    };
    let inline = vtp("format=\"ascii\">0 0 0 9 0 0 0 9 0", "") + "</VTKFile>";
    let mut appended =
        vtp("format=\"appended\" offset=\"0\">", "compressor=\"vtkZLibDataCompressor\"");
    // Not packed itself, the offsets' array is refused; so it is text here.
    appended = appended.replace("format=\"binary\">BAAAAAMAAAA=", "format=\"ascii\">3");
    let mut appended = (appended + "<AppendedData encoding=\"raw\">_").into_bytes();
    let mut packer = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::default());
    let bytes: Vec<u8> = corners.iter().flat_map(|v| v.to_le_bytes()).collect();
    packer.write_all(&bytes).expect("memory");
    let packed = packer.finish().expect("memory");
    let head = [1, 36, 0, packed.len() as u32];
    appended.extend(head.iter().flat_map(|v| v.to_le_bytes()));
    appended.extend(packed);
    appended.extend(b"</AppendedData></VTKFile>");
    let threemf = |model: &[u8]| {
        // Stored, so that what is damaged is the model as often as the archive.
        let mut zip = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
        let method = zip::CompressionMethod::Stored;
        let options = zip::write::SimpleFileOptions::default().compression_method(method);
        zip.start_file("3D/3dmodel.model", options).expect("memory");
        zip.write_all(model).expect("memory");
        zip.finish().expect("memory").into_inner()
    };
    let model = "<model unit=\"inch\"><resources><object id=\"1\"><mesh><vertices><vertex x=\"0\" \
        y=\"0\" z=\"0\"/><vertex x=\"9\" y=\"0\" z=\"0\"/><vertex x=\"0\" y=\"9\" z=\"0\"/></vertices>\
        <triangles><triangle v1=\"0\" v2=\"1\" v3=\"2\"/></triangles></mesh></object><object id=\"2\">\
        <components><component objectid=\"1\" transform=\"1 0 0 0 1 0 0 0 1 5 0 0\"/></components>\
        </object></resources><build><item objectid=\"2\"/></build></model>";
    let archive = threemf(model.as_bytes());
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
        ("a.ply", text_ply.as_bytes()),
        ("b.ply", &binary_ply),
        ("a.off", off.as_bytes()),
        ("a.vtk", vtk.as_bytes()),
        ("b.vtk", &vtk5),
        ("a.vtp", inline.as_bytes()),
        ("b.vtp", &appended),
        ("a.3mf", &archive),
        // The model inside, in a sound archive.
        ("b.3mf", model.as_bytes()),
        ("a.toml", scene.as_bytes()),
    ] {
        let path = folder.path().join(name);
        let whole = match name {
            "b.3mf" => archive.clone(),
            _ => sound.to_vec(),
        };
        std::fs::write(&path, whole).expect("written");
        let read = |path: &Path| mesh::inspect(path, &mesh::Options::default());
        // The others are not whole themselves.
        let whole = [".ply", ".off", ".vtk", ".vtp", ".3mf"].iter().any(|end| name.ends_with(end));
        assert!(!whole || read(&path).facts.triangles > 0, "{name}: {:?}", read(&path).issues);
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
            if name == "b.3mf" {
                bytes = threemf(&bytes);
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
