//! Labels without levels: what `simulation.label_levels` switches off.

use insonify::gpu::test_device;
use insonify::scene::Scene;
use insonify::sim::labels::{KINDS, LabelArray, LabelValues};
use insonify::sim::shaders::Library;
use insonify::sim::{Simulator, Tracer};

use super::frame;
use super::scenes::{add_layer, linear, tissue};
use super::timestamps::timestamps;

/// The arrays of samples and pixels, the stages that were timed, and the picture, of the first frame.
fn made(simulator: &mut Simulator, scene: &Scene) -> ([Vec<LabelArray>; 2], Vec<String>, Vec<u8>) {
    let labels = frame(simulator, scene, 0);
    let timings = simulator.wait().expect("no device error").pop().expect("a frame");
    let stages = timings.passes.into_iter().map(|(name, _)| name).collect();
    let (_, _, rgba) = simulator.pixels().expect("no device error");
    ([labels.samples.arrays(), labels.pixels.arrays()], stages, rgba)
}

/// The values of an array, NaN as well.
fn bits(array: &LabelArray) -> Vec<u32> {
    match &array.values {
        LabelValues::Indices(all) => all.iter().map(|v| *v as u32).collect(),
        LabelValues::Quantities(all) => all.iter().map(|v| v.to_bits()).collect(),
    }
}

#[test]
fn they_are_the_others_and_cost_no_second_trace() {
    let mut scene = linear(24, 12.0, tissue(1.54, 1.63, 0.5));
    add_layer(&mut scene, 10.0, tissue(1.45, 1.38, 0.6));
    let mut simulator = super::simulator(&mut scene, Tracer::Bvh);
    let (all, stages, picture) = made(&mut simulator, &scene);
    let timed = timestamps(&test_device());
    let ran = |stages: &[String], expected: [bool; 4]| {
        let names = ["label", "chart", "expect", "level"];
        let found = names.map(|stage| stages.iter().any(|s| s == stage));
        assert_eq!(found, expected.map(|ran| ran && timed));
    };
    ran(&stages, [true; 4]);
    scene.simulation.label_levels = false;
    let (few, stages, same) = made(&mut simulator, &scene);
    ran(&stages, [true, true, false, false]);
    assert!(picture == same, "the picture stays");
    for (all, few) in all.iter().zip(&few) {
        assert_eq!((all.len(), few.len()), (KINDS.len(), KINDS.len() - 2));
        assert!(few.iter().all(|array| !["level", "reverberation"].contains(&array.kind.name)));
        for array in few {
            let same = all.iter().find(|other| other.kind == array.kind).expect("all have it");
            assert!(bits(same) == bits(array), "{}", array.kind.name);
        }
    }
    // A simulator made without them gets room for them when they are asked for.
    let mut second =
        Simulator::new(&test_device(), &Library::embedded(), &scene, Tracer::Bvh).expect("made");
    ran(&made(&mut second, &scene).1, [true, true, false, false]);
    scene.simulation.label_levels = true;
    second.fit(&scene).expect("room");
    let (again, _, _) = made(&mut second, &scene);
    for (all, again) in all.iter().flatten().zip(again.iter().flatten()) {
        assert!(bits(all) == bits(again), "{}", all.kind.name);
    }
    assert_eq!(test_device().validation_messages(), Vec::<String>::new());
}
