//! Plans of user studies: the scenes, their views and backgrounds, and the questions
//! about the images. `docs/studies.md` describes the file.

use std::path::{Path, PathBuf};

use glam::DAffine3;
use serde::Deserialize;

use super::document::Source;
use super::error::SceneError;
use super::placing::{Placed, placement};
use super::probe::{self, pose};
use super::table::{Key, Keys, Table, defaults};
use crate::issue;
use crate::scene::Scene;
use crate::settings::{Facts, Form, Surroundings, Value, Words, group};

/// Most cases of a study; the paper has 27, for which an assessor needs a day.
const MAX_CASES: usize = 999;
/// Largest plan, bytes.
const MAX_PLAN: u64 = 16 << 20;
/// Longest text that is shown, bytes.
const MAX_WORDS: usize = 4000;
/// Default height of an image, pixels; the paper's 621 images take about 50 MB.
const HEIGHT: u32 = 320;
/// Heights of an image that a plan may give.
const HEIGHTS: Facts = Facts::whole(1, 4096).counted("pixels").key("image_height");

/// The plan of a study: its images and questions.
pub struct Plan {
    /// Headline of the form.
    pub title: String,
    /// Introduction for the assessor: plain text, an empty line between paragraphs.
    pub introduction: String,
    /// Surroundings of the simulated part, in the order of the tables.
    pub backgrounds: Vec<Surroundings>,
    /// Most rows of pixels of an image; larger ones are reduced.
    pub image_height: u32,
    /// The questions.
    pub question: Question,
    /// The scenes, at least one, with different names.
    pub scenarios: Vec<Scenario>,
    source: Source,
}

/// The wording of the questions.
#[derive(Clone, Debug, Deserialize, PartialEq, Eq)]
#[serde(deny_unknown_fields)]
pub struct Question {
    /// Asks for one of a case's images.
    pub choose: String,
    /// Statement about the chosen image.
    pub statement: String,
    /// Five degrees of agreement with it, from the least to the most (Likert, Archives of Psychology
    /// 140, 1932).
    #[serde(default = "agreement")]
    pub agreement: [String; 5],
    /// Asks for the order of the images chosen before the different backgrounds.
    pub rank: String,
}

fn agreement() -> [String; 5] {
    ["Strongly disagree", "Disagree", "Neither agree nor disagree", "Agree", "Strongly agree"]
        .map(str::to_owned)
}

/// One scene of a study.
#[derive(Clone, Debug)]
pub struct Scenario {
    /// Name in key and tables; the assessor does not see it.
    pub name: String,
    /// Title above its images for the assessor; empty: none.
    pub title: String,
    /// The scene file, seen from the current folder.
    pub scene: PathBuf,
    /// The positions of the transducer, at least one, with different names.
    pub slices: Vec<Slice>,
}

/// One position of the transducer.
#[derive(Clone, Debug)]
pub struct Slice {
    /// Name in key and tables; the assessor does not see it.
    pub name: String,
    /// Title for the assessor where its images are ranked; empty: none.
    pub title: String,
    pose: Pose,
}

#[derive(Clone, Copy, Debug)]
enum Pose {
    /// World from probe.
    Absolute(DAffine3),
    /// The scene's probe from this one.
    Relative(DAffine3),
}

impl Slice {
    /// World from probe in `scene`, mm, and the entry of a scene file, path and value without blanks,
    /// that says the same to the last bit. It lies on a grid of 0.1 um, so that the entry is short.
    pub fn pose(&self, scene: &Scene) -> (DAffine3, (String, String)) {
        let exact = match self.pose {
            Pose::Absolute(pose) => pose,
            Pose::Relative(pose) => scene.world_from_probe * pose,
        };
        probe::stated(exact)
    }
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct PlanTable {
    title: String,
    #[serde(default)]
    introduction: String,
    #[serde(default = "every_background")]
    backgrounds: Vec<Surroundings>,
    image_height: Option<u32>,
    question: Question,
    #[serde(default)]
    scenario: Vec<ScenarioTable>,
}

fn every_background() -> Vec<Surroundings> {
    use Surroundings::{None, Scatterers, Volume};
    vec![Volume, Scatterers, None]
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct ScenarioTable {
    name: String,
    #[serde(default)]
    title: String,
    scene: String,
    #[serde(default)]
    slice: Vec<Table<SliceKeys>>,
}

group! {
    /// A position of the transducer.
    pub struct SliceKeys in "scenario.slice" {
        /// Name in key and tables.
        name: String = String::new(), Facts::of(Form::Text).required();
        /// Title for the assessor where its images are ranked.
        title: String = String::new(), Facts::of(Form::Text);
    }
}

impl Keys for SliceKeys {
    const TABLE: &'static str = "scenario.slice";

    fn keys() -> Vec<Key> {
        let own = defaults::<Self>("").chain(defaults::<Placed>(""));
        own.chain(defaults::<probe::Pose>("pose.")).collect()
    }
}

impl Plan {
    /// Reads a plan. The scenes that it names are not read.
    ///
    /// # Errors
    /// The first mistake, with file, line, column and remedy.
    pub fn load(path: &Path) -> Result<Self, SceneError> {
        let text = issue::read_text(path, MAX_PLAN, "leave out slices")?;
        let source = Source::of(path, text).described_in("docs/studies.md");
        let document = source.document()?;
        let table: PlanTable = document.parse_as()?;
        let check = Check { source: &source };
        check.texts(&table)?;
        check.backgrounds(&table.backgrounds)?;
        let height = table.image_height.unwrap_or(HEIGHT);
        document.within("image_height", &HEIGHTS, &Value::Whole(height))?;
        check.names("scenario", table.scenario.iter().map(|s| &*s.name))?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let mut scenarios = Vec::new();
        for (i, scenario) in table.scenario.iter().enumerate() {
            let at = format!("scenario.{i}");
            let slices = scenario.slice.iter();
            check.names(
                &format!("{at}.slice"),
                slices.clone().filter_map(|s| s.stated.text("name")),
            )?;
            let slices = slices
                .enumerate()
                .map(|(j, slice)| slice_of(&source, &format!("{at}.slice.{j}"), slice))
                .collect::<Result<_, _>>()?;
            scenarios.push(Scenario {
                name: scenario.name.clone(),
                title: scenario.title.clone(),
                scene: folder.join(&scenario.scene),
                slices,
            });
        }
        let slices: usize = scenarios.iter().map(|s| s.slices.len()).sum();
        let cases = slices * table.backgrounds.len();
        if cases > MAX_CASES {
            let message = format!("these are {cases} cases, the limit is {MAX_CASES}");
            let remedy = "leave out slices, or make two studies of it";
            return Err(document.fail("scenario", message, remedy));
        }
        Ok(Self {
            title: table.title,
            introduction: table.introduction,
            backgrounds: table.backgrounds,
            image_height: height,
            question: table.question,
            scenarios,
            source,
        })
    }

    /// The text of its file.
    pub fn text(&self) -> &str {
        self.source.text()
    }

    /// An error at the value of a dotted path of the plan: `scenario.0.scene`.
    pub fn fault(&self, path: &str, message: String, remedy: &str) -> SceneError {
        match self.source.document() {
            Ok(document) => document.fail(path, message, remedy),
            Err(error) => error,
        }
    }
}

/// Checks conditions that the types of the tables do not express.
struct Check<'s> {
    source: &'s Source,
}

impl Check<'_> {
    fn fail<T>(&self, path: &str, message: String, remedy: &str) -> Result<T, SceneError> {
        Err(self.source.document()?.fail(path, message, remedy))
    }

