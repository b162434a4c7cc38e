//! `insonify render`: a scene to a B-mode image.

use std::path::{Path, PathBuf};

use miette::{IntoDiagnostic, Result, miette};
use serde_json::{Map, Value, json};

use super::common::{self, Common, Progress, Stage};
use insonify::gpu::{Device, FrameTimings, peak_bytes};
use insonify::output;
use insonify::scene::{Scene, file, shipped};
use insonify::settings::{Group as _, ScatterMode, Simulation};
use insonify::sim::calibration::Calibration;
use insonify::sim::contact::{REACH_SKIN, UNTOUCHED};
use insonify::sim::dump;
use insonify::sim::facts;
use insonify::sim::shaders::Library;
use insonify::sim::{Shot, Simulator, Tracer};
use insonify::statistics::Statistics;

mod coloured;
mod film;
mod labels;
mod mode;
mod moments;
mod spectrum;
mod strained;

use film::{Coloured, Film};
use labels::LabelFiles;
use mode::{Mode, Product};
use moments::{Moment, groups, moments, pace};

/// Frames per second of an animation whose scene time stands still.
const SHOWN: f64 = 10.0;

/// Arguments of `insonify render`.
#[derive(Debug, clap::Args)]
pub struct Render {
    /// Scene file (.toml), or the name of a scene that ships.
    #[arg(value_parser = common::scene_file())]
    scene: PathBuf,
    /// Image to write (PNG, 8-bit grey, with the size of a pixel) [default: the scene's name with .png, here]; its
    /// folder is made. NAME.json beside it says settings, pose, time and place of its pixels. With several
    /// frames NAME.png becomes NAME.0000.png, NAME.0001.png, ...; `{}` or `%04d` in the name says
    /// where the number goes. NAME.gif is an animation of all frames, played again and again; NAME.mp4 a film in
    /// H.264, which the program ffmpeg makes. NAME.dcm is a loop in DICOM, with the size of a pixel. NAME.seq.mha and NAME.seq.nrrd are loops with the probe's pose at each frame,
    /// for 3D Slicer and PLUS. NAME.uff has IQ and RF of all frames for USTB. NAME.hdf5 is a file of zea: images, poses,
    /// envelope, IQ and RF; with --set simulation.labels=true also the segmentation and every label of the pixels.
    #[arg(short, long)]
    output: Option<PathBuf>,
    /// Frames to simulate; each is written, timings are over all. --dump takes the last. [default: 1;
    /// along a trajectory one for each of its rows, or as many as --fps makes of it]
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    frames: Option<u32>,
    /// Frames per second of the scene's time [default: time stands still, and only noise differs;
    /// along a trajectory it goes on as that does]. Without it an animated GIF shows 10 frames a
    /// second, or as many as the trajectory has.
    #[arg(long, value_parser = common::between(1e-3, 1e4))]
    fps: Option<f64>,
    /// Poses of the probe (.csv, .toml): what the window has recorded, or columns time_s, x_mm, y_mm,
    /// z_mm, qw, qx, qy, qz. --frames alone are spread evenly from its first row to its last. --time
    /// is the scene's time at its first row.
    #[arg(long, value_name = "FILE")]
    trajectory: Option<PathBuf>,
    #[command(flatten)]
    common: Common,
    /// Writes what every sample and every pixel shows, for each frame. NAME.npz: all arrays of docs/labels.md (tissue and
    /// mesh that are there and that are seen, position, loss, incidence, displacement, contact, expected level,
    /// reverberation), the legend in legend.json. NAME.png: the tissue that is seen, as a grey level, with NAME.colours.png beside it; 255
    /// is outside. Several frames are numbered as images are.
    #[arg(long, value_name = "FILE")]
    labels: Option<PathBuf>,
    /// Doppler. Colours the image by a packet of pulses in the colour box of the scene's [doppler]: `color` shows velocities, red
    /// towards the probe and blue away from it, `power` how much moves, `tdi` how fast tissue moves (keys:
    /// [tissue_doppler]), `strain` how it is stretched (red) and compressed (blue) along the scanlines (keys: [strain]). `pw` records the gate of [spectral] instead of an
    /// image, and shows its spectra against time, `cw` all of the gate's line by a continuous wave; NAME.json says what is measured on them. PNG only.
    #[arg(long, value_enum, conflicts_with = "dump")]
    mode: Option<Mode>,
    /// Writes the packet of the last frame of --mode: `iq` (pulse, scanline, sample; real and imaginary), `times` (s), `depth`
    /// (mm), and what was found, `velocity` (mm/s, towards the probe), `variance`, `power` (scanline, sample); packet.json says
    /// frequency, speed of sound and PRF. Of `strain`: `displacement` (mm), `strain`, `likeness`
    /// (scanline, sample). Of `pw` and `cw`: `iq` (pulse; real and imaginary), `spectrum` (time, velocity), `velocity`,
    /// `times`, and the traces `maximum` and `mean`. NAME.npz
    #[arg(long, value_name = "FILE", requires = "mode")]
    packet: Option<PathBuf>,
    /// Writes what `--mode pw` or `cw` hears as sound, stereo: towards the probe left, away from it right. NAME.wav
    #[arg(long, value_name = "FILE", requires = "mode")]
    sound: Option<PathBuf>,
    /// Writes every stage as a numbered array with its axes into this folder.
    #[arg(long, value_name = "DIR")]
    dump: Option<PathBuf>,
    /// Writes settings, timings, memory and counters as one JSON object.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Adds to --json what rays come to on their way: nodes, triangles and instances, per ray; in one
    /// more frame, by kernels of the compute tracer that count.
    #[arg(long, requires = "json")]
    steps: bool,
    /// Compiles the kernels of this folder instead of using the built-in ones.
    #[cfg(feature = "compile")]
    #[arg(long, value_name = "DIR")]
    glsl: Option<PathBuf>,
}

