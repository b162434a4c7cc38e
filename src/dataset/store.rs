//! The folder of a data set: samples by format, each file whole or not there.

use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use crc::{CRC_32_ISO_HDLC, Crc};
use image::GrayImage;
use serde_json::{Map, Value, json};

use super::DatasetError;
use super::members::{IMAGE, SEGMENTATION, extensions, members};
use super::plan::{Format, Part, Plan};
use super::studio::{Made, Studio};
use crate::issue::FileError;
use crate::output::files::{self, Draft};

const MANIFEST: &str = "manifest.json";
const PLAN: &str = "plan.toml";
/// Digits of the numbers in names of files, at least.
const DIGITS: usize = 6;

/// Progress of [`Store::fill`].
pub enum Told<'m> {
    /// A sample was made.
    Made(&'m Made),
    /// A sample was there already.
    Kept,
    /// A part is complete.
    Part(&'m Part),
}

/// The folder of a data set.
pub struct Store<'p> {
    plan: &'p Plan,
    root: PathBuf,
    digits: usize,
    /// Extensions of a sample's files.
    extensions: Vec<String>,
}

/// The file of an archive that is being written.
type Archive = tar::Builder<Draft>;

impl<'p> Store<'p> {
    /// The folder `root` for samples of `plan`.
    pub fn new(plan: &'p Plan, root: &Path) -> Self {
        let digits = plan.samples().to_string().len().max(DIGITS);
        Self { plan, root: root.to_owned(), digits, extensions: extensions(plan) }
    }

    /// Name of a sample's files, without extension.
    pub fn name(&self, number: u32) -> String {
        format!("{number:0digits$}", digits = self.digits)
    }

    /// Name of a part: `train-000007`.
    pub fn part_name(&self, part: &Part) -> String {
        let split = &self.plan.splits[part.split].name;
        format!("{split}-{:0digits$}", part.index, digits = self.digits)
    }

    /// Path of a file in the data set.
    pub fn path(&self, name: &str) -> PathBuf {
        self.root.join(name)
    }

    fn writes(&self, format: Format) -> bool {
        self.plan.formats.contains(&format)
    }

    /// The folder of a split's samples in a format.
    fn folder(&self, format: Format, split: usize) -> PathBuf {
        let root = self.root.join(format.word());
        match format {
            Format::Folder => root.join(&self.plan.splits[split].name),
            Format::WebDataset => root,
        }
    }

    fn file(&self, part: &Part, number: u32, extension: &str) -> PathBuf {
        let folder = self.folder(Format::Folder, part.split);
        folder.join(format!("{}.{extension}", self.name(number)))
    }

    fn archive(&self, part: &Part) -> PathBuf {
        let folder = self.folder(Format::WebDataset, part.split);
        folder.join(format!("{}.tar", self.part_name(part)))
    }

    /// Makes the folder and notes in it what it is made of: plan, program, and the `device` that it is made on; or
    /// compares that with what a folder that is there was begun with. Files of `parts` may be there only to `resume`;
    /// what a killed run left of them unfinished is removed.
    ///
    /// # Errors
    /// A folder that holds something else, another plan, program or device; a folder that cannot be written.
    pub fn begin(&self, parts: &[Part], device: &Value, resume: bool) -> Result<(), DatasetError> {
        let fail = |message: String, remedy: &str| {
            Err(DatasetError::File(FileError::file(&self.root, message, remedy)))
        };
        let manifest = self.manifest(device);
        let path = self.root.join(MANIFEST);
        match std::fs::read_to_string(&path) {
            Ok(text) => {
                let begun: Value = serde_json::from_str(&text).unwrap_or_default();
                if let Some(name) = difference(&begun, &manifest) {
                    let message = format!(
                        "was begun with another {name}: {}, not {}",
                        begun.get(name).unwrap_or(&Value::Null),
                        manifest[name]
                    );
                    return fail(
                        message,
                        "go on with what manifest.json says, or name a new folder",
                    );
                }
                if !resume && parts.iter().any(|part| self.is_begun(part)) {
                    return fail(
                        "holds samples of this shard already".to_owned(),
                        "add --resume to go on, or name a new folder",
                    );
                }
            }
            Err(e) if e.kind() == ErrorKind::NotFound => {
                if !self.is_empty() {
                    return fail(
                        "holds files, and no data set that was begun".to_owned(),
                        "name a new folder",
                    );
                }
                let text = serde_json::to_string_pretty(&manifest).expect("plain values") + "\n";
                self.write(&self.root.join(PLAN), self.plan.text().as_bytes())?;
                self.write(&path, text.as_bytes())?;
            }
            Err(e) => return Err(DatasetError::reading(&path, e)),
        }
        self.remove_unfinished(parts)
    }

