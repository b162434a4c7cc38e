//! `profile strategies SCENE`: the same motion by every strategy.

use std::path::PathBuf;

use insonify::output::plot::{Curve, Plot};
use insonify::scene::graph::NodeKind;
use insonify::scene::{Scene, Strategy};
use insonify::settings::Words;
use insonify::sim::Tracer;
use miette::{IntoDiagnostic, Result, miette};
use serde_json::{Value, json};

use crate::Machine;
use crate::measure::{Rig, Sample, Statistics};
use crate::table::{Table, ms, write_json, write_plot};

#[derive(clap::Args)]
pub struct Arguments {
    /// Scene file with a selector over keyframes.
    scene: PathBuf,
    /// Frames that are measured, each in the middle of the keyframe after the last one's.
    #[arg(long, default_value_t = 24, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    frames: u32,
    /// Frames before those.
    #[arg(long, default_value_t = 2)]
    warm_up: u32,
    /// Overrides an entry of the scene file, e.g. --set simulation.paths=8.
    #[arg(long = "set", value_name = "PATH=VALUE", value_parser = insonify::scene::file::override_of)]
    overrides: Vec<(String, String)>,
}

/// Strategies that can show the scene by this tracer.
pub fn possible(scene: &Scene, tracer: Tracer) -> Vec<Strategy> {
    let mut keyframed = scene.instances.iter().filter(|i| !i.keyframes.meshes.is_empty());
    let shared = keyframed.all(|i| scene.shares_topology(i));
    let can = |s: &Strategy| {
        (shared || !s.needs_shared_topology())
            && (*s != Strategy::Selector || tracer == Tracer::Bvh)
    };
    Strategy::ALL.iter().copied().filter(can).collect()
}

/// Returns the scene with all its keyframes shown by `strategy`.
pub fn by(scene: &Scene, strategy: Strategy) -> Scene {
    let mut scene = scene.clone();
    for instance in &mut scene.instances {
        instance.keyframes.strategy = strategy;
    }
    scene.set_time(0.0);
    scene
}

/// Longest period of the scene's selectors, s.
pub fn period(scene: &Scene) -> Option<f64> {
    let selectors = scene.graph.nodes.iter().filter_map(|n| match &n.kind {
        NodeKind::Selector(sequence) => Some(sequence.clock().period),
        _ => None,
    });
    selectors.reduce(f64::max)
}

struct Run {
    strategy: Strategy,
    rig: Rig,
    samples: Vec<Sample>,
}

pub fn run(machine: &Machine, arguments: &Arguments) -> Result<()> {
    let (scene, _) = Scene::load(&arguments.scene, &arguments.overrides)?;
    let period = period(&scene).ok_or_else(|| {
        miette!(
            help = "take one whose meshes have keyframes, such as scenes/heart.toml",
            "{} has no selector",
            arguments.scene.display()
        )
    })?;
    let keyframed = scene.instances.iter().map(|i| i.keyframes.meshes.len());
    let keyframes = keyframed.max().unwrap_or(0).max(1);
    let mut results = Vec::new();
    for &tracer in &machine.tracers {
        let mut runs = Vec::new();
        for strategy in possible(&scene, tracer) {
            let rig = Rig::new(machine, by(&scene, strategy), tracer)?;
            runs.push(Run { strategy, rig, samples: Vec::new() });
        }
        for i in 0..arguments.warm_up + arguments.frames {
            let seconds = period / keyframes as f64 * (f64::from(i) + 0.5);
            for run in &mut runs {
                let sample = run.rig.frame_at(seconds)?;
                if i >= arguments.warm_up {
                    run.samples.push(sample);
                }
            }
        }
        results.push(report(machine, &scene, tracer, &mut runs, arguments.frames, period)?);
    }
    let all = json!({
        "machine": machine.provenance,
        "scene": scene.name,
        "triangles": scene.triangles(),
        "frames": arguments.frames,
        "tracers": results,
    });
    write_json(&machine.output, "strategies", &all)
}

fn report(
    machine: &Machine,
    scene: &Scene,
    tracer: Tracer,
    runs: &mut [Run],
    frames: u32,
    period: f64,
) -> Result<Value> {
    let mut table = Table::new(
        format!("{}, {} triangles, {tracer}, {frames} frames", scene.name, scene.triangles()),
        &[
            "strategy",
            "AS ms",
            "AS p95",
            "AS p99",
            "trace ms",
            "frame ms",
            "frame p95",
            "frame p99",
            "MB",
            "F1/ray",
            "F2/ray",
            "steps/ray",
        ],
    );
    let mut rows = Vec::new();
    let mut curves = Vec::new();
    for run in runs {
        let of = |part: fn(&Sample) -> f64| Statistics::of(run.samples.iter().map(part));
        let (structures, trace, frame) = (of(|s| s.structures), of(|s| s.trace), of(|s| s.frame));
        let megabytes = run.rig.simulator.memory().total() as f64 / 1e6;
        let counts = match tracer {
            Tracer::Bvh => Some(count(machine, run, period)?),
            Tracer::RayQuery => None,
        };
        let per_ray = |i: usize| counts.map_or("-".into(), |c| format!("{:.3}", c[i]));
        table.add(vec![
            run.strategy.to_string(),
            ms(structures.median),
            ms(structures.p95),
            ms(structures.p99),
            ms(trace.median),
            ms(frame.median),
            ms(frame.p95),
            ms(frame.p99),
            format!("{megabytes:.1}"),
            per_ray(0),
            per_ray(1),
            per_ray(2),
        ]);
        let points =
            run.samples.iter().zip(0..).map(|(s, i)| [f64::from(i), s.structures.max(1e-4)]);
        curves.push(Curve::line(run.strategy.to_string(), points.collect()));
        rows.push(json!({
            "strategy": run.strategy.to_string(),
            "structures_ms": structures,
            "trace_ms": trace,
            "frame_ms": frame,
            "world_mb": megabytes,
            "false_unions_per_ray": counts.map(|c| c[0]),
            "false_boxes_per_ray": counts.map(|c| c[1]),
            "steps_per_ray": counts.map(|c| c[2]),
        }));
    }
    table.print();
    table.csv(&machine.output, &format!("strategies-{tracer}"))?;
    let plot = Plot {
        title: format!("{}: structures, {tracer}", scene.name),
        axes: ["frame".into(), "ms".into()],
        logarithmic: [false, true],
        curves,
    };
    write_plot(&machine.output, &format!("strategies-{tracer}"), &plot)?;
    Ok(json!({ "tracer": tracer.to_string(), "strategies": rows }))
}

/// Returns false intersections of the union and of the box, and nodes visited, per ray: over eight frames.
fn count(machine: &Machine, run: &mut Run, period: f64) -> Result<[f64; 3]> {
    run.rig.simulator.count(&machine.library, true).into_diagnostic()?;
    let mut sums = [0.0; 4];
    for i in 0..8 {
        run.rig.frame_at(period * f64::from(i) / 8.0)?;
        let c = run.rig.simulator.counters().into_diagnostic()?;
        for (sum, n) in sums.iter_mut().zip([c.rays, c.false_unions, c.false_boxes, c.node_visits])
        {
            *sum += f64::from(n);
        }
    }
    run.rig.simulator.count(&machine.library, false).into_diagnostic()?;
    Ok([1, 2, 3].map(|i| sums[i] / sums[0]))
}