/// Runs the command.
///
/// # Errors
/// Every mistake of the user and every error of the device, reported once.
pub fn run(args: &Render) -> Result<()> {
    let output = args.output.clone().unwrap_or_else(|| default_output(&args.scene));
    distinct(args, &output)?;
    if let Some(dir) = &args.dump {
        common::writable_folder(dir)?;
    }
    if let Some(json) = &args.json {
        common::writable(json)?;
    }
    let mut scene = args.common.scene(&args.scene)?;
    let moments = moments(args, &scene)?;
    let frames = u32::try_from(moments.len()).expect("no more than can be asked for");
    film::check(&output, frames)?;
    let product = args.mode.map(Mode::product);
    match product {
        Some(Product::Spectra(wave)) => {
            scene.spectral.wave = wave;
            spectrum::check(args, &output, &scene)?;
        }
        Some(Product::Coloured(colours)) => {
            spectrum::check_silent(args)?;
            film::check_colour(&output)?;
            coloured::check(&scene, colours)?;
        }
        None => {}
    }
    if let Some(packet) = &args.packet {
        coloured::check_packet(packet)?;
    }
    if let Some(labels) = &args.labels {
        labels::check(labels, frames, &scene)?;
        scene.simulation.labels = true;
    }
    let of_file = scene.simulation.clone();
    let mut library = library(args)?;
    let Stage { device, tracer, mut simulator, upload_ms: build_ms } =
        args.common.stage(&mut scene, &library)?;

    let sidecar = sidecar(args, &output, &scene, &of_file, &device, tracer)?;
    if matches!(product, Some(Product::Spectra(_))) {
        let (timings, mut said) =
            spectrum::write(args, &output, &mut simulator, &mut scene, sidecar)?;
        if let Some(file) = &args.json {
            said.insert("stages_ms".into(), stage_statistics(&timings).into());
            common::write_json(file, &said)?;
        }
        return args.common.validated(&device);
    }
    let (timings, sidecar) =
        simulate(&mut simulator, &mut library, &mut scene, args, &output, moments, sidecar)?;
    if let Some(dir) = &args.dump {
        dump::frame(&mut simulator, &scene, dir).into_diagnostic()?;
    }

    let counters = simulator.counters().into_diagnostic()?;
    for lost in common::lost(&counters) {
        output::note(format!("warning: {lost}"));
    }
    let contact = simulator.contact();
    if contact.is_some_and(|touch| touch.share == 0.0) {
        output::note(format!("warning: {UNTOUCHED}; {REACH_SKIN}"));
    } else if is_black(&mut simulator)? {
        output::note(format!(
            "warning: the last image is black: see imaging.gain, the time-gain compensation, and what lies before the probe \
             (insonify check {})",
            args.scene.display()
        ));
    }
    let steps = match args.steps {
        true => Some(steps(&mut simulator, &library, &scene, tracer)?),
        false => None,
    };
    let messages = device.validation_messages();
    if let Some(file) = &args.json {
        let memory = device.memory();
        let mut report = sidecar;
        let figures = json!({
            "triangles": scene.triangles(),
            "fps": args.fps,
            "build_ms": build_ms,
            "stages_ms": stage_statistics(&timings),
            "frame_ms": Statistics::of(timings.iter().map(FrameTimings::total_ms)),
            "memory": { "host_peak_bytes": peak_bytes(), "device_peak_bytes": memory.peak },
            "counters": {
                "rays": counters.rays, "interactions": counters.interactions, "segments": counters.segments,
                "candidates": counters.candidates, "deposits": counters.deposits,
                "segments_dropped": counters.segments_dropped, "strips_limited": counters.strips_limited, "stack_overflow": counters.stack_overflow,
                "paths_lost": counters.paths_lost,
            },
            "scatterers_per_resolution_cell": scatterers(&scene),
            "steps_per_ray": steps,
            "contact": contact.map(|touch| json!({
                "share": touch.share, "depth_mm": touch.depth,
            })),
            "saturated_samples": counters.saturated,
            "validation_messages": messages,
        });
        report.extend(figures.as_object().expect("made as one").clone());
        common::write_json(file, &report)?;
    }
    args.common.validated(&device)
}