    /// What the data set is made of, but for the files that the scenes name.
    fn manifest(&self, device: &Value) -> Value {
        let plan = self.plan;
        let crc = |text: &str| {
            format!("{:08x}", Crc::<u32>::new(&CRC_32_ISO_HDLC).checksum(text.as_bytes()))
        };
        let parts = plan.parts();
        let mut splits = Map::new();
        for (i, split) in plan.splits.iter().enumerate() {
            let own = plan.scenes.iter().filter(|s| s.split == i);
            let mut anatomies: Vec<_> = own.map(|s| s.anatomy.as_str()).collect();
            anatomies.dedup();
            let count = parts.iter().filter(|p| p.split == i).count();
            let about = json!({
                "first": split.samples.start, "samples": split.samples.len(), "parts": count, "anatomies": anatomies,
            });
            splits.insert(split.name.clone(), about);
        }
        let scene =
            |s: &super::plan::PlanScene| json!({ "name": s.name, "crc": crc(s.file.text()) });
        json!({
            "program": format!("insonify {}", env!("CARGO_PKG_VERSION")),
            "plan": crc(plan.text()),
            "device": device,
            "scenes": plan.scenes.iter().map(scene).collect::<Vec<_>>(),
            "samples": plan.samples(),
            "splits": splits,
            "formats": plan.formats.iter().map(|f| f.word()).collect::<Vec<_>>(),
            "files": self.extensions,
            "segmentation": format!("{:?}", plan.segmentation).to_lowercase(),
            "classes": plan.classes,
        })
    }

    /// True if nothing of another's is in the folder: a run that was killed at once leaves the plan, or a part of it.
    fn is_empty(&self) -> bool {
        let ours = |name: &str| [PLAN, MANIFEST].contains(&files::draft_of(name).unwrap_or(name));
        std::fs::read_dir(&self.root).map_or(true, |all| {
            all.flatten().all(|entry| ours(&entry.file_name().to_string_lossy()))
        })
    }

    /// True if any file of a part is there.
    fn is_begun(&self, part: &Part) -> bool {
        let tarred = self.writes(Format::WebDataset) && self.archive(part).exists();
        let lies = |number| self.extensions.iter().any(|e| self.file(part, number, e).exists());
        tarred || (self.writes(Format::Folder) && part.samples.clone().any(lies))
    }

    /// Removes what a killed run left of these parts; other shards may be writing theirs.
    fn remove_unfinished(&self, parts: &[Part]) -> Result<(), DatasetError> {
        for split in 0..self.plan.splits.len() {
            for &format in &self.plan.formats {
                let folder = self.folder(format, split);
                let Ok(all) = std::fs::read_dir(&folder) else { continue };
                for entry in all.flatten() {
                    let name = entry.file_name().to_string_lossy().into_owned();
                    let Some(file) = files::draft_of(&name) else { continue };
                    let (stem, _) = file.split_once('.').unwrap_or((file, ""));
                    let number: Option<u32> = stem.parse().ok();
                    let is_own = |part: &&Part| match format {
                        Format::WebDataset => stem == self.part_name(part),
                        Format::Folder => {
                            number.is_some_and(|n| part.split == split && part.samples.contains(&n))
                        }
                    };
                    if parts.iter().any(|part| is_own(&part)) {
                        std::fs::remove_file(entry.path())
                            .map_err(|e| DatasetError::writing(&entry.path(), e))?;
                    }
                }
            }
        }
        Ok(())
    }

    /// Writes a file whole or not at all, and its folder where there is none.
    pub fn write(&self, path: &Path, bytes: &[u8]) -> Result<(), DatasetError> {
        let folder = path.parent().expect("it lies in the data set");
        let written = std::fs::create_dir_all(folder).and_then(|()| files::replace(path, bytes));
        written.map_err(|e| DatasetError::writing(path, e))
    }

