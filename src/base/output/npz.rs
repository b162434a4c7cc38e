//! Archives of NumPy arrays (`numpy.load`): a ZIP of `.npy` files, with texts beside them.

use std::io::{Cursor, Error, Result, Write as _};
use std::path::Path;

use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use super::files;
use super::npy::{self, Element};

/// An array of an archive.
#[derive(Clone, Debug)]
pub struct Entry<'a> {
    /// Its key.
    pub name: String,
    /// Type of its 32-bit words.
    pub element: Element,
    /// Its shape, C order.
    pub shape: &'a [usize],
    /// Its words, little-endian.
    pub bytes: &'a [u8],
}

impl<'a> Entry<'a> {
    /// An array of 32-bit floats, little-endian.
    pub fn floats(name: &str, shape: &'a [usize], bytes: &'a [u8]) -> Self {
        Self { name: name.to_owned(), element: Element::Float, shape, bytes }
    }
}

/// Writes arrays, and texts by their file names, whole or not at all. The same content makes the same bytes.
///
/// # Panics
/// When a shape does not hold exactly its words.
///
/// # Errors
/// Errors of the file system.
pub fn write(path: &Path, arrays: &[Entry], texts: &[(&str, &str)]) -> Result<()> {
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    // The fastest level: labels are mostly runs of equal words.
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .compression_level(Some(1))
        .last_modified_time(zip::DateTime::DEFAULT);
    for array in arrays {
        archive.start_file(format!("{}.npy", array.name), options).map_err(Error::other)?;
        npy::write_to(&mut archive, array.element, array.shape, array.bytes)?;
    }
    for (name, text) in texts {
        archive.start_file(*name, options).map_err(Error::other)?;
        archive.write_all(text.as_bytes())?;
    }
    let bytes = archive.finish().map_err(Error::other)?.into_inner();
    files::replace(path, &bytes)
}

#[cfg(test)]
mod tests {
    use std::io::Read;

    use super::*;

    #[test]
    fn arrays_and_texts_come_back_and_equal_content_makes_equal_bytes() {
        let dir = tempfile::tempdir().unwrap();
        let words: Vec<u8> = (0..24).collect();
        let entry = |name: &str| Entry {
            name: name.into(),
            element: Element::Integer,
            shape: &[2, 3],
            bytes: &words,
        };
        let paths = ["a.npz", "b.npz"].map(|name| dir.path().join(name));
        for path in &paths {
            write(path, &[entry("first"), entry("second")], &[("legend.json", "{}")]).unwrap();
        }
        let [a, b] = paths.map(|path| std::fs::read(path).unwrap());
        assert_eq!(a, b);
        let mut archive = zip::ZipArchive::new(Cursor::new(a)).unwrap();
        let mut read = |name: &str| {
            let mut bytes = Vec::new();
            archive.by_name(name).unwrap().read_to_end(&mut bytes).unwrap();
            bytes
        };
        assert_eq!(read("legend.json"), b"{}");
        let path = dir.path().join("second.npy");
        std::fs::write(&path, read("second.npy")).unwrap();
        assert_eq!(npy::read(&path).unwrap(), words);
    }
}
