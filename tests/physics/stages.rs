//! The kernels of image formation, each run alone on the device, with validation.

use std::sync::Arc;

use bytemuck::Pod;
use insonify::gpu::{Device, Kernel};
use insonify::harness::{self, Element, Extent, Input, Job, Role};
use insonify::probe::Probe;
use insonify::sim::layout::{self, Counters, Frame, Row};
use insonify::sim::shaders::Library;

/// Device and kernels.
pub struct Stages {
    device: Arc<Device>,
    library: Library,
}

fn input<T: Pod>(name: &'static str, values: &[T]) -> Input {
    Input {
        name,
        role: Role::Read,
        element: Element::Word,
        bytes: bytemuck::cast_slice(values).to_vec(),
    }
}

fn values<T: Pod>(bytes: &[u8]) -> Vec<T> {
    bytemuck::pod_collect_to_vec(bytes)
}

/// What `beam` reads of the contact where every element is coupled.
fn joined(frame: &Frame) -> Vec<f32> {
    let lines = frame.scanlines as usize;
    [vec![1.0; lines], vec![0.0; lines + 1]].concat()
}

impl Stages {
    pub fn new(device: &Arc<Device>) -> Self {
        Self { device: device.clone(), library: Library::embedded() }
    }

    /// Content of the bindings after a run; no validation message may have come.
    fn run(&self, stem: &str, inputs: Vec<Input>, threads: [u32; 2]) -> Vec<Vec<u8>> {
        let kernel = Kernel::new(&self.device, stem, self.library.words(stem), &[])
            .expect("the kernel fits the device");
        let job = Job { inputs, push: vec![] };
        let extent = Extent::Threads([threads[0], threads[1], 1]);
        let outcome = harness::run(&self.device, &kernel, &job, &extent).expect("the kernel runs");
        assert_eq!(self.device.validation_messages(), Vec::<String>::new());
        outcome.outputs
    }

    /// Accumulators to complex samples; also the saturated samples.
    pub fn beam(
        &self,
        frame: &Frame,
        rows: &[Row],
        surface: &[i32],
        volume: &[i32],
    ) -> (Vec<f32>, u32) {
        let inputs = vec![
            input("frame", &[*frame]),
            input("rows", rows),
            input("surface", surface),
            input("volume", volume),
            input("counters", &[Counters::default()]),
            input("lateral", &vec![0f32; surface.len()]),
            input("contact", &joined(frame)),
        ];
        let after =
            self.run("beam", inputs, [frame.samples, frame.scanlines.div_ceil(layout::BEAM_LINES)]);
        let counters: Vec<Counters> = values(&after[4]);
        (values(&after[5]), counters[0].saturated)
    }

    /// Complex samples through the axial kernel.
    pub fn axial(&self, frame: &Frame, lateral: &[f32]) -> Vec<f32> {
        let rows = vec![Row::default(); frame.samples as usize];
        self.detected(frame, &rows, lateral).0
    }

    /// Log-compressed envelope of samples as they are.
    pub fn detect(&self, frame: &Frame, rows: &[Row], iq: &[f32]) -> Vec<f32> {
        let sharp = Frame { axial_sigma: 0.0, ..*frame };
        self.detected(&sharp, rows, iq).1
    }

    /// Complex samples through the axial kernel, and their log-compressed envelope.
    fn detected(&self, frame: &Frame, rows: &[Row], lateral: &[f32]) -> (Vec<f32>, Vec<f32>) {
        let inputs = vec![
            input("frame", &[*frame]),
            input("rows", rows),
            input("lateral", lateral),
            input("iq", &vec![0f32; lateral.len()]),
            input("log image", &vec![0f32; lateral.len() / 2]),
        ];
        let threads = [frame.samples.div_ceil(layout::AXIAL_SAMPLES), frame.scanlines];
        let after = self.run("axial", inputs, threads);
        (values(&after[3]), values(&after[4]))
    }

    /// Pixels.
    pub fn display(&self, frame: &Frame, log: &[f32], grey: &[u32]) -> Vec<u32> {
        let size = [frame.image_width, frame.image_height];
        let inputs = vec![
            input("frame", &[*frame]),
            input("log image", log),
            input("grey map", grey),
            input("pixels", &vec![0u32; (size[0] * size[1]) as usize]),
        ];
        values(&self.run("display", inputs, size)[3])
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
    use crate::signal::scene;

    /// The accumulators' end is reported once per sample, whichever of its four numbers reached it.
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

    /// What the log image must be at the ends of the envelope's range.
    #[test]
    fn detection_of_nothing_and_of_everything() {
        let scene = scene(Probe { scanlines: 1, samples: 4, ..Probe::linear() });
        let (frame, rows) = (tables::frame(&scene, 0), tables::rows(&scene));
        let iq = [0.0, 0.0, 1e9, 0.0, f32::NAN, 0.0, f32::INFINITY, 0.0];
        let log = Stages::new(&test_device()).detect(&frame, &rows, &iq);
        assert_eq!(log, [0.0, 1.0, 0.0, 1.0]);
    }
}
