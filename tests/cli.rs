//! The command line as a user sees it: files written, figures reported, mistakes explained.

use std::path::Path;
use std::process::{Command, Output, Stdio};

use insonify::gpu::test_device;
use insonify::sim::stages;
use serde_json::Value;

use crate::common::timestamps::timestamps;
use crate::common::tracers::tracers;

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

#[test]
fn render_writes_picture_stages_and_figures_without_a_validation_message() {
    let dir = tempfile::tempdir().expect("a folder");
    let (png, json, dump) =
        (dir.path().join("a.png"), dir.path().join("a.json"), dir.path().join("stages"));
    // The program takes the same device: the best one.
    let timed = timestamps(&test_device());
    for tracer in tracers(&test_device()).iter().map(ToString::to_string) {
        let out = render(
            "scenes/phantom.toml",
            &[
                "--tracer",
                &tracer,
                "-o",
                path(&png),
                "--json",
                path(&json),
                "--dump",
                path(&dump),
                "--frames",
                "3",
                "--set",
                "simulation.labels=true",
                "--set",
                "processing.speckle_reduction=0.5",
                "--validate",
            ],
        );
        assert!(out.status.success(), "{}", text(&out.stderr));
        assert!(!png.exists(), "one image per frame");
        let [first, last] = ["a.0000.png", "a.0002.png"].map(|name| {
            let png = dir.path().join(name);
            image::open(&png).expect("a PNG").into_luma8()
        });
        assert!(first != last, "each frame has its noise");
        let image = last;
        let bright = image.pixels().filter(|p| p.0[0] > 60).count();
        assert!(bright * 5 > (image.width() * image.height()) as usize, "{bright} bright pixels");
        let figures: Value =
            serde_json::from_slice(&std::fs::read(&json).expect("figures")).expect("JSON");
        assert_eq!(figures["tracer"], tracer);
        assert_eq!(figures["saturated_samples"], 0);
        let counts = &figures["settings"]["counts"];
        assert_eq!(
            [&counts["lines"], &counts["paths_per_line"], &counts["paths"]],
            [96, 8, 96 * 8]
        );
        assert_eq!(figures["validation_messages"], Value::Array(vec![]));
        for key in ["settings", "device", "stages_ms", "frame_ms", "memory", "counters"] {
            assert!(figures[key].is_object(), "{key}");
        }
        let stages = stages::IMAGE.into_iter().chain(stages::LABELS).map(|pass| pass.name);
        for stage in stages.filter(|_| timed) {
            assert!(figures["stages_ms"][stage]["p99"].as_f64() > Some(0.0), "{stage}");
        }
        assert_eq!(figures["frame_ms"]["p99"].as_f64() > Some(0.0), timed);
        let labels = std::fs::metadata(dump.join("kernels/labels.npy")).expect("labels").len();
        assert!(labels > 64 * 48 * 512, "a label for each sample");
        assert!(figures["memory"]["device_peak_bytes"].as_u64() > Some(100_000));
        for (name, values) in [
            ("0_echoes", 2 * 48 * 512 * 2),
            ("2_iq", 48 * 512 * 2),
            ("3_envelope", 48 * 512),
            ("4_log", 48 * 512),
        ] {
            let size = std::fs::metadata(dump.join(name).with_extension("npy")).expect(name).len();
            assert_eq!(size % 64, (values * 4) % 64, "{name} has a padded header");
            let axes: Value = serde_json::from_slice(
                &std::fs::read(dump.join(name).with_extension("json")).expect(name),
            )
            .expect("JSON");
            let sizes = axes["axes"].as_array().expect("axes").iter();
            let count: u64 = sizes.map(|a| a["size"].as_u64().expect("a size")).product();
            assert_eq!(count, values, "{name}");
        }
        assert!(dump.join("1_rf.npy").exists() && dump.join("5_bmode.png").exists());
    }
}

#[test]
fn every_sampling_scatter_mode_and_probe_renders() {
    let dir = tempfile::tempdir().expect("a folder");
    let png = dir.path().join("a.png");
    let modes = [
        "simulation.sampling=plain",
        "simulation.sampling=shared-primary",
        "simulation.scatter_mode=voxel",
        "simulation.coherence=coherent",
        "simulation.texture_space=world",
        "simulation.face_reflection=true",
        "simulation.rough_transmission=true",
        "probe.preset=linear",
        "probe.preset=phased",
        "probe.preset=paper-table1",
    ];
    for mode in modes {
        let out = render(
            "scenes/abdomen.toml",
            &[
                "--set",
                mode,
                "--set",
                "probe.scanlines=64",
                "--quality",
                "draft",
                "-o",
                path(&png),
                "--validate",
            ],
        );
        assert!(out.status.success(), "{mode}: {}", text(&out.stderr));
        let image = image::open(&png).expect("a PNG").into_luma8();
        let lit = image.pixels().filter(|p| p.0[0] > 30).count();
        assert!(lit > 1000, "{mode}: {lit} pixels are lit");
    }
}

