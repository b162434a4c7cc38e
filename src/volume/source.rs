//! Bytes of a volume, never more than its header declares and its file can hold.

use std::fs::File;
use std::io::{self, BufRead, BufReader, ErrorKind, Read, Seek, SeekFrom};
use std::path::{Component, Path, PathBuf};

use bzip2::bufread::MultiBzDecoder;
use flate2::bufread::{MultiGzDecoder, ZlibDecoder};

use super::error::VolumeError;

/// Largest volume that is read, bytes of all its frames and channels: small enough to lie beside the rest in
/// the memory of a workstation.
pub(super) const MAX_BYTES: u64 = 4 << 30;
/// Most bytes for one byte of DEFLATE: a match of 258 bytes costs two bits
/// (zlib technical details, "Maximum Compression Factor").
pub(super) const MAX_RATIO: u64 = 1032;
/// Longest text header, bytes. Tracked sequences of some hundred frames reach 1 MB.
pub(super) const MAX_HEADER: u64 = 8 << 20;
/// Most bytes before compressed data that are skipped by counting from the end.
const MAX_LEAD: u64 = 1 << 20;

const AGAIN: &str = "export or copy it again";

/// Encoding of voxels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Coding {
    /// Plain bytes.
    Raw,
    /// A gzip stream.
    Gzip,
    /// A zlib stream.
    Zlib,
    /// A bzip2 stream.
    Bzip2,
    /// Two hexadecimal digits per byte.
    Hex,
    /// Numbers in text.
    Text,
}

/// Bytes before the first voxel, after decompression.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Skip {
    /// This number of bytes.
    Bytes(u64),
    /// The voxels are the last bytes.
    AllButLast,
}

/// Place and encoding of voxels.
#[derive(Clone, Debug)]
pub(super) struct Payload {
    /// File that holds them.
    pub file: PathBuf,
    /// Byte of the file from which the text lines are counted.
    pub offset: u64,
    /// Number of text lines before the voxels.
    pub lines: u64,
    /// Bytes before the voxels.
    pub skip: Skip,
    /// Encoding of the voxels.
    pub coding: Coding,
}

/// A regular file and its length. Pipes and devices, which may never end, are refused.
pub(super) fn open(path: &Path) -> Result<(File, u64), VolumeError> {
    let unreadable = |e: io::Error| {
        VolumeError::file(
            path,
            format!("cannot be read: {e}"),
            "check the name and the permissions",
        )
    };
    let data = std::fs::metadata(path).map_err(unreadable)?;
    if !data.is_file() {
        return Err(VolumeError::file(path, "is not an ordinary file", "give a file"));
    }
    let file = File::open(path).map_err(unreadable)?;
    Ok((file, data.len()))
}

/// The first bytes of a file, at most `limit`.
pub(super) fn prefix(path: &Path, limit: u64) -> Result<Vec<u8>, VolumeError> {
    let (file, len) = open(path)?;
    let mut bytes = Vec::new();
    file.take(limit.min(len))
        .read_to_end(&mut bytes)
        .map_err(|e| VolumeError::file(path, format!("cannot be read: {e}"), AGAIN))?;
    Ok(bytes)
}

/// The data file that a header names: in the folder of the header or below it.
pub(super) fn detached(header: &Path, name: &str) -> Result<PathBuf, String> {
    let inside = |c: Component| matches!(c, Component::Normal(_) | Component::CurDir);
    if name.is_empty() || !Path::new(name).components().all(inside) {
        return Err("a data file has to lie in the folder of its header or below it".to_owned());
    }
    let path = header.with_file_name(name);
    match path.is_file() {
        true => Ok(path),
        false => Err(format!("there is no file {}", path.display())),
    }
}

/// Bytes from hexadecimal digits; white space between them is ignored.
struct Hex<R>(R);

impl<R: BufRead> Hex<R> {
    fn digit(&mut self) -> io::Result<Option<u8>> {
        loop {
            let mut byte = [0];
            if self.0.read(&mut byte)? == 0 {
                return Ok(None);
            }
            if byte[0].is_ascii_whitespace() {
                continue;
            }
            let digit = char::from(byte[0]).to_digit(16);
            let wrong = || io::Error::new(ErrorKind::InvalidData, "no hexadecimal digit");
            return digit.map(|d| Some(d as u8)).ok_or_else(wrong);
        }
    }
}

impl<R: BufRead> Read for Hex<R> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        for (count, byte) in out.iter_mut().enumerate() {
            let Some(high) = self.digit()? else {
                return Ok(count);
            };
            *byte = 16 * high + self.digit()?.ok_or(ErrorKind::UnexpectedEof)?;
        }
        Ok(out.len())
    }
}

