//! A finished data set, sample by sample, from its folder of files or from its archives.

use std::fs::{self, File};
use std::io::Read as _;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::super::DatasetError;
use super::super::plan::Format;
use super::super::store::{MANIFEST, picture, within};
use crate::issue::FileError;
use image::GrayImage;

/// A data set whose samples are all there.
pub struct Set {
    root: PathBuf,
    /// Its `manifest.json`.
    pub(super) manifest: Value,
    /// Names of the classes, from 0 on.
    pub(super) classes: Vec<String>,
    /// Names of the splits.
    pub(super) splits: Vec<String>,
    /// Number of samples.
    pub(super) samples: u64,
    format: Format,
}

/// A sample with its segmentation.
pub(super) struct Labelled {
    /// Its number in the plan.
    pub(super) number: u64,
    /// Its number as text, as its files are named.
    pub(super) name: String,
    pub(super) split: String,
    /// The place of its split among those of the set.
    pub(super) place: usize,
    /// The content of its `.json`.
    pub(super) facts: Value,
    /// The image, PNG.
    pub(super) image: Vec<u8>,
    /// The class of each pixel.
    pub(super) classes: GrayImage,
}

fn fault(path: &Path, message: impl Into<String>, remedy: &str) -> DatasetError {
    FileError::file(path, message.into(), remedy).into()
}

impl Set {
    /// The data set in a folder.
    ///
    /// # Errors
    /// A folder without `manifest.json`, or without the formats `folder` and `webdataset`.
    pub fn open(root: &Path) -> Result<Self, DatasetError> {
        let path = root.join(MANIFEST);
        let text = fs::read_to_string(&path).map_err(|e| {
            fault(&path, format!("cannot be read: {e}"), "name the folder of a data set")
        })?;
        let spoilt = || fault(&path, "is no manifest of a data set", "make the data set anew");
        let manifest: Value = serde_json::from_str(&text).map_err(|_| spoilt())?;
        let texts = |value: &Value| -> Option<Vec<String>> {
            value.as_array()?.iter().map(|text| text.as_str().map(str::to_owned)).collect()
        };
        let classes = texts(&manifest["classes"]).ok_or_else(spoilt)?;
        let splits = manifest["splits"].as_object().ok_or_else(spoilt)?;
        let splits = splits.keys().cloned().collect();
        let samples = manifest["samples"].as_u64().ok_or_else(spoilt)?;
        let formats = texts(&manifest["formats"]).ok_or_else(spoilt)?;
        let read = [Format::Folder, Format::WebDataset];
        let format = read.into_iter().find(|format| formats.iter().any(|f| f == format.word()));
        let format = format.ok_or_else(|| {
            fault(root, "has no single images", "make it with the format `folder` or `webdataset`")
        })?;
        Ok(Self { root: root.to_owned(), manifest, classes, splits, samples, format })
    }

    /// Calls `act` with each sample, in the order of the splits and numbers.
    ///
    /// # Errors
    /// Files that cannot be read, samples that are not there yet, and those of `act`.
    pub(super) fn each(
        &self,
        act: &mut dyn FnMut(Labelled) -> Result<(), DatasetError>,
    ) -> Result<(), DatasetError> {
        let mut count = 0;
        for split in &self.splits {
            let mut counted = |sample| {
                count += 1;
                act(sample)
            };
            match self.format {
                Format::Folder => self.folder(split, &mut counted)?,
                _ => self.archives(split, &mut counted)?,
            }
        }
        if count == self.samples {
            return Ok(());
        }
        let message = format!("has {count} of its {} samples", self.samples);
        Err(fault(&self.root, message, "make the other shards, or go on with --resume"))
    }

    fn folder(
        &self,
        split: &str,
        act: &mut dyn FnMut(Labelled) -> Result<(), DatasetError>,
    ) -> Result<(), DatasetError> {
        let folder = self.root.join(Format::Folder.word()).join(split);
        for path in sorted(&folder, "json") {
            let file = |end: &str| {
                let path = path.with_extension(end);
                fs::read(&path).map_err(|e| DatasetError::reading(&path, e))
            };
            act(self.labelled(&path, &file("json")?, file("png")?, &file("seg.png")?)?)?;
        }
        Ok(())
    }

    fn archives(
        &self,
        split: &str,
        act: &mut dyn FnMut(Labelled) -> Result<(), DatasetError>,
    ) -> Result<(), DatasetError> {
        let folder = self.root.join(Format::WebDataset.word());
        let own = |path: &PathBuf| {
            let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            stem.rsplit_once('-').is_some_and(|(name, _)| name == split)
        };
        for path in sorted(&folder, "tar").into_iter().filter(own) {
            let failed = |e| DatasetError::reading(&path, e);
            let mut archive = tar::Archive::new(File::open(&path).map_err(failed)?);
            let (mut image, mut classes) = (Vec::new(), Vec::new());
            for entry in archive.entries().map_err(failed)? {
                let mut entry = entry.map_err(failed)?;
                let member = entry.path().map_err(failed)?.into_owned();
                let name = member.to_string_lossy().into_owned();
                let mut bytes = Vec::new();
                // A sample ends with its facts.
                match name.split_once('.').map(|(_, end)| end) {
                    Some("png") => drop(entry.read_to_end(&mut image).map_err(failed)?),
                    Some("seg.png") => drop(entry.read_to_end(&mut classes).map_err(failed)?),
                    Some("json") => {
                        entry.read_to_end(&mut bytes).map_err(failed)?;
                        let taken = std::mem::take(&mut image);
                        act(self.labelled(&path.join(member), &bytes, taken, &classes)?)?;
                        classes.clear();
                    }
                    _ => {}
                }
            }
        }
        Ok(())
    }

    /// A sample of the contents of its files.
    fn labelled(
        &self,
        path: &Path,
        facts: &[u8],
        image: Vec<u8>,
        classes: &[u8],
    ) -> Result<Labelled, DatasetError> {
        let spoilt = || {
            let remedy = "remove the sample's files, and go on with --resume";
            fault(path, "is no sample any more", remedy)
        };
        let facts: Value = serde_json::from_slice(facts).map_err(|_| spoilt())?;
        let classes = picture(classes).map_err(|_| spoilt())?;
        let number = facts["sample"].as_u64().ok_or_else(spoilt)?;
        let split = facts["split"].as_str().ok_or_else(spoilt)?.to_owned();
        let place = self.splits.iter().position(|known| *known == split).ok_or_else(spoilt)?;
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        Ok(Labelled { number, name, split, place, facts, image, classes })
    }
}

/// Files with an ending in a folder, by name.
fn sorted(folder: &Path, end: &str) -> Vec<PathBuf> {
    let entries = within(folder).into_iter();
    let ends = |path: &PathBuf| path.extension().is_some_and(|e| e == end);
    let mut all: Vec<PathBuf> = entries.map(|entry| entry.path()).filter(ends).collect();
    // Numbers in names have as many digits.
    all.sort_by(|a, b| a.file_name().cmp(&b.file_name()));
    all
}
