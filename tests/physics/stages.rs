//! The kernels of image formation, each run alone on the device, with validation.

use std::sync::Arc;

use bytemuck::Pod;
use insonify::gpu::{Device, Kernel};
use insonify::probe::Probe;
use insonify::sim::layout::{Counters, Frame, Row};
use insonify::sim::pass::Pass;
use insonify::sim::shaders::Library;
use insonify::sim::stages::{AXIAL, BEAM, DISPLAY};

use insonify_tools::harness::{self, Extent, Input, Job};

/// Device and kernels.
pub struct Stages {
    device: Arc<Device>,
    library: Library,
}

/// Result of a run.
struct Left {
    job: Job,
    outputs: Vec<Vec<u8>>,
}

impl Left {
    fn values<T: Pod>(&self, name: &str) -> Vec<T> {
        self.job.after(&self.outputs, name)
    }
}

/// The contact read by `beam` where every element is coupled.
fn joined(frame: &Frame) -> Vec<f32> {
    let lines = frame.scanlines as usize;
    [vec![1.0; lines], vec![0.0; lines + 1]].concat()
}

impl Stages {
    pub fn new(device: &Arc<Device>) -> Self {
        Self { device: device.clone(), library: Library::embedded() }
    }

    /// Runs a stage on the frame and its other inputs; no validation message may come.
    fn run(&self, pass: &Pass, frame: &Frame, mut given: Vec<Input>) -> Left {
        let words = self.library.words(pass.name);
        let kernel = Kernel::new(&self.device, pass.name, words, &[]).expect("it fits the device");
        given.push(Input::words("frame", &[*frame]));
        let job = Job::of(pass, given, Vec::new());
        let extent = Extent::Once(pass.extent.expect("its own")(frame));
        let outcome = harness::run(&self.device, &kernel, &job, &extent).expect("the kernel runs");
        assert_eq!(self.device.validation_messages(), Vec::<String>::new());
        Left { job, outputs: outcome.outputs }
    }

    /// Complex samples from accumulators, and the number of saturated samples.
    pub fn beam(
        &self,
        frame: &Frame,
        rows: &[Row],
        surface: &[i32],
        volume: &[i32],
    ) -> (Vec<f32>, u32) {
        let given = vec![
            Input::words("rows", rows),
            Input::words("surface_echoes", surface),
            Input::words("volume_echoes", volume),
            Input::words("contact", &joined(frame)),
        ];
        let left = self.run(&BEAM, frame, given);
        (left.values("lateral"), left.values::<Counters>("counters")[0].saturated)
    }

    /// Complex samples after the axial kernel.
    pub fn axial(&self, frame: &Frame, lateral: &[f32]) -> Vec<f32> {
        let rows = vec![Row::default(); frame.samples as usize];
        self.detected(frame, &rows, lateral).values("iq")
    }

    /// Log-compressed envelope of unfiltered samples.
    pub fn detect(&self, frame: &Frame, rows: &[Row], iq: &[f32]) -> Vec<f32> {
        let sharp = Frame { axial_sigma: 0.0, ..*frame };
        self.detected(&sharp, rows, iq).values("log_image")
    }

    fn detected(&self, frame: &Frame, rows: &[Row], lateral: &[f32]) -> Left {
        let given = vec![Input::words("rows", rows), Input::words("lateral", lateral)];
        self.run(&AXIAL, frame, given)
    }

    /// Pixels of a log image.
    pub fn display(&self, frame: &Frame, log: &[f32], grey: &[u32]) -> Vec<u32> {
        let given = vec![Input::words("log_image", log), Input::words("grey", grey)];
        self.run(&DISPLAY, frame, given).values("pixels")
    }
}

/// A convex, a linear and a phased array.
pub fn every_kind() -> [(&'static str, Probe); 3] {
    [("convex", Probe::paper_table1()), ("linear", Probe::linear()), ("phased", Probe::phased())]
}

#[cfg(test)]
mod tests {
    use insonify::gpu::test_device;
    use insonify::sim::tables;

    use super::*;
    use crate::common::signal::scene;

    /// An accumulator's end is reported once per sample, whichever of its four numbers reached it.
    #[test]
    fn saturation_is_counted() {
        let scene = scene(Probe { scanlines: 3, samples: 50, ..Probe::linear() });
        let (frame, rows) = (tables::frame(&scene, 0), tables::rows(&scene));
        let (mut surface, mut volume) = (vec![0; 300], vec![0; 300]);
        surface[0] = 1 << 30;
        volume[1] = i32::MIN;
        volume[299] = -(1 << 30);
        volume[100] = (1 << 30) - 1;
        let (_, saturated) = Stages::new(&test_device()).beam(&frame, &rows, &surface, &volume);
        assert_eq!(saturated, 2);
    }

    /// The log image at the ends of the envelope's range.
    #[test]
    fn detection_of_nothing_and_of_everything() {
        let scene = scene(Probe { scanlines: 1, samples: 4, ..Probe::linear() });
        let (frame, rows) = (tables::frame(&scene, 0), tables::rows(&scene));
        let iq = [0.0, 0.0, 1e9, 0.0, f32::NAN, 0.0, f32::INFINITY, 0.0];
        let log = Stages::new(&test_device()).detect(&frame, &rows, &iq);
        assert_eq!(log, [0.0, 1.0, 0.0, 1.0]);
    }
}
