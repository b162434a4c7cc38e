//! Tracked sweeps of known geometry: places of points in the volume, preservation of speckle, poses
//! read back, and the command.

use std::sync::LazyLock;

use glam::{DAffine3, DVec3};
use insonify::acquire::{self, Station, Sweep, acquire, stations_of};
use insonify::gpu::test_device;
use insonify::scene::Scene;
use insonify::scene::file::load_trajectory;
use insonify::sim::shaders::Library;
use insonify::sim::{Simulator, Tracer};
use insonify::volume::{Fan, Sequence, Settings, Transforms, Volume, reconstruct};

use crate::common::program::insonify;

/// Points in the world, mm: separated in every direction, none in the middle.
const POINTS: [[f64; 3]; 4] =
    [[-9.0, -3.2, 14.3], [6.4, 2.1, 17.6], [-3.7, 4.4, 26.2], [10.1, -1.3, 24.9]];

/// A scene of the points in fluid without scatterers, at the machine's assumed speed of sound.
fn points(probe: &str) -> Scene {
    let wires = POINTS.map(|p| format!("[[wire]]\nfrom = {p:?}\namplitude = \"-20 dB\"\n"));
    let text = format!(
        "background = \"fluid\"\n[probe]\n{probe}\nsamples = 640\nspeed = \"1540 m/s\"\n\
         elevation_focus = \"20 mm\"\nslice_thickness = \"4 mm\"\n[imaging]\nnoise = -inf\n\
         image_height = 240\ngain = 0\n[tissues.fluid]\nbased_on = \"water\"\nspeed = \"1540 m/s\"\n{}",
        wires.concat()
    );
    scene(&text)
}

const LINEAR: &str = "preset = \"linear\"\ndepth = \"36 mm\"\nscanlines = 128";
const CONVEX: &str = "kind = \"convex\"\nradius = 20\nfield_of_view = \"70 deg\"\ndepth = \"36 mm\"\n\
     scanlines = 128\nfocus = 20\nfrequency = 6";

fn scene(text: &str) -> Scene {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("scene.toml");
    std::fs::write(&path, text).expect("written");
    Scene::load(&path, &[]).expect("a scene").0
}

fn take(scene: &mut Scene, sweep: Sweep, frames: u32) -> Sequence {
    let stations = sweep.stations(scene, frames, 20.0);
    follow(scene, &stations)
}

fn follow(scene: &mut Scene, stations: &[Station]) -> Sequence {
    let device = test_device();
    let library = Library::embedded();
    let simulator = Simulator::new(&device, &library, scene, Tracer::Bvh);
    let made = acquire(&mut simulator.expect("a simulator"), scene, stations, None, |_| {});
    assert_eq!(device.validation_messages(), Vec::<String>::new());
    made.expect("acquired")
}

/// Centre of the grey within 3 mm of a point of the world, mm: weights are the squares of grey levels
/// above the half of the largest there.
fn centre(volume: &Volume, point: DVec3) -> DVec3 {
    let near = |wanted: &mut dyn FnMut(DVec3, f64)| {
        let [x, y, z] = volume.size;
        for (k, j, i) in
            (0..z).flat_map(|k| (0..y).flat_map(move |j| (0..x).map(move |i| (k, j, i))))
        {
            let index = DVec3::new(i as f64, j as f64, k as f64);
            let at = volume.world_from_voxel.transform_point3(index);
            if at.distance(point) < 3.0 {
                wanted(at, volume.value([i, j, k]));
            }
        }
    };
    let mut largest = 0.0f64;
    near(&mut |_, value| largest = largest.max(value));
    let (mut sum, mut weights) = (DVec3::ZERO, 0.0);
    near(&mut |at, value| {
        let weight = (value - largest / 2.0).max(0.0).powi(2);
        sum += weight * at;
        weights += weight;
    });
    sum / weights
}

