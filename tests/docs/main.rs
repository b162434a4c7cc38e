//! `docs/scenes.md` against the program: every key, type, choice, default, range, preset and shipped tissue,
//! and the examples. The program is asked through its messages about mistakes, so that a key added to the
//! schema is missed here without a list of keys.

use std::collections::BTreeMap;
use std::path::Path;

use insonify::scene::{Scene, SceneError, check};

mod schema;
mod settings;
mod values;

use schema::{Takes, explore, type_name};
use values::of_values;

/// Loads a scene of this text.
fn load(text: &str, set: &[(String, String)]) -> Result<Scene, SceneError> {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("scene.toml");
    std::fs::write(&file, text).expect("written");
    let way = "time_s,x_mm,y_mm,z_mm\n0,0,0,0\n1,5,0,0\n";
    std::fs::write(folder.path().join("way.csv"), way).expect("written");
    let volume = "NDims = 4\nDimSize = 2 2 2 2\nElementSpacing = 1 1 1 0.5\nElementType = MET_UCHAR\n\
         ElementDataFile = LOCAL\n0123456789abcdef";
    std::fs::write(folder.path().join("volume.mha"), volume).expect("written");
    Scene::load(&file, set).map(|(scene, _)| scene)
}

/// One row of a table: the heading's path and the cells.
struct Row<'d> {
    table: &'d str,
    head: Vec<&'d str>,
    cells: Vec<&'d str>,
}

fn rows(document: &str) -> Vec<Row<'_>> {
    let (mut table, mut head, mut out) = ("", Vec::new(), Vec::new());
    for line in document.lines() {
        if line.starts_with('#') {
            let code = line.split('`').nth(1).unwrap_or_default();
            table = code.trim_matches(['[', ']']);
        }
        if !line.starts_with('|') {
            head.clear();
            continue;
        }
        let line = line.trim_matches('|');
        let cells: Vec<_> = line.split('|').map(|c| c.trim().trim_matches('`')).collect();
        match head.is_empty() {
            true => head = cells,
            false if cells[0].starts_with("---") => {}
            false => out.push(Row { table, head: head.clone(), cells }),
        }
    }
    out
}

/// Faults of the tables of keys.
fn of_keys(document: &str, schema: &BTreeMap<String, Takes>) -> Vec<String> {
    let mut faults = Vec::new();
    // The rows of keys with a row in the program are written by the program.
    let mut named = settings::keys();
    for row in rows(document).iter().filter(|r| r.head[0] == "Key") {
        let &[key, kind, default, stated, _] = row.cells.as_slice() else {
            faults.push(format!("{}: a row has {} cells", row.table, row.cells.len()));
            continue;
        };
        let path = match row.table {
            "" => key.to_owned(),
            table => format!("{table}.{key}"),
        };
        if named.contains(&path) {
            continue;
        }
        match schema.get(&path) {
            Some(Takes::Choices(choices)) => {
                let mut told: Vec<_> = stated.split('"').skip(1).step_by(2).collect();
                let mut real: Vec<_> = choices.iter().map(String::as_str).collect();
                told.sort_unstable();
                real.sort_unstable();
                if kind != "one of" || told != real {
                    faults.push(format!("{path}: {kind} {told:?}, not one of {real:?}"));
                }
            }
            Some(Takes::Value(wanted)) if type_name(wanted) != kind => {
                faults.push(format!("{path}: {kind}, but the program wants {wanted}"));
            }
            Some(Takes::Value(_)) => {}
            None if kind == "table" && schema.keys().any(|k| k.starts_with(&path)) => continue,
            None => {
                faults.push(format!("{path} does not exist"));
                continue;
            }
        }
        faults.extend(of_values(&path, kind, default, stated));
        named.push(path);
    }
    let missing = schema.keys().filter(|key| !named.contains(key));
    faults.extend(missing.map(|key| format!("{key} is not described")));
    faults
}

