//! The times of one frame, and their statistics over many.

use insonify::gpu::FrameTimings;
use insonify::scene::Scene;
use insonify::sim::Simulator;
pub use insonify::statistics::Statistics;
use miette::{IntoDiagnostic, Result};

use crate::Machine;
use insonify::sim::Tracer;

/// Milliseconds of one frame.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// Update of the scene: uploads, builds, refits; on the device and before it on the
    /// processor.
    pub structures: f64,
    /// Tracing of the paths, with the search for what encloses their starts.
    pub trace: f64,
    /// The whole frame, both of the above included.
    pub frame: f64,
}

/// A scene on the device.
pub struct Rig {
    pub scene: Scene,
    pub simulator: Simulator,
    index: u32,
}

impl Rig {
    pub fn new(machine: &Machine, scene: Scene, tracer: Tracer) -> Result<Self> {
        let simulator = Simulator::new(&machine.device, &machine.library, &scene, tracer);
        Ok(Self::of(simulator.into_diagnostic()?, scene))
    }

    /// Makes a rig with a simulator made for `scene`.
    pub fn of(simulator: Simulator, scene: Scene) -> Self {
        Self { simulator, scene, index: 0 }
    }

    /// Images the scene as it stands, alone on the device: times of its passes and of the processor, ms.
    pub fn timings(&mut self) -> Result<(FrameTimings, f64)> {
        self.index += 1;
        let (simulator, scene) = (&mut self.simulator, &self.scene);
        simulator.frame(scene, self.index).into_diagnostic()?;
        let host = simulator.update_time().as_secs_f64() * 1e3;
        let mut timings = simulator.wait().into_diagnostic()?;
        Ok((timings.pop().expect("a frame was waited for"), host))
    }

    /// Images the scene as it stands.
    pub fn frame(&mut self) -> Result<Sample> {
        let (last, host) = self.timings()?;
        Ok(Sample {
            structures: host + last.of("update"),
            trace: last.of("origin") + last.of("trace"),
            frame: host + last.total_ms(),
        })
    }

    /// Images the scene at `seconds`.
    pub fn frame_at(&mut self, seconds: f64) -> Result<Sample> {
        self.scene.set_time(seconds);
        self.frame()
    }
}

pub fn mean(values: impl IntoIterator<Item = f64>) -> f64 {
    let (sum, count) = (values.into_iter()).fold((0.0, 0.0), |(s, n), v| (s + v, n + 1.0));
    sum / count
}
