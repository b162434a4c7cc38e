//! Folders and sets of files that one process at a time writes.

use std::fs::{File, TryLockError, remove_file};
use std::io::{ErrorKind, Result};
use std::path::{Path, PathBuf};

use same_file::Handle;

/// Name of the file of a folder that one run writes as a whole.
pub const LOCK: &str = ".lock";

/// The right to write a folder, or a set of files: one process at a time has it, and loses it when it ends, however that
/// is. Its file is removed when it is dropped; what a killed process leaves of it keeps nobody out.
#[derive(Debug)]
pub struct Hold {
    path: PathBuf,
    /// None where the file system has no locks.
    _file: Option<File>,
}

impl Hold {
    /// Takes the right whose file is `path`, in a folder that is there; none where another process has it. On file systems
    /// without locks, as some that clusters share, everybody gets it, with a warning.
    ///
    /// # Errors
    /// The file cannot be made.
    pub fn take(path: &Path) -> Result<Option<Self>> {
        loop {
            let file = File::options().create(true).truncate(false).write(true).open(path)?;
            let file = match had(&file, path) {
                Ok(Had::Yes) => Some(file),
                Ok(Had::No) => return Ok(None),
                // The process that had it until now has just removed its file.
                Ok(Had::Gone) => continue,
                Err(cause) => {
                    super::note(format!(
                        "warning: {} cannot be locked ({cause}): nothing keeps a second run from writing there meanwhile; start \
                         one at a time",
                        path.display()
                    ));
                    None
                }
            };
            return Ok(Some(Self { path: path.to_owned(), _file: file }));
        }
    }
}

impl Drop for Hold {
    fn drop(&mut self) {
        // Before the lock goes: nobody else's can be removed. What cannot be removed keeps nobody out.
        let _ = remove_file(&self.path);
    }
}

/// Whose an open file is.
enum Had {
    /// This process's, from now on until the file is closed.
    Yes,
    /// Another process's.
    No,
    /// Nobody's, but its path leads to another file now, or to none.
    Gone,
}

/// Takes the lock of a file that was opened at `path`.
///
/// # Errors
/// Locks that the file system does not have.
fn had(file: &File, path: &Path) -> Result<Had> {
    match file.try_lock() {
        Ok(()) => {}
        Err(TryLockError::WouldBlock) => return Ok(Had::No),
        Err(TryLockError::Error(cause)) => return Err(cause),
    }
    let here = Handle::from_file(file.try_clone()?)?;
    match Handle::from_path(path) {
        Ok(there) if there == here => Ok(Had::Yes),
        Ok(_) => Ok(Had::Gone),
        Err(e) if e.kind() == ErrorKind::NotFound => Ok(Had::Gone),
        Err(e) => Err(e),
    }
}

/// Makes the file `path`, which is this process's until it is closed; one that a dead process has left there is removed
/// before. None where another process has it, or where nobody knows.
///
/// # Errors
/// The file cannot be made.
pub(super) fn made(path: &Path) -> Result<Option<File>> {
    for _ in 0..2 {
        match File::create_new(path) {
            // Where it cannot be locked it is never taken for a dead one's either.
            Ok(file) => {
                return Ok(had(&file, path)
                    .map_or(true, |had| matches!(had, Had::Yes))
                    .then_some(file));
            }
            Err(e) if e.kind() == ErrorKind::AlreadyExists => {
                // Nothing but a file: opening a pipe waits for its reader.
                let is_file = path.symlink_metadata().is_ok_and(|about| about.is_file());
                let left = is_file.then(|| File::options().write(true).open(path).ok()).flatten();
                let is_dead = |file: &File| matches!(had(file, path), Ok(Had::Yes));
                if !left.is_some_and(|file| is_dead(&file) && remove_file(path).is_ok()) {
                    return Ok(None);
                }
            }
            Err(e) => return Err(e),
        }
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_has_it_at_a_time_and_what_the_dead_leave_keeps_nobody_out() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(".lock");
        let take = || Hold::take(&path).unwrap();
        // As a killed process leaves it.
        std::fs::write(&path, "").unwrap();
        let first = take().expect("nobody's");
        assert!(take().is_none());
        drop(first);
        assert!(!path.exists());
        drop(take().expect("free again"));
        assert!(Hold::take(&folder.path().join("no/.lock")).is_err());
    }

    #[test]
    fn of_many_at_once_one_has_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(".lock");
        let inside = std::sync::atomic::AtomicU32::new(0);
        let order = std::sync::atomic::Ordering::SeqCst;
        let turns = std::thread::scope(|scope| {
            let worker = || {
                let mut turns = 0;
                while turns < 200 {
                    let Some(hold) = Hold::take(&path).unwrap() else { continue };
                    assert_eq!(inside.fetch_add(1, order), 0, "two have it");
                    inside.fetch_sub(1, order);
                    turns += 1;
                    drop(hold);
                }
                turns
            };
            let all: Vec<_> = (0..4).map(|_| scope.spawn(worker)).collect();
            all.into_iter().map(|one| one.join().unwrap()).sum::<u32>()
        });
        assert_eq!(turns, 800);
    }
}
