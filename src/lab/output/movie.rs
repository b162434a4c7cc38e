//! Frames as an animated GIF.

use std::io::BufWriter;
use std::path::{Path, PathBuf};

use gif::{Encoder, Frame, Repeat};

use crate::output::files::Draft;
use crate::output::picture::grey;

/// Reason for which an animation was not written.
#[derive(Debug, thiserror::Error)]
#[error("writing {}: {cause}", path.display())]
pub struct MovieError {
    /// The file.
    pub path: PathBuf,
    /// Message of the system or of the format.
    pub cause: String,
}

/// An animated GIF that is being written: 256 greys, or half as many and colours, played again and again. All frames share
/// one palette, because some viewers show frames with a palette of their own in black.
pub struct Movie {
    path: PathBuf,
    /// Its palette has colours beside greys.
    coloured: bool,
    state: State,
    /// Time for which the frames so far are shown, hundredths of a second.
    shown: f64,
}

/// State of the file: the format needs the size of the first frame before anything else.
enum State {
    Empty(BufWriter<Draft>),
    Begun(Encoder<BufWriter<Draft>>),
    Failed,
}

impl Movie {
    /// Returns whether `path` names an animation, by its extension.
    pub fn is_meant(path: &Path) -> bool {
        let extension = path.extension().and_then(|e| e.to_str());
        extension.is_some_and(|e| e.eq_ignore_ascii_case("gif"))
    }

    /// Begins a file, which takes the place of an existing one when it is finished.
    ///
    /// # Errors
    /// Errors of the file system.
    pub fn new(path: &Path) -> Result<Self, MovieError> {
        let file = Draft::new(path).map_err(|e| failed(path, e))?;
        let state = State::Empty(BufWriter::new(file));
        Ok(Self { path: path.to_owned(), coloured: false, state, shown: 0.0 })
    }

    /// Begins a file whose frames have colours of flow beside greys: reds and blues with more or less green.
    ///
    /// # Errors
    /// Those of [`Self::new`].
    pub fn coloured(path: &Path) -> Result<Self, MovieError> {
        Ok(Self { coloured: true, ..Self::new(path)? })
    }

    /// Adds a frame that is shown until `end`, s from the beginning: RGBA bytes, row by row, of the size of the first one; of
    /// a grey file their red channel.
    ///
    /// # Errors
    /// Errors of the file system; an image larger than the format allows.
    pub fn add(
        &mut self,
        width: u32,
        height: u32,
        rgba: &[u8],
        end: f64,
    ) -> Result<(), MovieError> {
        let delay = centiseconds(self.shown, end);
        self.shown = 100.0 * end;
        self.write(width, height, rgba, delay).map_err(|e| failed(&self.path, e))
    }

    /// Puts the file into its place; without a frame there is none.
    ///
    /// # Errors
    /// Errors of the file system.
    pub fn finish(self) -> Result<(), MovieError> {
        let Self { path, state, .. } = self;
        let finished = match state {
            State::Begun(encoder) => encoder.into_inner().and_then(|file| {
                let file = file.into_inner().map_err(std::io::IntoInnerError::into_error)?;
                Ok(file.finish()?)
            }),
            State::Empty(_) | State::Failed => Ok(()),
        };
        finished.map_err(|e| failed(&path, e))
    }

    fn write(
        &mut self,
        width: u32,
        height: u32,
        rgba: &[u8],
        delay: u16,
    ) -> Result<(), gif::EncodingError> {
        let large = |_| std::io::Error::other("a GIF has at most 65535 pixels a side");
        let width = u16::try_from(width).map_err(large)?;
        let height = u16::try_from(height).map_err(large)?;
        let mut encoder = match std::mem::replace(&mut self.state, State::Failed) {
            State::Empty(file) => {
                let entry = |index: u8| if self.coloured { colour(index) } else { [index; 3] };
                let palette: Vec<u8> = (0..=255).flat_map(entry).collect();
                let mut encoder = Encoder::new(file, width, height, &palette)?;
                encoder.set_repeat(Repeat::Infinite)?;
                encoder
            }
            State::Begun(encoder) => encoder,
            State::Failed => return Err(std::io::Error::other("it failed before").into()),
        };
        let pixels: Vec<u8> = match self.coloured {
            true => rgba.chunks_exact(4).map(|p| nearest([p[0], p[1], p[2]])).collect(),
            false => grey(rgba).collect(),
        };
        encoder.write_frame(&Frame {
            width,
            height,
            delay,
            buffer: pixels.into(),
            ..Frame::default()
        })?;
        self.state = State::Begun(encoder);
        Ok(())
    }
}

