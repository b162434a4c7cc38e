//! Plans of data sets: what is drawn for each sample, how many there are, and where they go.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use toml::Table;

use super::draws::{Count, Draw, Drawn, draw, word};
use super::pose::Poses;
use super::reading::{self, Read, Target};
use super::split;
use crate::issue;
use crate::output::indexed::NOTHING;
use crate::scene::animation::Track;
use crate::scene::file::{Document, SceneFile, Source, load_trajectory, quoted};
use crate::scene::{Scene, SceneError, Warning};
use crate::settings::units::DURATION;
use crate::settings::{Facts, Form, Quality, suggest};
use crate::sim::calibration::Work;
use crate::sim::labels::KINDS;

/// Largest plan, bytes.
const MAX_PLAN: u64 = 4 << 20;
/// Most samples of a plan: their numbers have nine digits.
const MAX_SAMPLES: u64 = 1_000_000_000;
/// Most classes of a segmentation: a byte, of which one value shows nothing.
const MAX_CLASSES: usize = NOTHING as usize;
/// Samples of a part, unless the plan says it.
const PART: u32 = 100;
/// The scene's time.
pub(super) const TIME: Facts = Facts::quantity(&DURATION, -1e6, 1e6).key("time");

/// A form in which samples are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Format {
    /// A folder of files, `000123.png` and others.
    Folder,
    /// Archives of the same files, one of each part: `train-000007.tar`.
    WebDataset,
}

impl Format {
    /// All, in the order in which they are written.
    pub const ALL: [Self; 2] = [Self::Folder, Self::WebDataset];

    /// Its name in plans, and that of its folder.
    pub fn word(self) -> &'static str {
        match self {
            Self::Folder => "folder",
            Self::WebDataset => "webdataset",
        }
    }
}

/// An array beside the image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Array {
    /// Envelope after TGC, relative to a perfect mirror: [scanline, sample].
    Envelope,
    /// Complex baseband before TGC: [scanline, sample, real and imaginary].
    Iq,
    /// Labels of the image's pixels, by their name in [`KINDS`]: [row, column], some of them with three numbers each.
    Label(&'static str),
}

impl Array {
    /// All that a plan may name. What has moved since the last frame is not among them: a sample has no last frame.
    pub fn all() -> impl Iterator<Item = Self> + Clone {
        let labels = KINDS.iter().map(|kind| kind.name).filter(|name| *name != "displacement");
        [Self::Envelope, Self::Iq].into_iter().chain(labels.map(Self::Label))
    }

    /// Its name in plans and in names of files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Envelope => "envelope",
            Self::Iq => "iq",
            Self::Label(name) => name,
        }
    }
}

/// The tissue that a segmentation shows at a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Segmented {
    /// The one that is seen there: in which the refracted beam is when the echo is made.
    Seen,
    /// The one that the scan plane has there.
    True,
}

/// A plan that has been checked.
pub struct Plan {
    /// Headline of the contact sheet; empty: none.
    pub title: String,
    /// Seed of every draw.
    pub seed: u32,
    /// Path and scatterer counts; none: the scenes' own.
    pub quality: Option<Quality>,
    /// Forms in which samples are written.
    pub formats: Vec<Format>,
    /// Arrays beside the images.
    pub arrays: Vec<Array>,
    /// The tissue that segmentations show.
    pub segmentation: Segmented,
    /// The splits, in their order.
    pub splits: Vec<Split>,
    /// Names of the classes of segmentations, from 0 on: the tissues of all scenes.
    pub classes: Vec<String>,
    pub(super) part: u32,
    pub(super) scenes: Vec<PlanScene>,
    source: Source,
}

/// Samples that are kept apart from others: for training, validation or test.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Split {
    /// Its name in names of files.
    pub name: String,
    /// Numbers of its samples.
    pub samples: Range<u32>,
}

/// A scene of a plan.
pub(super) struct PlanScene {
    pub name: String,
    pub anatomy: String,
    /// Index into the plan's splits.
    pub split: usize,
    /// Numbers of its samples.
    pub samples: Range<u32>,
    pub file: SceneFile,
    pub path: PathBuf,
    /// Entries that are drawn; then variables, time and the parts of the pose.
    pub draws: Vec<Draw>,
    pub poses: Poses,
    /// True where every sample needs the scene to be loaded again.
    pub heavy: bool,
}

