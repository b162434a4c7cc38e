//! Frames as an MP4 film (H.264), made by the program `ffmpeg` where the system has it.
//!
//! An encoder of our own would be larger than the rest of `output`, and those that exist as libraries are C or carry
//! patents' licences with them; the user's `ffmpeg` has both settled. It gets plain arguments and pixels on its
//! standard input: no shell is between.

use std::ffi::{OsStr, OsString};
use std::io::{ErrorKind, Read, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread::JoinHandle;

use crate::output::files::Draft;

/// The program, on the PATH.
const PROGRAM: &str = "ffmpeg";
/// Most frames per second: what screens show.
const FASTEST: f64 = 60.0;
/// Fewest frames per second: players wait badly for slower ones.
const SLOWEST: f64 = 5.0;
/// Last lines of the program's messages that are said.
const LINES: usize = 4;

/// Reason for which a film was not written; no part of it is left.
#[derive(Debug, thiserror::Error)]
pub enum Mp4Error {
    /// There is no `ffmpeg`.
    #[error(
        "MP4 needs the program ffmpeg, which is not on the PATH. Install it (Debian and Ubuntu: apt install ffmpeg), or \
         save a GIF"
    )]
    Missing,
    /// It cannot be started.
    #[error("ffmpeg cannot be started: {0}. Mend its installation, or save a GIF")]
    Unstarted(std::io::Error),
    /// It has ended with an error.
    #[error(
        "{} was not written: ffmpeg ended ({status}) and said: {output}. It needs the encoder libx264 and room on the disk; \
         a GIF needs neither", path.display()
    )]
    Ended {
        /// The film.
        path: PathBuf,
        /// How it ended, in the system's words.
        status: String,
        /// Its last messages.
        output: String,
    },
    /// The film cannot take its place.
    #[error("{} cannot be written: {cause}. Name a folder that can be written to", path.display())]
    File {
        /// The film.
        path: PathBuf,
        /// The system's message.
        cause: String,
    },
}

/// A film that is being written: H.264 in yuv420p. It takes its place when it is finished; dropped before, it is gone.
pub struct Mp4 {
    program: OsString,
    path: PathBuf,
    /// Frames per second.
    rate: f64,
    /// Frames written so far.
    written: u64,
    encoder: Option<Encoder>,
}

impl Mp4 {
    /// Returns whether `path` names such a film, by its extension.
    pub fn is_meant(path: &Path) -> bool {
        let extension = path.extension().and_then(|e| e.to_str());
        extension.is_some_and(|e| e.eq_ignore_ascii_case("mp4"))
    }

    /// Fails where `ffmpeg` cannot be started.
    ///
    /// # Errors
    /// It is missing, or cannot be started.
    pub fn check() -> Result<(), Mp4Error> {
        let quiet = Command::new(PROGRAM)
            .arg("-version")
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .status();
        quiet.map(drop).map_err(unstarted)
    }

    /// Begins the film that is to become `path`, at `rate` frames per second.
    pub fn new(path: &Path, rate: f64) -> Self {
        Self::by(PROGRAM.as_ref(), path, rate)
    }

    fn by(program: &OsStr, path: &Path, rate: f64) -> Self {
        let rate = rate.clamp(SLOWEST, FASTEST);
        Self { program: program.to_owned(), path: path.to_owned(), rate, written: 0, encoder: None }
    }

    /// Adds a frame that is shown until `end`, s from the beginning: RGBA bytes, row by row, of the size of the first
    /// one. It is repeated as often as the rate asks for, and left out where the next one comes within half a frame.
    ///
    /// # Errors
    /// `ffmpeg` is missing, or has ended.
    pub fn add(&mut self, width: u32, height: u32, rgba: &[u8], end: f64) -> Result<(), Mp4Error> {
        let until = (end * self.rate).round() as u64;
        let frame = even_rgb([width, height], rgba);
        let encoder = match &mut self.encoder {
            Some(encoder) => encoder,
            none => {
                let size = [width, height].map(|side| side.next_multiple_of(2));
                none.insert(Encoder::new(&self.program, &self.path, size, self.rate)?)
            }
        };
        let input = encoder.child.stdin.as_mut().expect("taken only at the end");
        let mut all_taken = true;
        while self.written < until && all_taken {
            all_taken = input.write_all(&frame).is_ok();
            self.written += 1;
        }
        match all_taken {
            true => Ok(()),
            // It has closed its input: it says why.
            false => Err(self.encoder.take().expect("just used").ended(&self.path)),
        }
    }

    /// Ends the film and puts it into its place.
    ///
    /// # Errors
    /// `ffmpeg` has ended with an error; the film cannot take its place. Nothing is then left.
    pub fn finish(mut self) -> Result<(), Mp4Error> {
        match self.encoder.take() {
            Some(encoder) => encoder.finish(&self.path),
            None => Ok(()),
        }
    }
}

