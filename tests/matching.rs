//! `insonify match`: the closed form (an image of the simulator itself, made with other settings), a real
//! volume, and the messages where nothing can be matched.

use std::path::Path;
use std::process::{Command, Output};

use insonify::gpu::test_device;
use insonify::matching::{self, Adjusted, Matching, Options, Stage, depths};
use insonify::scene::{Imaging, Scene};
use insonify::sim::shaders::Library;
use insonify::sim::{Simulator, Tracer};

use crate::common::shared_data::shared_data;

/// Liver everywhere; the mask is an island of the same liver.
const SCENE: &str = r#"# An island.
background = "around"
[probe]
preset = "linear"
bandwidth = 0.77
elevation_layers = 1
samples = 1600
[simulation]
paths = 1
max_reflections = 0
cell = "0.1 mm"
scatterers_per_resolution_cell = 0
[imaging]
image_height = 300
gain = 16 # loud
[tissues.around]
based_on = "liver"
texture_depth = 0
[[mesh]]
name = "island"
tissue = "around"
shape = { ellipsoid = { radii = [12, 12, 13] } }
translate = [0, 0, 19]
"#;

const FUSED: &str = "[volume]\nfile = \"acquired.mha\"\n[fusion]\nmask = [\"island\"]\n";

/// The settings with which the volume was acquired.
fn truth() -> Imaging {
    Imaging {
        gain: 23.0,
        dynamic_range: 45.0,
        tgc_sliders: [-4.5, -3.0, -1.5, -0.5, 0.5, 2.0, 3.0, 4.5],
        psf_scale: [1.6, 1.4, 1.0],
        image_height: 300,
        ..Imaging::default()
    }
}

const ALL: Adjusted = Adjusted { gain: true, tgc: true, range: true, size: true };

fn options(band: f64) -> Options {
    Options { band, frames: 2, adjusted: ALL }
}

/// Writes a volume beside the scene, in bytes. The scanlines of a linear array are a grid: its log image, with another
/// seed and the settings of `truth`, is a volume of one slice whose voxels are the samples.
fn acquire(folder: &Path) {
    acquire_of(SCENE, folder);
}

/// The same of a scene with a lattice twice as coarse, where it is not asked how exact a fit is: the command runs often.
fn acquire_coarse(folder: &Path) {
    acquire_of(
        &SCENE.replace("0.1 mm", "0.2 mm").replace("samples = 1600", "samples = 1000"),
        folder,
    );
}

fn acquire_of(text: &str, folder: &Path) {
    let file = folder.join("scene.toml");
    std::fs::write(&file, text).expect("written");
    let (mut scene, _) = Scene::load(&file, &[]).expect("sound");
    scene.imaging = truth();
    scene.simulation.seed = 77;
    let device = test_device();
    let library = Library::embedded();
    let mut simulator = Simulator::new(&device, &library, &scene, Tracer::Bvh).expect("made");
    simulator.frame(&scene, 0).expect("a frame");
    let log = simulator.log_image().expect("read");
    let (lines, samples) = (scene.probe.scanlines as usize, scene.probe.samples as usize);
    let (pitch, dz) = (scene.probe.line_pitch(0.0), scene.probe.sample_pitch());
    let left = scene.probe.ray(0, 0).0.x;
    let mut bytes = format!(
        "NDims = 3\nDimSize = {lines} 1 {samples}\nElementSpacing = {pitch} 10 {dz}\n\
         Offset = {left} 0 0\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n"
    )
    .into_bytes();
    for k in 0..samples {
        let row = (0..lines).map(|l| (255.0 * log[l * samples + k]).round() as u8);
        bytes.extend(row);
    }
    std::fs::write(folder.join("acquired.mha"), bytes).expect("written");
    std::fs::write(&file, format!("{text}{FUSED}")).expect("written");
}

fn fit(scene: &mut Scene, options: &Options) -> Matching {
    let device = test_device();
    let library = Library::embedded();
    let mut simulator = Simulator::new(&device, &library, scene, Tracer::Bvh).expect("made");
    let made = matching::fit(&mut simulator, scene, options, |_, _| {}).expect("matched");
    assert_eq!(device.validation_messages(), Vec::<String>::new());
    made
}

/// Gain and sliders at depth `z`, dB.
fn level(scene: &Scene, imaging: &Imaging, z: f64) -> f64 {
    let position = z / scene.probe.depth * 7.0;
    let i = (position as usize).min(6);
    let (a, b) = (imaging.tgc_sliders[i], imaging.tgc_sliders[i + 1]);
    imaging.gain + a + (position - i as f64) * (b - a)
}

