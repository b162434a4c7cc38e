//! Files of the command line: what is said in and beside pictures, what is checked before anything is simulated, and the
//! scenes that ship, found from anywhere.

use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

/// A small frame, so that a software driver takes well under a second.
const SMALL: [&str; 6] = [
    "--set",
    "probe.scanlines=48",
    "--set",
    "probe.samples=512",
    "--set",
    "probe.elevation_layers=2",
];

fn insonify(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_insonify")).args(args).output().expect("the program starts")
}

fn render(scene: &str, more: &[&str]) -> Output {
    insonify(&[&["render", scene], &SMALL[..], more].concat())
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn path(path: &Path) -> &str {
    path.to_str().expect("a plain path")
}

/// The chunks of a PNG file: type and content.
fn chunks(png: &[u8]) -> Vec<(String, Vec<u8>)> {
    let mut rest = &png[8..];
    let mut out = Vec::new();
    while let Some((length, tail)) = rest.split_first_chunk::<4>() {
        let end = 4 + u32::from_be_bytes(*length) as usize;
        out.push((text(&tail[..4]), tail[4..end].to_vec()));
        rest = &tail[end + 4..];
    }
    out
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).expect("a file")).expect("JSON")
}

#[test]
fn pictures_say_what_they_show_and_how_large_it_is() {
    let dir = tempfile::tempdir().expect("a folder");
    let at = |name: &str| dir.path().join("made/for it").join(name);
    let (png, figures) = (at("a.png"), at("figures.json"));
    let set = ["--set", "probe.depth=80 mm", "--set", "imaging.gain=7", "--quality", "draft"];
    let more = ["-o", path(&png), "--json", path(&figures), "--tracer", "bvh"];
    let out = render("scenes/phantom.toml", &[&set[..], &more].concat());
    assert!(out.status.success(), "{}", text(&out.stderr));
    let (sidecar, figures) = (json(&at("a.json")), json(&figures));
    for said in [&sidecar, &figures] {
        let settings = &said["settings"];
        assert_eq!(settings["probe"]["depth"], 80.0);
        assert_eq!(settings["units"]["probe.depth"], "mm");
        assert_eq!(settings["imaging"]["gain"], 7.0);
        assert_eq!(settings["simulation"]["sampling"], "main-path");
        assert_eq!(said["set"]["probe.depth"], "80 mm");
        // The picture lies elsewhere: folders on the way would tell whose machine made it. Where the sources lie in the
        // folder of temporary files, both have that in common.
        let way = said["scene_file"].as_str().expect("a path");
        match Path::new(env!("CARGO_MANIFEST_DIR")).starts_with(std::env::temp_dir()) {
            true => {
                assert!(way.starts_with("../") && way.ends_with("/scenes/phantom.toml"), "{way}")
            }
            false => assert_eq!(way, "phantom.toml"),
        }
        assert_eq!(said["frames"][0]["file"], "a.png");
        assert_eq!(said["frames"][0]["pose"]["depth"], serde_json::json!([0.0, 0.0, 1.0]));
        assert_eq!(said["frames"][0]["time_s"], 0.0);
    }
    assert!(figures["stages_ms"].is_object() && sidecar["stages_ms"].is_null());
    // The lower edge of the image is the depth of the sector.
    let pitch = sidecar["image"]["pixel_pitch_mm"].as_f64().expect("a number");
    let height = sidecar["image"]["height"].as_f64().expect("a number");
    let top = sidecar["image"]["top_mm"].as_f64().expect("a number");
    assert!((top + pitch * height - 80.0).abs() < 2.0 * pitch, "{pitch} {height} {top}");
    let chunks = chunks(&std::fs::read(&png).expect("a picture"));
    let find = |kind: &str| &chunks.iter().find(|c| c.0 == kind).expect(kind).1;
    let per_metre = u32::from_be_bytes(find("pHYs")[..4].try_into().expect("four"));
    assert_eq!(per_metre, (1000.0 / pitch).round() as u32);
    let inside: Value = serde_json::from_slice(&find("iTXt")[13..]).expect("JSON");
    assert_eq!((&inside["settings"], &inside["file"]), (&sidecar["settings"], &"a.png".into()));
    // What is said under `set` makes the same image again.
    let again = at("b.png");
    let set: Vec<String> = sidecar["set"]
        .as_object()
        .expect("a table")
        .iter()
        .flat_map(|(key, value)| {
            ["--set".into(), format!("{key}={}", value.as_str().expect("text"))]
        })
        .collect();
    let set: Vec<&str> = set.iter().map(String::as_str).collect();
    let out = insonify(
        &[&["render", "scenes/phantom.toml", "--tracer", "bvh", "-o", path(&again)], &set[..]]
            .concat(),
    );
    assert!(out.status.success(), "{}", text(&out.stderr));
    let pixels = |path: &Path| image::open(path).expect("a PNG").into_luma8();
    assert!(pixels(&png) == pixels(&again));
}

