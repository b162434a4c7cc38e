//! The traces of paths on the device, before any image is formed.

use std::sync::Arc;

use insonify::gpu;
use insonify::scene::Scene;
use insonify::sim::{Simulator, Tracer, layout, shaders::Library, tables};
use insonify_tools::reference::Segment;

use crate::physics::check::Bench;

/// The paths of one frame.
pub struct Shot {
    /// Surface echoes before the lateral stage, complex, relative to a perfect mirror: [scanline][sample].
    pub surface: Vec<Vec<[f64; 2]>>,
    /// Segments by line.
    pub segments: Vec<Vec<Segment>>,
}

/// A scene on the device for repeated frames with other settings.
pub struct Range {
    device: Arc<gpu::Device>,
    simulator: Simulator,
}

impl Range {
    pub fn new(bench: &Bench, scene: &Scene, tracer: Tracer) -> Self {
        let simulator = Simulator::new(&bench.device, &Library::embedded(), scene, tracer)
            .unwrap_or_else(|e| panic!("{tracer}: {e}"));
        Self { device: Arc::clone(&bench.device), simulator }
    }

    /// Runs a frame; nothing may be lost on the way, and validation is silent.
    pub fn frame(&mut self, scene: &Scene) -> &mut Simulator {
        self.simulator.frame(scene, 0).expect("a frame");
        let counters = self.simulator.counters().expect("counters");
        let lost = [counters.saturated, counters.segments_dropped, counters.stack_overflow];
        assert_eq!(lost, [0; 3], "saturated, dropped, overflown");
        assert_eq!(self.device.validation_messages(), Vec::<String>::new());
        &mut self.simulator
    }

    /// Complex baseband of a frame: [scanline][sample].
    pub fn iq(&mut self, scene: &Scene) -> Vec<Vec<[f64; 2]>> {
        let iq = self.frame(scene).iq().expect("a read-back");
        let complex = |v: &[f32]| [f64::from(v[0]), f64::from(v[1])];
        iq.chunks(2 * scene.probe.samples as usize)
            .map(|line| line.chunks(2).map(complex).collect())
            .collect()
    }

    pub fn shoot(&mut self, scene: &Scene) -> Shot {
        let rows = tables::rows(scene);
        let simulator = self.frame(scene);
        let [surface, _] = simulator.echoes().expect("a read-back");
        let segments = simulator.segments().expect("a read-back");
        let undo = |(v, row): (&[i32], &layout::Row)| {
            [v[0], v[1]].map(|x| f64::from(x) * f64::from(row.surface_undo))
        };
        let wide = |line: &Vec<layout::Segment>| line.iter().map(Segment::from).collect();
        Shot {
            surface: surface
                .chunks(2 * rows.len())
                .map(|line| line.chunks(2).zip(&rows).map(undo).collect())
                .collect(),
            segments: segments.iter().map(wide).collect(),
        }
    }
}

/// Complex amplitude of a scanline within `reach` samples of one-way time `time`, us, relative to an echo of
/// amplitude 1 and phase 0 there.
pub fn echo(scene: &Scene, line: &[[f64; 2]], time: f64, reach: usize) -> [f64; 2] {
    let probe = &scene.probe;
    let k = (probe.speed * time / probe.sample_pitch()).floor() as usize;
    let (sin, cos) = (2.0 * std::f64::consts::TAU * probe.frequency * time).sin_cos();
    let window = k.saturating_sub(reach)..(k + reach + 2).min(line.len());
    line[window]
        .iter()
        .fold([0.0; 2], |[x, y], [re, im]| [x + re * cos - im * sin, y + re * sin + im * cos])
}

/// Sum of power times sample over the sum of power of `line` in `range`.
pub fn centroid(line: &[[f64; 2]], range: std::ops::Range<usize>) -> f64 {
    let amplitude = |k: usize| line[k][0].hypot(line[k][1]);
    let sum: f64 = range.clone().map(amplitude).sum();
    range.map(|k| k as f64 * amplitude(k)).sum::<f64>() / sum
}
