use super::*;
use crate::scene::Scene;
use crate::scene::file::tests::Case;

const COMMENTED: &str = r#"# A liver.
name = "test"   # title

[imaging]
# Found by trying.
gain = "14 dB" # loud
psf_scale = [
    2, # axial
    1.5,
    1,
]

[[mesh]] # first
name = "a"
tissue = "liver"
file = "cube.obj"

# The second.
[[mesh]]
name = "b"
tissue = "fat"
keyframes = ["cube.obj"]
parent = "beat"

[[selector]]
name = "beat"
period = 1
"#;

fn settings(pairs: &[(&str, &str)]) -> Vec<Entry> {
    let owned = |&(path, value): &(&str, &str)| (path.to_owned(), Some(value.to_owned()));
    pairs.iter().map(owned).collect()
}

#[test]
fn only_set_keys_change() {
    let case = Case::new();
    std::fs::write(case.path(), COMMENTED).expect("written");
    let set = settings(&[
        ("imaging.gain", "9.5 dB"),
        ("imaging.psf_scale", "[1.25, 0.75, 1]"),
        ("imaging.dynamic_range", "\"55 dB\""),
        ("mesh.b.priority", "3"),
        ("probe.pose.position", "[1, 2, 3]"),
    ]);
    save(&case.path(), &case.path(), &set).expect("saved");
    let text = std::fs::read_to_string(case.path()).expect("there");
    let expected = COMMENTED
        .replace("\"14 dB\"", "\"9.5 dB\"")
        .replace("2, # axial", "1.25, # axial")
        .replace("1.5,\n    1,\n]\n", "0.75,\n    1,\n]\ndynamic_range = \"55 dB\"\n")
        .replace("parent = \"beat\"\n", "parent = \"beat\"\npriority = 3\n")
        + "\n[probe.pose]\nposition = [1, 2, 3]\n";
    assert_eq!(text, expected);
    let (saved, _) = Scene::load(&case.path(), &[]).expect("sound");
    std::fs::write(case.path(), COMMENTED).expect("written");
    let set = set.into_iter().map(|(path, value)| (path, value.expect("set")));
    let (overridden, _) = Scene::load(&case.path(), &set.collect::<Vec<_>>()).expect("sound");
    assert_eq!(saved.imaging, overridden.imaging, "as the command line sets it");
    assert_eq!(saved.world_from_probe, overridden.world_from_probe);
}

#[test]
fn tables_in_any_spelling_are_found() {
    let case = Case::new();
    for (text, expected) in [
        ("imaging = { gain = 3 }\n", "imaging = { gain = 5 }\n"),
        ("imaging.gain = 3 # dotted\n", "imaging.gain = 5 # dotted\n"),
        ("", "[imaging]\ngain = 5\n"),
    ] {
        std::fs::write(case.path(), text).expect("written");
        save(&case.path(), &case.path(), &settings(&[("imaging.gain", "5")])).expect("saved");
        let saved = std::fs::read_to_string(case.path()).expect("there");
        assert_eq!(saved.trim_start(), expected, "{text}");
    }
}

#[test]
fn removing_a_key_removes_nothing_else() {
    let case = Case::new();
    std::fs::write(case.path(), COMMENTED).expect("written");
    let gone = |path: &str| (path.to_owned(), None);
    let all = [
        gone("imaging.gain"),
        gone("imaging.noise"),
        gone("mesh.b.parent"),
        gone("probe.pose.position"),
    ];
    save(&case.path(), &case.path(), &all).expect("saved");
    let text = std::fs::read_to_string(case.path()).expect("there");
    let expected = COMMENTED
        .replace("# Found by trying.\ngain = \"14 dB\" # loud\n", "")
        .replace("parent = \"beat\"\n", "");
    assert_eq!(text, expected, "what is not there needs no taking away");
    let error = save(&case.path(), &case.path(), &[gone("imaging.psf_scale.0")]);
    assert!(error.is_err(), "a list keeps its length");
}

