//! `insonify task`: scores of recorded trajectories at the tasks of a scene.

use std::path::{Path, PathBuf};

use clap::Args;
use insonify::issue::FileError;
use insonify::output;
use insonify::scene::task::{Goal, Task};
use insonify::scene::{Scene, file};
use insonify::settings::{Words, suggest};
use insonify::sim::contact::{Coupling, Skins};
use insonify::sim::seen;
use insonify::sim::shaders::Library;
use insonify::teach::history::{self, Entry};
use insonify::teach::{self, Attempt, Path as Way, Score};
use miette::{IntoDiagnostic, Result, miette};

use super::common::{self, Common};

/// Arguments of `insonify task`.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Scene file (.toml) with [[task]], or the name of a scene that ships. Alone, it lists the tasks.
    #[arg(value_parser = common::scene_file())]
    scene: PathBuf,
    /// The task, by its name; needed where the scene has several.
    #[arg(long, value_name = "NAME")]
    task: Option<String>,
    /// A trajectory (.csv, .toml), as the window records them, or several: each is an attempt.
    #[arg(long, value_name = "FILE", num_args = 1..)]
    trajectory: Vec<PathBuf>,
    /// What the learner measured, in the unit that the task names.
    #[arg(long, value_name = "NUMBER", allow_hyphen_values = true)]
    measured: Option<f64>,
    /// The answer that the learner chose, in its words.
    #[arg(long, value_name = "TEXT")]
    answer: Option<String>,
    /// Adds the scores to the history of this learner.
    #[arg(long, value_name = "NAME", requires = "history")]
    learner: Option<String>,
    /// Folder of the histories: NAME.csv and NAME.json.
    #[arg(long, value_name = "DIR", requires = "learner")]
    history: Option<PathBuf>,
    /// Prints the scores as JSON.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    common: Common,
}

/// Runs the command.
///
/// # Errors
/// Mistakes of the files, a task that is not there, an error of the device.
pub fn run(args: &Arguments) -> Result<()> {
    if let (Some(folder), Some(learner)) = (&args.history, &args.learner) {
        history::read(folder, learner)?;
    }
    let scene = args.common.scene(&args.scene)?;
    let mut attempts = Vec::new();
    for path in &args.trajectory {
        let track = file::load_trajectory(path)?;
        attempts.push((Some(path), Way::of(&track, &scene.world_from_probe)));
    }
    let says = args.measured.is_some() || args.answer.is_some();
    if attempts.is_empty() && says {
        attempts.push((None, Way::default()));
    }
    if attempts.is_empty() && args.task.is_none() {
        list(args, &scene)?;
        return Ok(());
    }
    let task = find(args, &scene)?;
    if attempts.is_empty() {
        return Err(miette!(
            help = "give --trajectory FILE, --measured NUMBER or --answer TEXT",
            "there is nothing to score"
        ));
    }
    let answer = answer(args, task)?;
    let mut scores = Vec::new();
    for (path, way) in attempts {
        let seen = seen_at_end(args, &scene, task, &way)?;
        let kept = way.way();
        let attempt = Attempt { path: way, seen, measured: args.measured, answer, guided: false };
        let score = scored(&scene, task, &attempt);
        if !args.json {
            print(path.map(PathBuf::as_path), task, &score);
        }
        if let (Some(folder), Some(learner)) = (&args.history, &args.learner) {
            history::add(folder, &Entry::now(learner, &scene.name, score.clone(), kept))?;
        }
        let mut json = serde_json::to_value(&score).into_diagnostic()?;
        json["trajectory"] = path.map(|path| path.display().to_string()).into();
        scores.push(json);
    }
    if args.json {
        output::line(output::json(&scores).trim_end());
    }
    Ok(())
}

