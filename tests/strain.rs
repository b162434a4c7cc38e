//! Strain between two images of tissue that is compressed evenly: known in closed form.

use insonify::gpu::test_device;
use insonify::scene::Scene;
use insonify::settings::Strain;
use insonify::sim::shaders::Library;
use insonify::sim::{Simulator, Tracer};
use insonify::strain::deformation;

/// A block whose height changes by 4 % to either side of 1 in the course of a second, about its middle.
const SCENE: &str = r#"
background = "water"
[probe]
preset = "linear"
depth = "40 mm"
scanlines = 64
samples = 1024
elevation_layers = 1
[[transform]]
name = "press"
translate = [0, 0, 20]
motion = { kind = "sine", period = "1 s", scale = [1, 1, 1.04] }
[[mesh]]
name = "block"
parent = "press"
shape = { box = { size = [60, 40, 24] } }
tissue = "liver"
"#;

#[test]
fn an_even_compression_has_its_strain_and_its_ways() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("scene.toml");
    std::fs::write(&file, SCENE).expect("written");
    let (mut scene, _) = Scene::load(&file, &[]).expect("a scene");
    let made = Simulator::new(&test_device(), &Library::embedded(), &scene, Tracer::Bvh);
    let mut simulator = made.expect("a simulator");
    let probe = scene.probe.clone();
    let mut image = |seconds: f64, index: u32| {
        scene.set_time(seconds);
        simulator.frame(&scene, index).expect("a frame");
        // Of the depth, about its middle.
        let scale = scene.instances[0].world_from_object.matrix3.z_axis.z;
        (simulator.iq().expect("samples"), scale)
    };
    for [from, to] in [[0.0, 0.03], [0.5, 0.56], [0.6, 0.55]] {
        let (before, small) = image(from, 1);
        let (after, large) = image(to, 2);
        let found = deformation(&probe, &Strain::default(), [&before, &after]);
        let (mut strain, mut count, mut off) = (0.0, 0.0, 0.0_f64);
        let pitch = probe.sample_pitch();
        for l in 8..56 {
            for k in (13.0 / pitch) as usize..(27.0 / pitch) as usize {
                let at = l * 1024 + k;
                strain += f64::from(found.strain[at]);
                let way = (k as f64 * pitch - 20.0) * (1.0 - small / large);
                off += (f64::from(found.displacement[at]) - way).powi(2);
                count += 1.0;
            }
        }
        let (mean, expected) = (strain / count, (large / small).ln());
        println!("{from}: {mean} {expected}, off by {}", (off / count).sqrt());
        assert!(expected.abs() > 3e-3, "nothing moves: {expected}");
        assert!((mean / expected - 1.0).abs() < 0.02, "{from}: {mean} {expected}");
        assert!((off / count).sqrt() < 5e-3, "{from}: ways off by {}", (off / count).sqrt());
        // The planted error: the images exchanged.
        let wrong = deformation(&probe, &Strain::default(), [&after, &before]);
        assert!((f64::from(wrong.strain[32 * 1024 + 512]) / expected - 1.0).abs() > 0.5);
    }
}
