//! Acceleration structures of the device alone: also where it has no ray query to walk them.

use insonify::gpu::{BlasInput, BlasOptions, build_times, refit_times};
use insonify::scene::shapes;
use miette::{IntoDiagnostic, Result, miette};
use serde_json::{Value, json};

use crate::Machine;
use crate::table::{Table, ms, write_json};

#[derive(clap::Args)]
pub struct Arguments {
    /// Subdivisions of the spheres: 20 * 4^n triangles.
    #[arg(long, value_delimiter = ',', default_value = "4,5,6,7,8", value_parser = clap::value_parser!(u32).range(0..=8))]
    subdivisions: Vec<u32>,
}

/// `profile builds`.
pub fn alone(machine: &Machine, arguments: &Arguments) -> Result<()> {
    if !machine.device.supports_acceleration_structure() {
        return Err(miette!(
            help = "the compute tracer builds its trees on the processor: `profile crossover` times them",
            "{} builds no acceleration structures",
            machine.device.name()
        ));
    }
    let rows = run(machine, &arguments.subdivisions)?;
    write_json(&machine.output, "builds", &json!({ "machine": machine.provenance, "rows": rows }))
}

/// Builds and refits of spheres; median of five.
pub fn run(machine: &Machine, subdivisions: &[u32]) -> Result<Value> {
    let mut table = Table::new(
        "Bottom-level structures built by the device, ms",
        &["triangles", "fast trace", "compaction", "fast build", "refit", "MB", "MB compacted"],
    );
    let mut rows = Vec::new();
    for &subdivisions in subdivisions {
        let mesh = shapes::sphere(30.0, subdivisions);
        let input =
            [BlasInput { name: "sphere", positions: &mesh.positions, triangles: &mesh.triangles }];
        let build = |options| build_times(&machine.device, &input, options).into_diagnostic();
        let quick = BlasOptions { fast_trace: false, compact: false };
        let mut times = [(); 4].map(|()| Vec::new());
        let mut bytes = [0.0; 2];
        for _ in 0..5 {
            let best = build(BlasOptions::default())?;
            let fast = build(quick)?;
            let refit = refit_times(&machine.device, &input, true).into_diagnostic()?;
            let found = [best.build_ms, best.compact_ms, fast.build_ms, refit.refit_ms];
            times.iter_mut().zip(found).for_each(|(times, ms)| times.push(ms));
            bytes = [best.bytes, best.compacted_bytes].map(|b| b as f64 / 1e6);
        }
        let [trace, compact, fast, refit] = times.map(|t| crate::measure::Statistics::of(t).median);
        table.add(vec![
            mesh.triangles.len().to_string(),
            ms(trace),
            ms(compact),
            ms(fast),
            ms(refit),
            format!("{:.2}", bytes[0]),
            format!("{:.2}", bytes[1]),
        ]);
        rows.push(json!({
            "triangles": mesh.triangles.len(), "fast_trace_ms": trace, "compaction_ms": compact,
            "fast_build_ms": fast, "refit_ms": refit, "mb": bytes[0], "compacted_mb": bytes[1],
        }));
    }
    table.print();
    table.csv(&machine.output, "builds")?;
    Ok(Value::Array(rows))
}
