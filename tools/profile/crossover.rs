//! `profile crossover`: the counterexample of the paper's section IV measured. A limb jumps between
//! unlike places; how far, and of how many triangles, decides whether a selector or a rebuild is
//! cheaper.

use std::path::PathBuf;

use glam::{DAffine3, DQuat, DVec3};
use insonify::output::plot::{Curve, Plot};
use insonify::scene::{Graph, Keyframes, Mesh, Scene, Strategy, shapes};
use insonify::settings::Words;
use insonify::sim::Tracer;
use miette::{IntoDiagnostic, Result};
use serde_json::{Value, json};

use crate::Machine;
use crate::builds;
use crate::measure::{Rig, Sample, Statistics};
use crate::splits;
use crate::table::{Table, ms, write_json, write_plot};

/// Seven and the slot of the shown one keep 1.3 million triangles each within the 128 MiB of a storage
/// buffer that every device has to offer, and each has a bit of a ray mask to itself.
const KEYFRAMES: usize = 7;

/// Half axes of the limb, mm.
const LIMB: [f64; 3] = [6.0, 6.0, 22.0];

#[derive(clap::Args)]
pub struct Arguments {
    /// Frames per setting.
    #[arg(long, default_value_t = 16, value_parser = clap::value_parser!(u32).range(8..=10_000))]
    frames: u32,
    /// Subdivisions of the limb in the sweep of triangles: 20 times 4 to their power .
    #[arg(long, value_delimiter = ',', default_value = "4,5,6,7,8", value_parser = clap::value_parser!(u32).range(0..=8))]
    subdivisions: Vec<u32>,
    /// Subdivisions in the sweep of distances.
    #[arg(long, value_delimiter = ',', default_value = "3,4,5", value_parser = clap::value_parser!(u32).range(0..=8))]
    sweep: Vec<u32>,
    /// Distances between keyframes, mm.
    #[arg(long, value_delimiter = ',', default_value = "0,5,10,20,40,60")]
    distances: Vec<f64>,
    /// Instead, what spatial splits bring to these scenes [default: the heart, the limbs and a limb of
    /// 1.3 million triangles]: nodes and triangles per ray, times, memory.
    #[arg(long, value_name = "SCENE", num_args = 0..)]
    splits: Option<Vec<PathBuf>>,
}

/// The shipped limb's scene with a plain limb of so many triangles, which is elsewhere in every
/// keyframe; 96 scanlines of 3 layers, so that a frame is not all scatterers.
fn limb(subdivisions: u32, distance: f64, strategy: Strategy) -> Result<Scene> {
    let file = insonify_tools::root().join("scenes/limbs.toml");
    let fewer = [("probe.scanlines", "96"), ("probe.elevation_layers", "3")];
    let fewer = fewer.map(|(key, value)| (key.to_owned(), value.to_owned()));
    let (mut scene, _) = Scene::load(&file, &fewer)?;
    let keyframed = scene.instances.iter().position(|i| !i.keyframes.meshes.is_empty());
    let mut limb = scene.instances[keyframed.expect("the limb")].clone();
    scene.instances.retain(|i| i.keyframes.meshes.is_empty());
    scene.graph = Graph::default();
    let first = scene.meshes.len();
    let rest = shapes::ellipsoid(LIMB, subdivisions);
    scene.meshes.extend((0..KEYFRAMES).map(|k| placed(&rest, k, distance).into()));
    limb.keyframes = Keyframes {
        meshes: (first..first + KEYFRAMES).collect(),
        strategy,
        ..Keyframes::default()
    };
    scene.instances.push(limb);
    show(&mut scene, 0);
    Ok(scene)
}

/// The limb at the k-th corner of a box of this size, 60 mm deep, turned by up to 0.4 k rad.
fn placed(rest: &Mesh, k: usize, distance: f64) -> Mesh {
    let corner = DVec3::from_array([0, 1, 2].map(|bit| f64::from(k as u32 >> bit & 1) - 0.5));
    let turn = DQuat::from_rotation_y(0.4 * k as f64 * (distance / 60.0).min(1.0));
    let at = DAffine3::from_rotation_translation(
        turn,
        DVec3::new(0.0, 0.0, 65.0) + corner * DVec3::new(distance, 0.3 * distance, distance),
    );
    let moved = |p: &[f32; 3]| at.transform_point3(DVec3::from(p.map(f64::from))).as_vec3().into();
    let turned = |n: &[f32; 3]| (turn * DVec3::from(n.map(f64::from))).as_vec3().into();
    Mesh {
        positions: rest.positions.iter().map(moved).collect(),
        normals: rest.normals.iter().map(turned).collect(),
        ..rest.clone()
    }
}

/// Returns the number of triangles of one keyframe of the limb.
fn triangles(scene: &Scene) -> usize {
    scene.meshes.last().expect("the limb").triangles.len()
}

