//! Unsaved work kept on the disk while it is unsaved, so that neither a crash nor a power cut takes it.
//!
//! Each session has a folder of its own, beside those of others, in the system's folder for the state of programs:
//! `scene.toml` is the scene file with the unsaved settings and poses in place, `session.json` says the rest. A lock
//! that a dead process cannot hold tells which sessions have ended without being asked.

use std::fs::{File, create_dir_all, read_dir, remove_dir_all};
use std::io::Error;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Sender, channel};
use std::sync::{Arc, OnceLock};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};

use super::model::{Leftover, Model};
use super::tools::Tools;
use super::unsaved::Unsaved;
use crate::output::{self, files};
use crate::scene::file::{Entry, save};

/// Least time between two writings.
const PAUSE: Duration = Duration::from_secs(2);
/// Names of the files of a session.
const SCENE: &str = "scene.toml";
const SESSION: &str = "session.json";
const LOCK: &str = "lock";
/// An empty one, which says that there is room.
const TRIAL: &str = "trial";

/// The variable of the environment that names the system's folder for the state of programs.
pub(super) const STATE_VARIABLE: &str = "XDG_STATE_HOME";

/// The program's folder in the system's one for the state of programs; none where the system has none.
pub(super) fn state_folder() -> Option<PathBuf> {
    let state = dirs::state_dir().or_else(dirs::data_local_dir);
    state.map(|folder| folder.join("insonify"))
}

/// What `session.json` says.
#[derive(Serialize, Deserialize)]
struct Session {
    /// The scene file, from the root.
    scene: PathBuf,
    /// Seconds since 1970.
    at: u64,
    /// What is unsaved, in words.
    what: Vec<String>,
    left: Leftover,
}

/// A session that has ended without being asked.
pub(super) struct Orphan {
    folder: PathBuf,
    session: Session,
    /// Held as long as this session may take it up: no other does meanwhile.
    _lock: File,
}

impl Orphan {
    /// The scene file with its unsaved settings and poses.
    pub(super) fn scene(&self) -> PathBuf {
        self.folder.join(SCENE)
    }

    /// What was unsaved, in words.
    pub(super) fn what(&self) -> &[String] {
        &self.session.what
    }

    /// Time since it was written.
    pub(super) fn age(&self) -> Duration {
        Duration::from_secs(now().saturating_sub(self.session.at))
    }

    /// Measurements and recording.
    pub(super) fn left(&self) -> Leftover {
        self.session.left.clone()
    }

    /// Removes it.
    pub(super) fn discard(self) {
        // What cannot be removed is offered once more.
        let _ = remove_dir_all(&self.folder);
    }
}

/// A session to be written.
struct Draft {
    entries: Vec<Entry>,
    session: Session,
}

/// Keeps the unsaved work of one window.
pub(super) struct Keeper {
    /// The folder of all sessions; none where the system has no place for it.
    all: Option<PathBuf>,
    writer: Option<(Sender<Option<Draft>>, JoinHandle<()>)>,
    /// State of the model at the last writing, and what was unsaved then: saving a trajectory changes no settings.
    kept: Option<([u64; 3], Unsaved)>,
    written: Instant,
    /// The first reason for which nothing is kept, from the thread that writes, until it is taken.
    fault: Arc<OnceLock<String>>,
    /// True once it was taken.
    told: bool,
}

impl Default for Keeper {
    fn default() -> Self {
        let fault = Arc::default();
        Self { all: None, writer: None, kept: None, written: Instant::now(), fault, told: false }
    }
}

impl Keeper {
    pub(super) fn new() -> Self {
        Self { all: state_folder().map(|folder| folder.join("unsaved")), ..Self::default() }
    }

    /// The newest session of the scene file at `path` that has ended without being asked.
    pub(super) fn orphan(&self, path: &Path) -> Option<Orphan> {
        let scene = path.canonicalize().ok()?;
        let folders = read_dir(self.all.as_ref()?).ok()?.flatten();
        let found = folders.filter_map(|entry| taken_up(&entry.path(), &scene));
        found.max_by_key(|orphan| orphan.session.at)
    }

    /// Writes what is unsaved, if it has changed and the last time is long enough ago; returns when to call again.
    pub(super) fn keep(
        &mut self,
        model: &Model,
        tools: &Tools,
        with_pose: bool,
        now: Instant,
    ) -> Option<Instant> {
        let unsaved = Unsaved::of_all(model, tools, with_pose);
        if unsaved.is_empty() {
            if self.kept.take().is_some() {
                self.send(None);
            }
            return None;
        }
        let rows = model.trajectory.recorder.as_ref().map_or(0, |recorder| recorder.rows());
        let stand = ([model.revision(), model.steps(), rows as u64], unsaved);
        if self.kept == Some(stand) {
            return None;
        }
        let due = self.written + PAUSE;
        if due > now {
            return Some(due);
        }
        (self.kept, self.written) = (Some(stand), now);
        let scene = model.file.path.canonicalize().unwrap_or_else(|_| model.file.path.clone());
        let left = Leftover::of(model, tools.unfiled(model), now);
        let session = Session { scene, at: self::now(), what: unsaved.words(), left };
        self.send(Some(Draft { entries: model.changes(true), session }));
        None
    }

