//! The scene files that were opened last, in the system's folder for the state of programs.

use std::path::{Path, PathBuf};

use super::keeper;
use crate::output::{self, files};
use crate::scene::shipped;

/// Most files that are remembered.
const MOST: usize = 8;

/// The files that were opened last and still exist, the newest first.
pub(super) fn list() -> Vec<PathBuf> {
    let text = place().and_then(|place| std::fs::read_to_string(place).ok()).unwrap_or_default();
    let files = text.lines().map(PathBuf::from);
    files.filter(|file| file.is_file()).take(MOST).collect()
}

/// The files that were opened last before the one at `path`.
pub(super) fn before(path: &Path) -> Vec<PathBuf> {
    let open = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    list().into_iter().filter(|file| *file != open).collect()
}

/// Puts a file at the head of the list, unless it ships: the gallery shows those. Where the list cannot be written, which is
/// told once, it stays as it is.
pub(super) fn add(file: &Path) {
    let not_kept = |place: Option<&Path>, cause: &str| {
        let what = "the files that were opened are not remembered";
        output::note_once(output::not_kept(what, place, cause, keeper::STATE_VARIABLE));
    };
    let Ok(file) = file.canonicalize() else { return };
    if shipped::is_shipped(&file) {
        return;
    }
    let Some(place) = place() else { return not_kept(None, output::NO_FOLDER) };
    let known = list();
    if known.first() == Some(&file) {
        return;
    }
    let lines: Vec<String> = std::iter::once(&file)
        .chain(known.iter().filter(|known| **known != file))
        .take(MOST)
        // A name of several lines is no line of the list.
        .filter_map(|file| file.to_str().filter(|name| !name.contains('\n')).map(str::to_owned))
        .collect();
    let made = place.parent().map_or(Ok(()), std::fs::create_dir_all);
    let written = made.and_then(|()| files::replace(&place, (lines.join("\n") + "\n").as_bytes()));
    if let Err(cause) = written {
        not_kept(Some(&place), &cause.to_string());
    }
}

fn place() -> Option<PathBuf> {
    keeper::state_folder().map(|folder| folder.join("recent"))
}