/// A device has no neighbours and is not replaced by a file.
#[test]
fn a_picture_goes_into_a_device_as_it_is() {
    let small = ["probe.scanlines=8", "imaging.image_height=20", "simulation.paths=1"];
    let set: Vec<&str> = small.iter().flat_map(|set| ["--set", set]).collect();
    let args = ["render", "scenes/phantom.toml", "--tracer", "bvh", "-o", "/dev/null"];
    let out = insonify(&[&args[..], &set[..]].concat());
    assert!(out.status.success(), "{}", text(&out.stderr));
    assert!(!Path::new("/dev/null").is_file() && !Path::new("/dev/null.json").exists());
}

/// Mistakes that cost minutes of simulation when they were found behind it.
#[test]
fn what_cannot_be_written_or_read_is_said_before_anything_is_simulated() {
    let dir = tempfile::tempdir().expect("a folder");
    let file = dir.path().join("file");
    std::fs::write(&file, "").expect("written");
    let inside = file.join("a.png");
    let wrong = path(&inside);
    let phantom = "scenes/phantom.toml";
    // No device of this name: had it been asked for one, it would say so.
    let nothing = ["--device", "none of this name"];
    for (args, cause) in [
        (vec!["render", phantom, "-o", wrong], "folder cannot be made"),
        (vec!["render", phantom, "-o", "a.jpg"], "no format that is known"),
        (vec!["render", phantom, "--json", wrong], "folder cannot be made"),
        (vec!["render", phantom, "--dump", wrong], "folder cannot be made"),
        (
            vec!["render", phantom, "--labels", &wrong.replace(".png", ".npz")],
            "folder cannot be made",
        ),
        (vec!["render", phantom, "--trajectory", "nope.csv"], "nope.csv"),
        (
            vec![
                "acquire",
                phantom,
                "--sweep",
                "linear:1",
                "--volume",
                &wrong.replace("png", "mha"),
            ],
            "folder cannot be made",
        ),
        (vec!["acquire", phantom, "--sweep", "linear:1"], "--volume NAME.mha"),
        (vec!["vary", phantom, "-o", wrong], "folder cannot be made"),
        (vec!["match", phantom, "-o", wrong], "folder cannot be made"),
    ] {
        let out = insonify(&[&args[..], &nothing].concat());
        let said = text(&out.stderr);
        assert!(!out.status.success() && said.contains(cause), "{args:?}: {said}");
        assert!(said.contains("help: "), "{args:?}: {said}");
    }
    assert_eq!(std::fs::read_dir(dir.path()).expect("there").count(), 1, "no draft is left");
}

/// Files that a command reads or writes are not written over by it, by whatever name.
#[test]
fn no_file_is_written_over_another_of_the_same_command() {
    let dir = tempfile::tempdir().expect("a folder");
    let at = |name: &str| path(&dir.path().join(name)).to_owned();
    let source = std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/limbs.toml"));
    let source = source.expect("it ships");
    for name in ["scene.toml", "bare", "poses.csv"] {
        std::fs::write(at(name), &source).expect("written");
    }
    let (scene, bare, poses) = (at("scene.toml"), at("bare"), at("poses.csv"));
    let step = at("./folder/../scene.toml");
    std::fs::create_dir(at("folder")).expect("room");
    let (picture, link) = (at("a.png"), at("link.png"));
    #[cfg(unix)]
    std::os::unix::fs::symlink(&bare, &link).expect("a link");
    #[cfg(not(unix))]
    std::fs::hard_link(&bare, &link).expect("a link");
    let volume = at("v.mha");
    for (args, told) in [
        (vec!["render", &scene, "-o", &picture, "--json", &scene], "is read as the scene"),
        (vec!["render", &scene, "-o", &picture, "--json", &step], "is read as the scene"),
        (vec!["render", &bare, "-o", &bare], "is read as the scene"),
        #[cfg(unix)]
        (vec!["render", &bare, "-o", &link], "is read as the scene"),
        (vec!["render", &scene, "-o", &picture, "--json", &picture], "would be written as -o"),
        (vec!["render", &scene, "-o", &picture, "--labels", &picture], "would be written as -o"),
        (
            vec!["render", &scene, "--trajectory", &poses, "-o", &picture, "--json", &poses],
            "is read as --trajectory",
        ),
        (
            vec!["acquire", &scene, "--sweep", "linear:1", "-o", &volume, "--volume", &volume],
            "would be written as -o",
        ),
        (vec!["reconstruct", &volume, "-o", &volume], "is read as the tracked frames"),
        (vec!["view", &scene, "--json", &scene], "is read as the scene"),
        (
            vec!["study", "answers", &poses, "--key", &scene, "--ratings", &scene],
            "is read as --key",
        ),
    ] {
        let out = insonify(&args);
        let said = text(&out.stderr);
        assert!(!out.status.success() && said.contains(told), "{args:?}: {said}");
        assert!(said.contains("help: name another file by "), "{args:?}: {said}");
    }
    for name in [&scene, &bare, &poses] {
        assert!(std::fs::read(name).expect("there") == source, "{name} is as it was");
    }
    // Figures say all that a sidecar does, so they may take its place.
    let figures = at("a.json");
    let args = ["-o", &picture, "--json", &figures, "--tracer", "bvh"];
    let out = render("scenes/phantom.toml", &args);
    assert!(out.status.success(), "{}", text(&out.stderr));
    let figures = json(Path::new(&figures));
    assert!(figures["stages_ms"].is_object() && figures["image"].is_object());
    assert_eq!(figures["frames"][0]["file"], "a.png");
}

