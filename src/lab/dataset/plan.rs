//! Plans of data sets: what is drawn for each sample, how many there are, and where they go.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::draws::{Count, Draw, Drawn, draw, word};
use super::pose::Poses;
use super::scenes::Reading;
use super::split;
use super::tables::{PlanTable, arrays, numbers, outlines, quality};
use crate::issue;
use crate::output::indexed::NOTHING;
use crate::scene::file::{SceneFile, Source};
use crate::scene::{SceneError, Warning};
use crate::settings::units::DURATION;
use crate::settings::{Facts, Quality};
use crate::sim::labels::{KINDS, LabelKind};

/// Largest plan, bytes.
const MAX_PLAN: u64 = 4 << 20;
/// Most classes of a segmentation: a byte, of which one value shows nothing.
const MAX_CLASSES: usize = NOTHING as usize;
/// Samples of a part, unless the plan says it.
pub(super) const PART: u32 = 100;
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
    /// Files of zea (HDF5), one a sample: image, segmentation, pose, and the plan's arrays.
    Zea,
    /// Files of UFF (HDF5), one a sample: beamformed baseband on its scan, and radio frequency where the plan asks for it.
    Uff,
}

impl Format {
    /// All, in the order in which they are written.
    pub const ALL: [Self; 4] = [Self::Folder, Self::WebDataset, Self::Zea, Self::Uff];

    /// Its name in plans, and that of its folder.
    pub fn word(self) -> &'static str {
        match self {
            Self::Folder => "folder",
            Self::WebDataset => "webdataset",
            Self::Zea => "zea",
            Self::Uff => "uff",
        }
    }
}

/// An array beside the image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Array {
    /// Envelope after TGC, relative to a perfect mirror: [scanline, sample].
    Envelope,
    /// Complex baseband before TGC: [scanline, sample, real and imaginary].
    Iq,
    /// Radio-frequency lines before TGC, several samples to each axial one: [scanline, sample].
    Rf,
    /// Labels of the image's pixels: [row, column], some of them with three numbers each.
    Label(&'static LabelKind),
}

impl Array {
    /// All that a plan may name. What has moved since the last frame is not among them: a sample has no last frame.
    pub fn all() -> impl Iterator<Item = Self> + Clone {
        let labels = KINDS.iter().filter(|kind| kind.name != "displacement");
        [Self::Envelope, Self::Iq, Self::Rf].into_iter().chain(labels.map(Self::Label))
    }

    /// Its name in plans and in names of files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Envelope => "envelope",
            Self::Iq => "iq",
            Self::Rf => "rf",
            Self::Label(kind) => kind.name,
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

/// Words of the numbers in the `.npy` files of samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Precision {
    /// 32 bits.
    #[default]
    Single,
    /// 16 bits, and a power of two for each array by which they are multiplied.
    Half,
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
    /// Words of their numbers in `.npy` files.
    pub precision: Precision,
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

/// The draws of a sample, but for its pose, which needs the scene.
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

impl Plan {
    /// Reads a plan, loads every scene that it names and checks every range in it, so that no sample is refused
    /// later. Returns warnings about the scenes as well.
    ///
    /// # Errors
    /// The first mistake, with file, line, column and remedy.
    pub fn load(path: &Path) -> Result<(Self, Vec<Warning>), SceneError> {
        let text = issue::read_text(path, MAX_PLAN, "make several plans of it")?;
        let source = Source::of(path, text).described_in("docs/datasets.md");
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
            precision: table.precision,
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

    /// For each scene that has samples among `parts`: the numbers of two of them, which may be one, and how many there are.
    pub fn scenes_of(&self, parts: &[Part]) -> Vec<([u32; 2], u32)> {
        let of = |scene: &PlanScene| {
            let all = parts.iter().flat_map(|part| part.samples.clone());
            let mut own = all.filter(|number| scene.samples.contains(number));
            let first = own.next()?;
            let second = own.next();
            let count = 1 + u32::from(second.is_some()) + own.count() as u32;
            Some(([first, second.unwrap_or(first)], count))
        };
        self.scenes.iter().filter_map(of).collect()
    }

    /// The draws of a sample: a function of the plan's text and the number alone.
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