/// Largest distance of a point's image from the point along an axis of the volume, in voxels.
fn farthest(volume: &Volume) -> f64 {
    let voxel_from_world = volume.world_from_voxel.inverse();
    let away = POINTS.map(|p| {
        let point = DVec3::from(p);
        let off = voxel_from_world.transform_vector3(centre(volume, point) - point);
        off.abs().max_element()
    });
    away.into_iter().fold(0.0, f64::max)
}

/// Asserts that a point lies within a voxel of its place: half a voxel by rounding to the nearest, and the
/// error of its centre across the slice by the frames' distance.
fn assert_in_place(sequence: &Sequence, spacing: DVec3) {
    let made = acquire::volume(sequence, Settings::new(spacing)).expect("a volume");
    let off = farthest(&made.volume);
    println!("points within {off:.2} voxels");
    assert!(off < 1.0, "{off} voxels");
    // Planted: a tracker that is 1.2 voxels off, and pixels counted from their corners 2 voxels away.
    for (name, shift) in [
        ("ProbeToTracker", DVec3::X * 1.2 * spacing.x),
        ("ProbeToTracker", DVec3::Y * 1.2 * spacing.y),
        ("ImageToProbe", DVec3::Z * 2.0 * spacing.z),
    ] {
        let mut planted = sequence.clone();
        for frame in &mut planted.frames {
            let pose = frame.poses.get_mut(name).expect("a pose");
            pose.transform.translation += shift;
        }
        let poses = Transforms::default().of_frames(&planted, "Image", "Tracker");
        let mut settings = Settings::new(spacing);
        settings.fan = Fan::of(&planted).expect("a fan");
        let made = reconstruct(&planted, &poses.expect("joined"), &settings).expect("a volume");
        let off = farthest(&made.volume);
        assert!(off >= 1.0, "{name} by {shift}: {off} voxels");
    }
}

static SWEPT: LazyLock<Sequence> =
    LazyLock::new(|| take(&mut points(LINEAR), Sweep::Linear(16.0), 33));

#[test]
fn points_lie_in_place_after_a_linear_sweep() {
    assert_in_place(&SWEPT, DVec3::new(0.4, 0.5, 0.3));
}

#[test]
fn points_lie_in_place_after_a_tilted_sweep() {
    let mut scene = points(CONVEX);
    let sequence = take(&mut scene, Sweep::Tilt(40f64.to_radians()), 61);
    assert_in_place(&sequence, DVec3::splat(0.5));
}

#[test]
fn points_lie_in_place_after_a_turn() {
    let mut scene = points(LINEAR);
    let sequence = take(&mut scene, Sweep::Rotate(std::f64::consts::PI), 91);
    assert_in_place(&sequence, DVec3::splat(0.6));
}

/// Every grey level is kept if voxels coincide with pixels.
#[test]
fn speckle_is_kept_to_the_last_grey_level() {
    let mut scene = scene(
        "background = \"liver\"\n[probe]\npreset = \"linear\"\nscanlines = 64\nsamples = 400\n\
         elevation_layers = 2\n[imaging]\nimage_height = 100\n\
         [probe.pose]\nposition = [11, -7, 3]\ndirection = [0.3, -0.2, 0.9]\nlateral = [0.8, 0.5, 0]\n",
    );
    let world_from_probe = scene.world_from_probe;
    let sequence = take(&mut scene, Sweep::Linear(6.0), 5);
    let [width, height] = sequence.size;
    let pitch = 0.4;
    let spacing = DVec3::new(pitch, 1.5, pitch);
    let made = acquire::volume(&sequence, Settings::new(spacing)).expect("a volume");
    assert_eq!(made.volume.size, [width, 5, height]);
    assert_eq!((made.frames, made.filled), (5, 0));
    let equal = |volume: &Volume| {
        let pixel = |x: usize, f: usize, y: usize| {
            let at = sequence.first_pixel(f) + x + width * y;
            sequence.pixels.get(at) == volume.value([x, f, y])
        };
        let all =
            (0..5).flat_map(|f| (0..height).flat_map(move |y| (0..width).map(move |x| (x, f, y))));
        all.filter(|&(x, f, y)| pixel(x, f, y)).count() as f64 / (5 * width * height) as f64
    };
    assert_eq!(equal(&made.volume), 1.0);
    // The volume's axes are the probe's, its first voxel the first pixel of the first frame.
    let first = DVec3::new(-19.0 + pitch / 2.0, -3.0, pitch / 2.0);
    let expected =
        world_from_probe * DAffine3::from_translation(first) * DAffine3::from_scale(spacing);
    // Pitch and corner of the image are in single precision on the device.
    let off = made.volume.world_from_voxel.matrix3 - expected.matrix3;
    assert!(off.to_cols_array().iter().all(|v| v.abs() < 1e-6), "{off}");
    let off = made.volume.world_from_voxel.translation - expected.translation;
    assert!(off.abs().max_element() < 1e-5, "{off}");
    let range = sequence.pixels.statistics();
    assert!(range.max - range.min > 100.0 && range.mean > 30.0, "speckle: {range:?}");
    // Planted: a row off.
    let mut settings = Settings::new(spacing);
    settings.lattice = Some((first + pitch * DVec3::Z, made.volume.size));
    let planted = acquire::volume(&sequence, settings).expect("a volume");
    let share = equal(&planted.volume);
    assert!(share < 0.2, "{share} of the voxels");
}

