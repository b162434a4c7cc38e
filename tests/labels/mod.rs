//! Labels against closed forms: where things are and are seen, what is lost, how tissue moves, how loud echoes are.

mod files;
mod geometry;
mod levels;
mod motion;
mod painted;
mod power;

use crate::physics::scenes;
use insonify::gpu::test_device;
use insonify::scene::Scene;
use insonify::sim::labels::Labels;
use insonify::sim::layout::Label;
use insonify::sim::shaders::Library;
use insonify::sim::{Simulator, Tracer};

use crate::common::program;
use crate::common::timestamps;
use crate::common::tracers;

/// A simulator of a scene that asks for labels.
fn simulator(scene: &mut Scene, tracer: Tracer) -> Simulator {
    scene.simulation.labels = true;
    Simulator::new(&test_device(), &Library::embedded(), scene, tracer).expect("a simulator")
}

/// The labels of a frame.
fn frame(simulator: &mut Simulator, scene: &Scene, index: u32) -> Labels {
    simulator.frame(scene, index).expect("a frame");
    simulator.labels().expect("no device error").expect("they are asked for")
}

/// The labels of the first frame of a scene.
fn labels(scene: &mut Scene, tracer: Tracer) -> Labels {
    let mut simulator = simulator(scene, tracer);
    let labels = frame(&mut simulator, scene, 0);
    assert_eq!(test_device().validation_messages(), Vec::<String>::new());
    labels
}

/// The label of sample `k` of scanline `l`.
fn at(labels: &Labels, l: usize, k: usize) -> &Label {
    &labels.samples.labels[l * labels.samples.shape[1] + k]
}

/// The place that a label says, mm.
fn place(label: &Label) -> glam::DVec3 {
    let [x, y, z, _] = label.place_loss.map(f64::from);
    glam::DVec3::new(x, y, z)
}
