//! An acquired volume that changes with time: the volume shown at each time, equality to the last bit with it
//! alone, and refusals.

use std::path::Path;
use std::sync::Arc;

use glam::{DAffine3, DVec3};
use insonify::gpu::{Device, test_device};
use insonify::scene::animation::{Clock, Interpolation, Loop, Sequence};
use insonify::scene::{Acquired, Scene, SceneError};
use insonify::sim::shaders::Library;
use insonify::sim::{Simulator, Tracer, dump};
use insonify::volume::Voxels;

mod words;

/// A ball in front of a flat probe, simulated in a volume that reaches all around it.
const SCENE: &str = r#"
background = "liver"
[probe]
preset = "linear"
width = "24 mm"
scanlines = 24
elevation_layers = 1
samples = 240
depth = "24 mm"
[simulation]
paths = 1
[imaging]
image_height = 96
[[mesh]]
name = "ball"
tissue = "kidney"
shape = { sphere = { radius = 4, subdivisions = 3 } }
translate = [0, 0, 11]
[fusion]
mask = ["ball"]
blur = 5
[volume]
"#;

const SIZE: [usize; 3] = [7, 5, 6];

/// Header of volumes of 16 bits: `times` of them 0.25 s apart, or a single one.
fn header(times: usize) -> String {
    let (axes, count, pace) = match times {
        1 => (3, String::new(), ""),
        _ => (4, format!(" {times}"), " 0.25"),
    };
    format!(
        "NDims = {axes}\nDimSize = 7 5 6{count}\nElementSpacing = 6 6 6{pace}\n\
         Offset = -18 -12 -3{}\nElementType = MET_SHORT\nElementDataFile = LOCAL\n",
        if times == 1 { "" } else { " 0" }
    )
}

/// Values of a time without any pattern, over a range of its own.
fn values(time: usize) -> Vec<i16> {
    let count: usize = SIZE.iter().product();
    let hash = |i: usize| (i + 977 * time).wrapping_mul(2_654_435_761) >> 7;
    (0..count).map(|i| (hash(i) % (500 + 300 * time)) as i16 - 200).collect()
}

fn bytes(values: &[i16]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// A folder with `all.mha`, which holds four times, and each of them alone in `tK.mha`.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, times: &[usize]| {
        let data: Vec<_> = times.iter().flat_map(|&t| bytes(&values(t))).collect();
        let file = [header(times.len()).into_bytes(), data].concat();
        std::fs::write(folder.path().join(name), file).expect("written");
    };
    write("all.mha", &[0, 1, 2, 3]);
    for time in 0..4 {
        write(&format!("t{time}.mha"), &[time]);
    }
    folder
}

fn load(folder: &Path, volume: &str) -> Result<Scene, SceneError> {
    let file = folder.join("scene.toml");
    std::fs::write(&file, format!("{SCENE}{volume}")).expect("written");
    Scene::load(&file, &[]).map(|(scene, _)| scene)
}

const ALL: &str = "file = \"all.mha\"\n";
const FILES: &str = "file = [\"t0.mha\", \"t1.mha\", \"t2.mha\", \"t3.mha\"]\n";

fn simulator(device: &Arc<Device>, scene: &Scene) -> Simulator {
    Simulator::new(device, &Library::embedded(), scene, Tracer::Bvh).expect("a simulator")
}

fn shoot(simulator: &mut Simulator, scene: &Scene) -> Vec<u8> {
    simulator.frame(scene, 0).expect("a frame");
    simulator.pixels().expect("pixels").2
}

/// Index of the volume at a time by the rule: each for 1/rate seconds, one after another.
fn expected(time: f64, rate: f64, count: usize, mode: Loop, late: f64) -> usize {
    let steps = (time * rate + 1e-6 + late).floor() as i64;
    let count = count as i64;
    (match mode {
        Loop::Repeat => steps.rem_euclid(count),
        Loop::Once => steps.clamp(0, count - 1),
        Loop::PingPong => {
            let turn = steps.rem_euclid(2 * count - 2);
            turn.min(2 * count - 2 - turn)
        }
    }) as usize
}

