//! Archives of samples (tar), with nothing in them that depends on time or user.

use std::io::{Read as _, Result};
use std::path::Path;

use crate::output::files::Draft;

/// An archive that is being written; it takes its place when it is finished.
pub(super) struct Archive(tar::Builder<Draft>);

impl Archive {
    /// Begins the archive that is to become `path`, in a folder that is made where there is none.
    pub fn new(path: &Path) -> Result<Self> {
        std::fs::create_dir_all(path.parent().expect("it lies in a folder"))?;
        Ok(Self(tar::Builder::new(Draft::new(path)?)))
    }

    /// Adds a file.
    pub fn add(&mut self, name: &str, bytes: &[u8]) -> Result<()> {
        let mut header = tar::Header::new_ustar();
        header.set_path(name)?;
        header.set_size(bytes.len() as u64);
        header.set_mode(0o644);
        header.set_mtime(0);
        header.set_uid(0);
        header.set_gid(0);
        header.set_cksum();
        self.0.append(&header, bytes)
    }

    /// Puts the archive into its place.
    pub fn finish(self) -> Result<()> {
        self.0.into_inner()?.finish()
    }
}

/// The files of these names in an archive; none where one is missing.
pub(super) fn read(path: &Path, names: &[String]) -> Result<Option<Vec<Vec<u8>>>> {
    let mut found = vec![None; names.len()];
    let mut archive = tar::Archive::new(std::fs::File::open(path)?);
    for entry in archive.entries()? {
        let mut entry = entry?;
        let name = entry.path()?.to_string_lossy().into_owned();
        if let Some(place) = names.iter().position(|n| *n == name) {
            let mut bytes = Vec::new();
            entry.read_to_end(&mut bytes)?;
            found[place] = Some(bytes);
        }
    }
    Ok(found.into_iter().collect())
}
