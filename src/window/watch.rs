//! The scene file and the files that it names, watched for changes by other programs.
//!
//! Their times and sizes are read twice a second. Notifications of the system would come sooner, but none come from
//! shared folders, and an editor that puts a new file in the place of the old one ends them.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::thread;
use std::time::{Duration, SystemTime};

use parking_lot::Mutex;

use crate::scene::file::named_files;

/// Time between two looks.
const PAUSE: Duration = Duration::from_millis(500);

/// The time of a file's last change, and its size; none of a file that is not there.
type Stamp = Option<(SystemTime, u64)>;

#[derive(Default)]
struct Watched {
    files: Vec<PathBuf>,
    /// The state of each file that the session knows.
    known: Vec<Stamp>,
    /// The state at the last look: what still changes is being written.
    last: Vec<Stamp>,
    changed: bool,
    /// True while the scene file is not there, and until that is told.
    gone: bool,
    untold: bool,
}

/// Watches the files of one scene. Its thread ends after it.
pub(super) struct Watch(Arc<Mutex<Watched>>);

impl Watch {
    /// Watches nothing yet; calls `wake`, from another thread, when something has changed.
    ///
    /// # Errors
    /// The system has no room for another thread.
    pub(super) fn new(wake: impl Fn() + Send + 'static) -> std::io::Result<Self> {
        let watched = Arc::new(Mutex::new(Watched::default()));
        let weak = Arc::downgrade(&watched);
        thread::Builder::new().name("watch".into()).spawn(move || {
            while let Some(watched) = weak.upgrade() {
                let files = watched.lock().files.clone();
                // Not under the lock: a shared folder may take long to answer.
                let now = stamps(&files);
                let mut watched = watched.lock();
                let is_new = watched.files == files && watched.look(now);
                drop(watched);
                if is_new {
                    wake();
                }
                thread::sleep(PAUSE);
            }
        })?;
        Ok(Self(watched))
    }

    /// Watches the scene file at `path` and the files that it names now, as they are now. What has already been seen
    /// to change of the same scene is still told.
    pub(super) fn set(&self, path: &Path) {
        let mut files = vec![path.to_owned()];
        let mut watched = self.0.lock();
        match named_files(path) {
            Some(named) => files.extend(named),
            // It cannot be read at present: what it named before is still of interest.
            None if watched.files.first() == Some(&files[0]) => files.clone_from(&watched.files),
            None => {}
        }
        let known = stamps(&files);
        let changed = watched.changed && watched.files.first() == files.first();
        let last = known.clone();
        *watched = Watched { files, last, known, changed, ..Watched::default() };
    }

    /// Returns, once, whether the scene file is no longer there.
    pub(super) fn take_gone(&self) -> bool {
        std::mem::take(&mut self.0.lock().untold)
    }

    /// Returns, once, whether something has changed.
    pub(super) fn take(&self) -> bool {
        std::mem::take(&mut self.0.lock().changed)
    }
}

impl Watched {
    /// Compares with a new look; returns whether something has changed, and is written, or the scene file is gone.
    fn look(&mut self, now: Vec<Stamp>) -> bool {
        let is_steady = now == self.last;
        self.last = now;
        // Of no files the first is not gone.
        let first = |stamps: &[Stamp]| stamps.first().copied().unwrap_or_default();
        let away = is_steady && !self.last.is_empty() && first(&self.last).is_none();
        let was_gone = std::mem::replace(&mut self.gone, away);
        if self.gone && !was_gone && first(&self.known).is_some() {
            self.untold = true;
            return true;
        }
        let is_new = is_steady && self.last != self.known && self.last[0].is_some();
        if is_new {
            self.known.clone_from(&self.last);
            self.changed = true;
        }
        is_new
    }
}

fn stamps(files: &[PathBuf]) -> Vec<Stamp> {
    let stamp = |file: &PathBuf| {
        let about = std::fs::metadata(file).ok()?;
        Some((about.modified().ok()?, about.len()))
    };
    files.iter().map(stamp).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_is_told_once_when_it_is_written_and_not_while_the_file_is_away() {
        let at = |n: u64| Some((SystemTime::UNIX_EPOCH + Duration::from_secs(n), n));
        let known = vec![at(1), at(1)];
        let mut watched = Watched { last: known.clone(), known, ..Watched::default() };
        let looks = [
            (at(1), at(1), false),
            // Two looks in which it grows, one in which it rests.
            (at(2), at(1), false),
            (at(3), at(1), false),
            (at(3), at(1), true),
            (at(3), at(1), false),
            // Replaced by an editor that removes it first; a mesh that is gone counts.
            (None, at(1), false),
            (at(3), None, false),
            (at(3), None, true),
            (at(3), None, false),
        ];
        for (i, (scene, mesh, expected)) in looks.into_iter().enumerate() {
            assert_eq!(watched.look(vec![scene, mesh]), expected, "{i}");
            assert_eq!(std::mem::take(&mut watched.changed), expected, "{i}");
        }
        // The scene file itself stays away: told once, and again when it has been back.
        for (i, (scene, expected)) in [
            (None, false),
            (None, true),
            (None, false),
            (at(3), false),
            (None, false),
            (None, true),
        ]
        .into_iter()
        .enumerate()
        {
            assert_eq!(watched.look(vec![scene, None]), expected, "{i}");
            assert_eq!(std::mem::take(&mut watched.untold), expected, "{i}");
            assert!(!watched.changed, "{i}");
        }
    }

    #[test]
    fn nothing_is_watched_at_first_and_nothing_is_told_of_it() {
        let mut watched = Watched::default();
        assert!(!watched.look(Vec::new()) && !watched.look(Vec::new()));
        assert!(!watched.untold && !watched.changed);
    }

    #[test]
    fn what_a_scene_names_is_watched_and_own_writing_is_no_change() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("scene.toml");
        let text = "[volume]\nfile = [\"v.mha\"]\n[[mesh]]\nname = \"a\"\nfile = \"a.obj\"\n";
        std::fs::write(&path, text).expect("written");
        let watch = Watch::new(|| {}).expect("a thread");
        watch.set(&path);
        let names = ["scene.toml", "v.mha", "a.obj"].map(|name| folder.path().join(name));
        assert_eq!(watch.0.lock().files, names);
        // Unreadable, its meshes stay watched.
        std::fs::write(&path, "[[mesh").expect("written");
        watch.set(&path);
        assert_eq!(watch.0.lock().files, names);
        assert!(!watch.take());
        std::fs::write(&names[2], "v 0 0 0").expect("written");
        let began = std::time::Instant::now();
        while !watch.take() {
            assert!(began.elapsed() < Duration::from_secs(60), "nothing is told");
            thread::sleep(Duration::from_millis(20));
        }
    }
}