/// Samples that are made together: one archive.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part {
    /// Index into [`Plan::splits`].
    pub split: usize,
    /// Its number in the split.
    pub index: u32,
    /// Numbers of its samples.
    pub samples: Range<u32>,
}

/// What was drawn for a sample, but for its pose, which needs the scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample {
    /// Its number in the plan.
    pub number: u32,
    /// Entries of the scene file, path and value.
    pub entries: Vec<(String, String)>,
    /// Numbers among them, in the units used inside.
    pub numbers: Vec<(String, f64)>,
    /// Values of the plan's variables.
    pub variables: Vec<(String, f64)>,
    /// Time of the scene, s.
    pub time: f64,
    /// Seed of the frame.
    pub seed: u32,
    pub(super) scene: usize,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PlanTable {
    #[serde(default)]
    title: String,
    #[serde(default)]
    seed: u32,
    quality: Option<String>,
    formats: Vec<Format>,
    #[serde(default)]
    arrays: Vec<String>,
    #[serde(default = "seen")]
    segmentation: Segmented,
    samples_per_part: Option<u32>,
    #[serde(default)]
    split: Table,
    #[serde(default)]
    variable: Table,
    #[serde(default)]
    draw: Table,
    #[serde(default)]
    scene: Vec<SceneTable>,
}