#[test]
fn each_volume_has_its_time() {
    let folder = folder();
    for (keys, rate, mode, start) in [
        // 0.25 s as in the file.
        (ALL.to_owned(), 4.0, Loop::Repeat, 0.0),
        (format!("{ALL}loop = \"once\"\n"), 4.0, Loop::Once, 0.0),
        (format!("{ALL}rate = \"20 Hz\"\n"), 20.0, Loop::Repeat, 0.0),
        (format!("{FILES}rate = 20\n"), 20.0, Loop::Repeat, 0.0),
        (format!("{FILES}period = \"200 ms\"\n"), 20.0, Loop::Repeat, 0.0),
        (format!("{FILES}period = 0.7\n"), 4.0 / 0.7, Loop::Repeat, 0.0),
        (format!("{FILES}rate = 7\nloop = \"once\"\n"), 7.0, Loop::Once, 0.0),
        (format!("{ALL}loop = \"ping-pong\"\n"), 4.0, Loop::PingPong, 0.0),
        (format!("{FILES}rate = 7\nloop = \"ping-pong\"\n"), 7.0, Loop::PingPong, 0.0),
        (format!("{ALL}phase = 0.5\n"), 4.0, Loop::Repeat, 0.5),
    ] {
        let mut scene = load(folder.path(), &keys).expect("sound");
        assert!(scene.is_animated());
        let mut planted = 0;
        // To and fro nothing comes before the first, and negative times are tested with the clock.
        let first = if mode == Loop::Repeat { -300 } else { 0 };
        for i in first..900 {
            // Instants at which the next volume is due, and between them.
            let time = f64::from(i) / rate / 7.0;
            scene.set_time(time);
            let acquired = scene.volume.as_ref().expect("a volume");
            let at = time + start * 4.0 / rate;
            let found = acquired.now;
            assert_eq!(found, expected(at, rate, 4, mode, 0.0), "{keys}{time} s");
            planted += usize::from(found != expected(at, rate, 4, mode, 1.0));
            let Voxels::I16(shown) = acquired.voxels() else { panic!("of 16 bits") };
            assert_eq!(*shown, values(found));
        }
        // One volume late is noticed.
        let least = if mode == Loop::Once { 20 } else { 500 };
        assert!(planted > least, "{keys}: {planted}");
    }
    let mut alone = load(folder.path(), "file = \"t1.mha\"\n").expect("sound");
    assert!(!alone.is_animated());
    alone.set_time(9.0);
    assert_eq!(alone.volume.expect("a volume").now, 0);
}

/// Levels common to all volumes, as a series has them by default.
fn shared(folder: &Path) -> String {
    let acquired = load(folder, ALL).expect("sound").volume.expect("a volume");
    let all: Vec<_> = (0..4).flat_map(values).collect();
    let (black, white) = (all.iter().min(), all.iter().max());
    assert_eq!(acquired.black, f64::from(*black.expect("values")));
    assert_eq!(acquired.white, f64::from(*white.expect("values")));
    format!("black = {}\nwhite = {}\n", acquired.black, acquired.white)
}

#[test]
fn a_frame_is_that_of_its_volume_alone_to_the_last_bit() {
    let device = test_device();
    let folder = folder();
    let levels = shared(folder.path());
    let alone: Vec<_> = (0..4)
        .map(|k| {
            let text = format!("file = \"t{k}.mha\"\n{levels}");
            let scene = load(folder.path(), &text).expect("sound");
            shoot(&mut simulator(&device, &scene), &scene)
        })
        .collect();
    for keys in [ALL.to_owned(), format!("{FILES}rate = 4\n")] {
        let mut scene = load(folder.path(), &keys).expect("sound");
        // It begins at the scene's time, and goes to and fro with the scene.
        scene.set_time(0.5);
        let mut simulator = simulator(&device, &scene);
        for (time, k) in [(0.5, 2), (0.0, 0), (0.74, 2), (0.75, 3), (1.0, 0), (-0.1, 3)] {
            scene.set_time(time);
            let found = shoot(&mut simulator, &scene);
            assert!(found == alone[k], "{keys}{time} s is not volume {k}");
            let other = (k + 1) % 4;
            assert!(found != alone[other], "{k} and {other} look alike");
        }
        // The input of a kernel run alone, and of its twin, is the frame's.
        let dumped = |simulator: &mut Simulator, scene: &Scene| {
            let to = tempfile::tempdir().expect("a folder");
            simulator.frame(scene, 0).expect("a frame");
            dump::frame(simulator, scene, to.path()).expect("dumped");
            let file = to.path().join(dump::KERNELS).join("acquired.npy");
            std::fs::read(file).expect("readable")
        };
        scene.set_time(0.25);
        let here = dumped(&mut simulator, &scene);
        let text = format!("file = \"t1.mha\"\n{levels}");
        let still = load(folder.path(), &text).expect("sound");
        let mut other = self::simulator(&device, &still);
        assert!(here == dumped(&mut other, &still), "of another time");
        scene.set_time(0.0);
        assert!(here != dumped(&mut simulator, &scene), "the same at all times");
    }
    // Levels of its own would make a volume flicker: 1 uses a third of what 3 does.
    let own = load(folder.path(), "file = \"t0.mha\"\n").expect("sound");
    assert!(shoot(&mut simulator(&device, &own), &own) != alone[0]);
    assert_eq!(device.validation_messages(), Vec::<String>::new());
}