#[test]
fn quality_sets_the_counts_that_the_user_does_not() {
    let dir = tempfile::tempdir().expect("a folder");
    let (png, json) = (dir.path().join("a.png"), dir.path().join("a.json"));
    let counts = |more: &[&str]| {
        let files = ["-o", path(&png), "--json", path(&json), "--tracer", "bvh"];
        let out = render("scenes/phantom.toml", &[&files, more].concat());
        assert!(out.status.success(), "{}", text(&out.stderr));
        let figures: Value =
            serde_json::from_slice(&std::fs::read(&json).expect("figures")).expect("JSON");
        figures["settings"]["counts"].clone()
    };
    let proof = counts(&["--quality", "reference"]);
    assert_eq!(proof["paths_per_line"], 128);
    assert_eq!(proof["scatterers_per_resolution_cell"], 0.0);
    let mixed = counts(&["--quality", "reference", "--set", "simulation.paths=3"]);
    assert_eq!(mixed["paths_per_line"], 3);
    assert_eq!(mixed["cell_mm"], proof["cell_mm"]);
    // The kind of draft depends on the device, but it is always less than the proof.
    let draft = counts(&["--quality", "draft"]);
    assert!(draft["paths_per_line"].as_u64() < Some(128));
}

#[test]
fn mistakes_are_explained() {
    let cases: [(&[&str], &str); 5] = [
        (&["render", "scenes/nowhere.toml"], "nowhere.toml"),
        (&["render", "scenes/phantom.toml", "--set", "probe.dept=3"], "depth"),
        (&["render", "scenes/phantom.toml", "--set", "probe.depth=5 MHz"], "mm"),
        (&["render", "scenes/phantom.toml", "--device", "no such device"], "no such device"),
        (&["render", "scenes/phantom.toml", "--set", "nonsense"], "PATH=VALUE"),
    ];
    for (args, needle) in cases {
        let out = insonify(args);
        assert!(!out.status.success(), "{args:?}");
        assert!(text(&out.stderr).contains(needle), "{args:?}: {}", text(&out.stderr));
    }
}

#[test]
fn a_mistake_in_a_file_is_shown_where_it_stands() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("scene.toml");
    std::fs::write(&file, "name = \"a\"\n[probe]\n  dept = 3\n").unwrap();
    let out = insonify(&["render", path(&file)]);
    let said = text(&out.stderr);
    let lines = " 2 | [probe]\n 3 |   dept = 3\n   |   ^^^^\n  help: did you mean `depth`?\n";
    assert!(!out.status.success() && said.starts_with("error: "), "{said}");
    assert!(said.contains("scene.toml:3:3: ") && said.ends_with(lines), "{said}");
}

#[test]
fn info_lists_this_machine() {
    let out = insonify(&["info"]);
    assert!(out.status.success(), "{}", text(&out.stderr));
    assert!(text(&out.stdout).contains("Vulkan 1."), "{}", text(&out.stdout));
}

/// Runs a program whose reader has left before the first line of output.
fn unread(program: &str, args: &[&str]) -> Output {
    let (reader, writer) = std::io::pipe().expect("a pipe");
    drop(reader);
    let child = Command::new(program)
        .args(args)
        .stdout(writer)
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    child.wait_with_output().expect("the program ends")
}

#[test]
fn a_closed_pipe_is_no_error() {
    let insonify = env!("CARGO_BIN_EXE_insonify");
    for (program, args, code) in [
        (insonify, &["info"][..], 0),
        (insonify, &["check", "scenes/phantom.toml"], 0),
        (insonify, &["check", "scenes/nowhere.toml"], 1),
    ] {
        let out = unread(program, args);
        let said = text(&out.stderr);
        assert!(!said.contains("panicked"), "{args:?}: {said}");
        assert_eq!(out.status.code(), Some(code), "{args:?}: {said}");
    }
}

/// Kernels compiled from the checked-in sources equal the checked-in kernels.
#[cfg(feature = "compile")]
#[test]
fn kernels_from_a_folder_of_sources_make_the_same_picture() {
    let dir = tempfile::tempdir().expect("a folder");
    let [embedded, compiled] = [&[][..], &["--glsl", "glsl"]].map(|more| {
        let png = dir.path().join("a.png");
        let args = ["-o", path(&png), "--tracer", "bvh"];
        let out = render("scenes/phantom.toml", &[&args, more].concat());
        assert!(out.status.success(), "{}", text(&out.stderr));
        std::fs::read(&png).expect("a picture")
    });
    assert!(embedded == compiled);
    let nowhere = render("scenes/phantom.toml", &["--glsl", "nowhere"]);
    assert!(text(&nowhere.stderr).contains("nowhere"));
}

