//! Runs that are stopped: killed, or without room.

use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use insonify::output::lock::{Hold, LOCK};

use crate::common::program;
use crate::common::skip::{Lacking, skip};
use crate::dataset::{Desk, PLAN, files};

/// Number of files that end so, while a run may be writing.
fn count(folder: &Path, ending: &str) -> usize {
    let all = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let of = |entry: std::fs::DirEntry| match entry.path() {
        path if path.is_dir() => count(&path, ending),
        _ => {
            let name = entry.file_name().to_string_lossy().into_owned();
            usize::from(name.ends_with(ending) && !name.starts_with('.'))
        }
    };
    all.map(of).sum()
}

/// A run in the folder of this name, which has just come to the middle of the third part.
fn at_work(desk: &Desk, name: &str) -> Child {
    let run = Command::new(env!("CARGO_BIN_EXE_insonify"))
        .current_dir(desk.path(""))
        .args(["dataset", "plan.toml", "--tracer", "bvh", "-o", name])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("the program starts");
    let begun = Instant::now();
    while count(&desk.path(name), ".json") < 1 + 5 {
        assert!(begun.elapsed() < Duration::from_secs(240), "no sample comes");
        std::thread::sleep(Duration::from_millis(1));
    }
    run
}

#[test]
fn a_folder_in_which_another_run_is_at_work_is_left_to_it() {
    let desk = Desk::new();
    let mut run = at_work(&desk, "both");
    let refused = |more: &[&str]| {
        let (went_well, said) = desk.make(&[&["-o", "both"], more].concat());
        assert!(!went_well, "{said}");
        let parts =
            ["both", "another run makes samples of this shard here: shard 0/1", "wait for its end"];
        for part in parts {
            assert!(said.contains(part), "{part}: {said}");
        }
    };
    refused(&["--resume"]);
    assert!(run.wait().expect("it ends").success());
    assert!(files(&desk.path("both")) == files(&crate::dataset::desk().path("whole")));
    // As long as it lives, whatever a second one asks for.
    let held = Hold::take(&desk.path("both/.shard-0-of-1.lock")).expect("room").expect("nobody's");
    refused(&[]);
    refused(&["--shard", "3/10", "--resume"]);
    drop(held);
    desk.made(&["-o", "both", "--shard", "3/10", "--resume"]);
    // Nor do two write one layout.
    std::fs::create_dir(desk.path("laid")).expect("made");
    let held = Hold::take(&desk.path("laid").join(LOCK)).expect("room").expect("nobody's");
    let layout = ["dataset", "both", "--layout", "coco", "-o", "laid"];
    let (went_well, said) = program::insonify(&desk.path(""), &layout);
    assert!(!went_well && said.contains("laid") && said.contains("another run"), "{said}");
    drop(held);
    assert!(program::insonify(&desk.path(""), &layout).0);
}

#[test]
fn a_killed_run_is_gone_on_with_to_the_same_bytes() {
    let desk = Desk::new();
    let folder = desk.path("killed");
    let mut run = at_work(&desk, "killed");
    run.kill().expect("it runs");
    run.wait().expect("it ends");
    assert!(folder.join(".shard-0-of-1.lock").exists(), "what it leaves keeps nobody out");
    let left = count(&folder, ".tar");
    assert!((1..10).contains(&left), "{left} archives were left");
    assert!(!folder.join("sheet.png").exists());
    // As if it had been killed while it wrote; what another writes stays.
    std::fs::write(folder.join("webdataset/.test-000003.tar.1"), "half").expect("written");
    std::fs::write(folder.join("folder/train/.000011.png.1"), "half").expect("written");
    let (went_well, said) = desk.make(&["-o", "killed"]);
    assert!(!went_well && said.contains("add --resume"), "{said}");
    desk.write("plan.toml", &PLAN.replace("seed = 3", "seed = 4"));
    let (went_well, said) = desk.make(&["-o", "killed", "--resume"]);
    assert!(
        !went_well && said.contains("another plan") && said.contains("manifest.json"),
        "{said}"
    );
    desk.write("plan.toml", PLAN);
    // Another shard leaves the drafts of this one alone.
    desk.made(&["-o", "killed", "--resume", "--shard", "0/10"]);
    assert!(folder.join("webdataset/.test-000003.tar.1").exists());
    desk.made(&["-o", "killed", "--resume"]);
    assert!(files(&folder) == files(&crate::dataset::desk().path("whole")));
    let said = desk.made(&["-o", "killed", "--resume"]);
    // One is made again to be compared.
    assert!(said.contains("1 samples made, 19 were there"), "{said}");
    assert!(files(&folder) == files(&crate::dataset::desk().path("whole")));
    // A file that the sample is made of is another one now.
    let spoilt = folder.join("folder/train/000000.png");
    std::fs::copy(folder.join("folder/train/000001.png"), spoilt).expect("copied");
    let (went_well, said) = desk.make(&["-o", "killed", "--resume"]);
    assert!(!went_well && said.contains("comes out differently now"), "{said}");
}

#[test]
fn a_folder_of_something_else_is_left_alone() {
    let desk = Desk::new();
    std::fs::create_dir(desk.path("full")).expect("made");
    desk.write("full/mine.txt", "kept");
    for more in [&[][..], &["--resume"]] {
        let (went_well, said) = desk.make(&[&["-o", "full"], more].concat());
        assert!(!went_well && said.contains("no data set that was begun"), "{said}");
    }
    assert_eq!(files(&desk.path("full")).len(), 1);
}

/// On a disk of a megabyte, which a few samples fill. It goes with the shell that has it, so that what it holds is copied.
#[test]
fn a_full_disk_is_an_error_that_loses_nothing() {
    let desk = Desk::new();
    let mount = "mkdir limited kept && mount -t tmpfs -o size=1m none limited";
    let run = "\"$0\" dataset plan.toml --tracer bvh -o limited; done=$?; cp -a limited/. kept; exit $done";
    let shell = |script: &str| {
        Command::new("unshare")
            .args(["--user", "--map-root-user", "--mount", "sh", "-c", script])
            .arg(env!("CARGO_BIN_EXE_insonify"))
            .current_dir(desk.path(""))
            .output()
    };
    if !shell("mount -t tmpfs none /mnt").is_ok_and(|out| out.status.success()) {
        return skip(Lacking::Tool, "no mounts of one's own (user namespaces)");
    }
    let out = shell(&format!("{mount}; {run}")).expect("it has run before");
    let said =
        String::from_utf8_lossy(&out.stderr).split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(!out.status.success(), "{said}");
    for part in ["cannot be written", "No space left", "--resume"] {
        assert!(said.contains(part), "{part}: {said}");
    }
    let kept = desk.path("kept");
    let left = files(&kept);
    assert!(left.len() > 2 + 5 && !left.keys().any(|n| n.contains("/.")), "{:?}", left.keys());
    let whole = files(&crate::dataset::desk().path("whole"));
    assert!(
        left.len() < whole.len() && left.iter().all(|(name, bytes)| whole.get(name) == Some(bytes))
    );
    desk.made(&["-o", "kept", "--resume"]);
    assert!(files(&kept) == whole);
}