/// Steps of a colour's strength, and of its green.
const SHADES: u8 = 8;

/// A colour of the palette with colours: every other grey, then reds and blues, each with as many strengths and greens.
fn colour(index: u8) -> [u8; 3] {
    let Some(rest) = index.checked_sub(128) else {
        return [2 * index + index / 64; 3];
    };
    let level = |step: u8| (f64::from(step) * 255.0 / f64::from(SHADES - 1)).round() as u8;
    let [strong, green] = [level(rest % 64 / SHADES), level(rest % SHADES)];
    if rest < 64 { [strong, green, 0] } else { [0, green, strong] }
}

/// The entry of that palette that is nearest to a grey, a red or a blue.
fn nearest([r, g, b]: [u8; 3]) -> u8 {
    if r == g && g == b {
        return g / 2;
    }
    let step = |level: u8| (f64::from(level) * f64::from(SHADES - 1) / 255.0).round() as u8;
    let (hue, strong) = if r >= b { (0, r) } else { (1, b) };
    128 + 64 * hue + SHADES * step(strong) + step(g)
}

fn failed(path: &Path, cause: impl ToString) -> MovieError {
    MovieError { path: path.to_owned(), cause: cause.to_string() }
}

/// Returns how long a frame that begins at `begin`, hundredths of a second, is shown until `end`, s, in the
/// format's hundredths: rounded such that the error does not add up.
fn centiseconds(begin: f64, end: f64) -> u16 {
    let shown = (100.0 * end).round() - begin.round();
    // Viewers slow down frames shorter than two hundredths.
    shown.clamp(2.0, 65_535.0) as u16
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::AnimationDecoder;
    use image::codecs::gif::GifDecoder;

    #[test]
    fn durations_add_up() {
        for (rate, frames) in [(10.0, 7), (30.0, 30), (24.0, 100), (15.0, 61), (0.1, 3)] {
            let at = |i: u32| f64::from(i) / rate;
            let shown = (0..frames).map(|i| centiseconds(100.0 * at(i), at(i + 1)));
            let total: u32 = shown.map(u32::from).sum();
            let exact = 100.0 * at(frames);
            assert!((f64::from(total) - exact).abs() <= 0.5, "{rate}: {total} {exact}");
        }
        assert_eq!(centiseconds(0.0, 0.001), 2);
    }

    #[test]
    fn colours_stay_near_what_they_were() {
        for index in 0..=255 {
            let [r, g, b] = colour(index);
            assert_eq!(colour(nearest([r, g, b])), [r, g, b], "{index}");
        }
        for pixel in [[60, 0, 0], [255, 200, 0], [0, 30, 133], [0, 230, 255], [77; 3], [255; 3]] {
            let apart = colour(nearest(pixel)).into_iter().zip(pixel).map(|(a, b)| a.abs_diff(b));
            assert!(apart.max() <= Some(18), "{pixel:?}");
        }
    }

    #[test]
    fn every_grey_comes_back_as_it_was() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.gif");
        let picture = |offset: u8| -> Vec<u8> {
            let grey = (0..=255u8).map(|g| g.wrapping_add(offset));
            grey.flat_map(|g| [g, g, g, if g < 9 { 0 } else { 255 }]).collect()
        };
        std::fs::write(&path, "before").expect("written");
        let mut movie = Movie::new(&path).expect("made");
        for (offset, end) in [(0, 0.05), (7, 0.1)] {
            movie.add(16, 16, &picture(offset), end).expect("written");
        }
        assert_eq!(std::fs::read(&path).expect("the one before"), b"before");
        movie.finish().expect("written");
        let file = std::io::BufReader::new(std::fs::File::open(&path).expect("there"));
        let frames = GifDecoder::new(file).expect("a GIF").into_frames();
        let frames = frames.collect_frames().expect("whole");
        assert_eq!(frames.len(), 2);
        for (frame, offset) in frames.iter().zip([0, 7]) {
            assert_eq!(frame.delay().numer_denom_ms(), (50, 1));
            let found: Vec<u8> = frame.buffer().pixels().map(|p| p.0[0]).collect();
            let expected: Vec<u8> = picture(offset).chunks(4).map(|p| p[0]).collect();
            assert_eq!(found, expected);
        }
    }
}
