//! Finished data sets in the layouts of others: nnU-Net, COCO, Hugging Face, and a table of the samples.

mod card;
mod coco;
mod huggingface;
mod nnunet;
mod set;
mod table;

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::DatasetError;
use super::store::thousand;
use crate::issue::FileError;
use crate::output::lock::{Hold, LOCK};
use crate::output::{self, files};
pub use card::Licence;
use card::Totals;
use set::Labelled;
pub use set::Set;

/// A layout in which a data set is written once more.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// `imagesTr`, `labelsTr` and `dataset.json` of nnU-Net (version 2).
    NnUnet,
    /// Images by split, and their segmentations as COCO's annotations.
    Coco,
    /// Images by split with `metadata.jsonl`, as `datasets.load_dataset("imagefolder")` reads it.
    HuggingFace,
    /// One table of all samples, CSV.
    Table,
}

impl Layout {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::NnUnet, Self::Coco, Self::HuggingFace, Self::Table];

    /// Its name in commands.
    pub fn word(self) -> &'static str {
        match self {
            Self::NnUnet => "nnunet",
            Self::Coco => "coco",
            Self::HuggingFace => "huggingface",
            Self::Table => "table",
        }
    }
}

/// The files of a layout that is being written.
struct Out {
    root: PathBuf,
    _held: Hold,
}

impl Out {
    /// Begins a folder, which has to be new or empty.
    fn new(root: &Path) -> Result<Self, DatasetError> {
        let refused =
            |message: &str, remedy| Err(FileError::file(root, message.to_owned(), remedy).into());
        fs::create_dir_all(root).map_err(|e| DatasetError::writing(root, e))?;
        let path = root.join(LOCK);
        let Some(held) = Hold::take(&path).map_err(|e| DatasetError::writing(&path, e))? else {
            return refused(
                "is being written by another run",
                "wait for its end, or name a new folder",
            );
        };
        let mut entries = fs::read_dir(root).map_err(|e| DatasetError::reading(root, e))?.flatten();
        if entries.any(|entry| entry.file_name() != LOCK) {
            return refused("holds files already", "name a new folder");
        }
        Ok(Self { root: root.to_owned(), _held: held })
    }

    /// Writes a file, by its path in the folder.
    fn write(&self, path: &str, bytes: &[u8]) -> Result<(), DatasetError> {
        let path = self.root.join(path);
        let folder = path.parent().expect("it lies in a folder");
        fs::create_dir_all(folder).map_err(|e| DatasetError::writing(folder, e))?;
        files::replace(&path, bytes).map_err(|e| DatasetError::writing(&path, e))
    }

    fn write_json(&self, path: &str, value: &Value) -> Result<(), DatasetError> {
        self.write(path, output::json(value).as_bytes())
    }
}

/// The path of an image among a thousand others: `train/000/000123.png`.
fn placed(sample: &Labelled, end: &str) -> String {
    format!("{}/{}/{}.{end}", sample.split, thousand(sample.number), sample.name)
}

/// Writes the data set in the folder `root` in a layout: into the folder `to`, or as the table `to`. `progress` hears of each
/// sample and of their number.
///
/// # Errors
/// A folder that is no data set, or is not complete; one that cannot be written, or holds files already.
pub fn write(
    root: &Path,
    layout: Layout,
    licence: &Licence,
    to: &Path,
    progress: &mut dyn FnMut(u64, u64),
) -> Result<(), DatasetError> {
    let set = Set::open(root)?;
    let mut totals = Totals::of(&set);
    let mut counted = |sample: &Labelled| {
        totals.add(sample);
        progress(totals.samples(), set.samples);
    };
    if layout == Layout::Table {
        return table::write(&set, to, &mut counted);
    }
    let out = Out::new(to)?;
    match layout {
        Layout::NnUnet => nnunet::write(&set, &out, &mut counted)?,
        Layout::Coco => coco::write(&set, licence, &out, &mut counted)?,
        Layout::HuggingFace => huggingface::write(&set, &out, &mut counted)?,
        Layout::Table => unreachable!("it has no folder"),
    }
    let card = totals.card(&set, layout, licence);
    out.write("README.md", card.as_bytes())
}
