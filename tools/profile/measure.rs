//! One frame at a time, and what many of them come to.

use insonify::scene::Scene;
use insonify::sim::Simulator;
use miette::{IntoDiagnostic, Result};
use serde_json::{Value, json};

use crate::Machine;
use insonify::sim::Tracer;

/// Milliseconds of one frame.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// Making the scene what it is: uploads, builds, refits; on the device and before it on the
    /// processor.
    pub structures: f64,
    /// Following the paths, and finding what encloses their starts.
    pub trace: f64,
    /// All of the above and the rest of the frame.
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
        Ok(Self {
            simulator: simulator.into_diagnostic()?,
            scene,
            index: 0,
        })
    }

    /// Images the scene as it stands, alone on the device.
    pub fn frame(&mut self) -> Result<Sample> {
        self.index += 1;
        let (simulator, scene) = (&mut self.simulator, &self.scene);
        simulator.frame(scene, self.index).into_diagnostic()?;
        let host = simulator.update_time().as_secs_f64() * 1e3;
        let timings = simulator.wait().into_diagnostic()?;
        let last = timings.last().expect("a frame was waited for");
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

/// Order statistics by nearest rank.
#[derive(Clone, Copy, Debug)]
pub struct Statistics {
    pub median: f64,
    pub p95: f64,
    pub p99: f64,
}

impl Statistics {
    pub fn of(values: impl IntoIterator<Item = f64>) -> Self {
        let mut sorted: Vec<f64> = values.into_iter().collect();
        sorted.sort_by(f64::total_cmp);
        let rank = |q: f64| {
            let rank = (sorted.len() as f64 * q).ceil() as usize;
            sorted
                .get(rank.saturating_sub(1))
                .copied()
                .unwrap_or(f64::NAN)
        };
        Self {
            median: rank(0.5),
            p95: rank(0.95),
            p99: rank(0.99),
        }
    }

    pub fn json(&self) -> Value {
        json!({ "median": self.median, "p95": self.p95, "p99": self.p99 })
    }
}

pub fn mean(values: impl IntoIterator<Item = f64>) -> f64 {
    let (sum, count) = (values.into_iter()).fold((0.0, 0.0), |(s, n), v| (s + v, n + 1.0));
    sum / count
}
