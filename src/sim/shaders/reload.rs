//! Kernels that are recompiled while the program runs; on an error the last good ones stay (feature `compile`).

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use super::Library;
use super::authors::source::{self, file_error};
use super::authors::{Error, compiler};

/// A folder of sources and its last known state.
pub(super) struct WatchedSources {
    dir: PathBuf,
    /// Modification time of every file at the last check; `None` before the first.
    seen: Option<BTreeMap<PathBuf, SystemTime>>,
    /// Hash of the sources of the words in use, per stem.
    loaded: BTreeMap<String, String>,
}

impl Library {
    /// The kernels of `dir`, compiled now and again whenever [`Library::poll`] finds them changed.
    /// Kernels that are missing in `dir` stay the embedded ones.
    pub fn with_sources(dir: impl Into<PathBuf>) -> Result<Self, Error> {
        let mut library = Self::embedded();
        library.watched =
            Some(WatchedSources { dir: dir.into(), seen: None, loaded: BTreeMap::new() });
        library.poll()?;
        Ok(library)
    }

    /// Checks whether sources have changed (by modification time) and recompiles the kernels that depend on
    /// them. Returns the stems whose words are new; their pipelines must be built again.
    /// On an error every kernel keeps its last good words, and the error is returned once, not on
    /// every call. Without sources nothing changes.
    pub fn poll(&mut self) -> Result<Vec<String>, Error> {
        let Some(watched) = &mut self.watched else {
            return Ok(Vec::new());
        };
        let times = modification_times(&watched.dir)?;
        if watched.seen.as_ref() == Some(&times) {
            return Ok(Vec::new());
        }
        watched.seen = Some(times);
        let mut fresh = Vec::new();
        for variant in source::variants(&watched.dir)? {
            if variant.keep_names {
                continue;
            }
            let hash = source::hash(&watched.dir, &variant, "")?;
            if watched.loaded.get(&variant.stem) != Some(&hash) {
                fresh.push((compiler::compile(&watched.dir, &variant)?, variant.stem, hash));
            }
        }
        let mut changed = Vec::new();
        for (words, stem, hash) in fresh {
            watched.loaded.insert(stem.clone(), hash);
            if self.words.get(&stem) != Some(&words) {
                self.words.insert(stem.clone(), words);
                changed.push(stem);
            }
        }
        Ok(changed)
    }
}

fn modification_times(dir: &Path) -> Result<BTreeMap<PathBuf, SystemTime>, Error> {
    let mut times = BTreeMap::new();
    for entry in fs::read_dir(dir).map_err(|e| file_error(dir, e))? {
        let path = entry.map_err(|e| file_error(dir, e))?.path();
        let time = fs::metadata(&path).and_then(|m| m.modified());
        times.insert(path.clone(), time.map_err(|e| file_error(path, e))?);
    }
    Ok(times)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn write(dir: &Path, body: &str, seconds: u64) {
        let path = dir.join("copy.comp");
        let text = format!(
            "#version 460\nlayout(local_size_x = 1) in;\n\
             layout(std430, binding = 0) buffer B {{ uint b[]; }};\nvoid main() {{ {body} }}\n"
        );
        fs::write(&path, text).unwrap();
        let time = SystemTime::UNIX_EPOCH + std::time::Duration::from_secs(seconds);
        fs::File::options().write(true).open(&path).unwrap().set_modified(time).unwrap();
    }

    #[test]
    fn a_kernel_that_does_not_compile_keeps_the_last_good_one() {
        let dir = tempfile::tempdir().unwrap();
        write(dir.path(), "b[0] = 1u;", 1);
        let mut library = Library::with_sources(dir.path()).unwrap();
        let first = library.words("copy").to_vec();
        assert!(library.poll().unwrap().is_empty());

        write(dir.path(), "b[0] = nonsense;", 2);
        let message = library.poll().unwrap_err().to_string();
        assert!(message.contains("copy.comp:4") && message.contains("nonsense"), "{message}");
        assert_eq!(library.words("copy"), first);
        assert!(library.poll().unwrap().is_empty(), "the error is told once");

        write(dir.path(), "b[0] = 2u;", 3);
        assert_eq!(library.poll().unwrap(), ["copy"]);
        assert_ne!(library.words("copy"), first);
    }
}
