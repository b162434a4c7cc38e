//! A file's elements: preamble, transfer syntax, and unpacking.

use std::io::Read;
use std::path::Path;

use flate2::read::DeflateDecoder;

use super::elements::{Elements, Item, Parser, Syntax};
use super::source::{self, MAX_BYTES};
use super::{Dicom, SAVE};
use crate::issue::FileError;

/// The preamble and the four letters after it.
const START: usize = 132;
/// Largest file, bytes, and most bytes of its elements once inflated: they are in memory beside the voxels.
const MAX_FILE: u64 = MAX_BYTES / 2;
/// Most bytes into which a byte of a deflated file may unpack. Images reach ten, not more.
const MAX_INFLATION: u64 = 64;

/// Transfer syntax: encoding of elements and pixels (PS3.5, annex A).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Transfer {
    /// Little endian without types.
    Implicit,
    /// Little endian with types.
    Explicit,
    /// The same, deflated.
    Deflated,
    /// Big endian.
    Big,
    /// Pixels in JPEG of 8 bits.
    Jpeg,
    /// Pixels in run lengths.
    Rle,
}

impl Transfer {
    fn of(uid: &str) -> Option<Self> {
        Some(match uid.strip_prefix("1.2.840.10008.1.2")? {
            "" => Self::Implicit,
            ".1" => Self::Explicit,
            ".1.99" => Self::Deflated,
            ".2" => Self::Big,
            ".4.50" => Self::Jpeg,
            ".5" => Self::Rle,
            _ => return None,
        })
    }

    /// Encoding of elements.
    pub fn elements(self) -> Syntax {
        Syntax { explicit: self != Self::Implicit, big: self == Self::Big }
    }
}

/// Name of a syntax that cannot be read.
fn name(uid: &str) -> &'static str {
    match uid.strip_prefix("1.2.840.10008.1.2.4.") {
        Some("51") => "JPEG of 12 bits",
        Some("57" | "70") => "lossless JPEG",
        Some("80" | "81") => "JPEG-LS",
        Some("90" | "91" | "92" | "93") => "JPEG 2000",
        Some(other) if other.starts_with("10") => "video",
        Some(other) if other.starts_with("20") => "HTJ2K",
        Some(other) if other.starts_with("11") => "JPEG XL",
        _ => "a transfer syntax",
    }
}

pub(super) fn read(path: &Path) -> Result<Dicom<'_>, FileError> {
    let start = source::prefix(path, START as u64)?;
    if start.get(START - 4..) != Some(b"DICM") {
        let message = "is no DICOM file: the letters DICM are not at byte 128";
        return Err(FileError::file(path, message, SAVE));
    }
    let (_, len) = source::open(path)?;
    if len > MAX_FILE {
        let message = format!("is {} MB, the limit is {} MB", len >> 20, MAX_FILE >> 20);
        let remedy = "crop or resample the volume, or convert it to .nrrd, .mha or .nii.gz";
        return Err(FileError::file(path, message, remedy));
    }
    let bytes = source::prefix(path, MAX_FILE)?;
    let mistake = |(at, cause): (usize, String)| FileError::byte(path, at as u64, cause, SAVE);
    let mut parser = Parser { bytes: &bytes, at: START, syntax: Transfer::Explicit.elements() };
    // Group 2 alone is written with types in every file.
    let end = parser.end_of_group_2();
    let meta = parser.item(end, 0).map_err(mistake)?;
    let elements = Elements { bytes: &bytes, big: false };
    let Some(uid) = elements.text(&meta, (0x0002, 0x0010)) else {
        let message = "lacks TransferSyntaxUID (0002,0010)";
        return Err(FileError::file(path, message, SAVE));
    };
    let Some(syntax) = Transfer::of(&uid) else {
        let uid: String = uid.chars().take(64).collect();
        let message = format!("is written in {} that cannot be read ({uid})", name(&uid));
        let remedy = "decompress it (e.g. gdcmconv --raw), or save it as .nrrd or .mha";
        return Err(FileError::file(path, message, remedy));
    };
    let (bytes, at) = match syntax {
        Transfer::Deflated => (inflate(path, &bytes[end..])?, 0),
        _ => (bytes, end),
    };
    let root = root(&bytes, at, syntax).map_err(mistake)?;
    Ok(Dicom { path, bytes, syntax, root })
}

fn root(bytes: &[u8], at: usize, syntax: Transfer) -> Result<Item, (usize, String)> {
    let mut parser = Parser { bytes, at, syntax: syntax.elements() };
    parser.item(bytes.len(), 0)
}

fn inflate(path: &Path, packed: &[u8]) -> Result<Vec<u8>, FileError> {
    let most = (packed.len() as u64).saturating_mul(MAX_INFLATION).min(MAX_FILE);
    let mut out = Vec::new();
    let mut stream = DeflateDecoder::new(packed).take(most + 1);
    stream.read_to_end(&mut out).map_err(|e| {
        let message = format!("the deflated elements cannot be read: {e}");
        FileError::file(path, message, SAVE)
    })?;
    if out.len() as u64 > most {
        let message = format!("unpacks to more than {MAX_INFLATION} times its size");
        return Err(FileError::file(path, message, SAVE));
    }
    Ok(out)
}