#[test]
fn names_with_dots_are_quoted() {
    let case = Case::new();
    let text = "[[mesh]]\nname = \"a.b\"\ntissue = \"fat\"\nfile = \"cube.obj\"\n";
    std::fs::write(case.path(), text).expect("written");
    let set = settings(&[("mesh.\"a.b\".roughness", "7"), ("tissues.\"x y\".based_on", "fat")]);
    save(&case.path(), &case.path(), &set).expect("saved");
    let saved = std::fs::read_to_string(case.path()).expect("there");
    let more = "roughness = 7\n\n[tissues.\"x y\"]\nbased_on = \"fat\"\n";
    assert_eq!(saved, format!("{text}{more}"));
}

#[test]
fn elsewhere_files_are_named_from_there() {
    let case = Case::new();
    std::fs::write(case.path(), COMMENTED).expect("written");
    let folder = case.folder.path().join("more/deep");
    std::fs::create_dir_all(&folder).expect("made");
    let to = folder.join("new.toml");
    save(&case.path(), &to, &[]).expect("saved");
    let text = std::fs::read_to_string(&to).expect("there");
    let expected = COMMENTED.replace("cube.obj", "../../cube.obj");
    assert_eq!(text, expected);
    Scene::load(&to, &[]).expect("its files are found");
    // And back again, past another name of the same folder.
    save(&to, &case.folder.path().join("more/../back.toml"), &[]).expect("saved");
    let text = std::fs::read_to_string(case.folder.path().join("back.toml")).expect("there");
    assert_eq!(text, COMMENTED);
}

// A stick that was pulled, another branch that was checked out.
#[test]
fn a_file_that_is_gone_is_saved_from_its_text_also_where_its_folder_is_gone() {
    let case = Case::new();
    let gain = settings(&[("imaging.gain", "\"9 dB\"")]);
    let expected = COMMENTED.replace("\"14 dB\" # loud", "\"9 dB\" # loud");
    save_text(COMMENTED, &case.path(), &case.path(), &gain).expect("saved");
    assert_eq!(std::fs::read_to_string(case.path()).expect("there"), expected);
    let gone = case.folder.path().join("gone/scene.toml");
    save_text(COMMENTED, &gone, &case.path(), &gain).expect("saved");
    let text = std::fs::read_to_string(case.path()).expect("there");
    assert_eq!(text, expected.replace("cube.obj", "gone/cube.obj"));
    let error = save_text("[[mesh", &gone, &case.path(), &gain).expect_err("no TOML");
    assert!(error.remedy.is_some() || error.line > 0, "{error}");
}

#[test]
fn a_failure_leaves_the_file_alone() {
    let case = Case::new();
    std::fs::write(case.path(), COMMENTED).expect("written");
    let nowhere = case.folder.path().join("gone/new.toml");
    for (to, set, cause) in [
        (case.path(), ("mesh.c.priority", "1"), "no mesh `c`"),
        (case.path(), ("imaging.gain.x", "1"), "no such part"),
        (case.path(), ("imaging.gian", "1"), "gian"),
        (case.path(), ("imaging.gain", "\"5 mm\""), "`mm` does not fit"),
        (case.path(), ("imaging.gain", "loud"), "loud"),
        (case.path(), ("imaging.gain", "999"), "gain is 999"),
        (case.path(), ("tissues.fat.speed", "99"), "speed is 99"),
        (nowhere, ("imaging.gain", "1"), "folder cannot be used"),
    ] {
        let error = save(&case.path(), &to, &settings(&[set])).expect_err(cause);
        assert!(error.message.contains(cause), "{error}");
        let text = std::fs::read_to_string(case.path()).expect("there");
        assert_eq!(text, COMMENTED, "{cause}");
    }
    let left = std::fs::read_dir(case.folder.path()).expect("a folder").count();
    assert_eq!(left, 2, "the scene and its mesh, nothing beside");
}

#[cfg(unix)]
#[test]
fn links_and_permissions_stay() {
    use std::os::unix::fs::PermissionsExt;
    let case = Case::new();
    std::fs::write(case.path(), COMMENTED).expect("written");
    let mode = std::fs::Permissions::from_mode(0o640);
    std::fs::set_permissions(case.path(), mode).expect("set");
    let link = case.folder.path().join("link.toml");
    std::os::unix::fs::symlink(case.path(), &link).expect("made");
    save(&link, &link, &settings(&[("imaging.gain", "5")])).expect("saved");
    assert!(link.is_symlink());
    let info = std::fs::metadata(case.path()).expect("there");
    assert_eq!(info.permissions().mode() & 0o777, 0o640);
    let text = std::fs::read_to_string(case.path()).expect("there");
    assert!(text.contains("gain = 5 # loud"), "{text}");
}