fn seen() -> Segmented {
    Segmented::Seen
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SceneTable {
    name: String,
    file: String,
    samples: u32,
    anatomy: Option<String>,
    split: Option<String>,
    time: Option<toml::Value>,
    #[serde(default)]
    pose: Table,
    #[serde(default)]
    draw: Table,
}

impl Plan {
    /// Reads a plan, loads every scene that it names and checks every range in it, so that no sample is refused
    /// later. Returns warnings about the scenes as well.
    ///
    /// # Errors
    /// The first mistake, with file, line, column and remedy.
    pub fn load(path: &Path) -> Result<(Self, Vec<Warning>), SceneError> {
        let text = issue::read_text(path, MAX_PLAN, "make several plans of it")?;
        let source = Source::of(path, text);
        let document = source.document()?;
        let table: PlanTable = document.parse_as()?;
        let quality = quality(&document, table.quality.as_deref())?;
        outlines(&document, &table)?;
        let part = table.samples_per_part.unwrap_or(PART);
        let asked = table.scene.iter().map(|s| split::Anatomy {
            name: s.anatomy.as_ref().unwrap_or(&s.name),
            split: s.split.as_deref(),
        });
        let (names, of_scene) =
            split::splits(&document, &table.split, &asked.collect::<Vec<_>>(), table.seed)?;
        let mut plan = Self {
            title: table.title.clone(),
            seed: table.seed,
            quality,
            formats: Format::ALL.into_iter().filter(|f| table.formats.contains(f)).collect(),
            arrays: arrays(&document, &table.arrays)?,
            segmentation: table.segmentation,
            splits: Vec::new(),
            classes: Vec::new(),
            part,
            scenes: Vec::new(),
            source: Source::of(path, source.text().to_owned()),
        };
        let mut warnings = Vec::new();
        let mut used = BTreeMap::new();
        let mut numbers = numbers(&table, &of_scene, names.len());
        for (i, of) in table.scene.iter().enumerate() {
            let folder = path.parent().unwrap_or(Path::new(""));
            let made = Reading {
                document: &document,
                table: &table,
                at: format!("scene.{i}"),
                of,
                folder,
            };
            let (scene, loaded, noted) = made.scene(of_scene[i], numbers.remove(0), &mut used)?;
            warnings.extend(noted);
            for tissue in &loaded.tissues {
                if !plan.classes.contains(&tissue.name) {
                    plan.classes.push(tissue.name.clone());
                }
            }
            plan.scenes.push(scene);
        }
        if let Some((at, name)) =
            used.iter().find_map(|(at, (name, is))| (!is).then_some((at, name)))
        {
            let message = format!("no scene of the plan has the tissue of `{name}`");
            return Err(document.fail(at, message, "name a tissue of a mesh, or leave this out"));
        }
        if plan.classes.len() > MAX_CLASSES {
            let message = format!("the scenes have {} tissues", plan.classes.len());
            let remedy = format!("a segmentation has at most {MAX_CLASSES}: make several plans");
            return Err(document.fail("scene", message, remedy));
        }
        plan.splits = names
            .into_iter()
            .enumerate()
            .map(|(split, name)| {
                let own = || plan.scenes.iter().filter(|s| s.split == split).map(|s| &s.samples);
                let first = own().map(|s| s.start).min().unwrap_or(0);
                let last = own().map(|s| s.end).max().unwrap_or(0);
                Split { name, samples: first..last }
            })
            .collect();
        Ok((plan, warnings))
    }

    /// The text of its file.
    pub fn text(&self) -> &str {
        self.source.text()
    }

    /// Number of all samples.
    pub fn samples(&self) -> u32 {
        self.splits.iter().map(|s| s.samples.end).max().unwrap_or(0)
    }

    /// Name of the scene of a sample.
    ///
    /// # Panics
    /// When the plan has no sample of this number.
    pub fn scene_of(&self, number: u32) -> &str {
        &self.scenes[self.sample(number).scene].name
    }

    /// All parts: those of the first split, then those of the next.
    pub fn parts(&self) -> Vec<Part> {
        let mut out = Vec::new();
        for (split, Split { samples, .. }) in self.splits.iter().enumerate() {
            let begins = samples.clone().step_by(self.part as usize);
            out.extend((0..).zip(begins).map(|(index, begin)| {
                let end = begin.saturating_add(self.part).min(samples.end);
                Part { split, index, samples: begin..end }
            }));
        }
        out
    }

    /// The parts of shard `index` of `count`: every `count`-th. All shards together have each part once.
    ///
    /// # Panics
    /// When `index` is not below `count`.
    pub fn shard(&self, index: u32, count: u32) -> Vec<Part> {
        assert!(index < count, "shards are counted from 0");
        self.parts().into_iter().skip(index as usize).step_by(count as usize).collect()
    }

    /// What is drawn for a sample: a function of the plan's text and the number alone.
    ///
    /// # Panics
    /// When the plan has no sample of this number.
    pub fn sample(&self, number: u32) -> Sample {
        let scene = self.scenes.iter().position(|s| s.samples.contains(&number));
        let scene = scene.expect("the plan has this sample");
        let of = &self.scenes[scene];
        let count = Count { seed: self.seed, number, attempt: 0 };
        let mut sample = Sample {
            number,
            entries: Vec::new(),
            numbers: Vec::new(),
            variables: Vec::new(),
            time: 0.0,
            seed: word("simulation.seed", count),
            scene,
        };
        for (i, one) in of.draws.iter().enumerate() {
            if of.poses.holds(i) {
                continue;
            }
            let Drawn { number, text } = draw(&of.draws, i, count);
            let plain = number.unwrap_or_default();
            match &one.name {
                _ if one.facts.is_none() => sample.variables.push((one.name.clone(), plain)),
                name if name == TIME.key => sample.time = plain,
                name if name == "simulation.seed" => sample.seed = plain as u32,
                name => {
                    sample.entries.push((name.clone(), text));
                    sample.numbers.extend(number.map(|number| (name.clone(), number)));
                }
            }
        }
        sample
    }

    /// An error about a sample, at its scene's file.
    pub(super) fn fault(&self, sample: &Sample, error: SceneError) -> SceneError {
        let of = &self.scenes[sample.scene];
        let message = format!("sample {} of `{}`: {error}", sample.number, of.name);
        let remedy = error.remedy.unwrap_or_else(|| "draw it from a narrower range".to_owned());
        match self.source.document() {
            Ok(document) => document.fail(&format!("scene.{}", sample.scene), message, remedy),
            Err(error) => error,
        }
    }

    /// Checks the draws of these samples together, as far as no mesh is needed.
    ///
    /// # Errors
    /// The first that its scene cannot have.
    pub fn check(&self, numbers: impl Iterator<Item = u32>) -> Result<(), SceneError> {
        for number in numbers {
            let sample = self.sample(number);
            let of = &self.scenes[sample.scene];
            of.file.check(&sample.entries).map_err(|error| self.fault(&sample, error))?;
        }
        Ok(())
    }
}

fn quality(document: &Document<'_>, word: Option<&str>) -> Result<Option<Quality>, SceneError> {
    let Some(word) = word else { return Ok(None) };
    let found = <Quality as clap::ValueEnum>::from_str(word, false);
    found.map(Some).map_err(|_| {
        let message = format!("unknown quality `{word}`");
        document.fail("quality", message, "choose one of `draft`, `standard`, `reference`")
    })
}

fn arrays(document: &Document<'_>, names: &[String]) -> Result<Vec<Array>, SceneError> {
    let found = |(i, name): (usize, &String)| {
        let found = Array::all().find(|array| array.name() == name);
        found.ok_or_else(|| {
            let remedy = suggest::among(name, Array::all().map(Array::name));
            document.fail(&format!("arrays.{i}"), format!("there is no array `{name}`"), remedy)
        })
    };
    names.iter().enumerate().map(found).collect()
}

/// Numbers of each scene's samples: split by split, each in the order of its scenes.
fn numbers(table: &PlanTable, of_scene: &[usize], splits: usize) -> Vec<Range<u32>> {
    let mut out = vec![0..0; table.scene.len()];
    let mut next = 0;
    for split in 0..splits {
        for (i, scene) in table.scene.iter().enumerate().filter(|(i, _)| of_scene[*i] == split) {
            out[i] = next..next + scene.samples;
            next += scene.samples;
        }
    }
    out
}

/// Checks what the types of the tables do not express.
fn outlines(document: &Document<'_>, table: &PlanTable) -> Result<(), SceneError> {
    let fail = |at: &str, message: String, remedy: &str| Err(document.fail(at, message, remedy));
    if table.formats.is_empty() {
        return fail(
            "formats",
            "there is no format".to_owned(),
            "name one: \"folder\" or \"webdataset\"",
        );
    }
    if table.samples_per_part == Some(0) {
        return fail("samples_per_part", "a part of no samples".to_owned(), "give at least 1");
    }
    if table.scene.is_empty() {
        return fail(
            "scene",
            "there is no scene".to_owned(),
            "add one: [[scene]] with name, file and samples",
        );
    }
    let total: u64 = table.scene.iter().map(|s| u64::from(s.samples)).sum();
    if total > MAX_SAMPLES {
        let remedy = format!("the limit is {MAX_SAMPLES}: make several plans");
        return fail("scene", format!("these are {total} samples"), &remedy);
    }
    for (i, scene) in table.scene.iter().enumerate() {
        let at = format!("scene.{i}");
        if scene.name.trim().is_empty() {
            return fail(&format!("{at}.name"), "this scene has no name".to_owned(), "give it one");
        }
        if table.scene[..i].iter().any(|s| s.name == scene.name) {
            let message = format!("there are two scenes of the name `{}`", scene.name);
            return fail(&format!("{at}.name"), message, "rename one");
        }
        if scene.samples == 0 {
            let message = format!("no sample of `{}` is made", scene.name);
            return fail(
                &format!("{at}.samples"),
                message,
                "give at least 1, or leave the scene out",
            );
        }
    }
    Ok(())
}

/// A scene's table while it is read.
struct Reading<'a> {
    document: &'a Document<'a>,
    table: &'a PlanTable,
    /// Its place in the plan: `scene.2`.
    at: String,
    of: &'a SceneTable,
    folder: &'a Path,
}

