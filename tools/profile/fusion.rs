//! Table I of the paper: the whole scene simulated, against its fusion with an acquired volume, of
//! which only the part inside the mask is simulated.

use std::path::Path;

use insonify::output;
use insonify::scene::Scene;
use insonify::sim::{Tracer, layout::Counters, stages};
use miette::{IntoDiagnostic, Result, miette};
use serde_json::{Value, json};

use crate::Machine;
use crate::measure::{Rig, Statistics};
use crate::table::{Table, ms};

/// The paper's imaging parameters; it does not give the pose of the probe.
const PROBE: [(&str, &str); 6] = [
    ("probe.preset", "paper-table1"),
    ("probe.frequency", "7 MHz"),
    ("probe.depth", "100 mm"),
    ("probe.scanlines", "192"),
    ("probe.elevation_layers", "7"),
    ("probe.samples", "2048"),
];
/// The parts of a frame that are timed, in its order.
fn parts() -> Vec<&'static str> {
    [vec!["update"], stages::names()].concat()
}

/// The same scene wholly simulated, and fused.
pub struct Scenes {
    simulated: Scene,
    pub fused: Scene,
}

impl Scenes {
    /// Loads the scene in `file`, which shows an acquired volume, with the paper's probe in the pose of its own.
    pub fn load(file: &Path, overrides: &[(String, String)]) -> Result<Self> {
        let probe = PROBE.map(|(key, value)| (key.to_owned(), value.to_owned()));
        let (fused, _) = Scene::load(file, &[&probe[..], overrides].concat())?;
        if fused.fusion.is_none() || fused.volume.is_none() {
            return Err(miette!(
                help = "give it [volume] and [fusion], as scenes/pregnancy.toml has them",
                "{} shows no acquired volume",
                file.display()
            ));
        }
        let mut simulated = fused.clone();
        simulated.volume = None;
        simulated.fusion = None;
        Ok(Self { simulated, fused })
    }
}

/// One scene under measurement: simulated or fused.
struct Way {
    rig: Rig,
    stages: Vec<Vec<f64>>,
    frames: Vec<f64>,
}

impl Way {
    fn new(machine: &Machine, scene: &Scene, tracer: Tracer) -> Result<Self> {
        let mut rig = Rig::new(machine, scene.clone(), tracer)?;
        rig.frame()?;
        Ok(Self { rig, stages: vec![Vec::new(); parts().len()], frames: Vec::new() })
    }

    fn measure(&mut self) -> Result<()> {
        let (timings, host) = self.rig.timings()?;
        for (name, times) in parts().iter().zip(&mut self.stages) {
            let own = if *name == "update" { host } else { 0.0 };
            // A pass that is not in this frame takes no time.
            let pass = timings.of(name);
            times.push(own + if pass.is_nan() { 0.0 } else { pass });
        }
        self.frames.push(host + timings.total_ms());
        Ok(())
    }

    fn medians(&self) -> Vec<f64> {
        let median = |times: &Vec<f64>| Statistics::of(times.iter().copied()).median;
        self.stages.iter().map(median).collect()
    }

    fn frame(&self) -> f64 {
        Statistics::of(self.frames.iter().copied()).median
    }

    fn counters(&mut self) -> Result<Counters> {
        self.rig.simulator.counters().into_diagnostic()
    }
}

/// Milliseconds per frame.
pub struct Measured {
    pub simulated: f64,
    pub fused: f64,
    pub triangles: usize,
    pub details: Value,
}

/// Measures both scenes in turns and prints the time of each stage.
pub fn run(machine: &Machine, scenes: &Scenes, tracer: Tracer, frames: u32) -> Result<Measured> {
    let mut ways =
        [Way::new(machine, &scenes.simulated, tracer)?, Way::new(machine, &scenes.fused, tracer)?];
    for round in 0..frames {
        // Each of the two is first in every second round.
        let first = usize::from(round % 2 == 1);
        ways[first].measure()?;
        ways[1 - first].measure()?;
    }
    let stages = [ways[0].medians(), ways[1].medians()];
    let frame = [ways[0].frame(), ways[1].frame()];
    let counters = [ways[0].counters()?, ways[1].counters()?];
    let mut table = Table::new(
        format!("Table I by stage, {tracer}: median ms of {frames} frames, interleaved"),
        &["stage", "simulated", "fused", "saved", "of the frame"],
    );
    let mut row = |name: &str, [simulated, fused]: [f64; 2]| {
        table.add(vec![
            name.into(),
            ms(simulated),
            ms(fused),
            ms(simulated - fused),
            format!("{:+.1} %", 100.0 * (simulated - fused) / frame[0]),
        ]);
    };
    for (i, name) in parts().iter().enumerate() {
        let both = [stages[0][i], stages[1][i]];
        if both != [0.0; 2] {
            row(name, both);
        }
    }
    row("frame", frame);
    table.print();
    table.csv(&machine.output, &format!("fusion-{tracer}"))?;
    explain(&counters, frame);
    let by_stage = |i: usize| -> Value {
        let pairs = parts().into_iter().zip(&stages[i]);
        pairs.map(|(name, ms)| (name.to_owned(), json!(ms))).collect()
    };
    let count = |c: &Counters| {
        json!({
            "rays": c.rays, "interactions": c.interactions, "segments": c.segments,
            "candidates": c.candidates, "deposits": c.deposits,
        })
    };
    Ok(Measured {
        simulated: frame[0],
        fused: frame[1],
        triangles: scenes.fused.triangles(),
        details: json!({
            "frames": frames,
            "simulated": by_stage(0), "fused": by_stage(1),
            "simulated_counts": count(&counters[0]), "fused_counts": count(&counters[1]),
        }),
    })
}

/// Explains the saving by the work that is not done.
fn explain(counters: &[Counters; 2], [simulated, fused]: [f64; 2]) {
    let of = |count: fn(&Counters) -> u32| {
        let [all, kept] = [&counters[0], &counters[1]].map(|c| f64::from(count(c)));
        let share = 100.0 * (1.0 - kept / all.max(1.0));
        format!("{all:.3e} to {kept:.3e} ({share:.0} % fewer)")
    };
    output::line(format_args!(
        "\nFusion saves {:.1} % of the frame; the paper saved {:.1} %. Work not done: rays {}, \
         segments {}, scatterer cells {}. Added: mask, tiles, convert, blur; fuse in place of display.",
        100.0 * (1.0 - fused / simulated),
        100.0 * (1.0 - PAPER[1] / PAPER[0]),
        of(|c| c.rays),
        of(|c| c.segments),
        of(|c| c.candidates),
    ));
}

/// The paper's milliseconds, simulated and fused.
pub const PAPER: [f64; 2] = [95.3, 85.4];
