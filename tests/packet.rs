//! Packets of pulses: what does not flow is the image's, and what flows is that of images at the pulses' times.

use std::f64::consts::PI;

use insonify::doppler::{make_packet, nyquist};
use insonify::gpu::test_device;
use insonify::scene::flow::{CentreLine, Course, Flow, FlowShape, Vessel};
use insonify::scene::{Scene, shapes};
use insonify::sim::shaders::Library;
use insonify::sim::{ColourMode, Packet, Simulator, Tracer};

use glam::{DAffine3, DVec3};

use crate::common::tracers::tracers;
use crate::physics::scenes::{add_body, linear, tissue};

const LINES: u32 = 40;

/// A vessel across the scanlines of a small image, in tissue that is heard as well.
fn scene(paths: u32) -> Scene {
    let mut scene = linear(LINES, 20.0, tissue(1.54, 1.63, 0.3));
    scene.probe.samples = 600;
    scene.probe.depth = 50.0;
    scene.simulation.paths = paths;
    let at = DAffine3::from_translation(DVec3::Z * 25.0) * DAffine3::from_rotation_y(1.2);
    add_body(&mut scene, shapes::cylinder(4.0, 80.0, 64), tissue(1.56, 1.65, 0.2), at);
    let ends = [-40.0, 40.0].map(|z| DVec3::Z * z).to_vec();
    let line = CentreLine::new(ends, vec![4.0; 2]).expect("a line");
    let shape = FlowShape::Tube(Vessel::tube(line, 2.0));
    scene.flows = vec![Flow::new("blood".into(), 0, shape, 300.0, Course::Steady)];
    scene
}

fn simulator(scene: &Scene, tracer: Tracer) -> Simulator {
    Simulator::new(&test_device(), &Library::embedded(), scene, tracer).expect("a simulator")
}

/// Baseband of the image of a scene, of these scanlines and samples.
fn image(simulator: &mut Simulator, scene: &Scene, packet: &Packet) -> Vec<[f32; 2]> {
    simulator.frame(scene, 3).expect("a frame");
    let iq = simulator.iq().expect("samples");
    let samples = scene.probe.samples;
    let at = |l: u32, k: u32| {
        let at = 2 * (l * samples + k) as usize;
        [iq[at], iq[at + 1]]
    };
    let lines = packet.lines.clone();
    lines.flat_map(|l| packet.samples.clone().map(move |k| (l, k))).map(|(l, k)| at(l, k)).collect()
}

/// Difference over the second, root mean squares.
fn difference(a: &[[f32; 2]], b: &[[f32; 2]]) -> f64 {
    let numbers =
        |v: &[[f32; 2]]| -> Vec<f64> { v.as_flattened().iter().map(|&x| f64::from(x)).collect() };
    let (a, b) = (numbers(a), numbers(b));
    let off: f64 = a.iter().zip(&b).map(|(a, b)| (a - b).powi(2)).sum();
    (off / b.iter().map(|x| x * x).sum::<f64>()).sqrt()
}

/// At time 0 one generation is silent: a pulse there is the image to the bit, others are images at their times, but for what
/// the second generation has of these.
#[test]
fn pulses_are_the_images_of_their_times() {
    for tracer in tracers(&test_device()) {
        // In one batch, and with segments for each path.
        for paths in [1, 3] {
            let mut scene = scene(paths);
            let times = vec![0.0, 4e-4, -3e-4];
            let packet = Packet { times, lines: 7..31, samples: 100..480, renewed: false };
            let mut simulator = simulator(&scene, tracer);
            let pulses = simulator.packet(&scene, 3, &packet).expect("a packet");
            let each = pulses.len() / 3;
            for (pulse, time) in pulses.chunks(each).zip(&packet.times) {
                scene.set_time(*time);
                let still = image(&mut simulator, &scene, &packet);
                let off = difference(pulse, &still);
                // The second generation's weight is the sine of that.
                let most = 1.1 * (std::f64::consts::PI * time.abs() / 0.02).sin();
                assert!(off <= most, "{tracer}, {paths} paths, at {time} s: {off}");
                scene.set_time(0.0);
                if *time != 0.0 {
                    let other = difference(pulse, &image(&mut simulator, &scene, &packet));
                    assert!(other > 5.0 * most, "blood has moved by then: {other}");
                }
            }
        }
    }
    assert_eq!(test_device().validation_messages(), [""; 0]);
}

