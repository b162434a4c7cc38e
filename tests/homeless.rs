//! Users whose folders cannot be written or are not there, and pictures that are written by two.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use insonify::output::lock::Hold;

use crate::common::program::insonify;

/// A small frame, so that a software driver takes well under a second.
const SMALL: [&str; 8] = [
    "--set",
    "probe.scanlines=32",
    "--set",
    "probe.samples=256",
    "--set",
    "probe.elevation_layers=1",
    "--set",
    "imaging.image_height=64",
];

/// Number of places at which `said` has `part`.
fn count(said: &str, part: &str) -> usize {
    said.matches(part).count()
}

/// The folders of a user, and the user's variables that name them.
#[test]
fn without_folders_to_write_to_the_work_goes_on_and_is_told_once() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("file"), "no folder").expect("written");
    let file = folder.path().join("file");
    let passing = folder.path().join("passing");
    std::fs::create_dir(&passing).expect("made");
    for home in [Path::new("/proc/nowhere"), &file] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_insonify"));
        for variable in ["XDG_DATA_HOME", "XDG_CACHE_HOME", "XDG_STATE_HOME"] {
            command.env(variable, home.join(variable));
        }
        command.env("HOME", home).env("TMPDIR", &passing).current_dir(folder.path());
        // What it compiles is not kept either: as little as there is.
        let args = ["render", "phantom", "-o", "a.png", "--frames", "2"];
        let out = command.args(args).args(SMALL).output().expect("the program starts");
        let said = String::from_utf8_lossy(&out.stderr).into_owned();
        assert!(out.status.success(), "{said}");
        for (what, variable) in [
            ("the scenes that ship are unpacked into", "XDG_DATA_HOME"),
            ("compiled kernels are not kept", "XDG_CACHE_HOME"),
        ] {
            let line = said
                .lines()
                .find(|line| line.contains(what))
                .unwrap_or_else(|| panic!("{what}: {said}"));
            let place = home.join(variable).display().to_string();
            for part in [&place, "cannot be written", &format!("by the variable {variable}")] {
                assert!(line.contains(part), "{part}: {line}");
            }
            assert_eq!(count(&said, what), 1, "{said}");
        }
        assert!(folder.path().join("a.0001.png").exists());
        std::fs::remove_file(folder.path().join("a.0001.png")).expect("it is there");
    }
}

/// Names of all files of a folder.
fn names(folder: &Path) -> Vec<String> {
    let all = std::fs::read_dir(folder).expect("a folder").flatten();
    let mut names: Vec<_> =
        all.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

/// A film that is stopped by a signal, once it has begun.
#[test]
fn what_a_stopped_run_leaves_goes_with_the_next_one_and_two_do_not_mix_their_pictures() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let film = |frames: &'static str| {
        [&["render", "phantom", "-o", "a.gif", "--frames", frames][..], &SMALL].concat()
    };
    let mut run = Command::new(env!("CARGO_BIN_EXE_insonify"))
        .current_dir(folder)
        .args(film("10000"))
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("the program starts");
    let begun = Instant::now();
    let left = folder.join(".a.gif.1");
    while !left.exists() {
        assert!(begun.elapsed() < Duration::from_secs(240), "it does not begin");
        std::thread::sleep(Duration::from_millis(1));
    }
    run.kill().expect("it runs");
    run.wait().expect("it ends");
    assert_eq!(names(folder), [".a.gif.1"]);
    let (went_well, said) = insonify(folder, &film("2"));
    assert!(went_well, "{said}");
    assert_eq!(names(folder), ["a.gif", "a.json"]);

    let pictures = [&["render", "phantom", "-o", "b.png", "--frames", "2"][..], &SMALL].concat();
    let held = Hold::take(&folder.join(".b.0000.png.lock")).expect("room").expect("nobody's");
    let (went_well, said) = insonify(folder, &pictures);
    assert!(!went_well && said.contains("b.0000.png to b.0001.png: another run"), "{said}");
    drop(held);
    assert!(insonify(folder, &pictures).0);
    assert_eq!(names(folder), ["a.gif", "a.json", "b.0000.png", "b.0001.png", "b.json"]);
}