    /// Makes what these parts lack. Of a part that is there, one sample is made again and compared. `told` hears of
    /// each sample and each part.
    ///
    /// # Errors
    /// A sample that cannot be made, or that is another one than it was; a file that cannot be written.
    pub fn fill(
        &self,
        studio: &mut Studio<'_>,
        parts: &[Part],
        told: &mut dyn FnMut(Told<'_>) -> Result<(), DatasetError>,
    ) -> Result<(), DatasetError> {
        // True once a sample of an earlier run has been made again.
        let mut compared = false;
        for part in parts {
            let path = self.archive(part);
            let mut archive = match self.writes(Format::WebDataset) && !path.exists() {
                true => Some(self.open(&path)?),
                false => None,
            };
            for number in part.samples.clone() {
                let lacking = self.lacking(part, number);
                let kept = archive.is_none() && lacking.is_empty();
                if kept && compared {
                    told(Told::Kept)?;
                    continue;
                }
                let made = studio.make(number)?;
                let files = members(self.plan, &made);
                if kept {
                    self.compare(part, number, &files)?;
                    compared = true;
                }
                for (extension, bytes) in self.extensions.iter().zip(&files) {
                    if let Some(archive) = &mut archive {
                        let name = format!("{}.{extension}", self.name(number));
                        append(archive, &name, bytes)
                            .map_err(|e| DatasetError::writing(&path, e))?;
                    }
                    if lacking.contains(extension) {
                        self.write(&self.file(part, number, extension), bytes)?;
                    }
                }
                told(Told::Made(&made))?;
            }
            if let Some(archive) = archive {
                let finished = archive.into_inner().and_then(Draft::finish);
                finished.map_err(|e| DatasetError::writing(&path, e))?;
            }
            told(Told::Part(part))?;
        }
        Ok(())
    }

    fn open(&self, path: &Path) -> Result<Archive, DatasetError> {
        let folder = path.parent().expect("it lies in the data set");
        let opened = std::fs::create_dir_all(folder).and_then(|()| Draft::new(path));
        opened.map(tar::Builder::new).map_err(|e| DatasetError::writing(path, e))
    }

    /// Extensions of a sample's files that are not in the folder of files and should be.
    fn lacking(&self, part: &Part, number: u32) -> Vec<String> {
        if !self.writes(Format::Folder) {
            return Vec::new();
        }
        let all = self.extensions.iter().cloned();
        all.filter(|extension| !self.file(part, number, extension).exists()).collect()
    }

    /// The files of a sample that is there, in the order of their extensions; none where one is missing.
    pub(super) fn kept(
        &self,
        part: &Part,
        number: u32,
    ) -> Result<Option<Vec<Vec<u8>>>, DatasetError> {
        let all = &self.extensions;
        if self.writes(Format::Folder) {
            let read = |extension: &String| {
                let path = self.file(part, number, extension);
                match std::fs::read(&path) {
                    Ok(bytes) => Ok(Some(bytes)),
                    Err(e) if e.kind() == ErrorKind::NotFound => Ok(None),
                    Err(e) => Err(DatasetError::reading(&path, e)),
                }
            };
            return all.iter().map(read).collect();
        }
        let path = self.archive(part);
        let names = all.iter().map(|extension| format!("{}.{extension}", self.name(number)));
        let names: Vec<String> = names.collect();
        let mut found = vec![None; names.len()];
        let reading = |e| DatasetError::reading(&path, e);
        let mut archive = tar::Archive::new(std::fs::File::open(&path).map_err(reading)?);
        for entry in archive.entries().map_err(reading)? {
            let mut entry = entry.map_err(reading)?;
            let name = entry.path().map_err(reading)?.to_string_lossy().into_owned();
            if let Some(place) = names.iter().position(|n| *n == name) {
                let mut bytes = Vec::new();
                std::io::Read::read_to_end(&mut entry, &mut bytes).map_err(reading)?;
                found[place] = Some(bytes);
            }
        }
        Ok(found.into_iter().collect())
    }

    /// Image and classes of a sample that is there.
    pub(super) fn pictures(
        &self,
        part: &Part,
        number: u32,
    ) -> Result<Option<[GrayImage; 2]>, DatasetError> {
        let Some(files) = self.kept(part, number)? else { return Ok(None) };
        let of = |wanted: &str| {
            let place = self.extensions.iter().position(|e| *e == wanted).expect("always written");
            let spoilt = |_| {
                let path = self.file(part, number, wanted);
                DatasetError::File(FileError::file(
                    &path,
                    "is no picture any more",
                    "remove it, and go on with --resume",
                ))
            };
            picture(&files[place]).map_err(spoilt)
        };
        Ok(Some([of(IMAGE)?, of(SEGMENTATION)?]))
    }

    /// Fails where the files of a sample are not those of the earlier run.
    fn compare(&self, part: &Part, number: u32, files: &[Vec<u8>]) -> Result<(), DatasetError> {
        if self.kept(part, number)?.as_deref() == Some(files) {
            return Ok(());
        }
        let message = format!(
            "sample {} was made by the earlier run, and comes out differently now",
            self.name(number)
        );
        let remedy = "name a new folder: something that a scene names, the driver or the program is not what it was";
        Err(DatasetError::File(FileError::file(&self.root, message, remedy)))
    }
}

/// The bytes of a PNG file's pixels, as they are: grey levels, or places in its palette.
fn picture(bytes: &[u8]) -> Result<GrayImage, png::DecodingError> {
    let mut decoder = png::Decoder::new(std::io::Cursor::new(bytes));
    decoder.set_transformations(png::Transformations::IDENTITY);
    let mut reader = decoder.read_info()?;
    let (width, height) = (reader.info().width, reader.info().height);
    let mut pixels = vec![0; width as usize * height as usize];
    reader.next_frame(&mut pixels)?;
    Ok(GrayImage::from_raw(width, height, pixels).expect("a byte per pixel"))
}

/// Adds a file to an archive, with nothing that depends on time or user.
fn append(archive: &mut tar::Builder<impl Write>, name: &str, bytes: &[u8]) -> std::io::Result<()> {
    let mut header = tar::Header::new_ustar();
    header.set_path(name)?;
    header.set_size(bytes.len() as u64);
    header.set_mode(0o644);
    header.set_mtime(0);
    header.set_uid(0);
    header.set_gid(0);
    header.set_cksum();
    archive.append(&header, bytes)
}

/// Name of the first fact that differs between the two.
fn difference<'a>(begun: &Value, now: &'a Value) -> Option<&'a str> {
    let now = now.as_object().expect("a table of facts");
    let other = now.iter().find(|(name, value)| begun.get(name) != Some(value));
    other.map(|(name, _)| name.as_str())
}