/// Frames per second by which none of these frames, each with the second until which it is shown, is left out.
pub fn rate(ends: impl Iterator<Item = f64>) -> f64 {
    let mut begin = 0.0;
    let shortest = ends.map(|end| end - std::mem::replace(&mut begin, end)).fold(1.0, f64::min);
    (1.0 / shortest.max(1e-3)).clamp(SLOWEST, FASTEST)
}

/// Pixels without their opacity; a last row and column are repeated where there is an odd number: yuv420p has one
/// colour for four pixels.
fn even_rgb([width, height]: [u32; 2], rgba: &[u8]) -> Vec<u8> {
    let row = 4 * width as usize;
    let mut out = Vec::with_capacity(rgba.len());
    for y in 0..height.next_multiple_of(2) {
        let line = &rgba[row * y.min(height - 1) as usize..][..row];
        out.extend(line.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]));
        if width % 2 == 1 {
            out.extend_from_slice(&line[row - 4..row - 1]);
        }
    }
    out
}

fn unwritten(path: &Path, cause: std::io::Error) -> Mp4Error {
    Mp4Error::File { path: path.to_owned(), cause: cause.to_string() }
}

fn unstarted(error: std::io::Error) -> Mp4Error {
    match error.kind() {
        ErrorKind::NotFound => Mp4Error::Missing,
        _ => Mp4Error::Unstarted(error),
    }
}

/// The running program, which writes beside the film's place.
struct Encoder {
    child: Child,
    /// Reads what it says, so that it never waits for a reader.
    messages: Option<JoinHandle<String>>,
    /// None once the film is in its place.
    draft: Option<Draft>,
}

impl Encoder {
    fn new(program: &OsStr, path: &Path, size: [u32; 2], rate: f64) -> Result<Self, Mp4Error> {
        let draft = Draft::new(path).map_err(|cause| unwritten(path, cause))?;
        let mut child = Command::new(program)
            .args(arguments(size, rate))
            .arg(named(draft.beside()))
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(unstarted)?;
        let mut output = child.stderr.take().expect("piped");
        let messages = std::thread::spawn(move || {
            let mut text = Vec::new();
            // What came until then is said.
            let _ = output.read_to_end(&mut text);
            String::from_utf8_lossy(&text).into_owned()
        });
        Ok(Self { child, messages: Some(messages), draft: Some(draft) })
    }

    fn finish(mut self, path: &Path) -> Result<(), Mp4Error> {
        drop(self.child.stdin.take());
        match self.child.wait() {
            Ok(status) if status.success() => {
                let draft = self.draft.take().expect("it is finished only once");
                draft.finish().map_err(|cause| unwritten(path, cause))
            }
            _ => Err(self.ended(path)),
        }
    }

    /// The error of a program that has ended, or has closed its input.
    fn ended(mut self, path: &Path) -> Mp4Error {
        drop(self.child.stdin.take());
        let status = self.child.wait().map_or_else(|e| e.to_string(), |status| status.to_string());
        let text = self.messages.take().and_then(|thread| thread.join().ok()).unwrap_or_default();
        let lines: Vec<&str> = text.lines().filter(|line| !line.trim().is_empty()).collect();
        let output = match lines.is_empty() {
            true => "nothing".to_owned(),
            false => lines[lines.len().saturating_sub(LINES)..].join("; "),
        };
        Mp4Error::Ended { path: path.to_owned(), status, output }
    }
}

impl Drop for Encoder {
    fn drop(&mut self) {
        // It may have ended by itself. Only then the draft is removed.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Everything that `ffmpeg` is told but the name of the file.
fn arguments([width, height]: [u32; 2], rate: f64) -> Vec<String> {
    let (size, rate) = (format!("{width}x{height}"), format!("{rate:.4}"));
    let input = ["-f", "rawvideo", "-pixel_format", "rgb24", "-video_size", &size];
    let input = input.into_iter().chain(["-framerate", &rate, "-i", "pipe:0"]);
    let output = ["-an", "-c:v", "libx264", "-crf", "18", "-pix_fmt", "yuv420p"];
    let output = output.into_iter().chain(["-movflags", "+faststart", "-f", "mp4"]);
    let all = ["-hide_banner", "-loglevel", "error", "-y"].into_iter().chain(input).chain(output);
    all.map(str::to_owned).collect()
}

/// The name as `ffmpeg` takes it for a file, whatever it begins with.
fn named(path: &Path) -> OsString {
    let mut name = OsString::from("file:");
    name.push(path);
    name
}

#[cfg(test)]
mod tests;
