//! The tables of a plan's file, and what their types do not express.

use std::ops::Range;

use serde::Deserialize;
use toml::Table;

use super::plan::{Array, Format, PART, Precision, Segmented};
use crate::scene::SceneError;
use crate::scene::file::Document;
use crate::settings::{Quality, suggest};

/// Most samples of a plan: their numbers have nine digits.
const MAX_SAMPLES: u64 = 1_000_000_000;
/// Most parts of a plan: each is a file or more in one folder.
const MAX_PARTS: u64 = 1_000_000;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PlanTable {
    #[serde(default)]
    pub title: String,
    #[serde(default)]
    pub seed: u32,
    pub quality: Option<String>,
    pub formats: Vec<Format>,
    #[serde(default)]
    pub arrays: Vec<String>,
    #[serde(default)]
    pub precision: Precision,
    #[serde(default = "seen")]
    pub segmentation: Segmented,
    pub samples_per_part: Option<u32>,
    #[serde(default)]
    pub split: Table,
    #[serde(default)]
    pub variable: Table,
    #[serde(default)]
    pub draw: Table,
    #[serde(default)]
    pub scene: Vec<SceneTable>,
}

fn seen() -> Segmented {
    Segmented::Seen
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SceneTable {
    pub name: String,
    pub file: String,
    pub samples: u32,
    pub anatomy: Option<String>,
    pub split: Option<String>,
    pub time: Option<toml::Value>,
    #[serde(default)]
    pub pose: Table,
    #[serde(default)]
    pub draw: Table,
}

pub(super) fn quality(
    document: &Document<'_>,
    word: Option<&str>,
) -> Result<Option<Quality>, SceneError> {
    let Some(word) = word else { return Ok(None) };
    let found = <Quality as clap::ValueEnum>::from_str(word, false);
    found.map(Some).map_err(|_| {
        let message = format!("unknown quality `{word}`");
        document.fail("quality", message, "choose one of `draft`, `standard`, `reference`")
    })
}

pub(super) fn arrays(document: &Document<'_>, names: &[String]) -> Result<Vec<Array>, SceneError> {
    let found = |(i, name): (usize, &String)| {
        let found = Array::all().find(|array| array.name() == name);
        found.ok_or_else(|| {
            let remedy = suggest::among(name, Array::all().map(Array::name));
            document.fail(&format!("arrays.{i}"), format!("there is no array `{name}`"), remedy)
        })
    };
    let said_before = |i: usize| names[..i].contains(&names[i]);
    if let Some(i) = (0..names.len()).find(|&i| said_before(i)) {
        let message = format!("`{}` stands here twice", names[i]);
        return Err(document.fail(&format!("arrays.{i}"), message, "leave out one of them"));
    }
    names.iter().enumerate().map(found).collect()
}

/// Numbers of each scene's samples: split by split, each in the order of its scenes.
pub(super) fn numbers(table: &PlanTable, of_scene: &[usize], splits: usize) -> Vec<Range<u32>> {
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
pub(super) fn outlines(document: &Document<'_>, table: &PlanTable) -> Result<(), SceneError> {
    let fail = |at: &str, message: String, remedy: &str| Err(document.fail(at, message, remedy));
    if table.formats.is_empty() {
        return fail(
            "formats",
            "there is no format".to_owned(),
            "name one: \"folder\", \"webdataset\", \"zea\" or \"uff\"",
        );
    }
    if let Some(i) =
        (0..table.formats.len()).find(|&i| table.formats[..i].contains(&table.formats[i]))
    {
        let message = "this format stands here twice".to_owned();
        return fail(&format!("formats.{i}"), message, "leave out one of them");
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
    let parts = total.div_ceil(u64::from(table.samples_per_part.unwrap_or(PART)));
    if parts > MAX_PARTS {
        let at = if table.samples_per_part.is_some() { "samples_per_part" } else { "scene" };
        let remedy = format!(
            "the limit is {MAX_PARTS}: set samples_per_part to {} or more",
            total.div_ceil(MAX_PARTS)
        );
        return fail(at, format!("{total} samples make {parts} parts"), &remedy);
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