/// Over several lives of the scatterers, and of few samples far from the face. Images afterwards show the scene's time.
#[test]
fn renewed_pulses_are_the_images_of_their_times_to_the_bit() {
    for tracer in tracers(&test_device()) {
        for paths in [1, 3] {
            let mut scene = scene(paths);
            let packet = Packet {
                times: vec![0.0, 0.013, 0.4, -0.021],
                lines: 12..14,
                samples: 330..360,
                renewed: true,
            };
            let mut simulator = simulator(&scene, tracer);
            let pulses = simulator.packet(&scene, 3, &packet).expect("a packet");
            let each = pulses.len() / packet.times.len();
            for (pulse, time) in pulses.chunks(each).zip(&packet.times) {
                scene.set_time(*time);
                let still = image(&mut simulator, &scene, &packet);
                assert!(pulse == still, "{tracer}, {paths} paths, at {time} s");
            }
            scene.set_time(0.0);
            let before = image(&mut simulator, &scene, &packet);
            assert!(pulses[..each] == before[..]);
            simulator.packet(&scene, 3, &packet).expect("a packet");
            assert!(image(&mut simulator, &scene, &packet) == before);
            let power =
                |pulse: &[[f32; 2]]| -> f32 { pulse.as_flattened().iter().map(|x| x * x).sum() };
            assert!(pulses.chunks(each).all(|pulse| power(pulse) > 0.0));
            assert!(pulses[..each] != pulses[each..2 * each]);
        }
    }
    assert_eq!(test_device().validation_messages(), [""; 0]);
}

#[test]
fn without_flow_all_pulses_are_the_image_and_noise_tells_them_apart() {
    let mut scene = scene(1);
    scene.flows.clear();
    let packet = Packet::even(3, 4000.0, 0..LINES, 0..scene.probe.samples);
    let mut simulator = simulator(&scene, Tracer::Bvh);
    let still = image(&mut simulator, &scene, &packet);
    let pulses = simulator.packet(&scene, 3, &packet).expect("a packet");
    assert!(pulses.chunks(still.len()).all(|pulse| pulse == still));
    scene.imaging.noise = -60.0;
    let noisy = image(&mut simulator, &scene, &packet);
    let pulses = simulator.packet(&scene, 3, &packet).expect("a packet");
    let pulses: Vec<_> = pulses.chunks(still.len()).collect();
    assert!(pulses[0] == noisy, "the first has the image's");
    assert!(pulses[1] != noisy && pulses[1] != pulses[2]);
}

/// Tissue that moves as one body along the scanlines: its velocity by the phases of successive pulses is that of its trajectory
/// within 2 %, at several moments of its way.
#[test]
fn tissue_doppler_is_the_velocity_of_a_body_that_moves() {
    let text = r#"
background = "water"
[probe]
preset = "linear"
depth = "40 mm"
scanlines = 64
samples = 1024
elevation_layers = 1
[doppler]
left = 0.3
right = 0.7
top = 0.35
bottom = 0.65
[[transform]]
name = "way"
motion = { kind = "sine", period = "1 s", translate = [0, 0, 3] }
[[mesh]]
name = "body"
parent = "way"
shape = { box = { size = [60, 40, 24] } }
tissue = "liver"
translate = [0, 0, 20]
"#;
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("scene.toml");
    std::fs::write(&file, text).expect("written");
    let (mut scene, _) = Scene::load(&file, &[]).expect("a scene");
    let mut simulator = simulator(&scene, Tracer::Bvh);
    let settings = ColourMode::Tissue.doppler(&scene.settings);
    let fastest = nyquist(&scene.probe, settings.prf);
    let mut heard = |mode: ColourMode, seconds: f64| {
        scene.set_time(seconds);
        let made = make_packet(&mut simulator, &mut scene, seconds, 0, mode, &settings);
        let pulses = made.expect("a packet").times.len();
        let echoes = simulator.pulses().expect("echoes");
        let each = echoes.len() / pulses;
        let pairs = echoes.iter().zip(&echoes[each..]);
        let sum = pairs.fold([0.0; 2], |[re, im], (a, b)| {
            let [a, b] = [a, b].map(|z| z.map(f64::from));
            [re + b[0] * a[0] + b[1] * a[1], im + b[1] * a[0] - b[0] * a[1]]
        });
        // Towards the probe; along the scanlines is away from it.
        -fastest * sum[1].atan2(sum[0]) / PI
    };
    for seconds in [0.0, 0.1, 0.4, 0.6] {
        let expected = 3.0 * 2.0 * PI * (2.0 * PI * seconds).cos();
        let found = heard(ColourMode::Tissue, seconds);
        assert!((found / expected - 1.0).abs() < 0.02, "{seconds}: {found} {expected}");
    }
    // The planted error: tissue that stands still from pulse to pulse.
    assert!(heard(ColourMode::Color, 0.0).abs() < 0.5);
}