/// Errors of settings: level (the largest over the compared depths, dB), dynamic range and both sizes
/// (relative).
fn errors(scene: &Scene, made: &Matching, imaging: &Imaging) -> [f64; 4] {
    let truth = truth();
    let places = depths(&scene.probe);
    let off = |&i: &usize| level(scene, imaging, places[i]) - level(scene, &truth, places[i]);
    let largest = made.compared.iter().map(off).map(f64::abs).fold(0.0, f64::max);
    let relative = |a: f64, b: f64| (a / b - 1.0).abs();
    [
        largest,
        relative(imaging.dynamic_range, truth.dynamic_range),
        relative(imaging.psf_scale[0], truth.psf_scale[0]),
        relative(imaging.psf_scale[1], truth.psf_scale[1]),
    ]
}

/// Three deviations of the estimates from the speckle of the two bands. Spread and sizes over n patches scatter by
/// 0.8 / sqrt(n) on either side, and are left alone up to 1 and 2 %; brightness at a depth by 5.6 dB / sqrt(n at
/// that depth), of which the sliders' smoothness leaves about half, and up to 0.3 dB.
fn allowed(made: &Matching) -> [f64; 4] {
    let sides = 1.0 / made.acquired.cells + 1.0 / made.after.simulated.cells;
    let relative = 3.0 * 0.8 * sides.sqrt();
    let depths = made.compared.len() as f64;
    [
        0.3 + 3.0 * 0.5 * 5.6 * (depths * sides).sqrt(),
        0.01 + relative,
        0.02 + relative,
        0.02 + relative,
    ]
}

#[test]
fn settings_of_the_simulators_own_image_are_recovered() {
    let folder = tempfile::tempdir().expect("a folder");
    acquire(folder.path());
    let (mut scene, _) = Scene::load(&folder.path().join("scene.toml"), &[]).expect("sound");
    let options = Options { frames: 3, ..options(8.0) };
    let made = fit(&mut scene, &options);
    assert!(made.settled, "{} rounds", made.rounds);
    assert_eq!((&made.notes, &made.faults), (&vec![], &vec![]));
    assert_eq!(made.tissue, "around");
    assert_eq!(scene.imaging, made.after.imaging);
    assert_eq!(scene.simulation.seed, 1, "the user's seed");
    let allowed = allowed(&made);
    let found = errors(&scene, &made, &scene.imaging);
    println!("{} rounds; errors {found:.3?}, allowed {allowed:.3?}", made.rounds);
    println!("{:?}", scene.imaging);
    assert!(allowed[0] < 1.0 && allowed[1] < 0.06 && allowed[2] < 0.07, "{allowed:?}");
    let recovered = |imaging: &Imaging| {
        let found = errors(&scene, &made, imaging);
        found.iter().zip(&allowed).all(|(e, a)| e <= a)
    };
    assert!(recovered(&scene.imaging), "{found:?} {allowed:?}");
    // A small error of each of them is noticed.
    let truth = truth();
    for planted in [
        Imaging { gain: truth.gain + 1.0, ..truth.clone() },
        Imaging { dynamic_range: 1.07 * truth.dynamic_range, ..truth.clone() },
        Imaging { psf_scale: [1.08 * 1.6, 1.4, 1.0], ..truth.clone() },
        Imaging { psf_scale: [1.6, 1.08 * 1.4, 1.0], ..truth.clone() },
        Imaging { tgc_sliders: [0.0; 8], ..truth.clone() },
        made.before.imaging.clone(),
    ] {
        assert!(!recovered(&planted), "{planted:?}");
    }
    assert!(recovered(&truth));
    // A second fit changes nothing.
    let again = fit(&mut scene, &options);
    assert_eq!((again.rounds, &again.after), (0, &made.after));
}

#[test]
fn only_the_chosen_settings_are_fitted() {
    let folder = tempfile::tempdir().expect("a folder");
    acquire(folder.path());
    let (mut scene, _) = Scene::load(&folder.path().join("scene.toml"), &[]).expect("sound");
    scene.imaging.gain = 25.0;
    let before = scene.imaging.clone();
    let mut options = options(8.0);
    options.adjusted = Adjusted { gain: true, tgc: false, range: false, size: false };
    let made = fit(&mut scene, &options);
    assert_ne!(scene.imaging.gain, before.gain);
    assert_eq!(Imaging { gain: before.gain, ..scene.imaging.clone() }, before);
    let mean = |stage: &Stage| {
        let errors = made.level_errors(stage);
        errors.iter().sum::<f64>() / errors.len() as f64
    };
    // 0.6 dB: errors that are left alone, and the weights of the depths, which differ.
    let (was, is) = (mean(&made.before), mean(&made.after));
    assert!(was.abs() > 3.0 && is.abs() < 0.6, "{was} {is} dB");
}

