//! Poses of a sequence without its images: files of a tracker alone have none.

use std::path::Path;

use super::frames::{self, TrackedFrame};
use crate::issue::FileError;
use crate::volume::fields::{Field, Fields};
use crate::volume::meta;
use crate::volume::source::{self, MAX_HEADER};

/// Reads the entries of frames from the header of a sequence (.mha, .mhd, .nrrd), in their order; the pixels, if
/// there are any, are not looked at.
///
/// # Errors
/// A header that cannot be read, or describes no frame.
pub fn track(path: &Path) -> Result<Vec<TrackedFrame>, FileError> {
    let name = path.to_string_lossy().to_ascii_lowercase();
    let fields = match name.ends_with(".nrrd") || name.ends_with(".nhdr") {
        true => pairs(path)?,
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

/// The key/value pairs of a NRRD header as fields.
fn pairs(path: &Path) -> Result<Fields<'_>, FileError> {
    let bytes = source::prefix(path, MAX_HEADER)?;
    let lines = bytes.split(|&b| b == b'\n').map(String::from_utf8_lossy);
    let mut list = Vec::new();
    for (line, text) in (1..).zip(lines).take_while(|(_, text)| !text.trim().is_empty()) {
        if let Some((key, value)) = text.split_once(":=") {
            let (key, value) = (key.trim().to_owned(), value.trim().to_owned());
            list.push(Field { line, key, value });
        }
    }
    Ok(Fields { path, list })
}
