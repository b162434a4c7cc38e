//! Poses of a sequence without its images: files of a tracker alone have none.

use std::path::Path;

use super::frames::{self, TrackedFrame};
use crate::issue::FileError;
use crate::volume::fields::Fields;
use crate::volume::{meta, nrrd};

/// Reads the entries of frames from the header of a sequence (.mha, .mhd, .nrrd), in their order; the pixels, if
/// there are any, are not looked at.
///
/// # Errors
/// A header that cannot be read, or describes no frame.
pub fn track(path: &Path) -> Result<Vec<TrackedFrame>, FileError> {
    let fields = match super::nrrd::is_meant(path) {
        true => Fields { path, list: nrrd::fields(path)?.1 },
        false => meta::fields(path)?.0,
    };
    let found = frames::parse(&fields, usize::MAX)?;
    if found.is_empty() {
        return Err(FileError::file(
            path,
            "describes no frame of a tracked sequence",
            "give a file with entries such as Seq_Frame0000_ProbeToTrackerTransform",
        ));
    }
    Ok(found.into_values().collect())
}
