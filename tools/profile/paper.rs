//! `profile paper`: the paper's tables again. Starkov et al. 2019 measured on a GeForce GTX 970 with
//! scenes of their own; what compares is the ratio within a table.

use std::path::{Path, PathBuf};

use insonify::output;
use insonify::scene::{Scene, Strategy};
use insonify::sim::Tracer;
use miette::{Context, IntoDiagnostic, Result};
use serde_json::{Value, json};

use crate::Machine;
use crate::measure::{Rig, Statistics, mean};
use crate::strategies::{by, period};
use crate::table::{Table, ms, write_json};

#[derive(clap::Args)]
pub struct Arguments {
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
    /// Overrides an entry of both scene files, e.g. --set probe.preset=paper-table1.
    #[arg(long = "set", value_name = "PATH=VALUE", value_parser = insonify::scene::file::override_of)]
    overrides: Vec<(String, String)>,
    /// Writes the medians: {"tables": {"II": {"static_ms", "transform_ms"}, "III": {...}}}.
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

/// Two ways to image the same things, ms per frame.
struct Pair {
    still: f64,
    animated: f64,
    triangles: usize,
}

impl Pair {
    /// How much more the animation costs, percent.
    fn excess(&self) -> f64 {
        100.0 * (self.animated / self.still - 1.0)
    }
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
    let (fetus, heart) = (
        load(&arguments.fetus, "fetus.toml")?,
        load(&arguments.heart, "heart.toml")?,
    );
    let mut all = Vec::new();
    for &tracer in &machine.tracers {
        let two = transform(machine, &fetus, tracer, arguments)?;
        let three = selector(machine, &heart, tracer, arguments)?;
        let mut table = Table::new(
            format!(
                "{tracer}: ms per frame, {} rounds, interleaved",
                arguments.rounds
            ),
            &[
                "table",
                "",
                "triangles",
                "static ms",
                "animated ms",
                "difference",
                "paper: triangles",
                "static ms",
                "animated ms",
                "difference",
            ],
        );
        let mut row = |name: &str, what: &str, pair: &Pair, paper: [f64; 3]| {
            table.add(vec![
                name.into(),
                what.into(),
                pair.triangles.to_string(),
                ms(pair.still),
                ms(pair.animated),
                format!("{:+.1} %", pair.excess()),
                format!("{}", paper[0]),
                ms(paper[1]),
                ms(paper[2]),
                format!("{:+.1} %", 100.0 * (paper[2] / paper[1] - 1.0)),
            ]);
        };
        // Tables II (without the paper's fusion) and III.
        row("II", "transform nodes", &two, [934e3, 85.6, 87.7]);
        row("III", "selector node", &three, [7.3e3, 65.0, 64.1]);
        table.print();
        table.csv(&machine.output, &format!("paper-{tracer}"))?;
        all.push(json!({
            "tracer": tracer.to_string(),
            "tables": {
                "II": { "static_ms": two.still, "transform_ms": two.animated },
                "III": { "static_ms": three.still, "selector_ms": three.animated },
            },
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
        still: Statistics::of(still).median,
        animated: Statistics::of(animated).median,
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
        still: part(0),
        animated: part(1),
        triangles: scene.triangles(),
    })
}