/// Black corners beside a fan do not darken what another frame shows there in the same plane.
#[test]
fn a_fan_leaves_the_corners_out() {
    let mut scene = scene(&format!(
        "background = \"liver\"\n[probe]\n{CONVEX}\nsamples = 400\nelevation_layers = 2\n\
         [imaging]\nimage_height = 120\n"
    ));
    let sequence = follow(
        &mut scene,
        &[0.0, 24.0].map(|x| Station {
            time: x,
            world_from_probe: DAffine3::from_translation(DVec3::X * x),
        }),
    );
    let mean = |fan: Option<Fan>| {
        let poses = Transforms::default().of_frames(&sequence, "Image", "Reference");
        let mut settings = Settings::new(DVec3::splat(0.6));
        settings.fan = fan;
        let made = reconstruct(&sequence, &poses.expect("joined"), &settings).expect("a volume");
        let voxel_from_world = made.volume.world_from_voxel.inverse();
        // In front of the first probe, beside the second.
        let values = (0..60).map(|i| {
            let point = DVec3::new(-3.0 + 0.1 * f64::from(i), 0.0, 3.0);
            let index = voxel_from_world.transform_point3(point).round();
            made.volume.value(index.to_array().map(|v| v as usize))
        });
        values.sum::<f64>() / 60.0
    };
    let fan = Fan::of(&sequence).expect("a fan");
    assert!(fan.is_some());
    let (with, without) = (mean(fan), mean(None));
    println!("{with} with, {without} without the fan");
    assert!(with > 1.5 * without, "{with} with, {without} without the fan");
}

#[test]
fn a_sequence_is_read_back_with_poses_and_fan() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("sweep.igs.mha");
    let sequence = take(&mut points(CONVEX), Sweep::Tilt(0.7), 3);
    sequence.write(&path).expect("written");
    let (read, _) = Sequence::load(&path).expect("readable");
    assert_eq!(read, sequence);
    let (fan, written) = (Fan::of(&read).expect("a fan"), Fan::of(&sequence).expect("a fan"));
    assert_eq!(fan, written);
    // Closed form: the apex lies a radius above the face, in the middle of the image.
    let fan = fan.expect("a fan");
    assert!((fan.origin[0] - (read.size[0] as f64 - 1.0) / 2.0).abs() < 1e-3, "{fan:?}");
    assert!(
        (fan.angles[1] - 35.0).abs() < 1e-9
            && (fan.radii[1] / fan.radii[0] - 56.0 / 20.0).abs() < 1e-6
    );
    for (index, frame) in read.frames.iter().enumerate() {
        let angle = 0.7 * (index as f64 / 2.0 - 0.5);
        let expected = DAffine3::from_rotation_x(angle);
        assert_eq!(frame.poses["ProbeToTracker"].transform, expected);
        assert_eq!(frame.timestamp, Some(index as f64 / 20.0));
        assert!(frame.has_image() && frame.poses.values().all(|p| p.is_ok()));
    }
    let mut planted = sequence.clone();
    planted.fields.retain(|(key, _)| key != "FanAnglesDeg");
    let told = Fan::of(&planted).expect_err("an entry is missing").to_string();
    assert!(told.contains("`FanAnglesDeg`"), "{told}");
}