fn insonify(args: &[&str]) -> Output {
    let program = env!("CARGO_BIN_EXE_insonify");
    let out = Command::new(program).args(args).output();
    out.expect("the program starts")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Runs `insonify match` on the scene, with the tracer that runs everywhere.
fn run(scene: &str, more: &[&str]) -> Output {
    insonify(&[&["match", scene, "--tracer", "bvh", "--frames", "1"], more].concat())
}

#[test]
fn the_scene_file_is_written_and_nothing_else_in_it_changes() {
    let folder = tempfile::tempdir().expect("a folder");
    acquire_coarse(folder.path());
    let at = |name: &str| folder.path().join(name).display().to_string();
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).expect(name);
    let scene = at("scene.toml");
    let before = read("scene.toml");
    let out = run(&scene, &[]);
    assert!(out.status.success(), "{}", text(&out.stderr));
    assert!(text(&out.stderr).contains("nothing is written"), "{}", text(&out.stderr));
    let said = text(&out.stdout);
    for what in ["brightness at 19 mm", "spread", "size axial", "rms difference", "imaging.gain = "]
    {
        assert!(said.contains(what), "{what}: {said}");
    }
    assert_eq!(read("scene.toml"), before);
    let out = run(&scene, &["-o", &at("other/new.toml")]);
    assert!(out.status.success(), "{}", text(&out.stderr));
    assert_eq!(read("scene.toml"), before);
    let other = read("other/new.toml");
    assert!(other.contains("file = \"../acquired.mha\""), "{other}");
    let (written, _) = Scene::load(&folder.path().join("other/new.toml"), &[]).expect("sound");
    assert!(written.imaging.gain > 18.0 && written.imaging.psf_scale[0] > 1.3);
    let out = run(&scene, &["--in-place"]);
    assert!(out.status.success(), "{}", text(&out.stderr));
    let after = read("scene.toml");
    assert_eq!(after.replace("acquired.mha", "../acquired.mha"), other);
    assert!(after.contains(" # loud\n"), "{after}");
    let kept = |line: &&str| !["gain", "dynamic", "tgc", "psf"].iter().any(|k| line.starts_with(k));
    let lines = |text: &str| text.lines().filter(kept).map(str::to_owned).collect::<Vec<_>>();
    assert_eq!(lines(&after), lines(&before));
    // A matched file stays as it is, to the byte.
    let out = run(&scene, &["--in-place"]);
    assert!(text(&out.stdout).contains("matched already"), "{}", text(&out.stdout));
    assert_eq!(read("scene.toml"), after);
}

#[test]
fn scenes_that_cannot_be_matched_are_refused_and_nothing_is_written() {
    let folder = tempfile::tempdir().expect("a folder");
    acquire_coarse(folder.path());
    let file = folder.path().join("scene.toml");
    let scene = file.display().to_string();
    let before = std::fs::read_to_string(&file).expect("there");
    for (more, cause, remedy) in [
        (vec!["--set", "fusion.surroundings=none"], "shows no acquired volume", "add [volume]"),
        (
            vec!["--set", "mesh.island.translate=[90, 0, 0]"],
            "no border of the mask",
            "move the mask",
        ),
        (vec!["--set", "mesh.island.scale=100"], "no border of the mask", "move the mask"),
        (
            vec!["--set", "volume.translate=[0, 90, 0]"],
            "does not reach to the mask",
            "move the volume",
        ),
        (
            vec!["--set", "volume.black=255", "--set", "volume.white=256"],
            "acquired volume around",
            "widen",
        ),
        (vec!["--set", "background=amniotic_fluid"], "scene's own tissue around", "`background`"),
        (vec!["--set", "imaging.gain=80"], "at no depth", "change gain"),
        (vec!["--band", "0.1"], "between 0.5 and 100 mm", ""),
        (vec!["--fit", "colour"], "colour", "gain"),
        (vec!["--in-place", "-o", "x.toml"], "cannot be used with", ""),
        (vec!["-o", "/dev/null/all.toml"], "folder cannot be made", "may write to"),
        // White of the volume at a hundredth of its grey: speckle would span nothing.
        (vec!["--set", "volume.white=4000"], "plausible settings of a scanner", "nothing is set"),
    ] {
        let out = run(&scene, &more);
        let said = text(&out.stderr).split_whitespace().collect::<Vec<_>>().join(" ");
        let said = said.replace("│ ", "");
        assert!(!out.status.success(), "{more:?}: {said}");
        assert!(said.contains(cause) && said.contains(remedy), "{more:?}: {said}");
        assert_eq!(std::fs::read_to_string(&file).expect("there"), before, "{more:?}");
    }
}