/// The program in an empty folder, with a home of its own and no display.
fn elsewhere(home: &Path, args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_insonify"));
    for name in ["DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET", "XDG_DATA_HOME"] {
        command.env_remove(name);
    }
    let here = home.join("here");
    std::fs::create_dir_all(&here).expect("made");
    command.args(args).env("HOME", home).current_dir(here).output().expect("the program starts")
}

#[test]
fn scenes_that_ship_are_found_from_anywhere_and_stay_as_they_are() {
    let home = tempfile::tempdir().expect("a folder");
    for scene in ["heart", "scenes/pregnancy.toml", "abdomen.toml"] {
        let out = elsewhere(home.path(), &["check", scene]);
        assert!(out.status.success(), "{scene}: {}", text(&out.stderr));
    }
    let out = elsewhere(
        home.path(),
        &[&["render", "phantom"], &SMALL[..], &["--tracer", "bvh"]].concat(),
    );
    assert!(out.status.success(), "{}", text(&out.stderr));
    assert!(
        home.path().join("here/phantom.png").exists()
            && home.path().join("here/phantom.json").exists()
    );
    // A file of the user's goes before one that ships.
    std::fs::write(home.path().join("here/heart.toml"), "name = \"Mine\"\n").expect("written");
    let out = elsewhere(home.path(), &["check", "heart.toml"]);
    assert!(text(&out.stdout).contains("Mine"), "{}", text(&out.stdout));
    let out = elsewhere(home.path(), &["render", "hart"]);
    let said = text(&out.stderr) + &text(&out.stdout);
    assert!(said.contains("scenes that ship: abdomen, artery, carotid"), "{said}");
    // What was unpacked is not written to.
    let scene = ["register", "pregnancy", "--surface", "decidua", "--in-place", "--volume-surface"];
    let surface = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/fetus/decidua.obj");
    let out = elsewhere(home.path(), &[&scene[..], &[path(&surface)]].concat());
    let said = text(&out.stderr);
    assert!(!out.status.success() && said.contains("another name"), "{said}");
}

#[test]
fn without_a_command_the_window_is_meant_and_says_what_to_do_first() {
    let home = tempfile::tempdir().expect("a folder");
    let out = elsewhere(home.path(), &[]);
    let said = text(&out.stderr);
    assert!(!out.status.success() && said.contains("no window can be opened"), "{said}");
    assert!(said.contains("render") && !said.contains(".rs:"), "{said}");
    for hint in ["Drag the probe", "Space freezes", "? lists the keys"] {
        assert!(said.contains(hint), "{hint}: {said}");
    }
    let out = elsewhere(home.path(), &["--help"]);
    assert!(text(&out.stdout).contains("insonify view heart"), "{}", text(&out.stdout));
}