impl Payload {
    /// Opens the stream of voxels and checks that it can hold `total` bytes, or in text as many numbers. The
    /// voxels begin at the present place of the stream, unless they are its last bytes.
    pub fn stream(&self, total: u64) -> Result<Box<dyn Read>, VolumeError> {
        let (mut file, len) = open(&self.file)?;
        let broken = |e: io::Error| self.broken(0, total, &e);
        file.seek(SeekFrom::Start(self.offset)).map_err(broken)?;
        let mut bytes = BufReader::with_capacity(1 << 16, file);
        let mut start = self.offset;
        for _ in 0..self.lines {
            let line = bytes.skip_until(b'\n').map_err(broken)?;
            if line == 0 {
                return Err(self.short(len, 0, total));
            }
            start += line as u64;
        }
        let held = len.saturating_sub(start);
        let most = match self.coding {
            Coding::Raw => held,
            // A digit each, and a separator between them.
            Coding::Text => held.div_ceil(2),
            Coding::Hex => held / 2,
            Coding::Gzip | Coding::Zlib => held.saturating_mul(MAX_RATIO),
            // Runs of runs have no useful bound; it is unpacked up to the declared size.
            Coding::Bzip2 => u64::MAX,
        };
        let lead = match self.skip {
            Skip::Bytes(bytes) => bytes,
            Skip::AllButLast => 0,
        };
        if most.checked_sub(lead).is_none_or(|most| most < total) {
            return Err(self.short(start, most.saturating_sub(lead), total));
        }
        if self.coding == Coding::Raw {
            let start = match self.skip {
                Skip::Bytes(bytes) => start + bytes,
                Skip::AllButLast => len - total,
            };
            bytes.seek(SeekFrom::Start(start)).map_err(broken)?;
            return Ok(Box::new(bytes));
        }
        let mut stream: Box<dyn Read> = match self.coding {
            Coding::Gzip => Box::new(MultiGzDecoder::new(bytes)),
            Coding::Zlib => Box::new(ZlibDecoder::new(bytes)),
            Coding::Bzip2 => Box::new(MultiBzDecoder::new(bytes)),
            Coding::Hex => Box::new(Hex(bytes)),
            Coding::Raw | Coding::Text => Box::new(bytes),
        };
        let skipped = io::copy(&mut stream.by_ref().take(lead), &mut io::sink()).map_err(broken)?;
        if skipped < lead {
            return Err(self.short(skipped, 0, total));
        }
        Ok(stream)
    }

    /// The `total` bytes, and whether more follow. At most one byte more of a compressed stream is
    /// unpacked.
    pub fn read(&self, total: u64) -> Result<(Vec<u8>, bool), VolumeError> {
        let mut stream = self.stream(total)?;
        let from_end = self.skip == Skip::AllButLast && self.coding != Coding::Raw;
        let keep = if from_end { total + MAX_LEAD + 1 } else { total };
        let mut out = Vec::new();
        out.try_reserve_exact(total as usize).map_err(|_| {
            VolumeError::file(
                &self.file,
                format!("{total} bytes of voxels do not fit into memory"),
                "crop or resample the volume",
            )
        })?;
        let count = stream.by_ref().take(keep).read_to_end(&mut out);
        count.map_err(|e| self.broken(out.len() as u64, total, &e))?;
        let read = out.len() as u64;
        if from_end {
            if read > total + MAX_LEAD {
                return Err(VolumeError::byte(
                    &self.file,
                    read,
                    format!("more than {MAX_LEAD} bytes precede the voxels"),
                    "state the bytes to skip, or export it again",
                ));
            }
            let Some(lead) = read.checked_sub(total) else {
                return Err(self.short(read, read, total));
            };
            out.drain(..lead as usize);
            return Ok((out, false));
        }
        if read < total {
            return Err(self.short(read, read, total));
        }
        let more = stream.read(&mut [0]);
        let more = more.map_err(|e| self.broken(total, total, &e))?;
        Ok((out, more > 0))
    }

    fn short(&self, at: u64, held: u64, total: u64) -> VolumeError {
        let what = if self.coding == Coding::Text { "numbers" } else { "bytes" };
        VolumeError::byte(
            &self.file,
            at,
            format!(
                "is cut off: the header declares {total} {what} of voxels, there can be {held}"
            ),
            "export or copy it again, or correct the sizes in the header",
        )
    }

    fn broken(&self, at: u64, total: u64, error: &io::Error) -> VolumeError {
        if error.kind() == ErrorKind::UnexpectedEof {
            return self.short(at, at, total);
        }
        VolumeError::byte(&self.file, at, format!("the voxels cannot be read: {error}"), AGAIN)
    }
}
