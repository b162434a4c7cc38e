//! The folder of a study: its settings, and the images made so far.

use std::path::{Path, PathBuf};

use insonify::output::lock::{Hold, LOCK};
use insonify::output::{self, files};
use insonify::scene::file::Plan;
use insonify::study::key::crc32;
use miette::{Context, IntoDiagnostic, Result, miette};
use serde_json::{Value, json};

use super::super::common::Common;

/// Place of all files of a study. Only [`Folder::form`] is handed to assessors.
pub struct Folder {
    root: PathBuf,
    /// Digits of the numbers of cases and of images.
    digits: [usize; 2],
}

impl Folder {
    /// A folder for `cases` cases of at most `images` images.
    pub fn new(root: &Path, cases: usize, images: usize) -> Self {
        Self { root: root.to_owned(), digits: [cases, images].map(|n| n.to_string().len().max(2)) }
    }

    /// The folder for assessors, with the images one by one.
    pub fn form(&self) -> PathBuf {
        self.root.join("form")
    }

    /// The file that identifies each image.
    pub fn key(&self) -> PathBuf {
        self.root.join("key.csv")
    }

    fn settings(&self) -> PathBuf {
        self.root.join("settings.json")
    }

    /// Path of an image within [`Folder::form`], with slashes: `cases/03/17.png`.
    pub fn image(&self, case: usize, image: usize) -> String {
        let [cases, images] = self.digits;
        format!("cases/{case:0cases$}/{image:0images$}.png")
    }

    /// The bytes of an image; none where it is not there.
    pub fn made(&self, case: usize, image: usize) -> Result<Option<Vec<u8>>> {
        let path = self.form().join(self.image(case, image));
        match std::fs::read(&path) {
            Ok(bytes) => Ok(Some(bytes)),
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(None),
            Err(e) => {
                Err(e).into_diagnostic().wrap_err_with(|| format!("reading {}", path.display()))
            }
        }
    }

    /// Makes the folder and notes `settings` in it; or, to resume, compares them with those of its beginning and
    /// removes unfinished files of a killed run. No other run writes there while the result lives.
    pub fn begin(&self, settings: &Value, resume: bool) -> Result<Hold> {
        let root = self.root.display();
        let fail = |cause: String, remedy: &str| Err(miette!(help = remedy, "{cause}"));
        std::fs::create_dir_all(&self.root)
            .into_diagnostic()
            .wrap_err_with(|| format!("making the folder {root}"))?;
        let taken = Hold::take(&self.root.join(LOCK)).into_diagnostic();
        let Some(held) = taken.wrap_err_with(|| format!("writing {root}"))? else {
            return fail(
                format!("{root} is being written by another run"),
                "wait for its end or stop it, and add --resume; or name a new folder",
            );
        };
        let before = std::fs::read_to_string(self.settings()).ok();
        // A run that was killed at once leaves half-written settings.
        let is_ours = |name: &str| name == LOCK || files::draft_of(name) == Some("settings.json");
        let is_empty = std::fs::read_dir(&self.root).map_or(true, |all| {
            let mut names = all.flatten().map(|entry| entry.file_name());
            names.all(|name| is_ours(&name.to_string_lossy()))
        });
        match before {
            None if !is_empty => {
                return fail(
                    format!("{root} holds files, and no study that was begun"),
                    "name a new folder",
                );
            }
            Some(_) if !resume => {
                return fail(
                    format!("{root} holds a study already"),
                    "add --resume to go on with it, or name a new folder",
                );
            }
            Some(text) => {
                let begun: Value = serde_json::from_str(&text)
                    .into_diagnostic()
                    .wrap_err_with(|| format!("reading {}", self.settings().display()))?;
                if let Some(name) = difference(&begun, settings) {
                    return fail(
                        format!(
                            "{root} was begun with another {name}: {}, not {}",
                            begun[name], settings[name]
                        ),
                        "go on with what it was begun with (settings.json), or name a new folder",
                    );
                }
            }
            None => {}
        }
        self.remove_unfinished().into_diagnostic().wrap_err_with(|| format!("tidying {root}"))?;
        let text = output::json(settings);
        self.write(&self.settings(), text.as_bytes())?;
        Ok(held)
    }

    /// Writes a file of the study as a whole or not at all, and makes its folder where there is none.
    pub fn write(&self, path: &Path, bytes: &[u8]) -> Result<()> {
        let folder = path.parent().expect("it lies in the study's folder");
        std::fs::create_dir_all(folder)
            .and_then(|()| files::replace(path, bytes))
            .into_diagnostic()
            .wrap_err_with(|| format!("writing {}", path.display()))
    }

    /// Removes files that were being written when a run was killed: they begin with a dot.
    fn remove_unfinished(&self) -> std::io::Result<()> {
        let cases = self.form().join("cases");
        let mut folders = vec![self.root.clone(), self.form()];
        if let Ok(all) = std::fs::read_dir(cases) {
            folders.extend(all.flatten().map(|entry| entry.path()));
        }
        for folder in folders {
            let Ok(all) = std::fs::read_dir(folder) else {
                continue;
            };
            for entry in all.flatten() {
                let name = entry.file_name().to_string_lossy().into_owned();
                let kinds = [".png", ".json", ".csv", ".html"];
                let file = files::draft_of(&name);
                if file.is_some_and(|file| kinds.iter().any(|kind| file.ends_with(kind))) {
                    std::fs::remove_file(entry.path())?;
                }
            }
        }
        Ok(())
    }
}

/// All settings that determine the images, except the files that the scenes name: to check those, one image
/// of each case is made again.
pub fn settings(plan: &Plan, common: &Common, seed: u32, device: &str) -> Result<Value> {
    let mut scenes = Vec::new();
    for scenario in &plan.scenarios {
        let text = std::fs::read(&scenario.scene).into_diagnostic()?;
        scenes.push(json!({ "name": scenario.name, "crc": crc32(&text) }));
    }
    let set = common.overrides.iter();
    let set: Vec<String> = set.map(|(path, value)| format!("{path}={value}")).collect();
    Ok(json!({
        "program": format!("insonify {}", env!("CARGO_PKG_VERSION")),
        "plan": crc32(plan.text().as_bytes()),
        "scenes": scenes,
        "order": seed,
        "seed": common.seed,
        "time_s": common.time,
        "quality": common.quality.map(|q| format!("{q:?}").to_lowercase()),
        "tracer": format!("{:?}", common.tracer).to_lowercase(),
        "device": device,
        "set": set,
    }))
}

/// Name of the first setting that differs between the two.
fn difference<'a>(begun: &Value, now: &'a Value) -> Option<&'a str> {
    let now = now.as_object().expect("a table of settings");
    let other = now.iter().find(|(name, value)| begun.get(name) != Some(value));
    other.map(|(name, _)| name.as_str())
}