    fn texts(&self, table: &PlanTable) -> Result<(), SceneError> {
        let question = &table.question;
        let own = |path: &str, text: &str| (path.to_owned(), text.to_owned());
        let mut must = vec![
            own("title", &table.title),
            own("question.choose", &question.choose),
            own("question.statement", &question.statement),
            own("question.rank", &question.rank),
        ];
        let degrees = question.agreement.iter().enumerate();
        must.extend(degrees.map(|(i, text)| own(&format!("question.agreement.{i}"), text)));
        if let Some((path, _)) = must.iter().find(|(_, text)| text.trim().is_empty()) {
            let message = "this text is empty".to_owned();
            return self.fail(path, message, "write what the assessor reads");
        }
        let mut all = must;
        all.push(own("introduction", &table.introduction));
        for (i, scenario) in table.scenario.iter().enumerate() {
            all.push(own(&format!("scenario.{i}.title"), &scenario.title));
            all.push(own(&format!("scenario.{i}.name"), &scenario.name));
            for (j, slice) in scenario.slice.iter().enumerate() {
                let SliceKeys { name, title } = slice.stated.get("");
                all.push(own(&format!("scenario.{i}.slice.{j}.title"), &title));
                all.push(own(&format!("scenario.{i}.slice.{j}.name"), &name));
            }
        }
        match all.iter().find(|(_, text)| text.len() > MAX_WORDS) {
            Some((path, text)) => {
                let message = format!("this text has {} bytes", text.len());
                self.fail(path, message, &format!("the limit is {MAX_WORDS}"))
            }
            None => Ok(()),
        }
    }

    fn backgrounds(&self, backgrounds: &[Surroundings]) -> Result<(), SceneError> {
        if backgrounds.is_empty() {
            let message = "there is no background".to_owned();
            return self.fail("backgrounds", message, "name one of `volume`, `scatterers`, `none`");
        }
        for (i, background) in backgrounds.iter().enumerate() {
            if backgrounds[..i].contains(background) {
                let message = format!("`{}` is there twice", background.word());
                return self.fail(&format!("backgrounds.{i}"), message, "remove one");
            }
        }
        Ok(())
    }

    /// Fails unless there is at least one name, none is empty and none occurs twice.
    fn names<'n>(
        &self,
        path: &str,
        names: impl Iterator<Item = &'n str>,
    ) -> Result<(), SceneError> {
        let noun = path.rsplit('.').next().unwrap_or(path);
        let names: Vec<&str> = names.collect();
        if names.is_empty() {
            let message = format!("there is no {noun}");
            let table = if noun == "slice" { "scenario.slice" } else { noun };
            return self.fail(path, message, &format!("add one: [[{table}]] with its name"));
        }
        for (i, name) in names.iter().enumerate() {
            let at = format!("{path}.{i}.name");
            if name.trim().is_empty() {
                return self.fail(&at, format!("this {noun} has no name"), "give it one");
            }
            if names[..i].contains(name) {
                let message = format!("there are two of the name `{name}`");
                return self.fail(&at, message, "rename one");
            }
        }
        Ok(())
    }
}

fn slice_of(source: &Source, path: &str, table: &Table<SliceKeys>) -> Result<Slice, SceneError> {
    let document = source.document()?;
    table.check(&document, path)?;
    let stated = &table.stated;
    let SliceKeys { name, title } = stated.get("");
    let moved = stated.has("translate") || stated.has("rotate");
    let pose = match stated.has("pose") {
        true if moved => {
            return Err(document.fail(
                path,
                format!("`{name}` has a pose, and a shift from the scene's own"),
                "give either `pose`, or `translate` and `rotate`",
            ));
        }
        true => Pose::Absolute(pose(&document, path, stated)?),
        false => Pose::Relative(placement(stated, "")),
    };
    Ok(Slice { name, title, pose })
}

#[cfg(test)]
mod tests;