/// The task that is asked for.
fn find<'s>(args: &Arguments, scene: &'s Scene) -> Result<&'s Task, FileError> {
    let fail = |message: String, remedy: String| FileError::file(&args.scene, message, remedy);
    match (&args.task, &scene.tasks[..]) {
        (_, []) => Err(fail(
            "the scene has no tasks".to_owned(),
            "add one as [[task]]; docs/scenes.md says what it takes".to_owned(),
        )),
        (None, [only]) => Ok(only),
        (None, tasks) => Err(fail(
            format!("the scene has {} tasks", tasks.len()),
            format!("choose one with --task: {}", names(tasks).join(", ")),
        )),
        (Some(name), tasks) => tasks.iter().find(|task| task.name == *name).ok_or_else(|| {
            let remedy = suggest::among(name, tasks.iter().map(|task| task.name.as_str()));
            fail(format!("there is no task `{name}`"), remedy)
        }),
    }
}

fn names(tasks: &[Task]) -> Vec<String> {
    tasks.iter().map(|task| format!("`{}`", task.name)).collect()
}

/// The answer's index; a measurement or an answer that the task does not ask for is a mistake.
fn answer(args: &Arguments, task: &Task) -> Result<Option<usize>> {
    let asks = [matches!(task.goal, Goal::Measure(_)), matches!(task.goal, Goal::Question(_))];
    let given = [args.measured.is_some(), args.answer.is_some()];
    for (i, option) in ["--measured", "--answer"].into_iter().enumerate() {
        if given[i] && !asks[i] {
            let name = &task.name;
            return Err(miette!(help = "leave it out", "the task `{name}` takes no {option}"));
        }
    }
    match (&task.goal, &args.answer) {
        (Goal::Question(question), Some(text)) => match question.choice(text) {
            Some(choice) => Ok(Some(choice)),
            None => {
                let help = suggest::among(text, question.choices.iter().map(String::as_str));
                Err(miette!(help = help, "`{text}` is none of the answers"))
            }
        },
        _ => Ok(None),
    }
}

/// The areas of the structures to be seen, from where the trajectory ends.
fn seen_at_end(
    args: &Arguments,
    scene: &Scene,
    task: &Task,
    way: &Way,
) -> Result<Option<Vec<f64>>> {
    let (Goal::Show(cover), Some(last)) = (&task.goal, way.last()) else { return Ok(None) };
    let mut scene = scene.clone();
    scene.world_from_probe = last;
    let device = args.common.device()?;
    args.common.settle(&mut scene, &device);
    let tracer = args.common.tracer(&device, &scene)?;
    let found = seen::areas(&device, &Library::embedded(), &scene, tracer, &cover.instances);
    args.common.validated(&device)?;
    found.map(Some).into_diagnostic()
}

/// The score, with the contact that the scene asks for.
fn scored(scene: &Scene, task: &Task, attempt: &Attempt) -> Score {
    let mut skins = Skins::default();
    let mut touch = |pose: &glam::DAffine3| {
        Coupling::at(scene, pose, &mut skins).map_or(1.0, |found| found.touch.share)
    };
    let touch: Option<&mut teach::score::Touch<'_>> =
        if scene.contact.is_some() { Some(&mut touch) } else { None };
    Score::of(scene, task, attempt, touch)
}

fn list(args: &Arguments, scene: &Scene) -> Result<()> {
    if scene.tasks.is_empty() {
        find(args, scene)?;
    }
    for task in &scene.tasks {
        output::line(format_args!("{}: {}", task.name, task.text));
        if let Goal::Measure(measurement) = &task.goal {
            output::line(format_args!("   --measured in {}", measurement.unit.word()));
        }
        if let Goal::Question(question) = &task.goal {
            output::line(format_args!("   --answer one of: {}", question.choices.join(", ")));
        }
    }
    Ok(())
}

fn print(path: Option<&Path>, task: &Task, score: &Score) {
    if let Some(path) = path {
        output::line(format_args!("{}", path.display()));
    }
    let verdict = if score.reached { "reached" } else { "not reached" };
    output::line(format_args!("{}: {verdict}", task.name));
    for reason in &score.reasons {
        output::line(format_args!("   {reason}"));
    }
    for line in score.lines() {
        output::line(format_args!("   {line}"));
    }
    if let (Goal::Question(question), true) = (&task.goal, score.answer.is_some())
        && !question.explanation.is_empty()
    {
        output::line(format_args!("   {}", question.explanation));
    }
}
