//! Stopped runs that are resumed.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::study::{Desk, IMAGES, VOLUME, files, paths};

fn spawned(desk: &Desk, folder: &str) -> Child {
    Command::new(env!("CARGO_BIN_EXE_insonify"))
        .current_dir(desk.0.path())
        .args(["study", "make", "plan.toml", "--tracer", "bvh", "-o", folder])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("the program starts")
}

/// Number of whole images, while a run may be writing.
fn images_in(folder: &Path) -> usize {
    let is_image = |path: &&PathBuf| path.extension().is_some_and(|e| e == "png");
    paths(folder).iter().filter(is_image).count()
}

#[test]
fn a_killed_run_is_gone_on_with() {
    let desk = Desk::new();
    let folder = desk.path("killed");
    let mut run = spawned(&desk, "killed");
    let begun = Instant::now();
    while images_in(&folder) < 2 {
        assert!(begun.elapsed() < Duration::from_secs(240), "no image comes");
        std::thread::sleep(Duration::from_millis(1));
    }
    let (went_well, said) = desk.make(&["-o", "killed", "--resume"]);
    assert!(!went_well && said.contains("killed is being written by another run"), "{said}");
    run.kill().expect("it runs");
    run.wait().expect("it ends");
    let left = images_in(&folder);
    assert!((2..IMAGES).contains(&left), "{left} images were left");
    assert!(!folder.join("key.csv").exists() && !folder.join("form/form.html").exists());
    // As if it had been killed while it wrote.
    std::fs::write(folder.join("form/cases/01/.01.png.1"), "half").ok();
    std::fs::write(folder.join(".key.csv.1"), "half").expect("written");
    let (went_well, said) = desk.make(&["-o", "killed"]);
    assert!(!went_well && said.contains("add --resume"), "{said}");
    let (went_well, said) = desk.make(&["-o", "killed", "--resume", "--seed", "3"]);
    assert!(!went_well && said.contains("another order: 0, not 3"), "{said}");
    desk.made(&["-o", "killed", "--resume"]);
    assert!(files(&folder) == files(&crate::study::desk().path("first")));
    // Another run changes nothing.
    desk.made(&["-o", "killed", "--resume"]);
    assert!(files(&folder) == files(&crate::study::desk().path("first")));
    // The file named by the scene differs now, but the scene's own text does not.
    let voxels = [VOLUME.as_bytes(), &[77; 60]].concat();
    std::fs::write(desk.path("volume.mha"), voxels).expect("written");
    let (went_well, said) = desk.make(&["-o", "killed", "--resume"]);
    assert!(!went_well && said.contains("comes out differently now"), "{said}");
}