/// What is inside the mask is not compared: fluid in it changes nothing that is found.
#[test]
fn tissue_is_compared_with_the_same_tissue() {
    let folder = tempfile::tempdir().expect("a folder");
    acquire(folder.path());
    let fit_with = |tissue: &str, planted: f64| {
        let set = [
            ("mesh.island.tissue", format!("\"{tissue}\"")),
            ("imaging.gain", "20".to_owned()),
            ("tissues.around.echogenicity", format!("\"{} dB\"", planted)),
        ];
        let set = set.map(|(path, value)| (path.to_owned(), value));
        let (mut scene, _) = Scene::load(&folder.path().join("scene.toml"), &set).expect("sound");
        let mut options = options(8.0);
        options.adjusted = Adjusted { gain: true, tgc: false, range: false, size: false };
        let made = fit(&mut scene, &options);
        assert_eq!(made.tissue, "around");
        scene.imaging.gain
    };
    let own = Scene::load(&folder.path().join("scene.toml"), &[]).expect("sound").0;
    let own = own.tissues[own.background].echogenicity;
    let [same, fluid, bright] =
        ["around", "amniotic_fluid", "placenta"].map(|tissue| fit_with(tissue, own));
    // As the margins of the two differ by what the mask holds: a tenth of the speckle's deviation.
    assert!((same - fluid).abs() < 0.6 && (same - bright).abs() < 0.6, "{same} {fluid} {bright}");
    // The tissue around the mask is what counts: 6 dB brighter, it needs 6 dB less.
    let planted = fit_with("amniotic_fluid", own + 6.0);
    assert!((fluid - planted - 6.0).abs() < 0.6, "{fluid} {planted}");
}

/// The scene that ships is matched by plausible settings. Side for side, the bright rim inside the mask was taken for the
/// tissue around it: sliders at their ends, 5 dB left over, and nothing of it was refused.
#[test]
fn the_shipped_fusion_is_matched_by_the_tissue_around_the_mask() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/pregnancy.toml");
    let (mut scene, _) = Scene::load(&path, &[]).expect("sound");
    let made = fit(&mut scene, &Options { band: 4.0, frames: 2, adjusted: ALL });
    println!("{:?} {:?} {:?}", made.after.imaging, made.notes, made.faults);
    assert_eq!((made.tissue.as_str(), &made.faults), ("mother_skin", &vec![]));
    let [before, after] = [&made.before, &made.after].map(|stage| made.level_deviation(stage));
    assert!(after < 2.0 && after < before, "{before} {after} dB");
    assert!(scene.imaging.tgc_sliders.iter().all(|s| s.abs() < 20.0), "{:?}", scene.imaging);
}

/// The sac in the recording of a spine phantom: brightness and spread come nearer.
#[test]
fn a_real_volume_is_approached() {
    if shared_data().is_none() {
        return;
    }
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/scenes/fusion.toml");
    let plain = [
        ("probe.elevation_layers", "2"),
        ("probe.samples", "1024"),
        ("imaging.image_height", "300"),
        ("imaging.gain", "16"),
        ("imaging.psf_scale", "[1, 1, 1]"),
    ]
    .map(|(key, value)| (key.to_owned(), value.to_owned()));
    let (mut scene, _) = Scene::load(&path, &plain).expect("sound");
    let made = fit(&mut scene, &options(4.0));
    let rms = |stage: &Stage| {
        let errors = made.level_errors(stage);
        (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt()
    };
    let spread = |stage: &Stage| {
        let there = made.acquired.spread.expect("speckle");
        (stage.simulated.spread.expect("speckle") / there - 1.0).abs()
    };
    let (before, after) = (&made.before, &made.after);
    println!("levels {:.2} -> {:.2} dB", rms(before), rms(after));
    println!("spread {:.3} -> {:.3}", spread(before), spread(after));
    println!("{:?} {:?} {} rounds", after.imaging, made.notes, made.rounds);
    assert!(rms(after) < 0.7 * rms(before), "{} {}", rms(before), rms(after));
    assert!(spread(after) < 0.5 * spread(before) + 0.02);
}
