//! The folder of a data set: samples by format, each file whole or not there.

use std::borrow::Cow;
use std::fs::DirEntry;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use crc::{CRC_32_ISO_HDLC, Crc};
use image::GrayImage;
use serde_json::{Map, Value, json};

use super::DatasetError;
use super::archive::{self, Archive};
use super::members::{IMAGE, SEGMENTATION, extensions, members};
use super::plan::{Format, Part, Plan};
use super::studio::{Made, Studio};
use super::{exchange, hold};
use crate::issue::FileError;
use crate::output::{self, files};

pub(super) const MANIFEST: &str = "manifest.json";
const PLAN: &str = "plan.toml";
/// Samples of a folder, of sets that have more: `train/012/012345.png`.
const PER_FOLDER: u32 = 1000;
/// Digits of the numbers in names of files, at least.
const DIGITS: usize = 6;

/// Progress of [`Store::fill`].
pub enum Event<'m> {
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
    /// Extensions of a sample's files in a folder of files, and in archives.
    extensions: Vec<String>,
    /// The files that each sample has to itself: the format, and the extension in it.
    own: Vec<(Format, String)>,
}

impl<'p> Store<'p> {
    /// The folder `root` for samples of `plan`.
    pub fn new(plan: &'p Plan, root: &Path) -> Self {
        let digits = plan.samples().to_string().len().max(DIGITS);
        let extensions = extensions(plan);
        let own = plan.formats.iter().flat_map(|format| {
            let of_format = match format {
                Format::Folder => extensions.clone(),
                Format::WebDataset => Vec::new(),
                Format::Zea => vec!["hdf5".to_owned()],
                Format::Uff => vec!["uff".to_owned()],
            };
            of_format.into_iter().map(|extension| (*format, extension))
        });
        let own = own.collect();
        Self { plan, root: root.to_owned(), digits, extensions, own }
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
            Format::WebDataset => root,
            _ => root.join(&self.plan.splits[split].name),
        }
    }

    /// The path of a file that a sample has to itself.
    fn file(&self, part: &Part, number: u32, (format, extension): &(Format, String)) -> PathBuf {
        let mut folder = self.folder(*format, part.split);
        if self.plan.samples() > PER_FOLDER {
            folder.push(thousand(number.into()));
        }
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
                let text = output::json(&manifest);
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

    /// True if nothing of another's is in the folder: a run that was killed at once leaves this plan, or a part of it.
    fn is_empty(&self) -> bool {
        let this =
            |path: &Path| std::fs::read(path).is_ok_and(|t| t == self.plan.text().as_bytes());
        let ours = |entry: &DirEntry| match entry.file_name().to_string_lossy() {
            name if name == PLAN => this(&entry.path()),
            name if hold::shard(&name).is_some() => true,
            name => files::draft_of(&name).is_some_and(|of| [PLAN, MANIFEST].contains(&of)),
        };
        std::fs::read_dir(&self.root).map_or(true, |all| all.flatten().all(|entry| ours(&entry)))
    }

    /// True if any file of a part is there.
    fn is_begun(&self, part: &Part) -> bool {
        let tarred = self.writes(Format::WebDataset) && self.archive(part).exists();
        let lies = |number| self.own.iter().any(|own| self.file(part, number, own).exists());
        tarred || part.samples.clone().any(lies)
    }

    /// Removes what a killed run left of these parts; other shards may be writing theirs.
    fn remove_unfinished(&self, parts: &[Part]) -> Result<(), DatasetError> {
        for split in 0..self.plan.splits.len() {
            for &format in &self.plan.formats {
                for entry in within(&self.folder(format, split)) {
                    let name = entry.file_name().to_string_lossy().into_owned();
                    let Some(file) = files::draft_of(&name) else { continue };
                    let (stem, _) = file.split_once('.').unwrap_or((file, ""));
                    let number: Option<u32> = stem.parse().ok();
                    let is_own = |part: &&Part| match format {
                        Format::WebDataset => stem == self.part_name(part),
                        _ => {
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

    /// Makes what these parts lack. Of a part that is there, one sample is made again and compared. `progress` hears of
    /// each sample and each part.
    ///
    /// # Errors
    /// A sample that cannot be made, or that is another one than it was; a file that cannot be written.
    pub fn fill(
        &self,
        studio: &mut Studio<'_>,
        parts: &[Part],
        progress: &mut dyn FnMut(Event<'_>) -> Result<(), DatasetError>,
    ) -> Result<(), DatasetError> {
        // True once a sample of an earlier run has been made again.
        let mut compared = false;
        for part in parts {
            let path = self.archive(part);
            let tarring = |e| DatasetError::writing(&path, e);
            let mut archive = match self.writes(Format::WebDataset) && !path.exists() {
                true => Some(Archive::new(&path).map_err(tarring)?),
                false => None,
            };
            for number in part.samples.clone() {
                let own = |own: &&(Format, String)| !self.file(part, number, own).exists();
                let lacking: Vec<_> = self.own.iter().filter(own).collect();
                let kept = archive.is_none() && lacking.is_empty();
                if kept && compared {
                    progress(Event::Kept)?;
                    continue;
                }
                let made = studio.make(number)?;
                let files = members(self.plan, &made);
                if kept {
                    self.compare(part, &made, &files)?;
                    compared = true;
                }
                if let Some(archive) = &mut archive {
                    for (name, bytes) in self.names(number).iter().zip(&files) {
                        archive.add(name, bytes).map_err(tarring)?;
                    }
                }
                for own in lacking {
                    self.write(&self.file(part, number, own), &self.bytes(own, &made, &files))?;
                }
                progress(Event::Made(&made))?;
            }
            if let Some(archive) = archive {
                archive.finish().map_err(tarring)?;
            }
            progress(Event::Part(part))?;
        }
        Ok(())
    }

    /// Number and bytes of the files that such a sample has, in all formats; of archives its part.
    pub fn weight(&self, made: &Made) -> [u64; 2] {
        let files = members(self.plan, made);
        let own = self.own.iter().map(|own| self.bytes(own, made, &files).len() as u64);
        let archived = match self.writes(Format::WebDataset) {
            // Each member has a head, and is filled up to whole blocks.
            true => files.iter().map(|bytes| 512 + bytes.len().next_multiple_of(512) as u64).sum(),
            false => 0,
        };
        [self.own.len() as u64, own.sum::<u64>() + archived]
    }

    /// Names of a sample's files in archives.
    fn names(&self, number: u32) -> Vec<String> {
        let name = self.name(number);
        self.extensions.iter().map(|extension| format!("{name}.{extension}")).collect()
    }

    /// The bytes of a file that a sample has to itself; `files` are those of its extensions.
    fn bytes<'f>(
        &self,
        (format, extension): &(Format, String),
        made: &Made,
        files: &'f [Vec<u8>],
    ) -> Cow<'f, [u8]> {
        match format {
            Format::Zea => exchange::bytes(self.plan, made, crate::exchange::Format::Zea).into(),
            Format::Uff => exchange::bytes(self.plan, made, crate::exchange::Format::Uff).into(),
            Format::Folder | Format::WebDataset => {
                let place = self.extensions.iter().position(|e| e == extension);
                files[place.expect("one of its files")][..].into()
            }
        }
    }

    /// The files of a sample that is there, in the order of their extensions; none where one is missing, or no format
    /// has them.
    fn kept(&self, part: &Part, number: u32) -> Result<Option<Vec<Vec<u8>>>, DatasetError> {
        if self.writes(Format::Folder) {
            let all = self.extensions.iter();
            let all =
                all.map(|e| self.read(&self.file(part, number, &(Format::Folder, e.clone()))));
            return all.collect();
        }
        if !self.writes(Format::WebDataset) {
            return Ok(None);
        }
        let path = self.archive(part);
        archive::read(&path, &self.names(number)).map_err(|e| DatasetError::reading(&path, e))
    }

    /// The bytes of a file; none where it is not there.
    fn read(&self, path: &Path) -> Result<Option<Vec<u8>>, DatasetError> {
        match std::fs::read(path) {
            Ok(bytes) => Ok(Some(bytes)),
            Err(e) if e.kind() == ErrorKind::NotFound => Ok(None),
            Err(e) => Err(DatasetError::reading(path, e)),
        }
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
                DatasetError::File(FileError::file(
                    Path::new(&self.name(number)),
                    "is no picture any more",
                    "remove it, and go on with --resume",
                ))
            };
            picture(&files[place]).map_err(spoilt)
        };
        Ok(Some([of(IMAGE)?, of(SEGMENTATION)?]))
    }

    /// Fails where the files of a sample are not those of the earlier run.
    fn compare(&self, part: &Part, made: &Made, files: &[Vec<u8>]) -> Result<(), DatasetError> {
        let number = made.sample.number;
        let mut same = match self.writes(Format::WebDataset) {
            true => {
                let path = self.archive(part);
                let read = archive::read(&path, &self.names(number));
                read.map_err(|e| DatasetError::reading(&path, e))?.as_deref() == Some(files)
            }
            false => true,
        };
        for own in &self.own {
            let before = self.read(&self.file(part, number, own))?;
            same &= before.as_deref() == Some(&*self.bytes(own, made, files));
        }
        if same {
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

/// The grey levels of a PNG file's pixels.
pub(super) fn picture(bytes: &[u8]) -> Result<GrayImage, png::DecodingError> {
    let mut decoder = png::Decoder::new(std::io::Cursor::new(bytes));
    decoder.set_transformations(png::Transformations::IDENTITY);
    let mut reader = decoder.read_info()?;
    let (width, height) = (reader.info().width, reader.info().height);
    let mut pixels = vec![0; width as usize * height as usize];
    reader.next_frame(&mut pixels)?;
    Ok(GrayImage::from_raw(width, height, pixels).expect("a byte per pixel"))
}

/// The folder of a sample's files where a thousand share one.
pub(super) fn thousand(number: u64) -> String {
    format!("{:03}", number / u64::from(PER_FOLDER))
}

/// The entries of a folder of samples, and of those of a thousand each below it.
pub(super) fn within(folder: &Path) -> Vec<DirEntry> {
    let entries = |folder: &Path| std::fs::read_dir(folder).into_iter().flatten().flatten();
    let is_folder = |entry: &DirEntry| entry.file_type().is_ok_and(|kind| kind.is_dir());
    let (folders, mut all): (Vec<_>, Vec<_>) = entries(folder).partition(is_folder);
    all.extend(folders.iter().flat_map(|below| entries(&below.path())));
    all
}

/// Name of the first fact that differs between the two.
fn difference<'a>(begun: &Value, now: &'a Value) -> Option<&'a str> {
    let now = now.as_object().expect("a table of facts");
    let other = now.iter().find(|(name, value)| begun.get(name) != Some(value));
    other.map(|(name, _)| name.as_str())
}
