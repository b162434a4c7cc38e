//! `profile paper`: the paper's tables again. Starkov et al. 2019 measured on a GeForce GTX 970 with
//! scenes of their own; what compares is the ratio within a table.

use std::path::{Path, PathBuf};

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
    #[command(flatten)]
    fusion: fusion::Options,
    /// One of the tables alone.
    #[arg(long, value_enum)]
    only: Option<Which>,
    /// Scene of Table II, with transform nodes [default: the shipped scenes/fetus.toml].
    #[arg(long)]
    fetus: Option<PathBuf>,
    /// Scene of Table III, with a selector [default: the shipped scenes/heart.toml].
    #[arg(long)]
    heart: Option<PathBuf>,
    /// Strategy of the selector.
    #[arg(long, default_value = "selector", value_parser = strategy)]
    strategy: Strategy,
    /// Poses of Table II.
    #[arg(long, default_value_t = 24)]
    poses: u32,
    /// How often each pose and keyframe is measured.
    #[arg(long, default_value_t = 3)]
    rounds: u32,
    /// Overrides an entry of all scene files, e.g. --set probe.scanlines=64.
    #[arg(long = "set", value_name = "PATH=VALUE", value_parser = insonify::scene::file::override_of)]
    overrides: Vec<(String, String)>,
    /// Writes the medians: {"tables": {"I": {"simulated_ms", "fused_ms"}, "II": {...}, "III": {...}}}.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

