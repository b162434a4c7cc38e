//! Keys and values of a text header, each with the number of its text line.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use super::source::{self, Skip};
use crate::issue::FileError;

/// One key and its value.
pub(super) struct Field {
    /// Line, from 1.
    pub line: usize,
    /// Key without surrounding space.
    pub key: String,
    /// Value without surrounding space.
    pub value: String,
}

/// Fields of a header in the order of the file.
pub(super) struct Fields<'p> {
    /// The header's file.
    pub path: &'p Path,
    /// The fields.
    pub list: Vec<Field>,
}

impl Fields<'_> {
    /// The first field with one of `keys`; case does not matter.
    pub fn find(&self, keys: &[&str]) -> Option<&Field> {
        self.list.iter().find(|f| keys.iter().any(|k| f.key.eq_ignore_ascii_case(k)))
    }

    /// The field of this key; an error where it is missing.
    pub fn need(&self, key: &str) -> Result<&Field, FileError> {
        self.find(&[key]).ok_or_else(|| {
            FileError::file(
                self.path,
                format!("the header lacks `{key}`"),
                "add it or export the volume again",
            )
        })
    }

    /// An error on the line of a field; the message follows its key and value.
    pub fn error(&self, field: &Field, message: &str, remedy: &str) -> FileError {
        let value: String = field.value.chars().take(60).collect();
        let message = format!("`{}` is `{value}`: {message}", field.key);
        FileError::line(self.path, field.line, message, remedy)
    }

    /// The value as exactly `count` numbers.
    pub fn numbers<T: FromStr>(&self, field: &Field, count: usize) -> Result<Vec<T>, FileError> {
        let words: Vec<_> = field.value.split_whitespace().collect();
        if words.len() != count {
            return Err(self.error(
                field,
                &format!("{} values where {count} are needed", words.len()),
                "give one value per axis (a direction matrix: one per pair of axes)",
            ));
        }
        let read = |word: &&str| {
            word.parse().map_err(|_| {
                self.error(field, &format!("`{word}` is no number that fits"), "correct it")
            })
        };
        words.iter().map(read).collect()
    }

    /// The value as one number.
    pub fn number<T: FromStr>(&self, field: &Field) -> Result<T, FileError> {
        Ok(self.numbers(field, 1)?.remove(0))
    }

    /// Bytes before the voxels, stated at one of these keys; with `from_end`, -1 means all but those of the voxels.
    pub fn skip(&self, keys: &[&str], from_end: bool) -> Result<Skip, FileError> {
        let Some(field) = self.find(keys) else { return Ok(Skip::Bytes(0)) };
        match self.number(field)? {
            -1i64 if from_end => Ok(Skip::AllButLast),
            bytes => u64::try_from(bytes).map(Skip::Bytes).map_err(|_| {
                self.error(field, "no number of bytes", "write -1 or the bytes to skip")
            }),
        }
    }

    /// The file with the voxels that a field names.
    pub fn detached(&self, field: &Field) -> Result<PathBuf, FileError> {
        if field.value.starts_with("LIST") || field.value.contains('%') {
            let message = "volumes in several files, such as one file per slice, cannot be read";
            return Err(self.error(field, message, "save the volume to one file"));
        }
        source::detached(self.path, &field.value).map_err(|cause| {
            self.error(field, &cause, "put the data beside the header and name it there")
        })
    }

    /// Sizes along the axes, none of them zero.
    pub fn sizes(&self, field: &Field, count: usize) -> Result<Vec<usize>, FileError> {
        let sizes = self.numbers(field, count)?;
        if sizes.contains(&0) {
            return Err(self.error(
                field,
                "an axis of size 0 holds no voxels",
                "give a file with an image (one with poses alone is none)",
            ));
        }
        Ok(sizes)
    }

    /// Spacings along the axes, mm or the file's unit: finite and above zero.
    pub fn spacings(&self, field: &Field, count: usize) -> Result<Vec<f64>, FileError> {
        let spacings: Vec<f64> = self.numbers(field, count)?;
        if spacings.iter().all(|s| s.is_finite() && *s > 0.0) {
            return Ok(spacings);
        }
        Err(self.error(
            field,
            "a spacing has to be a finite number above zero",
            "state the distance between voxels; a reversed axis belongs in the direction",
        ))
    }
}