/// A plate in water that goes from 10 to 20 mm of depth and back within two seconds, and is hidden in
/// the second half of every second.
const MOVING: &str = r#"
[probe]
preset = "linear"
depth = 30
[imaging]
image_height = 120
[[transform]]
name = "way"
translate = [0, 0, 15]
motion = { kind = "sine", period = 2, phase = 0.75, translate = [0, 0, 5] }
[[selector]]
name = "blink"
parent = "way"
period = "1 s"
[[group]]
name = "seen 1"
parent = "blink"
[[mesh]]
name = "plate"
parent = "seen 1"
tissue = "liver"
shape = { plane = { size = [80, 80], thickness = 40 } }
[[group]]
name = "unseen"
parent = "blink"
"#;

/// Row of the brightest plate echo, as a share of the picture's height.
fn brightest(image: &image::GrayImage) -> f64 {
    let sum = |y: u32| -> u64 { (0..image.width()).map(|x| u64::from(image[(x, y)].0[0])).sum() };
    let row = (0..image.height()).max_by_key(|&y| sum(y)).expect("rows");
    f64::from(row) / f64::from(image.height())
}

#[test]
fn time_moves_the_scene_and_frames_become_an_animation() {
    let dir = tempfile::tempdir().expect("a folder");
    let (scene, gif, png) =
        (dir.path().join("moving.toml"), dir.path().join("a.gif"), dir.path().join("a.png"));
    std::fs::write(&scene, MOVING).expect("written");
    let more = ["--tracer", "bvh", "--frames", "4", "--fps", "4", "--time", "100 ms"];
    let out = render(path(&scene), &[&more[..], &["-o", path(&gif)]].concat());
    assert!(out.status.success(), "{}", text(&out.stderr));
    assert_eq!(text(&out.stdout).trim(), path(&gif));
    let file = std::io::BufReader::new(std::fs::File::open(&gif).expect("a file"));
    let decoder = image::codecs::gif::GifDecoder::new(file).expect("a GIF");
    let frames = image::AnimationDecoder::into_frames(decoder);
    let frames = frames.collect_frames().expect("whole");
    assert_eq!(frames.len(), 4);
    let grey: Vec<_> =
        frames.iter().map(|f| image::DynamicImage::from(f.buffer().clone()).into_luma8()).collect();
    // At 0.1 and 0.35 s; the plate's front is at 15 - 5 cos(pi t) of 30 mm, within a row or two of
    // the 120 rows; the pulse is 0.2 mm long.
    for (frame, t) in grey.iter().zip([0.1, 0.35]) {
        let expected = (15.0 - 5.0 * f64::cos(std::f64::consts::PI * t)) / 30.0;
        let found = brightest(frame);
        assert!((found - expected).abs() < 0.02, "{t}: {found} {expected}");
    }
    // In the second half of the second the plate is hidden.
    let light = |image: &image::GrayImage| image.pixels().filter(|p| p.0[0] > 60).count();
    let counts: Vec<_> = grey.iter().map(light).collect();
    assert!(counts[..2].iter().all(|&n| n > 100) && counts[2..] == [0, 0], "{counts:?}");
    assert_eq!(frames[0].delay().numer_denom_ms(), (250, 1));

    let out = render(path(&scene), &["--tracer", "bvh", "--time", "0.35", "-o", path(&png)]);
    assert!(out.status.success(), "{}", text(&out.stderr));
    let still = image::open(&png).expect("a PNG").into_luma8();
    assert!((brightest(&still) - brightest(&grey[1])).abs() < 0.01);

    for (wrong, cause) in [(["--time", "4 mm"], "`s`, `ms`"), (["--fps", "0"], "between")] {
        let out = render(path(&scene), &wrong);
        assert!(!out.status.success() && text(&out.stderr).contains(cause), "{wrong:?}");
    }
}

/// A full disk behind standard output is reported to the user, not a bug; the requested files are written.
#[cfg(target_os = "linux")]
#[test]
fn lines_that_cannot_be_written_are_told_and_files_are_there_all_the_same() {
    let dir = tempfile::tempdir().expect("a folder");
    let png = dir.path().join("p.png");
    let full = std::fs::OpenOptions::new().write(true).open("/dev/full");
    let mut command = Command::new(env!("CARGO_BIN_EXE_insonify"));
    command.args(["render", "scenes/phantom.toml", "-o", path(&png)]);
    command.args(SMALL).stdout(full.expect("a full device"));
    let output = command.output().expect("the program starts");
    let told = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{told}");
    assert!(told.contains("standard output could not be written: No space left"), "{told}");
    assert!(!told.contains("panicked"), "{told}");
    assert!(image::open(&png).is_ok(), "the picture is whole");
}