#[test]
fn a_file_of_poses_is_followed() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("way.csv");
    std::fs::write(&path, "time_s,x_mm,y_mm,z_mm\n1,0,0,0\n3,4,0,2\n4,4,8,2\n").expect("written");
    let mut scene = points(LINEAR);
    scene.world_from_probe = DAffine3::from_rotation_z(0.5);
    let track = load_trajectory(&path).expect("a trajectory");
    let at = |frames| {
        let stations = stations_of(&track, &scene, frames);
        stations
            .iter()
            .map(|s| (s.time, s.world_from_probe.translation.to_array()))
            .collect::<Vec<_>>()
    };
    let rows = [(1.0, [0.0, 0.0, 0.0]), (3.0, [4.0, 0.0, 2.0]), (4.0, [4.0, 8.0, 2.0])];
    assert_eq!(at(None), rows);
    assert_eq!(at(Some(4))[1], (2.0, [2.0, 0.0, 1.0]));
    // Quantities that the file lacks are the scene's.
    let turned = stations_of(&track, &scene, None)[2].world_from_probe.matrix3;
    let off = turned - scene.world_from_probe.matrix3;
    assert!(off.to_cols_array().iter().all(|v| v.abs() < 1e-12), "{off}");
    let error = load_trajectory(&folder.path().join("none.csv")).expect_err("no file");
    assert!(error.to_string().contains("none.csv"), "{error}");
}

/// More frames than memory holds are counted before they are made: 10000 a second over thirty years.
#[test]
fn a_file_of_poses_that_makes_too_many_frames_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = "[probe]\nscanlines = 2\nsamples = 16\nelevation_layers = 1\n[imaging]\nimage_height = 16\n";
    std::fs::write(folder.path().join("a.toml"), text).expect("written");
    let way = "time_s,x_mm,y_mm,z_mm\n0,0,0,0\n1e9,5,0,0\n";
    std::fs::write(folder.path().join("way.csv"), way).expect("written");
    let render = ["render", "a.toml", "--trajectory", "way.csv", "--fps", "10000", "-o", "a.gif"];
    let (fine, told) = insonify(folder.path(), &render);
    assert!(!fine && told.contains("makes 10000000000001 frames"), "{told}");
    assert!(told.contains("a lower --fps"), "{told}");
}

