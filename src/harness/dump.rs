//! Jobs to and from a folder: `NAME.npy` per binding, `push.npy` for push constants.
//!
//! A binding is also found under a leading number, so that stages of `insonify render --dump`
//! (`2_lateral.npy`) can be replayed; `frame.npy` says how large everything is.

use std::fs;
use std::path::{Path, PathBuf};

use super::{Element, Job, Subject};
use crate::npy;

/// Writes every binding of a job, or of what a run left behind.
///
/// # Errors
/// What the file system says.
pub fn write(dir: &Path, job: &Job, contents: &[Vec<u8>]) -> std::io::Result<()> {
    fs::create_dir_all(dir)?;
    for (input, bytes) in job.inputs.iter().zip(contents) {
        npy::write(
            &dir.join(format!("{}.npy", input.name)),
            input.element,
            &[bytes.len() / 4],
            bytes,
        )?;
    }
    let words = [job.push.len() / 4];
    npy::write(&dir.join("push.npy"), Element::Word, &words, &job.push)
}

/// Replaces the bindings of `job` that the folder has; returns their names. Bindings that the
/// kernel only writes are made as large as the others ask for.
///
/// # Errors
/// A sentence on an array that cannot be read or is too small for the frame.
pub fn read(dir: &Path, subject: &Subject, job: &mut Job) -> Result<Vec<&'static str>, String> {
    let mut found = Vec::new();
    for input in &mut job.inputs {
        if let Some(path) = file(dir, input.name)? {
            input.bytes = npy::read(&path)?;
            found.push(input.name);
        }
    }
    if let Some(path) = file(dir, "push")? {
        job.push = npy::read(&path)?;
        found.push("push");
    }
    if found.is_empty() {
        let names: Vec<_> = job.inputs.iter().map(|i| i.name).collect();
        return Err(format!(
            "{}: none of {} is there as NAME.npy; `kernels run {} --output DIR` writes them",
            dir.display(),
            names.join(", "),
            subject.name
        ));
    }
    if found.contains(&"frame") && job.get::<crate::sim::layout::Frame>("frame").is_empty() {
        return Err(format!(
            "{}: frame.npy is shorter than a frame",
            dir.display()
        ));
    }
    let needed = (subject.sizes)(job);
    for (input, needed) in job.inputs.iter_mut().zip(needed) {
        if input.bytes.len() >= needed {
            continue;
        }
        if found.contains(&input.name) {
            return Err(format!(
                "{}: {} has {} bytes and the frame asks for {needed}; dump frame.npy from the same run",
                dir.display(),
                input.name,
                input.bytes.len()
            ));
        }
        input.bytes.resize(needed, 0);
    }
    Ok(found)
}

/// `NAME.npy` or `2_NAME.npy`.
fn file(dir: &Path, name: &str) -> Result<Option<PathBuf>, String> {
    let entries = fs::read_dir(dir).map_err(|e| format!("{}: {e}", dir.display()))?;
    for entry in entries {
        let path = entry.map_err(|e| format!("{}: {e}", dir.display()))?.path();
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let plain = stem.trim_start_matches(|c: char| c.is_ascii_digit() || c == '_');
        if plain == name && path.extension().is_some_and(|x| x == "npy") {
            return Ok(Some(path));
        }
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use super::super::{Case, SUBJECTS, Size};
    use super::*;

    fn contents(job: &Job) -> Vec<Vec<u8>> {
        job.inputs.iter().map(|i| i.bytes.clone()).collect()
    }

    #[test]
    fn every_job_survives_the_folder() {
        for subject in &SUBJECTS {
            for case in Case::ALL {
                let job = (subject.job)(case, Size::Small);
                let dir = tempfile::tempdir().unwrap();
                write(dir.path(), &job, &contents(&job)).unwrap();
                let mut again = (subject.job)(Case::One, Size::Small);
                read(dir.path(), subject, &mut again).unwrap();
                assert_eq!(again, job, "{} {case:?}", subject.name);
            }
        }
    }

    #[test]
    fn numbered_stages_are_found_and_arrays_too_small_refused() {
        let subject = SUBJECTS.iter().find(|s| s.name == "axial").unwrap();
        let mut job = (subject.job)(Case::Odd, Size::Small);
        let dir = tempfile::tempdir().unwrap();
        let empty = read(dir.path(), subject, &mut job).unwrap_err();
        assert!(empty.contains("frame, lateral, iq"), "{empty}");
        let path = dir.path().join("2_lateral.npy");
        let lateral = job.inputs[1].bytes.clone();
        npy::write(&path, Element::Float, &[lateral.len() / 4], &lateral).unwrap();
        assert_eq!(read(dir.path(), subject, &mut job).unwrap(), ["lateral"]);
        npy::write(
            &path,
            Element::Float,
            &[lateral.len() / 4 - 2],
            &lateral[8..],
        )
        .unwrap();
        let error = read(dir.path(), subject, &mut job).unwrap_err();
        assert!(
            error.contains("lateral has") && error.contains("dump frame.npy"),
            "{error}"
        );
    }
}
