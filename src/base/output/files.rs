//! Files that are written whole or not at all.

use std::fs::File;
use std::io::{Error, ErrorKind, Result, Write};
use std::path::{Path, PathBuf};

use super::lock;

/// Most drafts of one file at a time.
const DRAFTS: u32 = 100;

/// A file that is being written beside its place, as `.NAME.` with a number, and takes its place when it is
/// finished: no failure leaves half a file. Dropped before, it is removed; what a killed process has left of it is removed by
/// the next draft of the file. Pipes and devices are written to as they are.
pub struct Draft {
    path: PathBuf,
    /// Path of what is being written; `path` itself for a stream.
    beside: PathBuf,
    /// None once the file has taken its place.
    file: Option<File>,
}

impl Draft {
    /// Begins the file that is to become `path`. A link stays one; permissions stay as they were.
    ///
    /// # Errors
    /// Errors of the file system; `path` is then unchanged.
    pub fn new(path: &Path) -> Result<Self> {
        if is_stream(path) {
            let file = std::fs::OpenOptions::new().write(true).open(path)?;
            return Ok(Self { path: path.to_owned(), beside: path.to_owned(), file: Some(file) });
        }
        let path = path.canonicalize().unwrap_or_else(|_| path.to_owned());
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        // From 1, so that the dead ones are met.
        let free = (1..=DRAFTS).find_map(|number| {
            let beside = path.with_file_name(format!(".{name}.{number}"));
            lock::made(&beside).map(|file| Some((beside, file?))).transpose()
        });
        let all_taken = || Err(Error::from(ErrorKind::AlreadyExists));
        let (beside, file) = free.unwrap_or_else(all_taken)?;
        let draft = Self { path, beside, file: Some(file) };
        if let Ok(before) = std::fs::metadata(&draft.path) {
            draft.open().set_permissions(before.permissions())?;
        }
        Ok(draft)
    }

    /// Path of what is being written, for a program that writes it in this one's place.
    pub fn beside(&self) -> &Path {
        &self.beside
    }

    fn open(&self) -> &File {
        self.file.as_ref().expect("it is finished only once")
    }

    /// Puts what was written into its place, once it is on the disk.
    ///
    /// # Errors
    /// Errors of the file system; the place is then unchanged.
    pub fn finish(mut self) -> Result<()> {
        if self.beside != self.path {
            self.open().sync_all()?;
            std::fs::rename(&self.beside, &self.path)?;
        }
        self.file = None;
        Ok(())
    }
}

impl Write for Draft {
    fn write(&mut self, bytes: &[u8]) -> Result<usize> {
        self.open().write(bytes)
    }

    fn flush(&mut self) -> Result<()> {
        self.open().flush()
    }
}

impl Drop for Draft {
    fn drop(&mut self) {
        if self.file.is_some() && self.beside != self.path {
            // A partial file is of no use; the first error is the one to report.
            let _ = std::fs::remove_file(&self.beside);
        }
    }
}

/// The file of which the file name `name` is a draft; none for other names.
pub fn draft_of(name: &str) -> Option<&str> {
    let (file, number) = name.strip_prefix('.')?.rsplit_once('.')?;
    let is_number = !number.is_empty() && number.bytes().all(|b| b.is_ascii_digit());
    (is_number && !file.is_empty()).then_some(file)
}

/// True for a pipe or a device, which is written to as it is.
pub fn is_stream(path: &Path) -> bool {
    path.exists() && !path.is_file() && !path.is_dir()
}

/// Writes `bytes` as the file `path`, by a [`Draft`].
///
/// # Errors
/// Errors of the file system; `path` is then unchanged.
pub fn replace(path: &Path, bytes: &[u8]) -> Result<()> {
    let mut draft = Draft::new(path)?;
    draft.write_all(bytes)?;
    draft.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_draft_takes_its_place_when_finished_and_leaves_nothing_when_dropped() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.tar");
        let names = || {
            let all = std::fs::read_dir(folder.path()).unwrap();
            let mut names: Vec<_> =
                all.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
            names.sort();
            names
        };
        replace(&path, b"before").unwrap();
        let mut draft = Draft::new(&path).unwrap();
        let mut other = Draft::new(&path).unwrap();
        draft.write_all(b"after").unwrap();
        other.write_all(b"lost").unwrap();
        let drafts: Vec<_> =
            names().iter().filter_map(|n| draft_of(n).map(str::to_owned)).collect();
        assert_eq!(drafts, ["a.tar", "a.tar"]);
        drop(other);
        assert_eq!(std::fs::read(&path).unwrap(), b"before");
        draft.finish().unwrap();
        assert_eq!(
            (names(), std::fs::read(&path).unwrap()),
            (vec!["a.tar".to_owned()], b"after".to_vec())
        );
    }

    #[test]
    fn what_a_killed_process_left_goes_with_the_next_draft() {
        let folder = tempfile::tempdir().unwrap();
        let [path, left] = ["a.gif", ".a.gif.1"].map(|name| folder.path().join(name));
        std::fs::write(&left, "half").unwrap();
        // Another file's, and a folder, are not ours.
        let others = [".b.gif.1", ".a.gif.2"].map(|name| folder.path().join(name));
        std::fs::write(&others[0], "half").unwrap();
        std::fs::create_dir(&others[1]).unwrap();
        let mut first = Draft::new(&path).unwrap();
        let second = Draft::new(&path).unwrap();
        assert_eq!((first.beside(), second.beside()), (&*left, &*folder.path().join(".a.gif.3")));
        first.write_all(b"whole").unwrap();
        first.finish().unwrap();
        drop(second);
        assert_eq!(std::fs::read(&path).unwrap(), b"whole");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 3);
        assert!(others.iter().all(|path| path.exists()));
    }

    #[test]
    fn names_of_drafts_are_told_from_others() {
        assert_eq!(draft_of(".train-000007.tar.4711"), Some("train-000007.tar"));
        for name in ["a.png", ".hidden", ".a.png", ".5", ".a.png.4x", "a.1"] {
            assert_eq!(draft_of(name), None, "{name}");
        }
    }
}