const PLACED: &str = r#"# A box.
[[mesh]]
name = "a"
tissue = "fat"
file = "cube.obj"

[[transform]]
name = "b"
    # By eye.
    # registered long ago
    translate = [1, 2, 3] # mm
rotate = { axis = [0, 0, 1], angle = "3 deg" } # a little
"#;

fn noted(text: &str, set: &[(&str, &str)], note: (&str, &str)) -> Result<String, SceneError> {
    let case = Case::new();
    std::fs::write(case.path(), text).expect("written");
    let notes = [(note.0.to_owned(), note.1.to_owned())];
    save_with(&case.path(), &case.path(), &settings(set), &notes)?;
    Ok(std::fs::read_to_string(case.path()).expect("there"))
}

#[test]
fn a_note_stands_above_its_key_and_replaces_its_like() {
    let turn = "{ axis = [1, 0, 0], angle = \"4 deg\" }";
    let set = [("transform.b.rotate", turn), ("mesh.a.scale", "2")];
    let text = noted(PLACED, &set, ("transform.b.translate", "registered: well"));
    let expected = PLACED
        .replace(
            "    # registered long ago\n",
            "    # registered long ago\n    # registered: well\n",
        )
        .replace("[0, 0, 1], angle = \"3 deg\"", "[1, 0, 0], angle = \"4 deg\"")
        .replace("cube.obj\"\n", "cube.obj\"\nscale = 2\n");
    assert_eq!(text.expect("saved"), expected);
    let text = noted(PLACED, &[], ("transform.b.translate", "registered anew"));
    let expected = PLACED.replace("registered long ago", "registered anew");
    assert_eq!(text.expect("saved"), expected);
    let set = [("mesh.a.translate", "[1, 0, 0]")];
    let text = noted(PLACED, &set, ("mesh.a.translate", "registered"));
    let expected =
        PLACED.replace("cube.obj\"\n", "cube.obj\"\n# registered\ntranslate = [1, 0, 0]\n");
    assert_eq!(text.expect("saved"), expected);
    // Into an inline table no comment fits.
    let inline = "# Keyed.\ntracker = { device = \"a\" }\n";
    let text = noted(inline, &[("tracker.device", "b")], ("tracker.device", "registered"));
    let expected = "# Keyed.\n# registered\ntracker = { device = \"b\" }\n";
    assert_eq!(text.expect("saved"), expected);
    let error = noted(PLACED, &[], ("transform.b.scale", "registered")).expect_err("no such key");
    assert!(error.message.contains("`scale`"), "{error}");
}

#[test]
fn a_table_is_replaced_key_by_key_in_any_spelling() {
    let head = "[[transform]]\nname = \"b\"\n";
    let turn = "{ axis = [1, 0, 0], angle = \"4 deg\" }";
    for (before, after) in [
        ("", "rotate = { axis = [1, 0, 0], angle = \"4 deg\" }\n"),
        (
            "rotate.axis = [0, 1, 0] # up\nrotate.angle = \"9 deg\"\n",
            "rotate.axis = [1, 0, 0] # up\nrotate.angle = \"4 deg\"\n",
        ),
        (
            "\n[transform.rotate]\n# up\naxis = [0, 1, 0]\nangle = \"9 deg\" # little\n",
            "\n[transform.rotate]\n# up\naxis = [1, 0, 0]\nangle = \"4 deg\" # little\n",
        ),
    ] {
        let set = [("transform.b.rotate", turn), ("transform.b.translate", "[1, 0, 0]")];
        let text = noted(&format!("{head}{before}"), &set, ("transform.b.translate", "seen"));
        let text = text.expect("saved");
        let moved = "# seen\ntranslate = [1, 0, 0]\n";
        assert_eq!(text.replacen(moved, "", 1), format!("{head}{after}"), "{text}");
        let case = Case::new();
        case.load(&text, &[]).expect("sound");
    }
    let far = [("transform.b.translate", "[1, 0, 1e9]")];
    let error = noted(PLACED, &far, ("transform.b.translate", "seen")).expect_err("too far");
    assert!(error.message.contains("translate is 1000000000"), "{error}");
}