fn show(scene: &mut Scene, k: usize) {
    let instance = scene.instances.last_mut().expect("the limb is the last");
    instance.keyframes.blend = [(k, 1.0), (0, 0.0), (0, 0.0), (0, 0.0)];
    instance.mesh = instance.keyframes.meshes[k];
}

fn strategies(tracer: Tracer) -> Vec<Strategy> {
    let has = |s: &Strategy| tracer == Tracer::Bvh || *s != Strategy::Selector;
    // Between keyframes there is nothing to compare with the others.
    let same = |s: &Strategy| *s != Strategy::Interpolate;
    Strategy::ALL.iter().copied().filter(has).filter(same).collect()
}

/// A rig with its samples for each strategy, in turns, over keyframes that follow each other erratically.
fn samples(
    machine: &Machine,
    tracer: Tracer,
    strategies: &[Strategy],
    scene: impl Fn(Strategy) -> Result<Scene>,
    frames: u32,
) -> Result<Vec<(Rig, Vec<Sample>)>> {
    let mut rigs = Vec::new();
    for &strategy in strategies {
        let rig = Rig::new(machine, scene(strategy)?, tracer)?;
        rigs.push((rig, Vec::new()));
    }
    for i in 0..frames as usize + 2 {
        for (rig, samples) in &mut rigs {
            // Steps of 3 of 7 visit every keyframe, none after its neighbour.
            show(&mut rig.scene, (3 * i + 1) % KEYFRAMES);
            let sample = rig.frame()?;
            if i >= 2 {
                samples.push(sample);
            }
        }
    }
    Ok(rigs)
}

/// One limb of so many triangles that a tree takes long to build.
pub fn large() -> Result<Scene> {
    let mut scene = limb(8, 0.0, Strategy::Exchange)?;
    let limb = scene.instances.last_mut().expect("the limb is the last");
    limb.keyframes = Keyframes::default();
    scene.name = "limb of 1.3 million".into();
    Ok(scene)
}

pub fn run(machine: &Machine, arguments: &Arguments) -> Result<()> {
    if let Some(scenes) = &arguments.splits {
        return splits::run(machine, scenes, arguments.frames);
    }
    let mut results = Vec::new();
    for &tracer in &machine.tracers {
        let swap = swap(machine, tracer, arguments)?;
        let sweep = sweep(machine, tracer, arguments)?;
        results.push(json!({ "tracer": tracer.to_string(), "swap": swap, "sweep": sweep }));
    }
    let builds = match machine.device.supports_acceleration_structure() {
        true => builds::run(machine, &arguments.subdivisions)?,
        false => Value::Null,
    };
    let all = json!({
        "machine": machine.provenance,
        "frames": arguments.frames,
        "tracers": results,
        "device_builds": builds,
    });
    write_json(&machine.output, "crossover", &all)
}

/// Measures the cost of a change of keyframe by its triangles, 20 mm apart.
fn swap(machine: &Machine, tracer: Tracer, arguments: &Arguments) -> Result<Value> {
    let strategies = strategies(tracer);
    let mut table = Table::new(
        format!("Change of keyframe, {tracer}: structures, ms (median, p99)"),
        &["triangles", "strategy", "AS ms", "AS p99", "frame ms", "MB"],
    );
    let mut curves: Vec<Curve> =
        strategies.iter().map(|s| Curve::line(s.to_string(), Vec::new())).collect();
    let mut rows = Vec::new();
    for &subdivisions in &arguments.subdivisions {
        let scene = |s| limb(subdivisions, 20.0, s);
        let triangles = triangles(&scene(Strategy::Exchange)?);
        for (curve, &strategy) in curves.iter_mut().zip(&strategies) {
            // One at a time: eight keyframes of a million triangles by eight strategies do not fit.
            let found = samples(machine, tracer, &[strategy], scene, arguments.frames)?;
            let (rig, samples) = &found[0];
            let structures = Statistics::of(samples.iter().map(|s| s.structures));
            let frame = Statistics::of(samples.iter().map(|s| s.frame));
            let megabytes = rig.simulator.memory().total() as f64 / 1e6;
            curve.points.push([triangles as f64, structures.median.max(1e-4)]);
            table.add(vec![
                triangles.to_string(),
                strategy.to_string(),
                ms(structures.median),
                ms(structures.p99),
                ms(frame.median),
                format!("{megabytes:.1}"),
            ]);
            rows.push(json!({
                "triangles": triangles,
                "strategy": strategy.to_string(),
                "structures_ms": structures,
                "frame_ms": frame,
                "world_mb": megabytes,
            }));
        }
    }
    table.print();
    table.csv(&machine.output, &format!("swap-{tracer}"))?;
    let plot = Plot {
        title: format!("Cost of a change of keyframe, {tracer}"),
        axes: ["triangles per keyframe".into(), "ms".into()],
        logarithmic: [true, true],
        curves,
    };
    write_plot(&machine.output, &format!("swap-{tracer}"), &plot)?;
    Ok(Value::Array(rows))
}