    /// The reason for which unsaved work is not kept, with the remedy; once.
    pub(super) fn fault(&mut self) -> Option<&str> {
        let fault = self.fault.get().filter(|_| !self.told)?;
        self.told = true;
        Some(fault)
    }

    /// Forgets what is kept: it is saved, or the user wants none of it.
    pub(super) fn forget(&mut self) {
        self.kept = None;
        if self.writer.is_some() {
            self.send(None);
        }
        if let Some((sender, thread)) = self.writer.take() {
            drop(sender);
            // Its panic is told by `deaths`.
            let _ = thread.join();
        }
    }

    fn send(&mut self, draft: Option<Draft>) {
        match &self.all {
            Some(all) if self.writer.is_none() => {
                self.writer = writer(all.clone(), self.fault.clone());
            }
            Some(_) => {}
            None => not_kept(&self.fault, None, output::NO_FOLDER),
        }
        if let Some((sender, _)) = &self.writer {
            // A writer that has died is told by `deaths`.
            let _ = sender.send(draft);
        }
    }
}

/// Notes why nothing is kept, and tells it where nobody sees the window; once.
fn not_kept(fault: &OnceLock<String>, place: Option<&Path>, cause: &str) {
    let what = "unsaved work is not kept for the case of a crash or a power cut";
    output::note_once(
        fault.get_or_init(|| output::not_kept(what, place, cause, STATE_VARIABLE)).clone(),
    );
}

/// Starts the thread that writes; none where the system has no room for one, which other threads tell.
fn writer(
    all: PathBuf,
    fault: Arc<OnceLock<String>>,
) -> Option<(Sender<Option<Draft>>, JoinHandle<()>)> {
    let (sender, drafts) = channel::<Option<Draft>>();
    let work = move || {
        let mut own: Option<(PathBuf, File)> = None;
        while let Ok(first) = drafts.recv() {
            // The newest counts.
            let newest = drafts.try_iter().last().unwrap_or(first);
            let done = match newest {
                Some(draft) => write(&all, &mut own, &draft),
                None => own.take().map_or(Ok(()), |(folder, _)| remove_dir_all(folder)),
            };
            if let Err(error) = done {
                not_kept(&fault, Some(&all), &error.to_string());
            }
        }
    };
    let thread = thread::Builder::new().name("keeper".into()).spawn(work).ok()?;
    Some((sender, thread))
}

/// Writes a draft into the session's own folder, which is made for the first.
fn write(all: &Path, own: &mut Option<(PathBuf, File)>, draft: &Draft) -> Result<(), Error> {
    let (folder, _) = match own {
        Some(own) => own,
        None => own.insert(folder(all)?),
    };
    let saved = save(&draft.session.scene, &folder.join(SCENE), &draft.entries);
    if let Err(error) = saved {
        // A scene file that somebody is editing is none for a while: what was kept before stays until the next change.
        let room = files::replace(&folder.join(TRIAL), &[]);
        return room.map_err(|_| Error::other(error.to_string()));
    }
    let text = serde_json::to_vec(&draft.session).map_err(Error::other)?;
    files::replace(&folder.join(SESSION), &text)
}

/// A folder that no other session has, with its lock.
fn folder(all: &Path) -> Result<(PathBuf, File), Error> {
    create_dir_all(all)?;
    let names = (0..).map(|number: u32| all.join(format!("{}-{number}", std::process::id())));
    let folder =
        names.into_iter().find(|folder| !folder.exists()).expect("there is no last number");
    create_dir_all(&folder)?;
    let lock = File::create(folder.join(LOCK))?;
    lock.try_lock()?;
    Ok((folder, lock))
}

/// The session in a folder, where it is one of `scene` and nobody's.
fn taken_up(folder: &Path, scene: &Path) -> Option<Orphan> {
    let session: Session =
        serde_json::from_slice(&std::fs::read(folder.join(SESSION)).ok()?).ok()?;
    if session.scene != scene {
        return None;
    }
    let lock = File::options().write(true).open(folder.join(LOCK)).ok()?;
    lock.try_lock().ok()?;
    Some(Orphan { folder: folder.to_owned(), session, _lock: lock })
}

fn now() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn draft() -> Option<Draft> {
        let left = Leftover { marks: Default::default(), recording: None };
        let session = Session { scene: "/nowhere.toml".into(), at: 0, what: Vec::new(), left };
        Some(Draft { entries: Vec::new(), session })
    }

    #[test]
    fn where_nothing_can_be_kept_it_is_told_once_with_place_and_remedy() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("file");
        std::fs::write(&file, "no folder").expect("written");
        let below = file.join("unsaved");
        for all in [Some(below.clone()), None] {
            let is_named = all.is_some();
            let mut keeper = Keeper { all, ..Keeper::default() };
            assert_eq!(keeper.fault(), None);
            keeper.send(draft());
            // By the thread that writes.
            let begun = Instant::now();
            let said = loop {
                if let Some(fault) = keeper.fault() {
                    break fault.to_owned();
                }
                assert!(begun.elapsed() < Duration::from_secs(60), "it is not told");
                thread::sleep(Duration::from_millis(1));
            };
            let named = said.contains(&below.display().to_string());
            assert!(named == is_named && said.contains(STATE_VARIABLE), "{said}");
            keeper.send(draft());
            keeper.forget();
            assert_eq!(keeper.fault(), None, "it was told");
        }
    }
}
