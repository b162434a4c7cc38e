//! `profile crossover --splits`: what spatial splits bring. The paper gives the children of a selector
//! trees that are slow to build and quick to trace (SBVH), since a rebuild has no time for them.

use std::path::PathBuf;
use std::time::Instant;

use insonify::scene::{Scene, Strategy};
use insonify::sim::bvh::Splits;
use insonify::sim::fields::Fields;
use insonify::sim::world::GeometryArrays;
use insonify::sim::{Simulator, Tracer};
use miette::{IntoDiagnostic, Result};
use serde_json::{Value, json};

use crate::Machine;
use crate::measure::{Rig, Statistics};
use crate::strategies::{by, period};
use crate::table::{Table, ms, write_json};

/// Time and manner in which trees are built.
#[derive(Clone, Copy, PartialEq)]
enum Builder {
    /// Before the first frame.
    Lasting(Splits),
    /// The fast one of the strategy `rebuild`, for every keyframe anew.
    Rebuild,
}

impl Builder {
    const ALL: [Self; 3] =
        [Self::Lasting(Splits::Object), Self::Lasting(Splits::Spatial), Self::Rebuild];

    fn name(self) -> &'static str {
        match self {
            Self::Lasting(Splits::Object) => "object splits",
            Self::Lasting(Splits::Spatial) => "spatial splits",
            Self::Rebuild => "rebuild",
        }
    }

    fn splits(self) -> Splits {
        match self {
            Self::Lasting(splits) => splits,
            Self::Rebuild => Splits::Object,
        }
    }
}

/// The shipped scenes with keyframes, and the limb of the sweep of triangles at its finest.
pub fn run(machine: &Machine, files: &[PathBuf], frames: u32) -> Result<()> {
    let mut scenes = Vec::new();
    let shipped =
        ["heart", "limbs"].map(|name| insonify_tools::root().join(format!("scenes/{name}.toml")));
    for file in if files.is_empty() { &shipped[..] } else { files } {
        scenes.push(Scene::load(file, &[])?.0);
    }
    if files.is_empty() {
        scenes.push(crate::crossover::large()?);
    }
    let mut table = Table::new(
        "Trees of the compute tracer by how they are built",
        &[
            "scene",
            "triangles",
            "trees",
            "stored",
            "nodes",
            "MB",
            "build ms",
            "AS ms",
            "nodes/ray",
            "triangles/ray",
            "trace ms",
            "ns/ray",
        ],
    );
    let mut rows = Vec::new();
    for scene in &scenes {
        let keyframed = scene.instances.iter().any(|i| !i.keyframes.meshes.is_empty());
        for builder in Builder::ALL {
            if builder == Builder::Rebuild && !keyframed {
                continue;
            }
            rows.push(measured(machine, scene, builder, frames, &mut table)?);
        }
    }
    table.print();
    table.csv(&machine.output, "splits")?;
    let all = json!({ "machine": machine.provenance, "frames": frames, "rows": rows });
    write_json(&machine.output, "splits", &all)
}

fn measured(
    machine: &Machine,
    scene: &Scene,
    builder: Builder,
    frames: u32,
    table: &mut Table,
) -> Result<Value> {
    let scene = match builder {
        Builder::Rebuild => by(scene, Strategy::Rebuild),
        Builder::Lasting(_) => scene.clone(),
    };
    let fields = Fields::build(&scene);
    let begun = Instant::now();
    let arrays =
        GeometryArrays::new(&scene, Tracer::Bvh, builder.splits(), fields).into_diagnostic()?;
    let build = begun.elapsed().as_secs_f64() * 1e3;
    let nodes = arrays.bvh.map_or(0, |bvh| bvh.nodes.len());
    let stored = arrays.triangles.len();

    let (device, library, tracer) = (&machine.device, &machine.library, Tracer::Bvh);
    let simulator = Simulator::with_splits(device, library, &scene, tracer, builder.splits());
    let mut rig = Rig::of(simulator.into_diagnostic()?, scene);
    let seconds = |rig: &Rig, i: u32| {
        let period = period(&rig.scene).unwrap_or(0.0);
        period * (f64::from(i) + 0.5) / f64::from(frames)
    };
    let mut samples = Vec::new();
    for i in 0..frames {
        samples.push(rig.frame_at(seconds(&rig, i))?);
    }
    rig.simulator.count(library, true).into_diagnostic()?;
    let [mut rays, mut visits, mut tests] = [0.0; 3];
    for i in 0..frames {
        rig.frame_at(seconds(&rig, i))?;
        let counters = rig.simulator.counters().into_diagnostic()?;
        rays += f64::from(counters.rays);
        visits += f64::from(counters.node_visits);
        tests += f64::from(counters.triangle_tests);
    }
    let memory = rig.simulator.memory();
    let megabytes = (memory.geometry + memory.structures) as f64 / 1e6;
    let trace = Statistics::of(samples.iter().map(|s| s.trace)).median;
    let structures = Statistics::of(samples.iter().map(|s| s.structures)).median;
    let per_ray = 1e6 * trace * f64::from(frames) / rays;
    table.add(vec![
        rig.scene.name.clone(),
        rig.scene.triangles().to_string(),
        builder.name().into(),
        stored.to_string(),
        nodes.to_string(),
        format!("{megabytes:.1}"),
        ms(build),
        ms(structures),
        format!("{:.2}", visits / rays),
        format!("{:.2}", tests / rays),
        ms(trace),
        format!("{per_ray:.0}"),
    ]);
    Ok(json!({
        "scene": rig.scene.name, "triangles": rig.scene.triangles(), "trees": builder.name(),
        "stored_triangles": stored, "nodes": nodes, "world_mb": megabytes, "build_ms": build,
        "structures_ms": structures, "rays": rays / f64::from(frames),
        "nodes_per_ray": visits / rays, "triangles_per_ray": tests / rays,
        "trace_ms": trace, "ns_per_ray": per_ray,
    }))
}