/// Black and white in turns, in front of the same simulation.
#[test]
fn the_background_switches_at_its_time_and_back() {
    let device = test_device();
    let folder = tempfile::tempdir().expect("a folder");
    let count: usize = SIZE.iter().product();
    let mut file = header(2).replace("MET_SHORT", "MET_UCHAR").into_bytes();
    file.extend(vec![0; count]);
    file.extend(vec![255; count]);
    std::fs::write(folder.path().join("two.mha"), file).expect("written");
    let mut scene = load(folder.path(), "file = \"two.mha\"\nrate = \"2 Hz\"\n").expect("sound");
    let mut simulator = simulator(&device, &scene);
    let bytes = simulator.memory().volume;
    assert!(bytes >= 2 * count as u64, "{bytes}");
    let mut balls = Vec::new();
    for (time, level) in
        [(0.0, 0), (0.49, 0), (0.5, 255), (0.99, 255), (1.0, 0), (1.5, 255), (0.2, 0)]
    {
        scene.set_time(time);
        simulator.frame(&scene, 0).expect("a frame");
        let (width, height, pixels) = simulator.pixels().expect("pixels");
        let at = |x: u32, y: u32| pixels[4 * (y * width + x) as usize];
        let corners = [(3, 3), (width - 4, 3), (3, height - 4), (width - 4, height - 4)];
        assert_eq!(corners.map(|(x, y)| at(x, y)), [level; 4], "{time} s");
        // The ball covers 16 pixels on either side of its middle, which no change reaches.
        let (x, y) = (width / 2, height * 11 / 24);
        let ball: Vec<_> =
            (x - 8..x + 8).flat_map(|x| (y - 8..y + 8).map(move |y| (x, y))).collect();
        balls.push(ball.iter().map(|&(x, y)| at(x, y)).collect::<Vec<_>>());
    }
    assert!(balls.iter().all(|ball| *ball == balls[0]));
    assert!(balls[0].iter().any(|&v| v != balls[0][0]), "nothing is simulated");
    assert_eq!(device.validation_messages(), Vec::<String>::new());
}

/// Beyond the device's limits all volumes are averaged over the same blocks, and the shown one is its own
/// average.
#[test]
fn volumes_beyond_the_devices_limit_are_averaged_alike() {
    let device = test_device();
    let folder = folder();
    let mut scene = load(folder.path(), ALL).expect("sound");
    let long = device.limits().max_image_3d as usize + 1;
    let volume = |time: usize| {
        let value = |i: usize| ((i * (3 + time)) % 251) as u8;
        Arc::new(Voxels::U8((0..4 * long).map(value).collect()))
    };
    let place = DAffine3::from_translation(DVec3::new(-14.0, -5.0, -1.0))
        * DAffine3::from_scale(DVec3::new(28.0 / long as f64, 10.0, 30.0));
    let clock = Clock { period: 3.0, ..Clock::default() };
    let series = Acquired {
        size: [long, 2, 2],
        volumes: (0..3).map(volume).collect(),
        now: 0,
        sequence: Some(Sequence::even(clock, 3, Interpolation::Linear)),
        world_from_voxel: place,
        world_from_lps: DAffine3::IDENTITY,
        black: 0.0,
        white: 255.0,
    };
    scene.volume = Some(series.clone());
    let mut all = simulator(&device, &scene);
    let warning = all.warning().expect("a warning").to_owned();
    assert!(warning.contains("at 3 times is larger"), "{warning}");
    for time in [2, 0, 1] {
        scene.set_time(time as f64);
        let found = shoot(&mut all, &scene);
        let mut still = scene.clone();
        still.volume = Some(Acquired {
            volumes: vec![volume(time)],
            now: 0,
            sequence: None,
            ..series.clone()
        });
        let alone = shoot(&mut simulator(&device, &still), &still);
        assert!(found == alone, "time {time}");
    }
    assert_eq!(device.validation_messages(), Vec::<String>::new());
}