/// Loads the examples as `insonify check` does, each beside the shipped meshes that it names.
fn of_examples(document: &str) -> Vec<String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let mut faults = Vec::new();
    let examples = document.split("```toml\n").skip(1);
    for example in examples.map(|e| e.split("```").next().unwrap_or_default()) {
        let folder = tempfile::tempdir().expect("a folder");
        for mesh in example.lines().filter_map(|l| l.strip_prefix("file = ")) {
            let mesh = mesh.trim_matches('"');
            let to = folder.path().join(mesh);
            std::fs::create_dir_all(to.parent().expect("a folder")).expect("made");
            std::fs::copy(root.join(mesh), to).expect(mesh);
        }
        let file = folder.path().join("example.toml");
        std::fs::write(&file, example).expect("written");
        let report = check::report(&file);
        if !report.passed() || !report.issues.is_empty() {
            faults.push(format!("example: {report}\n{:?}", report.error));
        }
    }
    faults
}

fn document() -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/scenes.md");
    std::fs::read_to_string(path).expect("the document")
}

#[test]
fn the_reference_names_every_key_as_the_program_takes_it() {
    let mut schema = BTreeMap::new();
    explore("", "", "", &mut schema);
    // Any number among the settings is allowed.
    schema.retain(|key, _| !key.starts_with("vary.") && !key.starts_with("sweep."));
    let depth = |path: &str| schema.keys().filter(|k| k.starts_with(path)).count();
    assert!(depth("mesh.shape.") >= 10 && depth("tissues.NAME.") >= 11, "{schema:?}");
    let real = document();
    assert_eq!(of_keys(&real, &schema), [""; 0]);

    let row = |key: &str| {
        let start = format!("| `{key}` |");
        let line = real.lines().find(|l| l.starts_with(&start)).expect(key);
        format!("{line}\n")
    };
    for (from, to, noticed) in [
        (row("period"), String::new(), "transform.motion.period is not described"),
        (row("sphere.radius"), String::new(), "mesh.shape.sphere.radius is not described"),
        (
            row("pause"),
            row("pause").replace("pause", "paus"),
            "transform.motion.paus does not exist",
        ),
        (
            row("sphere.subdivisions"),
            row("sphere.subdivisions").replace("integer", "number"),
            "mesh.shape.sphere.subdivisions: number",
        ),
        (
            row("pause"),
            row("pause").replace("6 s", "7 s"),
            "transform.motion.pause: 7 s is not the default",
        ),
        (
            row("keyframes"),
            row("keyframes").replace("list of texts", "text"),
            "mesh.keyframes: text",
        ),
        (
            row("timeout"),
            row("timeout").replace("0.01 to", "0.02 to"),
            "tracker.timeout: range 0.02",
        ),
        (row("units"), row("units").replace(", `\"in\"`", ""), "mesh.units: one"),
    ] {
        let faults = of_keys(&real.replace(&from, &to), &schema);
        assert!(faults.iter().any(|f| f.starts_with(noticed)), "{noticed}: {faults:?}");
    }
}

/// Compares the text lines that follow from the program with the document, or writes them there.
#[test]
fn the_reference_says_of_settings_and_units_what_the_program_does() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/scenes.md");
    let real = document();
    let lines = settings::lines();
    let wanted = settings::written(&real, &lines);
    if std::env::var_os("INSONIFY_BLESS").is_some() {
        return std::fs::write(path, wanted).expect("written");
    }
    let remedy = "INSONIFY_BLESS=1 cargo test --test docs writes it";
    assert!(real == wanted, "docs/scenes.md is not up to date: {remedy}");
    // A line with another text, and a missing one.
    let paths = real.lines().find(|line| line.starts_with("| `paths` |")).expect("a row");
    for planted in [paths.replace("65535", "65536"), String::new()] {
        let wrong = real.replace(&format!("{paths}\n"), &planted);
        assert_ne!(settings::written(&wrong, &lines), wrong);
    }
}

#[test]
fn the_examples_of_the_reference_load() {
    let real = document();
    assert_eq!(real.matches("```toml").count(), 3);
    assert_eq!(of_examples(&real), [""; 0]);
    let wrong = real.replace("paths = 16", "pathz = 16");
    assert_eq!(of_examples(&wrong).len(), 1);
}