/// True if nothing is seen in the last image.
fn is_black(simulator: &mut Simulator) -> Result<bool> {
    let (_, _, rgba) = simulator.pixels().into_diagnostic()?;
    Ok(rgba.chunks_exact(4).all(|pixel| pixel[..3] == [0; 3]))
}

/// Refuses files of which one would replace another. Figures may be written into the sidecar: they say all that it does.
fn distinct(args: &Render, output: &Path) -> Result<()> {
    common::distinct(
        &[("the scene", Some(&args.scene)), ("--trajectory", args.trajectory.as_deref())],
        &[
            ("-o", Some(output)),
            ("--json", args.json.as_deref()),
            ("--labels", args.labels.as_deref()),
            ("--packet", args.packet.as_deref()),
            ("--sound", args.sound.as_deref()),
        ],
    )
}

/// What is said of all frames beside the pictures and in them. Under `set` stands what of the scene file to replace to
/// get them again.
fn sidecar(
    args: &Render,
    output: &Path,
    scene: &Scene,
    of_file: &Simulation,
    device: &Device,
    tracer: Tracer,
) -> Result<Map<String, Value>> {
    let settled = file::changes(of_file, &scene.simulation, Simulation::TABLE).into_iter();
    let set = args.common.overrides(&args.scene)?.into_iter();
    let set = set.map(|(path, value)| (path, Some(value))).chain(settled);
    let set: Map<String, Value> = set.map(|(path, value)| (path, value.into())).collect();
    let sidecar = json!({
        "program": concat!("insonify ", env!("CARGO_PKG_VERSION")),
        "scene": scene.name,
        "scene_file": shipped::cited(&args.scene, output.parent().unwrap_or(output)),
        "device": { "name": device.name(), "driver": device.driver(), "api": device.api_version() },
        "tracer": tracer.to_string(),
        "time_s": args.common.time,
        "set": set,
        "settings": facts::settings(scene),
    });
    Ok(sidecar.as_object().expect("made as one").clone())
}

/// Scatterers per resolution cell over depth, of the tissue with most; none in voxel mode.
fn scatterers(scene: &Scene) -> Option<Vec<Value>> {
    if scene.simulation.scatter_mode == ScatterMode::Voxel {
        return None;
    }
    let calibration = Calibration::new(scene);
    let most = |z| {
        let counts = scene.tissues.iter().map(|t| calibration.scatterers_at(t, z));
        counts.fold(0.0, f64::max)
    };
    let depth = |eighth: u32| scene.probe.depth * f64::from(eighth) / 8.0;
    let row = |z| json!({ "depth_mm": z, "scatterers": most(z) });
    Some((0..=8).map(depth).map(row).collect())
}

/// Counts of one more frame, per ray.
fn steps(
    simulator: &mut Simulator,
    library: &Library,
    scene: &Scene,
    tracer: Tracer,
) -> Result<Value> {
    if tracer != Tracer::Bvh {
        return Err(miette!(
            help = "take --tracer bvh, or leave --steps out",
            "the steps of the ray query cannot be counted"
        ));
    }
    simulator.count(library, true).into_diagnostic()?;
    simulator.frame(scene, 0).into_diagnostic()?;
    let c = simulator.counters().into_diagnostic()?;
    let per_ray = |count: u32| f64::from(count) / f64::from(c.rays.max(1));
    Ok(json!({
        "node_visits": per_ray(c.node_visits), "top_visits": per_ray(c.top_visits),
        "triangle_tests": per_ray(c.triangle_tests),
        "instances_reached": per_ray(c.instances_reached),
    }))
}

#[cfg(feature = "compile")]
fn library(args: &Render) -> Result<Library> {
    match &args.glsl {
        Some(dir) => Library::with_sources(dir).into_diagnostic(),
        None => Ok(Library::embedded()),
    }
}

