//! `profile paper`: the paper's tables measured again. Starkov et al. 2019 used a GeForce GTX 970 and
//! scenes of their own; only the ratios within a table can be compared.

use std::path::PathBuf;

use insonify::output;
use insonify::scene::{Scene, Strategy};
use insonify::sim::Tracer;
use miette::{Context, IntoDiagnostic, Result};
use serde_json::{Value, json};

use crate::Machine;
use crate::fusion;
use crate::measure::{Rig, Statistics, mean};
use crate::strategies::{by, period};
use crate::table::{Table, ms, write_json};

#[derive(clap::Args)]
pub struct Arguments {
    /// One of the tables alone.
    #[arg(long, value_enum)]
    only: Option<Which>,
    /// Scene of Tables I and II, with an acquired volume and transform nodes, imaged by the paper's probe [default: the
    /// shipped scenes/pregnancy.toml]. The paper's had 929 and 934 thousand triangles: `anatomy -- fetus --triangles
    /// 930000 -o DIR` and `anatomy -- pregnancy -o DIR` make as many.
    #[arg(long, value_name = "SCENE")]
    fetus: Option<PathBuf>,
    /// Scene of Table III, with a selector [default: the shipped scenes/heart.toml].
    #[arg(long, value_name = "SCENE")]
    heart: Option<PathBuf>,
    /// Few frames, of 96 scanlines and 3 layers.
    #[arg(long)]
    quick: bool,
    /// Frames of Table I, simulated and fused [default: 5; 2 with --quick].
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    frames: Option<u32>,
    /// Poses of Table II [default: 24; 6 with --quick].
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    poses: Option<u32>,
    /// Measurements of each pose and keyframe [default: 3; 1 with --quick].
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    rounds: Option<u32>,
    /// Overrides an entry of all scene files, e.g. --set probe.scanlines=64.
    #[arg(long = "set", value_name = "PATH=VALUE", value_parser = insonify::scene::file::override_of)]
    overrides: Vec<(String, String)>,
    /// Writes the figures: {"tables": {"I": {"simulated_ms", "fused_ms"}, "II": {...}, "III": {...}}}.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// The probe's settings with `--quick`.
const QUICK: [(&str, &str); 2] = [("probe.scanlines", "96"), ("probe.elevation_layers", "3")];

/// Number of frames, poses and rounds to measure.
struct Plan {
    frames: u32,
    poses: u32,
    rounds: u32,
    overrides: Vec<(String, String)>,
}

impl Arguments {
    fn plan(&self) -> Plan {
        let [frames, poses, rounds] = if self.quick { [2, 6, 1] } else { [5, 24, 3] };
        let smaller = QUICK.map(|(key, value)| (key.to_owned(), value.to_owned()));
        let own = if self.quick { &smaller[..] } else { &[] };
        Plan {
            frames: self.frames.unwrap_or(frames),
            poses: self.poses.unwrap_or(poses),
            rounds: self.rounds.unwrap_or(rounds),
            overrides: [own, &self.overrides[..]].concat(),
        }
    }
}

#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Which {
    /// Fusion.
    #[value(name = "i")]
    One,
    /// Transform nodes.
    #[value(name = "ii")]
    Two,
    /// Selector nodes.
    #[value(name = "iii")]
    Three,
}

/// Mean times of two methods that image the same things, ms per frame.
struct Pair {
    first: f64,
    second: f64,
    /// Deviations over the keyframes, if there are any.
    deviations: Option<[f64; 2]>,
    triangles: usize,
}

