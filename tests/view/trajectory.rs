//! Recorded trajectories of the probe: in the window, and without one.

use std::path::Path;
use std::process::Command;

use crate::view::desk::{self, Desk, Key};
use crate::view::{IMAGE, SCENE, brightness, difference};

/// A trajectory: half a second along the image by 12 mm.
const WAY: &str = "time_s,x_mm,y_mm,z_mm\n0,0,0,0\n0.25,6,0,0\n0.5,12,0,0\n";

#[test]
fn a_recorded_trajectory_is_replayed() {
    let Some(mut desk) = Desk::open(SCENE, &["--validate"]) else {
        return;
    };
    desk.wait_for("an image", |d| brightness(&d.grab(IMAGE)) > 10.0);
    let home = desk.settle(IMAGE);
    desk.press(Key::Letter('r'));
    for _ in 0..6 {
        desk.press(Key::Right);
    }
    desk.wait_for("the image to move", |d| difference(&d.grab(IMAGE), &home) > 4.0);
    let away = desk.settle(IMAGE);
    desk.press(Key::Letter('r'));
    desk.press(Key::Home);
    desk.wait_for("the image to come back", |d| difference(&d.grab(IMAGE), &home) < 1.5);
    desk.hold_control(Key::Letter('r'));
    desk.wait_for("the replay to end where the recording did", |d| {
        difference(&d.grab(IMAGE), &away) < 1.5
    });
    // It has ended: nothing is drawn any more.
    desk.settle(IMAGE);
    desk.press(Key::Home);
    desk.wait_for("the keys to have the probe", |d| difference(&d.grab(IMAGE), &home) < 1.5);
    desk.quit();
}

#[test]
fn a_trajectory_of_a_file_is_gone_along_from_the_start() {
    let folder = tempfile::tempdir().expect("a folder");
    let way = folder.path().join("way.csv");
    std::fs::write(&way, WAY).expect("written");
    let way = way.to_str().expect("plain");
    let Some(mut desk) = Desk::open(SCENE, &["--validate", "--trajectory", way]) else {
        return;
    };
    desk.wait_for("an image", |d| brightness(&d.grab(IMAGE)) > 10.0);
    let end = desk.settle(IMAGE);
    desk.press(Key::Home);
    desk.wait_for("the beginning, which is home", |d| difference(&d.grab(IMAGE), &end) > 4.0);
    for _ in 0..6 {
        desk.press(Key::Right);
    }
    desk.wait_for("what six keys show, 12 mm from home", |d| {
        difference(&d.grab(IMAGE), &end) < 1.5
    });
    desk.quit();
}

/// Runs `insonify render` of a small image, into `output`.
fn render(scene: &Path, output: &Path, more: &[&str]) -> std::process::Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_insonify"));
    command.arg("render").arg(scene).arg("-o").arg(output);
    command.args(["--quality", "draft", "--set", "imaging.image_height=100"]);
    command.args(more).output().expect("started")
}

#[test]
fn a_trajectory_is_rendered_pose_by_pose_without_a_window() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    let scene = path("scene.toml");
    std::fs::write(&scene, SCENE).expect("written");
    std::fs::write(path("way.csv"), WAY).expect("written");
    std::fs::write(path("end.csv"), "time_s,x_mm,y_mm,z_mm\n9,12,0,0\n").expect("written");
    let file = |name: &str| path(name).to_str().expect("plain").to_owned();
    let frames = |name: &str, more: &[&str]| {
        let output = render(&scene, &path(name), more);
        assert!(output.status.success(), "{output:?}");
        let reader = std::io::BufReader::new(std::fs::File::open(path(name)).expect("there"));
        let decoder = image::codecs::gif::GifDecoder::new(reader).expect("a GIF");
        let frames = image::AnimationDecoder::into_frames(decoder);
        frames.collect_frames().expect("whole")
    };
    let way = file("way.csv");
    // A frame for each row, as far apart as the rows.
    let rows = frames("rows.gif", &["--trajectory", &way]);
    assert_eq!(rows.len(), 3);
    assert!(rows.iter().all(|f| f.delay().numer_denom_ms() == (250, 1)));
    assert_eq!(frames("rate.gif", &["--trajectory", &way, "--fps", "10"]).len(), 6);
    assert_eq!(frames("count.gif", &["--trajectory", &way, "--frames", "4"]).len(), 4);
    // The same file gives the same frames.
    let again = frames("again.gif", &["--trajectory", &way]);
    for (a, b) in rows.iter().zip(&again) {
        assert_eq!(a.buffer(), b.buffer());
    }
    // A row's frame is that of a scene whose probe is at the row's place.
    let there = "probe.pose={ position = [12, 0, 0] }";
    for (name, more) in [
        ("moved.png", vec!["--set", there]),
        ("end.png", vec!["--trajectory", &*file("end.csv")]),
        ("home.png", vec![]),
    ] {
        let output = render(&scene, &path(name), &more);
        assert!(output.status.success(), "{output:?}");
    }
    let pixels = |name: &str| image::open(path(name)).expect("a picture").to_luma8().into_raw();
    assert_eq!(pixels("end.png"), pixels("moved.png"));
    assert!(difference(&pixels("end.png"), &pixels("home.png")) > 4.0);
}

#[test]
fn a_trajectory_that_cannot_be_read_is_refused_with_its_line_and_what_to_do() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = folder.path().join("scene.toml");
    std::fs::write(&scene, SCENE).expect("written");
    let way = folder.path().join("way.csv");
    let named = way.to_str().expect("plain");
    for (text, words) in [
        (
            "time_s,x_mm,y_mm,z_mm\n0,0,0,0\n1,2,far,0\n",
            ["way.csv:3", "`far` is not a number", "like 1.5"],
        ),
        (
            "time_s,x_mm,y_mm,z_mm\n0,0,0,0\n0,2,0,0\n",
            ["way.csv:3", "occurs twice", "must increase"],
        ),
        ("time_s,x_mm\n0,0\n", ["way.csv", "`y_mm` is missing", "together"]),
        ("time_s,x_mm,y_mm,z_mm\n0,0,0\n", ["way.csv:2", "3 values", "one for each column"]),
    ] {
        std::fs::write(&way, text).expect("written");
        let render = render(&scene, &folder.path().join("a.png"), &["--trajectory", named]);
        let view = desk::program(&scene, &["--trajectory", named]).output();
        for output in [render, view.expect("started")] {
            let said = String::from_utf8_lossy(&output.stderr).into_owned();
            // The message may be wrapped into several text lines.
            let said = said.split_whitespace().collect::<Vec<_>>().join(" ");
            assert_eq!(output.status.code(), Some(1), "{said}");
            assert!(words.iter().all(|w| said.contains(w)), "{words:?}: {said}");
        }
    }
}