#[cfg(not(feature = "compile"))]
fn library(_: &Render) -> Result<Library> {
    Ok(Library::embedded())
}

/// Takes over kernels whose sources have changed; reports a mistake in them and keeps the last good
/// ones.
#[cfg(feature = "compile")]
fn reload(simulator: &mut Simulator, library: &mut Library) {
    match library.poll() {
        Ok(stems) if stems.is_empty() => {}
        Ok(stems) => match simulator.reload(library) {
            Ok(()) => output::note(format!("reloaded {}", stems.join(", "))),
            Err(error) => output::note(format!("warning: {error}; the last kernels stay")),
        },
        Err(error) => output::note(format!("warning: {error}; the last kernels stay")),
    }
}

#[cfg(not(feature = "compile"))]
fn reload(_: &mut Simulator, _: &mut Library) {}

/// Simulates all frames and writes each as an image; returns the device's timings of each, and what is `said` of them.
/// The scene's time is then that of the last frame.
fn simulate(
    simulator: &mut Simulator,
    library: &mut Library,
    scene: &mut Scene,
    args: &Render,
    output: &Path,
    moments: Vec<Moment>,
    sidecar: Map<String, Value>,
) -> Result<(Vec<FrameTimings>, Map<String, Value>)> {
    let frames = moments.len() as u32;
    let shown = args.fps.or_else(|| pace(args, &moments)).unwrap_or(SHOWN);
    // Packets are made one by one, each behind its image.
    let colours = match args.mode.map(Mode::product) {
        Some(Product::Coloured(colours)) => Some(colours),
        _ => None,
    };
    let mut film = Film::new(output, simulator, scene, &moments, shown, colours, sidecar)?;
    let labels = args.labels.as_ref().map(|path| LabelFiles::new(path, frames)).transpose()?;
    let mut progress = Progress::new(frames, "frames");
    let mut timings = Vec::new();
    let mut unseen = scene.masks_off_the_image();
    let at_once = if colours.is_some() { 1 } else { simulator.most_shots() };
    for group in groups(&moments, scene, at_once) {
        reload(simulator, library);
        scene.set_time(moments[group.start].seconds);
        let mut shots = Vec::new();
        for index in group.clone() {
            scene.world_from_probe = moments[index].pose.unwrap_or(scene.world_from_probe);
            if index > 0 && !unseen.is_empty() {
                let still = scene.masks_off_the_image();
                unseen.retain(|mask| still.contains(mask));
            }
            shots.push(Shot::of(scene, index as u32));
        }
        simulator.frames(scene, &shots).into_diagnostic()?;
        for (place, (index, shot)) in group.zip(&shots).enumerate() {
            simulator.choose(place);
            scene.world_from_probe = shot.world_from_probe;
            if let Some(labels) = &labels {
                labels.add(index as u32, simulator, scene)?;
            }
            let last = index + 1 == moments.len();
            let packet = args.packet.as_deref().filter(|_| last);
            let seconds = moments[index].seconds;
            let coloured_by = colours.map(|colours| Coloured { colours, seconds, packet });
            film.add(index as u32, simulator, scene, coloured_by)?;
            progress.done(index as u32 + 1);
        }
        let took = simulator.wait().into_diagnostic()?.pop().unwrap_or_default();
        timings.extend(vec![took.of_each(shots.len()); shots.len()]);
    }
    for mask in unseen {
        output::note(format!("warning: {}", common::unseen(scene, mask)));
    }
    progress.finish();
    let sidecar = film.finish(output, args.json.as_deref())?;
    if let Some(labels) = labels {
        labels.finish();
    }
    Ok((timings, sidecar))
}

fn default_output(scene: &Path) -> PathBuf {
    PathBuf::from(scene.file_stem().unwrap_or_default()).with_extension("png")
}

/// Statistics per stage, in frame order; a stage that ran more than once per frame counts in total.
fn stage_statistics(timings: &[FrameTimings]) -> Map<String, Value> {
    let mut stages: Vec<(String, Vec<f64>)> = Vec::new();
    for (index, frame) in timings.iter().enumerate() {
        for (name, ms) in &frame.passes {
            let at = stages.iter().position(|(n, _)| n == name).unwrap_or_else(|| {
                stages.push((name.clone(), Vec::new()));
                stages.len() - 1
            });
            stages[at].1.resize(index + 1, 0.0);
            stages[at].1[index] += ms;
        }
    }
    stages.into_iter().map(|(name, ms)| (name, json!(Statistics::of(ms)))).collect()
}
