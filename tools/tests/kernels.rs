//! The program `kernels` as an author of kernels uses it: on the frame that a simulator dumped, on another driver,
//! with a reader that leaves.

#[path = "../../tests/common/skip.rs"]
mod skip;

use std::process::{Command, Output, Stdio};

use insonify::gpu::test_device;
use insonify::scene::Scene;
use insonify::sim::dump;
use insonify::sim::shaders::Library;
use insonify::sim::{Simulator, Tracer, stages};
use insonify_tools::root;
use skip::{Lacking, skip};

/// Returns the program, with its arguments.
fn kernels(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_kernels"));
    command.args(arguments);
    command
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Settings for which no point of a wire, half a millimetre apart, lies on the border of two layers, where rounding
/// decides which of them sees it; and one kind of cylinder reflects.
const REPLAYED: [(&str, &str); 7] = [
    ("probe.scanlines", "12"),
    ("probe.samples", "512"),
    ("probe.elevation_layers", "3"),
    ("probe.slice_thickness", "8.7mm"),
    ("simulation.paths", "2"),
    ("simulation.labels", "true"),
    ("tissues.plus_6.speed", "1600m/s"),
];

#[test]
fn every_kernel_of_a_dumped_frame_runs_alone_and_equals_its_twin() {
    let scene = root().join("scenes/phantom.toml");
    let set = REPLAYED.map(|(key, value)| (key.to_owned(), value.to_owned()));
    let (scene, _) = Scene::load(&scene, &set).expect("a shipped scene");
    let device = test_device();
    let mut simulator =
        Simulator::new(&device, &Library::embedded(), &scene, Tracer::Bvh).expect("a simulator");
    simulator.frame(&scene, 0).expect("a frame");
    let folder = tempfile::tempdir().expect("a folder");
    dump::frame(&mut simulator, &scene, folder.path()).expect("dumped");
    let input = folder.path().to_str().expect("a plain path");
    let run = |name: &str| -> Output {
        let command = ["run", name, "--size", "small", "--input", input];
        kernels(&command).output().expect("the program starts")
    };
    let names = stages::IMAGE.into_iter().chain(stages::LABELS).map(|pass| match pass.name {
        "scatter" => "scatter_rigid",
        name => name,
    });
    for name in names.chain(["detect"]) {
        let out = run(name);
        let said = text(&out.stdout) + &text(&out.stderr);
        assert!(out.status.success(), "{said}");
        let from = said.lines().find(|l| l.starts_with("from "));
        assert!(from.is_some_and(|l| l.contains("frame, ")), "{said}");
    }
    // A truncated array is refused, and named.
    let rows = folder.path().join("kernels/rows.npy");
    let mut bytes = std::fs::read(&rows).expect("rows");
    bytes.truncate(bytes.len() / 2);
    std::fs::write(&rows, bytes).expect("rows");
    let out = run("detect");
    assert!(!out.status.success());
    assert!(text(&out.stderr).contains("rows.npy"), "{}", text(&out.stderr));
}

#[test]
fn a_reader_that_leaves_is_no_error() {
    let (reader, writer) = std::io::pipe().expect("a pipe");
    drop(reader);
    let mut command = kernels(&["list"]);
    let child = command.stdout(writer).stderr(Stdio::piped()).spawn().expect("the program starts");
    let out = child.wait_with_output().expect("the program ends");
    let said = text(&out.stderr);
    assert!(out.status.success() && !said.contains("panicked"), "{said}");
}

#[test]
fn a_machine_without_a_driver_is_told_what_to_install() {
    let mut command = kernels(&["check"]);
    command.env("VK_DRIVER_FILES", "/no/driver.json").env("VK_ICD_FILENAMES", "/no/driver.json");
    let out = command.output().expect("the program starts");
    let said = text(&out.stderr);
    assert!(!out.status.success(), "{said}");
    assert!(
        said.starts_with("error: no usable Vulkan device")
            && said.contains("; install a GPU driver"),
        "{said}"
    );
}

/// The names of all kernels in two parts of about equally much SPIR-V.
fn halves() -> [Vec<String>; 2] {
    let listed = kernels(&["list"]).output().expect("the program starts");
    let listed = text(&listed.stdout);
    let library = Library::embedded();
    // A line for each kernel, with its variants, and indented ones that say more of it.
    let lines = listed.lines().filter(|line| !line.starts_with(' '));
    let mut all: Vec<(usize, &str)> = lines
        .filter_map(|line| {
            let mut words = line.split_whitespace();
            let name = words.next()?;
            Some((words.map(|stem| library.words(stem).len()).sum(), name))
        })
        .collect();
    assert!(all.len() > 20, "{listed}");
    all.sort_unstable();
    let mut halves = [(0, Vec::new()), (0, Vec::new())];
    for (size, name) in all.into_iter().rev() {
        let half = halves.iter_mut().min_by_key(|half| half.0).expect("two");
        half.0 += size;
        half.1.push(name.to_owned());
    }
    halves.map(|half| half.1)
}

#[test]
fn kernels_agree_with_their_twins_on_a_second_driver() {
    let manifest = root().join("target/second-driver/vk_swiftshader_icd.json");
    if !manifest.exists() {
        let why = "no second driver in target/second-driver (./tools/setup.sh unpacks one)";
        return skip(Lacking::Tool, why);
    }
    // Nearly all of the time that driver compiles, one kernel at a time: two processes take half of it.
    let half = |names: &Vec<String>| {
        let mut command = kernels(&["check", "--validate"]);
        command.args(names);
        if std::env::var_os("INSONIFY_LONG").is_none() {
            // Where drivers differ most; a long run has all.
            command.args(["--case", "random", "--case", "not-finite"]);
        }
        // The second name is that of loaders before 1.3.207.
        command.env("VK_DRIVER_FILES", &manifest).env("VK_ICD_FILENAMES", &manifest);
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        command.spawn().expect("the program starts")
    };
    for child in halves().each_ref().map(half) {
        let out = child.wait_with_output().expect("it ends");
        let said = text(&out.stdout) + &text(&out.stderr);
        assert!(out.status.success(), "{said}");
        assert!(said.starts_with("SwiftShader"), "{said}");
        assert!(!said.contains("WRONG"), "{said}");
    }
}

/// A driver that cannot translate a kernel may end the process: LLVM 19 did so on `shadow_query`, for vectors of four
/// alone. Each kernel is compiled in a process of its own, for vectors of `width` bits where the driver is Mesa's for the
/// processor, with nothing kept from before.
fn every_kernel_compiles(width: &str) {
    let folder = tempfile::tempdir().expect("a folder");
    let mut command = kernels(&["compile"]);
    command.env("LP_NATIVE_VECTOR_WIDTH", width).env("MESA_SHADER_CACHE_DIR", folder.path());
    let out = command.output().expect("the program starts");
    let said = text(&out.stdout) + &text(&out.stderr);
    println!("{said}");
    assert!(out.status.success(), "{said}");
    for stem in Library::embedded().stems() {
        assert!(said.lines().any(|line| line.starts_with(stem)), "{stem}: {said}");
    }
}

// The harness (tests/kernels.rs) compiles all but the parts of `trace`, and dies where the driver does.
#[test]
#[ignore = "takes minutes"]
fn every_kernel_compiles_for_the_width_of_the_program() {
    every_kernel_compiles("128");
}

#[test]
#[ignore = "takes minutes"]
fn every_kernel_compiles_for_the_usual_width() {
    every_kernel_compiles("256");
}
