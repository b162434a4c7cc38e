//! Jobs to and from a folder: `NAME.npy` per binding, `push.npy` for push constants.
//!
//! The folder that `insonify render --dump` writes will do as well.

use std::fs;
use std::path::Path;

use super::{Element, Job, Role, Subject};
use crate::output::npy;

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

/// Replaces the bindings of `job` that the kernel reads and the folder has; returns their names.
/// Accumulators and outputs begin anew, as large as the frame asks for.
///
/// # Errors
/// A sentence on an array that cannot be read or is too small for the frame.
pub fn read(dir: &Path, subject: &Subject, job: &mut Job) -> Result<Vec<&'static str>, String> {
    let kernels = dir.join(crate::sim::dump::KERNELS);
    let dir = if kernels.is_dir() { &kernels } else { dir };
    let load = |name: &str| {
        let path = dir.join(format!("{name}.npy"));
        path.exists().then(|| npy::read(&path)).transpose()
    };
    let mut found = Vec::new();
    for input in job.inputs.iter_mut().filter(|i| i.role == Role::Read) {
        if let Some(bytes) = load(input.name)? {
            input.bytes = bytes;
            found.push(input.name);
        }
    }
    // A dump of a frame has those of `trace`, of which it has every binding.
    let reads = job.inputs.iter().filter(|i| i.role == Role::Read).count();
    if !job.push.is_empty()
        && found.len() == reads
        && let Some(bytes) = load("push")?
        && bytes.len() == job.push.len()
    {
        job.push = bytes;
        found.push("push");
    }
    if found.is_empty() {
        let names: Vec<_> = job.inputs.iter().map(|i| i.name).collect();
        return Err(format!(
            "{}: none of {} is there as NAME.npy; `kernels run {} --output DIR` and \
             `insonify render --dump DIR` write them",
            dir.display(),
            names.join(", "),
            subject.name
        ));
    }
    if found.contains(&"frame") && job.get::<crate::sim::layout::Frame>("frame").is_empty() {
        return Err(format!("{}: frame.npy is shorter than a frame", dir.display()));
    }
    let needed = (subject.sizes)(job);
    for (input, needed) in job.inputs.iter_mut().zip(needed) {
        if input.role != Role::Read {
            input.begin(needed / 4);
        } else if input.bytes.len() < needed {
            return Err(format!(
                "{}: {} has {} bytes and the frame asks for {needed}; dump it and frame.npy from the \
                 same run",
                dir.display(),
                input.name,
                input.bytes.len()
            ));
        }
    }
    Ok(found)
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
    fn a_folder_of_nothing_and_arrays_too_small_are_refused() {
        let subject = SUBJECTS.iter().find(|s| s.name == "axial").unwrap();
        let mut job = (subject.job)(Case::Odd, Size::Small);
        let dir = tempfile::tempdir().unwrap();
        let empty = read(dir.path(), subject, &mut job).unwrap_err();
        assert!(empty.contains("frame, rows, lateral, iq"), "{empty}");
        let path = dir.path().join("lateral.npy");
        let at = job.index("lateral");
        let words = job.inputs[at].bytes.len() / 4;
        for (words, fits) in [(words, true), (words - 2, false)] {
            let lateral = &job.inputs[at].bytes[..4 * words];
            npy::write(&path, Element::Float, &[words], lateral).unwrap();
            match read(dir.path(), subject, &mut job) {
                Ok(found) => assert!(fits && found == ["lateral"], "{found:?}"),
                Err(e) => assert!(!fits && e.contains("lateral has"), "{e}"),
            }
        }
    }
}