/// Measures from which distance rebuilding pays: a whole frame's structures and trace.
fn sweep(machine: &Machine, tracer: Tracer, arguments: &Arguments) -> Result<Value> {
    let lasting = match tracer {
        Tracer::Bvh => Strategy::Selector,
        Tracer::RayQuery => Strategy::Mask,
    };
    let compared = [lasting, Strategy::Exchange, Strategy::Rebuild];
    let mut table = Table::new(
        format!("Distance between keyframes, {tracer}: structures and trace, ms"),
        &[
            "triangles",
            "distance mm",
            "SA(child)/SA(union)",
            "F1/ray",
            "kept ms",
            "exchange ms",
            "rebuild ms",
        ],
    );
    let (mut rows, mut curves) = (Vec::new(), Vec::new());
    for &subdivisions in &arguments.sweep {
        let mut lines = compared.map(|_| Vec::new());
        let mut triangles = 0;
        for &distance in &arguments.distances {
            let scene = |s| limb(subdivisions, distance, s);
            let found = samples(machine, tracer, &compared, scene, arguments.frames)?;
            let cost =
                |i: usize| Statistics::of(found[i].1.iter().map(|s| s.structures + s.trace)).median;
            let costs = [cost(0), cost(1), cost(2)];
            for (line, cost) in lines.iter_mut().zip(costs) {
                line.push([distance, cost]);
            }
            let still = scene(lasting)?;
            triangles = self::triangles(&still);
            let ratio = ratio(&still);
            let false_unions = match tracer {
                Tracer::Bvh => Some(false_unions(machine, still)?),
                Tracer::RayQuery => None,
            };
            table.add(vec![
                triangles.to_string(),
                distance.to_string(),
                format!("{ratio:.3}"),
                false_unions.map_or("-".into(), |f| format!("{f:.3}")),
                ms(costs[0]),
                ms(costs[1]),
                ms(costs[2]),
            ]);
            rows.push(json!({
                "triangles": triangles, "distance_mm": distance, "area_ratio": ratio,
                "false_unions_per_ray": false_unions,
                lasting.to_string(): costs[0], "exchange": costs[1], "rebuild": costs[2],
            }));
        }
        let labelled = compared.iter().zip(lines);
        curves.extend(labelled.map(|(s, line)| Curve::line(format!("{s}, {triangles}"), line)));
        crossing(&rows, triangles, &lasting.to_string());
    }
    table.print();
    table.csv(&machine.output, &format!("crossover-{tracer}"))?;
    let plot = Plot {
        title: format!("Structures and trace, {tracer}, by triangles"),
        axes: ["distance between keyframes, mm".into(), "ms".into()],
        logarithmic: [false, false],
        curves,
    };
    write_plot(&machine.output, &format!("crossover-{tracer}"), &plot)?;
    Ok(Value::Array(rows))
}

/// Prints the distance from which a rebuild is cheaper than the strategy that keeps all keyframes.
fn crossing(rows: &[Value], triangles: usize, lasting: &str) {
    let of = |row: &&Value| row["triangles"] == triangles;
    let cheaper = |row: &&Value| row["rebuild"].as_f64() < row[lasting].as_f64();
    let text = match rows.iter().filter(of).find(cheaper) {
        Some(row) => format!("rebuild is cheaper than {lasting} from {} mm on", row["distance_mm"]),
        None => format!("{lasting} is cheaper than rebuild at every distance"),
    };
    insonify::output::line(format_args!("{triangles} triangles: {text}"));
}

/// Surface of a keyframe's box over that of the box around all: of isotropic lines that meet the
/// latter this share meets the former.
fn ratio(scene: &Scene) -> f64 {
    let area = |[low, high]: [[f32; 3]; 2]| {
        let [x, y, z] = [0, 1, 2].map(|i| f64::from(high[i] - low[i]));
        x * y + y * z + z * x
    };
    let limb = scene.meshes.iter().rev().take(KEYFRAMES);
    let boxes: Vec<_> = limb.map(|mesh| mesh.bounds()).collect();
    let union = boxes.iter().copied().reduce(|[a, b], [c, d]| {
        let pick =
            |f: fn(f32, f32) -> f32, p: [f32; 3], q: [f32; 3]| [0, 1, 2].map(|i| f(p[i], q[i]));
        [pick(f32::min, a, c), pick(f32::max, b, d)]
    });
    let mean = crate::measure::mean(boxes.into_iter().map(area));
    union.map_or(1.0, |union| mean / area(union))
}

/// False intersections of the union box per ray, over all keyframes.
fn false_unions(machine: &Machine, scene: Scene) -> Result<f64> {
    let mut rig = Rig::new(machine, scene, Tracer::Bvh)?;
    rig.simulator.count(&machine.library, true).into_diagnostic()?;
    let (mut missed, mut rays) = (0.0, 0.0);
    for k in 0..KEYFRAMES {
        show(&mut rig.scene, k);
        rig.frame()?;
        let counters = rig.simulator.counters().into_diagnostic()?;
        missed += f64::from(counters.false_unions);
        rays += f64::from(counters.rays);
    }
    Ok(missed / rays)
}