fn strategy(text: &str) -> Result<Strategy, String> {
    let found = Strategy::ALL.into_iter().find(|s| s.to_string() == text);
    found.ok_or_else(|| {
        let all: Vec<_> = Strategy::ALL.iter().map(Strategy::to_string).collect();
        format!(
            "there is no strategy '{text}'; there are {}",
            all.join(", ")
        )
    })
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

/// Two ways to image the same things, ms per frame.
struct Pair {
    first: f64,
    second: f64,
    triangles: usize,
}

/// Two ways, what they are called in JSON, and what the paper says: thousand triangles and ms.
struct Entry {
    number: &'static str,
    what: &'static str,
    keys: [&'static str; 2],
    pair: Pair,
    paper: [f64; 3],
}

pub fn run(machine: &Machine, arguments: &Arguments) -> Result<()> {
    let shipped = |name: &str| {
        Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("scenes")
            .join(name)
    };
    let load = |given: &Option<PathBuf>, name| {
        let file = given.clone().unwrap_or_else(|| shipped(name));
        Scene::load(&file, &arguments.overrides).map(|(scene, _)| scene)
    };
    let wanted = |table: Which| arguments.only.is_none_or(|only| only == table);
    let scenes = match wanted(Which::One) {
        true => Some(fusion::Scenes::load(
            &arguments.fusion,
            &arguments.overrides,
        )?),
        false => None,
    };
    let fetus = match wanted(Which::Two) {
        true => Some(load(&arguments.fetus, "fetus.toml")?),
        false => None,
    };
    let heart = match wanted(Which::Three) {
        true => Some(load(&arguments.heart, "heart.toml")?),
        false => None,
    };
    let mut all = Vec::new();
    for &tracer in &machine.tracers {
        let mut entries = Vec::new();
        let mut details = Value::Null;
        if let Some(scenes) = &scenes {
            let one = fusion::run(machine, scenes, tracer, arguments.fusion.frames)?;
            details = one.details;
            entries.push(Entry {
                number: "I",
                what: "simulated / fused",
                keys: ["simulated_ms", "fused_ms"],
                pair: Pair {
                    first: one.simulated,
                    second: one.fused,
                    triangles: one.triangles,
                },
                paper: [929.0, fusion::PAPER[0], fusion::PAPER[1]],
            });
        }
        // The paper's with fusion, here without.
        if let Some(fetus) = &fetus {
            entries.push(Entry {
                number: "II",
                what: "static / transform nodes",
                keys: ["static_ms", "transform_ms"],
                pair: transform(machine, fetus, tracer, arguments)?,
                paper: [934.0, 85.6, 87.7],
            });
        }
        if let Some(heart) = &heart {
            entries.push(Entry {
                number: "III",
                what: "static / selector node",
                keys: ["static_ms", "selector_ms"],
                pair: selector(machine, heart, tracer, arguments)?,
                paper: [7.3, 65.0, 64.1],
            });
        }
        report(machine, tracer, &entries)?;
        let tables: serde_json::Map<String, Value> = entries.iter().map(json_of).collect();
        all.push(json!({
            "tracer": tracer.to_string(), "tables": tables, "fusion": details,
        }));
    }
    if let Some(file) = &arguments.json {
        // Of the tracer that a frame takes unless told otherwise: the last.
        let tables = all.last().map_or(Value::Null, |one| one["tables"].clone());
        let text = serde_json::to_string_pretty(&json!({ "tables": tables })).into_diagnostic()?;
        std::fs::write(file, text + "\n")
            .into_diagnostic()
            .wrap_err_with(|| format!("cannot write {}", file.display()))?;
        output::line(file.display());
    }
    let provenance = &machine.provenance;
    write_json(
        &machine.output,
        "paper",
        &json!({ "machine": provenance, "runs": all }),
    )
}

fn json_of(entry: &Entry) -> (String, Value) {
    let [first, second] = entry.keys;
    let values = json!({ first: entry.pair.first, second: entry.pair.second });
    (entry.number.to_owned(), values)
}

fn report(machine: &Machine, tracer: Tracer, entries: &[Entry]) -> Result<()> {
    let mut table = Table::new(
        format!("{tracer}: median ms per frame, the two ways in turns"),
        &[
            "table",
            "ways",
            "thousand triangles",
            "first ms",
            "second ms",
            "difference",
            "paper: triangles",
            "first ms",
            "second ms",
            "difference",
        ],
    );
    let change = |a: f64, b: f64| format!("{:+.1} %", 100.0 * (b / a - 1.0));
    for entry in entries {
        let (pair, paper) = (&entry.pair, entry.paper);
        table.add(vec![
            entry.number.into(),
            entry.what.into(),
            format!("{:.1}", pair.triangles as f64 / 1e3),
            ms(pair.first),
            ms(pair.second),
            change(pair.first, pair.second),
            format!("{}", paper[0]),
            ms(paper[1]),
            ms(paper[2]),
            change(paper[1], paper[2]),
        ]);
    }
    table.print();
    table.csv(&machine.output, &format!("paper-{tracer}"))
}

/// Table II: every pose imaged when it has just been taken, and again while nothing moves.
fn transform(
    machine: &Machine,
    scene: &Scene,
    tracer: Tracer,
    arguments: &Arguments,
) -> Result<Pair> {
    let mut rig = Rig::new(machine, scene.clone(), tracer)?;
    rig.frame()?;
    let (mut still, mut animated) = (Vec::new(), Vec::new());
    for round in 0..arguments.rounds {
        for pose in 0..arguments.poses {
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
        triangles: scene.triangles(),
    })
}

/// Table III: the beating heart against hearts that stand still, one in each keyframe, with the tight
/// box of the strategy `selector`; medians over the rounds, averaged over the keyframes as in the paper.
fn selector(
    machine: &Machine,
    scene: &Scene,
    tracer: Tracer,
    arguments: &Arguments,
) -> Result<Pair> {
    let beating = by(scene, arguments.strategy);
    let mut still = by(scene, Strategy::Selector);
    let count = beating
        .instances
        .iter()
        .map(|i| i.keyframes.meshes.len())
        .max()
        .unwrap_or(0);
    let step = period(scene).unwrap_or(1.0) / count as f64;
    let times: Vec<f64> = (0..count).map(|k| (k as f64 + 0.5) * step).collect();
    let mut stills = Vec::new();
    for &seconds in &times {
        still.set_time(seconds);
        stills.push(Rig::new(machine, still.clone(), tracer)?);
    }
    let mut rig = Rig::new(machine, beating, tracer)?;
    rig.frame()?;
    for still in &mut stills {
        still.frame()?;
    }
    let mut found = vec![[Vec::new(), Vec::new()]; count];
    for _ in 0..arguments.rounds {
        for (k, &seconds) in times.iter().enumerate() {
            found[k][0].push(stills[k].frame()?.frame);
            found[k][1].push(rig.frame_at(seconds)?.frame);
        }
    }
    let part = |i: usize| {
        mean(
            found
                .iter()
                .map(|f| Statistics::of(f[i].iter().copied()).median),
        )
    };
    Ok(Pair {
        first: part(0),
        second: part(1),
        triangles: scene.triangles(),
    })
}
