//! Repetition of frames. The shipped scenes at their own settings are in `tests/frame.rs`.

use glam::{DAffine3, DVec3};
use insonify::scene::{Instance, Keyframes, Scene, Surface, shapes};
use insonify::sim::{Simulator, Tracer, shaders::Library};

use crate::physics::check::{Bench, Check, Outcome, Physics, Picture};
use crate::physics::scenes::{linear, tissue};

/// Check T34.
pub fn a_frame_repeats_bit_for_bit_and_both_tracers_show_it() -> Check {
    Check {
        row: "T34",
        name: "a_frame_repeats_bit_for_bit_and_both_tracers_show_it",
        claim: "Echoes are summed as integers, so the order of additions leaves no trace: two runs \
            are equal in every accumulator. Two implementations of ray tracing show the same image \
            within one grey level at 99.9 % of the pixels; the rest leaves room for the few rays near \
            an edge for which a device's own test finds the neighbour.",
        planted: "Another seed for the second run.",
        run: repeats,
    }
}

/// A rough sphere in speckle, many paths.
fn rough_sphere() -> Scene {
    let mut scene = linear(48, 30.0, tissue(1.540, 1.630, 0.5));
    scene.probe.samples = 1024;
    scene.imaging.image_height = 400;
    scene.simulation.paths = 8;
    scene.simulation.max_reflections = 3;
    scene.meshes.push(shapes::sphere(8.0, 3).into());
    scene.tissues.push(tissue(1.600, 1.900, 0.7));
    scene.instances.push(Instance {
        name: "sphere".into(),
        mesh: 0,
        keyframes: Keyframes::default(),
        shown: true,
        tissue: 1,
        priority: 0,
        world_from_object: DAffine3::from_translation(DVec3::new(1.3, 0.7, 35.0)),
        surface: [Surface { roughness: 100.0, thickness: 0.1, specularity: 1.0, gain: 0.0 }; 2],
    });
    scene
}

/// Surface and volume echoes, and the picture.
fn shoot(bench: &Bench, scene: &Scene, tracer: Tracer) -> ([Vec<i32>; 2], Picture) {
    let mut simulator =
        Simulator::new(&bench.device, &Library::embedded(), scene, tracer).expect("a simulator");
    simulator.frame(scene, 0).expect("a frame");
    let (width, _, pixels) = simulator.pixels().expect("pixels");
    let grey = |p: &[u8]| if p[3] == 0 { 255 } else { p[0] };
    let picture =
        Picture { title: format!("{tracer}"), width, grey: pixels.chunks(4).map(grey).collect() };
    (simulator.echoes().expect("echoes"), picture)
}

fn repeats(bench: &Bench, physics: Physics) -> Outcome {
    let scene = rough_sphere();
    let mut again = scene.clone();
    if physics == Physics::Planted {
        again.simulation.seed += 1;
    }
    let mut out = Outcome::default();
    for tracer in [Tracer::Bvh, Tracer::RayQuery] {
        let (first, picture) = shoot(bench, &scene, tracer);
        let (second, last) = shoot(bench, &again, tracer);
        for (i, what) in ["surface", "volume"].into_iter().enumerate() {
            assert!(first[i].iter().any(|&v| v != 0), "{what} echoes");
            let pairs = first[i].iter().zip(&second[i]);
            let differing = pairs.filter(|(a, b)| a != b).count() as f64;
            let of = first[i].len();
            let what = format!("{tracer}: of {of} {what} accumulators, different the second time");
            out.compare(what, differing, 0.0, 0.0);
        }
        // The last run's, so that the planted seed shows in it.
        out.pictures.push(if tracer == Tracer::Bvh { picture } else { last });
    }
    let pairs = out.pictures[0].grey.iter().zip(&out.pictures[1].grey);
    let far = pairs.filter(|(a, b)| a.abs_diff(**b) > 1).count() as f64;
    let share = far / out.pictures[0].grey.len() as f64;
    let what = "bvh and query: share of pixels more than a grey level apart";
    out.compare(what, share, 0.0, 1e-3);
    out
}
