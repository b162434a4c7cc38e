//! Free file names, and pictures in colour.

use std::fs::{File, OpenOptions};
use std::io::{Cursor, ErrorKind, Write as _};
use std::path::{Path, PathBuf};

use image::{DynamicImage, ImageFormat, RgbaImage};
use serde_json::Value;

use super::{CaptureError, Sidecar};
use crate::output::{self, picture};
use crate::picture::Frame;

/// A number that no other capture of a folder has, reserved by its sidecar. The files written under
/// it are removed unless all are kept.
pub(super) struct Claim {
    /// Folder, stem and number.
    base: String,
    folder: PathBuf,
    sidecar: File,
    written: Vec<PathBuf>,
    kept: bool,
}

impl Claim {
    /// Takes the lowest free number in `folder`, which is made where it does not exist.
    pub(super) fn new(folder: &Path, stem: &str) -> Result<Self, CaptureError> {
        std::fs::create_dir_all(folder).map_err(|e| CaptureError::file(folder, e))?;
        for number in 1.. {
            let base = format!("{stem}-{number:04}");
            let is_taken = |end: &str| folder.join(format!("{base}{end}")).exists();
            if ["", ".png", ".gif", ".mp4", ".dcm", "-marked.png", "-mmode.png", "-spectrum.png"]
                .into_iter()
                .any(is_taken)
            {
                continue;
            }
            let path = folder.join(format!("{base}.json"));
            match OpenOptions::new().write(true).create_new(true).open(&path) {
                Ok(sidecar) => {
                    return Ok(Self {
                        base,
                        folder: folder.to_owned(),
                        sidecar,
                        written: vec![path],
                        kept: false,
                    });
                }
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
                Err(error) => return Err(CaptureError::file(&path, error)),
            }
        }
        unreachable!("there is a number behind each")
    }

    /// Returns the path of a file under the number.
    pub(super) fn add(&mut self, end: &str) -> PathBuf {
        let path = self.folder.join(format!("{}{end}", self.base));
        self.written.push(path.clone());
        path
    }

    /// Makes a folder under the number.
    pub(super) fn add_folder(&mut self) -> Result<PathBuf, CaptureError> {
        let path = self.folder.join(&self.base);
        std::fs::create_dir(&path).map_err(|e| CaptureError::file(&path, e))?;
        self.written.push(path.clone());
        Ok(path)
    }

    /// Writes the sidecar and keeps all files.
    pub(super) fn keep(mut self, sidecar: &Sidecar) -> Result<(), CaptureError> {
        let text = output::json(sidecar);
        let written = self.sidecar.write_all(text.as_bytes());
        written.map_err(|e| CaptureError::file(&self.written[0], e))?;
        self.kept = true;
        Ok(())
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        if self.kept {
            return;
        }
        for path in &self.written {
            // A file that was never written needs no removal, and no one can be told of the rest.
            let _ = match path.is_dir() {
                true => std::fs::remove_dir_all(path),
                false => std::fs::remove_file(path),
            };
        }
    }
}

/// The last part of a path.
pub(super) fn name(path: &Path) -> Value {
    let name = path.file_name().unwrap_or_default();
    Value::from(name.to_string_lossy())
}

/// Writes a file under the lowest free number of its stem and ending; returns its path.
pub(super) fn write_next(
    folder: &Path,
    stem: &str,
    ending: &str,
    bytes: &[u8],
) -> Result<PathBuf, CaptureError> {
    std::fs::create_dir_all(folder).map_err(|e| CaptureError::file(folder, e))?;
    let mut paths = (1..).map(|number| folder.join(format!("{stem}-{number:04}.{ending}")));
    let path = paths.find(|path| !path.exists()).expect("there is a number behind each");
    write_new(&path, bytes)?;
    Ok(path)
}

/// Writes a file that must not exist.
pub(super) fn write_new(path: &Path, bytes: &[u8]) -> Result<(), CaptureError> {
    let opened = OpenOptions::new().write(true).create_new(true).open(path);
    opened.and_then(|mut file| file.write_all(bytes)).map_err(|e| CaptureError::file(path, e))
}

/// The PNG of a frame's image whose pixels' edges are `pitch` mm, with `text` in it: grey unless it has colours.
pub(super) fn image_png(
    size: [u32; 2],
    rgba: &[u8],
    pitch: f64,
    text: Option<&str>,
    frame: &Frame,
) -> Vec<u8> {
    let png = if frame.coloured.is_some() { picture::colour_png } else { picture::grey_png };
    png(size, rgba, pitch, text)
}

/// A PNG file in colour, without scale or text.
pub(super) fn colour_png([width, height]: [u32; 2], rgba: &[u8]) -> Vec<u8> {
    let picture = RgbaImage::from_raw(width, height, rgba.to_vec()).expect("four bytes per pixel");
    let mut out = Cursor::new(Vec::new());
    let written = (DynamicImage::from(picture).to_rgb8()).write_to(&mut out, ImageFormat::Png);
    written.expect("a picture fits into memory twice");
    out.into_inner()
}

/// Resizes RGBA pixels: all pictures of a clip have the size of its finest.
pub(super) fn scaled(rgba: Vec<u8>, [width, height]: [u32; 2], to: [u32; 2]) -> Vec<u8> {
    if [width, height] == to {
        return rgba;
    }
    let image = image::RgbaImage::from_raw(width, height, rgba).expect("four bytes each");
    image::imageops::resize(&image, to[0], to[1], image::imageops::FilterType::Triangle).into_raw()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::{Claim, Sidecar, write_new};

    #[test]
    fn numbers_are_taken_once() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path().join("made/for it");
        let names = |at: &Path| {
            let all = std::fs::read_dir(at).unwrap();
            let mut names: Vec<_> =
                all.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
            names.sort();
            names
        };
        let mut first = Claim::new(&at, "a").unwrap();
        let mut second = Claim::new(&at, "a").unwrap();
        write_new(&first.add(".png"), b"1").unwrap();
        write_new(&second.add_folder().unwrap().join("0000.png"), b"2").unwrap();
        first.keep(&Sidecar::new()).unwrap();
        drop(second);
        assert_eq!(names(&at), ["a-0001.json", "a-0001.png"], "what is not kept is gone");
        // A picture without its sidecar is not written over, either.
        std::fs::write(at.join("a-0002.gif"), "").unwrap();
        std::fs::write(at.join("a-0003.dcm"), "").unwrap();
        let third = Claim::new(&at, "a").unwrap();
        assert_eq!(third.base, "a-0004");
        assert!(write_new(&at.join("a-0001.png"), b"3").is_err());
    }

    #[test]
    fn a_folder_that_cannot_be_made_is_reported() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        std::fs::write(&file, "").unwrap();
        let text = match Claim::new(&file.join("in it"), "a") {
            Ok(_) => panic!("a folder in a file"),
            Err(error) => error.to_string(),
        };
        assert!(text.contains("cannot be written") && text.contains("Name a folder"), "{text}");
    }
}