#[test]
fn what_is_another_s_is_kept() {
    let dir = tempfile::tempdir().expect("a folder");
    let at = |name: &str| dir.path().join(name);
    // A file of the name of the sidecar, of another program.
    std::fs::write(at("a.json"), "{\"mine\": 1}").expect("written");
    let output = at("a.png");
    let out = render("scenes/phantom.toml", &["-o", path(&output)]);
    let told = text(&out.stderr);
    assert!(out.status.success() && told.contains("a.json is there and is not of"), "{told}");
    assert_eq!(json(&at("a.json"))["mine"], 1);
    assert!(image::open(&output).is_ok());
    // One of its own is replaced.
    std::fs::remove_file(at("a.json")).expect("there");
    for gain in ["imaging.gain=3", "imaging.gain=5"] {
        let out = render("scenes/phantom.toml", &["-o", path(&output), "--set", gain]);
        assert!(out.status.success() && !text(&out.stderr).contains("is there"));
    }
    assert_eq!(json(&at("a.json"))["settings"]["imaging"]["gain"], 5.0);

    // Meshes that are imported into the folder that they lie in.
    let ball = "v 0 0 0\nv 30 0 0\nv 0 30 0\nv 0 0 30\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
    std::fs::create_dir_all(at("p/meshes")).expect("room");
    std::fs::write(at("p/meshes/liver.obj"), ball).expect("written");
    for force in [&[][..], &["--force"]] {
        let (meshes, into) = (at("p/meshes"), at("p"));
        let out = insonify(&[&["import", path(&meshes), "-o", path(&into)], force].concat());
        let told = text(&out.stderr);
        assert!(!out.status.success() && told.contains("would be written over it"), "{told}");
        assert!(told.contains("name another folder"), "{told}");
        assert_eq!(std::fs::read_to_string(at("p/meshes/liver.obj")).expect("there"), ball);
    }

    // The table of a sheet beside a scene of its name.
    let scene = at("v.csv");
    std::fs::write(&scene, "background = \"liver\"\n").expect("written");
    let out = insonify(&["vary", path(&scene), "-o", path(&at("v.png"))]);
    let told = text(&out.stderr);
    assert!(!out.status.success() && told.contains("one file cannot be both"), "{told}");
    assert_eq!(std::fs::read_to_string(&scene).expect("there"), "background = \"liver\"\n");
}

#[test]
fn images_that_are_black_are_told_with_the_reason() {
    let dir = tempfile::tempdir().expect("a folder");
    let scene = dir.path().join("s.toml");
    let head = "background = \"fat\"\n[probe]\npreset = \"linear\"\nscanlines = 32\nsamples = 256\n\
                elevation_layers = 1\n[imaging]\nimage_height = 100\n";
    let skin = "[contact]\nmesh = [\"skin\"]\n[[mesh]]\nname = \"skin\"\ntissue = \"liver\"\n\
                shape = { box = { size = [80, 80, 20] } }\n";
    let bone = "[[mesh]]\nname = \"x\"\ntissue = \"cortical_bone\"\nshape = { sphere = { radius = 30 } }\n";
    for (rest, in_check, in_render) in [
        (format!("{skin}translate = [0, 0, -100]\n"), "touches the skin", "touches the skin"),
        (format!("{skin}translate = [0, 0, 12]\n"), "", ""),
        (bone.to_owned(), "start inside `cortical_bone`", "start inside `cortical_bone`"),
        (bone.replace("cortical_bone", "liver"), "", ""),
    ] {
        std::fs::write(&scene, format!("{head}{rest}")).expect("written");
        let out = insonify(&["check", path(&scene)]);
        let told = text(&out.stdout) + &text(&out.stderr);
        assert!(out.status.success(), "{told}");
        assert_eq!(told.contains("warning: "), !in_check.is_empty(), "{told}");
        assert!(told.contains(in_check), "{told}");
        let png = dir.path().join("s.png");
        let out = insonify(&["render", path(&scene), "--quality", "draft", "-o", path(&png)]);
        let told = text(&out.stderr);
        assert!(out.status.success() && told.contains(in_render), "{told}");
        assert!(!in_render.is_empty() || !told.contains("black"), "{told}");
    }
    std::fs::write(&scene, format!("{head}gain = -200\n")).expect("written");
    let png = dir.path().join("s.png");
    let out = insonify(&["render", path(&scene), "--quality", "draft", "-o", path(&png)]);
    assert!(text(&out.stderr).contains("the last image is black"), "{}", text(&out.stderr));
    // What many devices refuse.
    std::fs::write(&scene, format!("{head}gain = 0\n").replace("= 100", "= 8192"))
        .expect("written");
    let out = insonify(&["check", path(&scene)]);
    assert!(text(&out.stdout).contains("lower imaging.image_height"), "{}", text(&out.stdout));
}
