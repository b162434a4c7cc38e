//! Free file names, and PNG files that carry their settings.

use std::fs::{File, OpenOptions};
use std::io::{Cursor, ErrorKind, Write as _};
use std::path::{Path, PathBuf};

use image::{DynamicImage, ImageFormat, RgbaImage};
use serde_json::Value;

use super::{CaptureError, Sidecar};

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
            if ["", ".png", ".gif", "-marked.png"].into_iter().any(is_taken) {
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
        let text = serde_json::to_string_pretty(sidecar).expect("plain values") + "\n";
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

/// Writes a file that must not exist.
pub(super) fn write_new(path: &Path, bytes: &[u8]) -> Result<(), CaptureError> {
    let opened = OpenOptions::new().write(true).create_new(true).open(path);
    opened.and_then(|mut file| file.write_all(bytes)).map_err(|e| CaptureError::file(path, e))
}

/// A PNG file in 8-bit grey, the red channel of `rgba`: pixels of `pitch` mm, and a text under the
/// keyword `insonify`.
pub(super) fn grey_png(
    [width, height]: [u32; 2],
    rgba: &[u8],
    pitch: f64,
    text: Option<&str>,
) -> Vec<u8> {
    let grey: Vec<u8> = rgba.chunks_exact(4).map(|p| p[0]).collect();
    let per_metre = (1000.0 / pitch).round() as u32;
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, width, height);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_pixel_dims(Some(png::PixelDimensions {
        xppu: per_metre,
        yppu: per_metre,
        unit: png::Unit::Meter,
    }));
    if let Some(text) = text {
        let added = encoder.add_itxt_chunk("insonify".into(), text.into());
        added.expect("nothing is written yet");
    }
    let written = encoder.write_header().and_then(|mut writer| {
        writer.write_image_data(&grey)?;
        writer.finish()
    });
    written.expect("one byte per pixel, into memory");
    out
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

    use super::{Claim, Sidecar, grey_png, write_new};

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
        let third = Claim::new(&at, "a").unwrap();
        assert_eq!(third.base, "a-0003");
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

    #[test]
    fn a_picture_keeps_its_greys_and_says_what_it_is() {
        let rgba: Vec<u8> = (0..=255).flat_map(|g| [g, g, g, 255]).collect();
        let text = "{\"title\": \"Fœtus\"}";
        let png = grey_png([32, 8], &rgba, 0.2, Some(text));
        let back = image::load_from_memory(&png).expect("a PNG").to_luma8();
        assert_eq!(back.into_raw(), (0..=255).collect::<Vec<u8>>());
        let chunks = chunks(&png);
        let kinds: Vec<&str> = chunks.iter().map(|c| c.0).collect();
        assert_eq!(kinds, ["IHDR", "pHYs", "iTXt", "IDAT", "IEND"]);
        assert_eq!(chunks[1].1, [0, 0, 0x13, 0x88, 0, 0, 0x13, 0x88, 1], "5000 a metre");
        let (keyword, rest) = chunks[2].1.split_at(13);
        assert_eq!((keyword, rest), (&b"insonify\0\0\0\0\0"[..], text.as_bytes()));
    }

    /// Type and content of each, with the sum that the format's own program computes (PNG, third
    /// edition, annex D): independent of the one that wrote it.
    fn chunks(mut png: &[u8]) -> Vec<(&str, &[u8])> {
        let word = |bytes: &[u8]| u32::from_be_bytes(bytes[..4].try_into().unwrap());
        let mut out = Vec::new();
        png = &png[8..];
        while !png.is_empty() {
            let length = word(png) as usize;
            let body = &png[4..8 + length];
            let sum = body.iter().fold(u32::MAX, |sum, &byte| {
                (0..8).fold(sum ^ u32::from(byte), |c, _| {
                    if c & 1 == 1 { 0xedb8_8320 ^ (c >> 1) } else { c >> 1 }
                })
            });
            assert_eq!(!sum, word(&png[8 + length..]));
            out.push((std::str::from_utf8(&body[..4]).unwrap(), &body[4..]));
            png = &png[12 + length..];
        }
        out
    }
}