impl Reading<'_> {
    /// The scene with its draws, checked on the scene file, which is loaded once. `used` says of each draw of a
    /// tissue, by its place in the plan, whether any scene has that tissue.
    fn scene(
        &self,
        split: usize,
        samples: Range<u32>,
        used: &mut BTreeMap<String, (String, bool)>,
    ) -> Result<(PlanScene, Scene, Vec<Warning>), SceneError> {
        let (document, of, at) = (self.document, self.of, &self.at);
        let path = self.folder.join(&of.file);
        let named = |error: SceneError| match error.line {
            0 => document.fail(
                &format!("{at}.file"),
                error.to_string(),
                error.remedy.unwrap_or_default(),
            ),
            _ => error,
        };
        let file = SceneFile::read(&path).map_err(named)?;
        let (mut scene, warnings) = file.load(&[])?;
        let mut read = self.variables()?;
        read.extend(reading::settings(document, "draw", &self.table.draw)?);
        read.extend(reading::settings(document, &format!("{at}.draw"), &of.draw)?);
        read.retain(|one| self.fits(&one.draw, &scene, used));
        read.extend(self.time()?);
        let trajectory = self.trajectory()?;
        let mut poses = Poses::new(document, &format!("{at}.pose"), &of.pose, trajectory, &scene)?;
        read.extend(poses.read(document, &format!("{at}.pose"), &of.pose)?);
        let draws = reading::linked(document, read)?;
        poses.find(&draws);
        let heavy =
            draws.iter().any(|d| is_entry(d, &poses, &draws) && !SceneFile::is_light(&d.name));
        let made = PlanScene {
            name: of.name.clone(),
            anatomy: of.anatomy.clone().unwrap_or_else(|| of.name.clone()),
            split,
            samples,
            file,
            path,
            draws,
            poses,
            heavy,
        };
        self.ends(&made, &mut scene)?;
        Ok((made, scene, warnings))
    }

    /// True if a draw of a tissue is of one that the scene has; true for all other draws.
    fn fits(
        &self,
        draw: &Draw,
        scene: &Scene,
        used: &mut BTreeMap<String, (String, bool)>,
    ) -> bool {
        let Some(rest) = draw.name.strip_prefix("tissues.") else { return true };
        let fits = scene.tissues.iter().any(|t| rest.starts_with(&format!("{}.", quoted(&t.name))));
        used.entry(draw.at.clone()).or_insert_with(|| (draw.name.clone(), false)).1 |= fits;
        fits
    }

    fn variables(&self) -> Result<Vec<Read>, SceneError> {
        let document = self.document;
        let one = |(name, value): (&String, &toml::Value)| {
            let at = format!("variable.{}", quoted(name));
            let target = Target { name: name.clone(), at, facts: None, document };
            target.read(value, Form::Number)
        };
        self.table.variable.iter().map(one).collect()
    }

    fn time(&self) -> Result<Option<Read>, SceneError> {
        let at = format!("{}.time", self.at);
        let target =
            Target { name: TIME.key.to_owned(), at, facts: Some(&TIME), document: self.document };
        self.of.time.as_ref().map(|value| target.read(value, TIME.form)).transpose()
    }

    fn trajectory(&self) -> Result<Option<Track>, SceneError> {
        let Some(given) = self.of.pose.get("trajectory") else { return Ok(None) };
        let at = format!("{}.pose.trajectory", self.at);
        let Some(name) = given.as_str() else {
            return Err(self.document.fail(
                &at,
                "this is no name of a file",
                "name a trajectory (.csv, .toml)",
            ));
        };
        let path = self.folder.join(name);
        match load_trajectory(&path) {
            Err(error) if error.line == 0 => {
                Err(self.document.fail(&at, error.to_string(), error.remedy.unwrap_or_default()))
            }
            read => read.map(Some),
        }
    }

    /// Checks the ends of every range on the scene file, beside what is always the same.
    fn ends(&self, made: &PlanScene, scene: &mut Scene) -> Result<(), SceneError> {
        let entries = || made.draws.iter().filter(|d| is_entry(d, &made.poses, &made.draws));
        let fixed = |d: &&Draw| matches!(d.kind, super::draws::Kind::Constant(_));
        let always: Vec<_> = entries()
            .filter(fixed)
            .map(|d| (d.name.clone(), d.ends(&made.draws)[0].text.clone()))
            .collect();
        for draw in entries() {
            for end in draw.ends(&made.draws) {
                let mut all = always.clone();
                all.push((draw.name.clone(), end.text.clone()));
                let put = match made.heavy {
                    true => made.file.check(&all),
                    false => made.file.put(&all, scene),
                };
                put.map_err(|error| {
                    let message = format!(
                        "{} cannot be {} in `{}`: {}",
                        draw.name, end.text, made.name, error.message
                    );
                    self.document.fail(&draw.at, message, error.remedy.unwrap_or_default())
                })?;
                if let Some(Work { too_much: true, message, remedy }) = Work::of(scene) {
                    let message =
                        format!("{} at {} in `{}`: {message}", draw.name, end.text, made.name);
                    return Err(self.document.fail(&draw.at, message, remedy));
                }
            }
        }
        Ok(())
    }
}

/// True if a draw is an entry of the scene file: neither a variable nor the time nor a part of the pose.
fn is_entry(draw: &Draw, poses: &Poses, all: &[Draw]) -> bool {
    let place = all.iter().position(|other| other.name == draw.name);
    draw.facts.is_some() && draw.name != TIME.key && !place.is_some_and(|i| poses.holds(i))
}
