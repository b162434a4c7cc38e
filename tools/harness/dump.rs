//! Jobs to and from a folder: `NAME.npy` per binding, `push.npy` for push constants.
//!
//! The folder that `insonify render --dump` writes will do as well.

use std::fs;
use std::path::Path;
use std::sync::Arc;

use insonify::gpu::{Device, Kernel};
use insonify::output::npy;
use insonify::sim::shaders::Library;

use super::{Case, Check, Element, Job, Role, SUBJECTS, Size, Subject, run};

/// Writes the contents of every binding of a job, before or after a run.
///
/// # Errors
/// A file-system error.
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
/// Accumulators and outputs start anew, in the size that the frame needs.
///
/// # Errors
/// A sentence on an array that cannot be read or is too small for the frame.
pub fn read(dir: &Path, subject: &Subject, job: &mut Job) -> Result<Vec<&'static str>, String> {
    let kernels = dir.join(insonify::sim::dump::KERNELS);
    let is_frame = kernels.is_dir();
    let dir = if is_frame { &kernels } else { dir };
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
    // A dump of a frame has those of `trace`.
    let reads = job.inputs.iter().filter(|i| i.role == Role::Read).count();
    let are_own = !is_frame || subject.name == "trace";
    if !job.push.is_empty()
        && are_own
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
    if found.contains(&"frame") && job.get::<insonify::sim::layout::Frame>("frame").is_empty() {
        return Err(format!("{}: frame.npy is shorter than a frame", dir.display()));
    }
    let needed: Vec<usize> =
        job.inputs.iter().map(|input| (subject.size)(job, input.name)).collect();
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

/// Runs the first variant of the kernel `name` on the files in `dir`, read by [`read`], and compares
/// it with its twin.
///
/// # Panics
/// If `dir` lacks most of the kernel's inputs, or the kernel does not run.
pub fn check(device: &Arc<Device>, library: &Library, dir: &Path, name: &str) -> Vec<Check> {
    let subject = SUBJECTS.iter().find(|s| s.name == name).expect(name);
    let mut job = (subject.job)(Case::One, Size::Small);
    let found = read(dir, subject, &mut job).expect(name);
    assert!(found.len() >= 2, "{name}: {found:?}");
    let stem = subject.stems(library)[0];
    let kernel = Kernel::new(device, stem, library.words(stem), &[]).expect(stem);
    let outcome = run(device, &kernel, &job, &subject.extent(&job)).expect(stem);
    (subject.check)(&job, &outcome.outputs)
}
