//! Bytes of a volume, never more than its header declares and its file can hold.

use std::fs::File;
use std::io::{self, BufRead, BufReader, ErrorKind, Read, Seek, SeekFrom};
use std::path::{Component, Path, PathBuf};

use bzip2::bufread::MultiBzDecoder;
use flate2::bufread::{MultiGzDecoder, ZlibDecoder};

use crate::issue::FileError;

/// Largest volume that is read, bytes of all its frames and channels: small enough to lie beside the rest in
/// the memory of a workstation.
pub(super) const MAX_BYTES: u64 = 4 << 30;
/// Most bytes for one byte of DEFLATE: a match of 258 bytes costs two bits
/// (zlib technical details, "Maximum Compression Factor").
pub(super) const MAX_RATIO: u64 = 1032;
/// Longest text header, bytes. PLUS writes 650 to 880 bytes for each frame of a tracked sequence: three quarters of
/// an hour at 30 Hz.
pub(super) const MAX_HEADER: u64 = 64 << 20;
/// Most lines of a text header: some ten for each of as many frames. Each takes memory beside its text.
const MAX_LINES: usize = 1 << 20;
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
pub(super) fn open(path: &Path) -> Result<(File, u64), FileError> {
    let unreadable = |e: io::Error| {
        FileError::file(path, format!("cannot be read: {e}"), "check the name and the permissions")
    };
    let data = std::fs::metadata(path).map_err(unreadable)?;
    if !data.is_file() {
        return Err(FileError::file(path, "is not an ordinary file", "give a file"));
    }
    let file = File::open(path).map_err(unreadable)?;
    Ok((file, data.len()))
}

/// The first bytes of a file, at most `limit`.
pub(super) fn prefix(path: &Path, limit: u64) -> Result<Vec<u8>, FileError> {
    let (file, len) = open(path)?;
    let mut bytes = Vec::new();
    file.take(limit.min(len))
        .read_to_end(&mut bytes)
        .map_err(|e| FileError::file(path, format!("cannot be read: {e}"), AGAIN))?;
    Ok(bytes)
}

/// The lines of a text header, read as far as they are asked for.
pub(super) struct Lines<'p> {
    path: &'p Path,
    rest: BufReader<io::Take<File>>,
    /// Lines and bytes so far.
    number: usize,
    at: u64,
}

/// A line of a text header.
pub(super) struct Line {
    /// Number, from 1.
    pub number: usize,
    /// Its text, with the end of the line.
    pub text: String,
    /// The byte of the file after it.
    pub end: u64,
}

impl<'p> Lines<'p> {
    pub fn of(path: &'p Path) -> Result<Self, FileError> {
        let (file, _) = open(path)?;
        Ok(Self { path, rest: BufReader::new(file.take(MAX_HEADER)), number: 0, at: 0 })
    }

    /// The next line; none at the end of the file.
    ///
    /// # Errors
    /// The file cannot be read, or the header is too long.
    pub fn next(&mut self) -> Result<Option<Line>, FileError> {
        let fail = |cause: String, remedy: &str| Err(FileError::file(self.path, cause, remedy));
        let mut bytes = Vec::new();
        if let Err(e) = self.rest.read_until(b'\n', &mut bytes) {
            return fail(format!("cannot be read: {e}"), AGAIN);
        }
        self.at += bytes.len() as u64;
        self.number += 1;
        let long = self.at == MAX_HEADER && !bytes.ends_with(b"\n");
        if long || self.number > MAX_LINES {
            let cause = format!(
                "the header does not end within {} MB and {MAX_LINES} lines",
                MAX_HEADER >> 20
            );
            return fail(cause, "split the sequence, or export the file again");
        }
        let text = String::from_utf8_lossy(&bytes).into_owned();
        let line = Line { number: self.number, text, end: self.at };
        Ok((!bytes.is_empty()).then_some(line))
    }
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
    pub fn stream(&self, total: u64) -> Result<Box<dyn Read>, FileError> {
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
    pub fn read(&self, total: u64) -> Result<(Vec<u8>, bool), FileError> {
        let mut stream = self.stream(total)?;
        let from_end = self.skip == Skip::AllButLast && self.coding != Coding::Raw;
        let keep = if from_end { total + MAX_LEAD + 1 } else { total };
        let mut out = Vec::new();
        out.try_reserve_exact(total as usize).map_err(|_| self.too_large(total))?;
        let count = stream.by_ref().take(keep).read_to_end(&mut out);
        count.map_err(|e| self.broken(out.len() as u64, total, &e))?;
        let read = out.len() as u64;
        if from_end {
            if read > total + MAX_LEAD {
                return Err(FileError::byte(
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
        let more = self.goes_on(&mut stream, total)?;
        Ok((out, more))
    }

    /// Fills `block` from the stream, of which `done` of `total` bytes have been read.
    pub fn fill(
        &self,
        stream: &mut dyn Read,
        block: &mut [u8],
        done: u64,
        total: u64,
    ) -> Result<(), FileError> {
        let mut held = 0;
        while held < block.len() {
            match stream.read(&mut block[held..]) {
                Ok(0) => {
                    let at = done + held as u64;
                    return Err(self.short(at, at, total));
                }
                Ok(count) => held += count,
                Err(e) if e.kind() == ErrorKind::Interrupted => {}
                Err(e) => return Err(self.broken(done + held as u64, total, &e)),
            }
        }
        Ok(())
    }

    /// Returns whether a stream goes on after its `total` bytes.
    pub fn goes_on(&self, stream: &mut dyn Read, total: u64) -> Result<bool, FileError> {
        let more = stream.read(&mut [0]);
        Ok(more.map_err(|e| self.broken(total, total, &e))? > 0)
    }

    /// The error for voxels for which there is no room.
    pub fn too_large(&self, total: u64) -> FileError {
        FileError::file(
            &self.file,
            format!("{total} bytes of voxels do not fit into memory"),
            "crop or resample the volume",
        )
    }

    fn short(&self, at: u64, held: u64, total: u64) -> FileError {
        let what = if self.coding == Coding::Text { "numbers" } else { "bytes" };
        FileError::byte(
            &self.file,
            at,
            format!(
                "is cut off: the header declares {total} {what} of voxels, there can be {held}"
            ),
            "export or copy it again, or correct the sizes in the header",
        )
    }

    fn broken(&self, at: u64, total: u64, error: &io::Error) -> FileError {
        if error.kind() == ErrorKind::UnexpectedEof {
            return self.short(at, at, total);
        }
        FileError::byte(&self.file, at, format!("the voxels cannot be read: {error}"), AGAIN)
    }
}
