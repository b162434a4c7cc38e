//! Files that commands write: checked before the work, apart from each other and from what is read, whole or not there.

use std::fs::OpenOptions;
use std::path::{Path, PathBuf};

use insonify::output;
use insonify::output::files::{self, Draft};
use miette::{Result, miette};
use serde::Serialize;
use serde_json::{Map, Value};

/// Writes a JSON file, or a stream.
///
/// # Errors
/// Errors of the file system; a file that was there is then unchanged.
pub fn write_json(path: &Path, value: &impl Serialize) -> Result<()> {
    let written = files::replace(path, output::json(value).as_bytes());
    written.map_err(|e| miette!("writing {}: {e}", path.display()))
}

/// Writes what is said of pictures beside them, but not over a file of another program's; says so then.
///
/// # Errors
/// Errors of the file system; a file that was there is then unchanged.
pub fn write_sidecar(path: &Path, sidecar: &Map<String, Value>) -> Result<()> {
    if !files::is_stream(path) && path.exists() && !is_ours(path) {
        output::note(format!(
            "warning: {0} is there and is not of this program: it is kept, and what is said of the pictures is not written; \
             rename it, or name other pictures by -o",
            path.display()
        ));
        return Ok(());
    }
    write_json(path, sidecar)
}

/// True for a file that says which of these programs made it.
fn is_ours(path: &Path) -> bool {
    let sidecar = std::fs::read(path).ok();
    let sidecar = sidecar.and_then(|bytes| serde_json::from_slice::<Value>(&bytes).ok());
    let program = sidecar.as_ref().and_then(|sidecar| sidecar.get("program")?.as_str());
    program.is_some_and(|program| program.starts_with("insonify "))
}

/// Makes the folder of a file that is to be written, and makes sure that the file can be, before minutes of work for it.
///
/// # Errors
/// The folder cannot be made, or nothing can be written into it.
pub fn writable(path: &Path) -> Result<()> {
    let refused = |cause: String| {
        miette!(
            help = "name a file in a folder that you may write to",
            "{} cannot be written: {cause}",
            path.display()
        )
    };
    if path.is_dir() {
        return Err(refused("it is a folder".to_owned()));
    }
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder)
            .map_err(|e| refused(format!("its folder cannot be made: {e}")))?;
    }
    let tried = match files::is_stream(path) {
        true => OpenOptions::new().write(true).open(path).map(drop),
        false => Draft::new(path).map(drop),
    };
    tried.map_err(|e| refused(e.to_string()))
}

/// Makes a folder that is to be written to, and makes sure that it can be.
///
/// # Errors
/// Those of [`writable`].
pub fn writable_folder(path: &Path) -> Result<()> {
    writable(&path.join("-"))
}

/// A file of a command, where it is given, with what it is to the user: "the scene", "--json".
pub type Named<'a> = (&'a str, Option<&'a Path>);

/// Refuses to write a file that the same command reads, or writes as something else: by whatever names, also through
/// links. Pipes and devices take anything.
///
/// # Errors
/// Two of them are one file.
pub fn distinct(read: &[Named], written: &[Named]) -> Result<()> {
    let mut taken: Vec<(bool, &str, PathBuf)> = Vec::new();
    let read = read.iter().map(|named| (false, named));
    for (is_written, &(name, path)) in read.chain(written.iter().map(|named| (true, named))) {
        let Some(path) = path.filter(|path| !files::is_stream(path)) else { continue };
        let file = itself(path);
        let other = taken.iter().find(|(_, _, other)| *other == file);
        if let Some((other_is_written, other, _)) = other.filter(|_| is_written) {
            let deed = if *other_is_written { "would be written" } else { "is read" };
            return Err(miette!(
                help = format!("name another file by {name}"),
                "{} would be written as {name}, and {deed} as {other}: one file cannot be both",
                path.display()
            ));
        }
        taken.push((is_written, name, file));
    }
    Ok(())
}

/// The path of a file without links and steps back, also where there is no such file yet.
fn itself(path: &Path) -> PathBuf {
    let there = || {
        let path = std::path::absolute(path).ok()?;
        Some(path.parent()?.canonicalize().ok()?.join(path.file_name()?))
    };
    path.canonicalize().ok().or_else(there).unwrap_or_else(|| path.to_owned())
}