#[test]
fn the_command_writes_a_sequence_and_the_volume_that_it_makes() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = |args: &[&str]| insonify(folder.path(), args);
    let text = "background = \"liver\"\n[probe]\npreset = \"linear\"\nscanlines = 32\nsamples = 200\n\
        elevation_layers = 1\n[imaging]\nimage_height = 64\n";
    std::fs::write(folder.path().join("a.toml"), text).expect("written");
    let (fine, text) = run(&[
        "acquire",
        "a.toml",
        "--sweep",
        "linear:6mm",
        "--frames",
        "4",
        "-o",
        "a.igs.mha",
        "--volume",
        "a.mha",
        "--spacing",
        "1,2,1",
    ]);
    assert!(fine && text.contains("4 tracked frames of"), "{text}");
    let (fine, text) = run(&["check", "a.igs.mha"]);
    assert!(fine && text.contains("pose ProbeToTracker: 4, 4 of them OK"), "{text}");
    assert!(!text.contains("keys are not used"), "{text}");
    // The same volume without any geometry arguments: the probe's axes are the world's here.
    let (fine, text) = run(&["reconstruct", "a.igs.mha", "--spacing", "1,2,1", "-o", "b.mha"]);
    assert!(fine && text.contains("4 of 4 frames"), "{text}");
    let load = |name: &str| Volume::load(&folder.path().join(name)).expect("a volume").0;
    let (a, b) = (load("a.mha"), load("b.mha"));
    assert_eq!((a.size, &a.voxels), (b.size, &b.voxels));
    let off = a.world_from_voxel.translation - b.world_from_voxel.translation;
    assert!(off.abs().max_element() < 1e-9, "{off}");

    for (args, cause) in [
        (&["--sweep", "linear:6mm"][..], "nothing would be written"),
        (&["--sweep", "tilt:6", "-o", "c.mha"], "has no unit"),
        (&["--sweep", "linear:6mm", "-o", "c.nhdr"], "end the name in .mha or .nrrd"),
        (&["--sweep", "linear:6mm", "-o", "a.toml/c.mha"], "folder cannot be made"),
        (&["--sweep", "none.csv", "-o", "c.mha"], "check the path"),
        (&["--sweep", "linear:6mm", "-o", "c.mha", "--spacing", "1"], "--volume"),
    ] {
        let (fine, text) = run(&[&["acquire", "a.toml"], args].concat());
        assert!(!fine && text.contains(cause), "{cause}: {text}");
    }
}

/// Volumes over a period: each equals the one that the same sweep makes of the anatomy at its time.
#[test]
fn the_command_writes_volumes_over_time() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = |args: &[&str]| insonify(folder.path(), args);
    let text = "background = \"liver\"\n[probe]\npreset = \"linear\"\nscanlines = 32\nsamples = 200\n\
        elevation_layers = 1\n[imaging]\nimage_height = 64\n[[transform]]\nname = \"to and fro\"\n\
        motion = { kind = \"sine\", period = 0.8, translate = [3, 0, 0] }\n[[mesh]]\nname = \"cyst\"\n\
        parent = \"to and fro\"\nshape = { sphere = { radius = 6 } }\ntissue = \"water\"\n\
        translate = [0, 0, 18]\n";
    std::fs::write(folder.path().join("a.toml"), text).expect("written");
    let sweep =
        ["acquire", "a.toml", "--sweep", "linear:6mm", "--frames", "4", "--spacing", "1,2,1"];
    let acquired = |more: &[&str]| {
        let (fine, text) = run(&[&sweep, more].concat());
        assert!(fine, "{text}");
        text
    };
    let times = ["--volumes", "4", "--period", "0.8s", "--time", "0.05"];
    let text = acquired(&[&times[..], &["--volume", "all.mha"]].concat());
    assert!(text.contains("4 volumes over time, one every 0.2 s"), "{text}");
    let load = |name: &str| Volume::load(&folder.path().join(name)).expect("a volume").0;
    let all = load("all.mha");
    assert_eq!(all.interval, Some(0.2));
    let all: Vec<_> = all.volumes().cloned().collect();
    for (k, time) in ["0.05", "0.25", "0.45", "0.65"].into_iter().enumerate() {
        acquired(&["--volume", "one.mha", "--time", time]);
        assert!(load("one.mha").voxels == all[k], "{time} s");
        assert!(all[(k + 1) % 4] != all[k], "nothing moved after {time} s");
    }
    for (args, cause) in [
        (&["--volumes", "4", "--volume", "b.mha"][..], "--period"),
        (&["--period", "1", "--volume", "b.mha"], "--volumes"),
        (&["--volumes", "4", "--period", "1", "-o", "b.mha"], "--volume"),
        (&["--volumes", "1", "--period", "1", "--volume", "b.mha"], "1 is not in 2..=1000"),
        (&["--volumes", "4", "--period", "0", "--volume", "b.mha"], "it must lie between"),
        (
            &["--volumes", "4", "--period", "1", "--volume", "b.mha", "--moving"],
            "cannot be used with",
        ),
    ] {
        let (fine, text) = run(&[&sweep, args].concat());
        assert!(!fine && text.contains(cause), "{cause}: {text}");
    }
}