/// Two methods, their names in JSON, and the paper's figures: thousand triangles, ms, and their deviations.
struct Entry {
    number: &'static str,
    what: String,
    keys: [&'static str; 2],
    pair: Pair,
    paper: Paper,
}

#[derive(Clone, Copy)]
struct Paper {
    triangles: f64,
    ms: [f64; 2],
    deviations: Option<[f64; 2]>,
}

const TABLE_II: Paper = Paper { triangles: 934.0, ms: [85.6, 87.7], deviations: None };
/// The deviation is that of the static hearts.
const TABLE_III: Paper =
    Paper { triangles: 7.3, ms: [65.0, 64.1], deviations: Some([0.63, f64::NAN]) };

pub fn run(machine: &Machine, arguments: &Arguments) -> Result<()> {
    let plan = arguments.plan();
    let wanted = |table: Which| arguments.only.is_none_or(|only| only == table);
    let file = |given: &Option<PathBuf>, name: &str| {
        let shipped = || {
            let scenes = insonify_tools::root().join("scenes");
            scenes.join(name)
        };
        given.clone().unwrap_or_else(shipped)
    };
    let fetus = match wanted(Which::One) || wanted(Which::Two) {
        true => {
            let file = file(&arguments.fetus, "pregnancy.toml");
            Some(fusion::Scenes::load(&file, &plan.overrides)?)
        }
        false => None,
    };
    let heart = match wanted(Which::Three) {
        true => Some(Scene::load(&file(&arguments.heart, "heart.toml"), &plan.overrides)?.0),
        false => None,
    };
    let mut all = Vec::new();
    for &tracer in &machine.tracers {
        let mut entries = Vec::new();
        let mut details = Value::Null;
        if let Some(scenes) = fetus.as_ref().filter(|_| wanted(Which::One)) {
            let one = fusion::run(machine, scenes, tracer, plan.frames)?;
            details = one.details;
            entries.push(Entry {
                number: "I",
                what: "simulated / fused".into(),
                keys: ["simulated_ms", "fused_ms"],
                pair: Pair {
                    first: one.simulated,
                    second: one.fused,
                    deviations: None,
                    triangles: one.triangles,
                },
                paper: Paper { triangles: 929.0, ms: fusion::PAPER, deviations: None },
            });
        }
        if let Some(scenes) = fetus.as_ref().filter(|_| wanted(Which::Two)) {
            entries.push(Entry {
                number: "II",
                what: "static / transform nodes, both fused".into(),
                keys: ["static_ms", "transform_ms"],
                pair: transform(machine, &scenes.fused, tracer, &plan)?,
                paper: TABLE_II,
            });
        }
        if let Some(heart) = &heart {
            // Vulkan nests no more structures: by ray query all keyframes are in the top level, under masks.
            let selector = match tracer {
                Tracer::Bvh => (Strategy::Selector, "selector node (union box)", "III"),
                Tracer::RayQuery => (Strategy::Mask, "masked keyframes", "III (mask)"),
            };
            let exchange = (Strategy::Exchange, "node exchange", "III (exchange)");
            let ways = [selector, exchange];
            let pairs = keyframed(machine, heart, tracer, ways.map(|(s, ..)| s), &plan)?;
            for ((_, name, number), pair) in ways.into_iter().zip(pairs) {
                entries.push(Entry {
                    number,
                    what: format!("static / {name}"),
                    keys: ["static_ms", "animated_ms"],
                    pair,
                    paper: TABLE_III,
                });
            }
        }
        report(machine, tracer, &entries)?;
        let tables: serde_json::Map<String, Value> = entries.iter().map(json_of).collect();
        all.push(json!({
            "tracer": tracer.to_string(), "tables": tables, "fusion": details,
        }));
    }
    if let Some(file) = &arguments.json {
        // The tables of the tracer that a frame uses by default: the last.
        let tables = all.last().map_or(Value::Null, |one| one["tables"].clone());
        let text = serde_json::to_string_pretty(&json!({ "tables": tables })).into_diagnostic()?;
        std::fs::write(file, text + "\n")
            .into_diagnostic()
            .wrap_err_with(|| format!("cannot write {}", file.display()))?;
        output::line(file.display());
    }
    let provenance = &machine.provenance;
    write_json(&machine.output, "paper", &json!({ "machine": provenance, "runs": all }))
}

fn json_of(entry: &Entry) -> (String, Value) {
    let [first, second] = entry.keys;
    let Pair { first: a, second: b, deviations, triangles } = entry.pair;
    let mut values = json!({ first: a, second: b, "triangles": triangles });
    if let Some(deviations) = deviations {
        values["deviations_ms"] = json!(deviations);
    }
    (entry.number.to_owned(), values)
}

fn report(machine: &Machine, tracer: Tracer, entries: &[Entry]) -> Result<()> {
    let mut table = Table::new(
        format!(
            "{tracer}: median ms per frame, the two ways in turns; III: mean and deviation over the keyframes"
        ),
        &[
            "table",
            "ways",
            "thousand triangles",
            "first ms",
            "second ms",
            "difference",
            "frames/s",
            "paper: triangles",
            "first ms",
            "second ms",
            "difference",
            "frames/s",
        ],
    );
    for entry in entries {
        let (pair, paper) = (&entry.pair, &entry.paper);
        let ours = [pair.first, pair.second];
        let mut row = vec![
            entry.number.into(),
            entry.what.clone(),
            format!("{:.1}", pair.triangles as f64 / 1e3),
        ];
        row.extend(figures(ours, pair.deviations));
        row.push(format!("{}", paper.triangles));
        row.extend(figures(paper.ms, paper.deviations));
        table.add(row);
    }
    table.print();
    table.csv(&machine.output, &format!("paper-{tracer}"))
}

/// Both times, the surplus of the second, and the frames per second of both.
fn figures(times: [f64; 2], deviations: Option<[f64; 2]>) -> [String; 4] {
    let shown = |i: usize| match deviations.map(|d| d[i]).filter(|d| d.is_finite()) {
        Some(deviation) => format!("{} ± {}", ms(times[i]), ms(deviation)),
        None => ms(times[i]),
    };
    let [first, second] = times;
    [
        shown(0),
        shown(1),
        format!("{:+.1} %", 100.0 * (second / first - 1.0)),
        format!("{:.1} / {:.1}", 1e3 / first, 1e3 / second),
    ]
}

/// Table II: every pose imaged when it has just been taken, and again while nothing moves.
fn transform(machine: &Machine, scene: &Scene, tracer: Tracer, plan: &Plan) -> Result<Pair> {
    let mut rig = Rig::new(machine, scene.clone(), tracer)?;
    rig.frame()?;
    let (mut still, mut animated) = (Vec::new(), Vec::new());
    for round in 0..plan.rounds {
        for pose in 0..plan.poses {
            // Half a second apart: unlike poses.
            let seconds = 0.5 * f64::from(pose);
            let moved = |rig: &mut Rig| rig.frame_at(seconds);
            if round % 2 == 0 {
                animated.push(moved(&mut rig)?.frame);
                still.push(rig.frame()?.frame);
            } else {
                // The other order, lest the second of two frames be favoured.
                moved(&mut rig)?;
                still.push(rig.frame()?.frame);
                rig.frame_at(seconds + 0.25)?;
                animated.push(moved(&mut rig)?.frame);
            }
        }
    }
    Ok(Pair {
        first: Statistics::of(still).median,
        second: Statistics::of(animated).median,
        deviations: None,
        triangles: scene.triangles(),
    })
}

/// Table III: the beating heart by each of `strategies` against one that stands still in each keyframe and has its
/// tight box, all in turns; medians over the rounds, then mean and deviation over the keyframes as in the paper.
fn keyframed(
    machine: &Machine,
    scene: &Scene,
    tracer: Tracer,
    strategies: [Strategy; 2],
    plan: &Plan,
) -> Result<[Pair; 2]> {
    let [first, second] = strategies.map(|strategy| by(scene, strategy));
    let keyframes = first.instances.iter().map(|i| i.keyframes.meshes.len());
    let count = keyframes.max().unwrap_or(0);
    let step = period(scene).unwrap_or(1.0) / count as f64;
    let still = by(scene, Strategy::Exchange);
    let mut rigs = Vec::new();
    for scene in [still, first, second] {
        let mut rig = Rig::new(machine, scene, tracer)?;
        rig.frame()?;
        rigs.push(rig);
    }
    let mut found = vec![[const { Vec::new() }; 3]; count];
    for round in 0..plan.rounds as usize {
        for (k, found) in found.iter_mut().enumerate() {
            let seconds = (k as f64 + 0.5) * step;
            // Each time another one is first.
            for way in (0..3).map(|i| (i + round + k) % 3) {
                // After a frame of its own, which has its data at hand: of the keyframe before, or of the same where
                // nothing moves.
                let before = if way == 0 { seconds } else { seconds - step };
                rigs[way].frame_at(before)?;
                found[way].push(rigs[way].frame_at(seconds)?.frame);
            }
        }
    }
    let of = |way: usize| -> [f64; 2] {
        let median = |times: &[Vec<f64>; 3]| Statistics::of(times[way].iter().copied()).median;
        let medians: Vec<f64> = found.iter().map(median).collect();
        let middle = mean(medians.iter().copied());
        let squares = medians.iter().map(|m| (m - middle).powi(2));
        let degrees = (count.max(2) - 1) as f64;
        [middle, (squares.sum::<f64>() / degrees).sqrt()]
    };
    let [first, a] = of(0);
    Ok([1, 2].map(|way| {
        let [second, b] = of(way);
        Pair { first, second, deviations: Some([a, b]), triangles: scene.triangles() }
    }))
}
