//! Names of the images of several frames.

use std::ffi::OsString;
use std::fmt;
use std::path::{MAIN_SEPARATOR, Path, PathBuf};

/// File names of a number of frames.
#[derive(Debug)]
pub struct Images {
    output: PathBuf,
    number: Number,
    frames: u32,
}

/// The place of a frame's number in its file's name.
#[derive(Debug)]
enum Number {
    /// There is none.
    Nowhere,
    /// Between name and extension, with so many digits.
    BeforeExtension(usize),
    /// Between these two parts, with at least so many digits.
    Between(String, usize, String),
}

impl Images {
    /// The number takes the place of the first `{}` or `%04d` in the file name of `output`; several frames
    /// without either are numbered before the extension, as those of a path that is no text.
    pub fn new(output: &Path, frames: u32) -> Self {
        // All numbers are as long as the last, so that names sort.
        let digits = frames.saturating_sub(1).to_string().len().max(4);
        let asked = output.to_str().and_then(|text| braces(text, digits).or_else(|| percent(text)));
        let number = match asked {
            Some((before, digits, after)) => Number::Between(before, digits, after),
            None if frames > 1 => Number::BeforeExtension(digits),
            None => Number::Nowhere,
        };
        Self { output: output.to_owned(), number, frames }
    }

    /// File of frame `index`.
    pub fn path(&self, index: u32) -> PathBuf {
        match &self.number {
            Number::Nowhere => self.output.clone(),
            Number::BeforeExtension(digits) => {
                let mut ending = OsString::from(format!("{index:0digits$}"));
                if let Some(extension) = self.output.extension() {
                    ending.push(".");
                    ending.push(extension);
                }
                self.output.with_extension(ending)
            }
            Number::Between(before, digits, after) => {
                PathBuf::from(format!("{before}{index:0digits$}{after}"))
            }
        }
    }

    /// The file with what is said of all of them: their name without its number, as JSON.
    pub fn sidecar(&self) -> PathBuf {
        let Number::Between(before, _, after) = &self.number else {
            return self.output.with_extension("json");
        };
        let before = before.trim_end_matches(['.', '-', '_']);
        match before.is_empty() || before.ends_with(MAIN_SEPARATOR) {
            true => PathBuf::from(format!("{before}frames.json")),
            false if after.starts_with('.') => PathBuf::from(format!("{before}.json")),
            false => PathBuf::from(format!("{before}{after}")).with_extension("json"),
        }
    }
}

/// Writes the file name, or the first and the last.
impl fmt::Display for Images {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.path(0).display())?;
        if self.frames > 1 {
            write!(f, " to {}", self.path(self.frames - 1).display())?;
        }
        Ok(())
    }
}

type Parts = (String, usize, String);

fn braces(text: &str, digits: usize) -> Option<Parts> {
    let (before, after) = text.split_once("{}")?;
    Some((before.to_owned(), digits, after.to_owned()))
}

/// Splits a name at `%d` or `%04d`, as in printf.
fn percent(text: &str) -> Option<Parts> {
    text.match_indices('%').find_map(|(at, _)| {
        let (width, after) = text[at + 1..].split_once('d')?;
        let digits = match width {
            "" => 0,
            _ if width.starts_with('0') => width.parse().ok().filter(|&n| n <= 20)?,
            _ => return None,
        };
        Some((text[..at].to_owned(), digits, after.to_owned()))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_stand_where_they_are_asked_for() {
        for (output, frames, index, expected) in [
            ("out/a.png", 1, 0, "out/a.png"),
            ("out/a.png", 3, 2, "out/a.0002.png"),
            ("a.b.png", 12_000, 7, "a.b.00007.png"),
            ("a", 2, 1, "a.0001"),
            ("a_{}.png", 1, 0, "a_0000.png"),
            ("{}/a.png", 2, 1, "0001/a.png"),
            ("a%03d.png", 5, 4, "a004.png"),
            ("a%d.png", 12, 11, "a11.png"),
            ("50%.d.png", 2, 1, "50%.d.0001.png"),
        ] {
            let images = Images::new(Path::new(output), frames);
            assert_eq!(images.path(index), Path::new(expected), "{output}");
        }
        for (output, frames, expected) in [
            ("out/a.png", 1, "out/a.json"),
            ("out/a.png", 3, "out/a.json"),
            ("out/a-%04d.png", 3, "out/a.json"),
            ("a_{}.png", 1, "a.json"),
            ("out/{}.png", 2, "out/frames.json"),
            ("{}-a.png", 2, "frames.json"),
        ] {
            let images = Images::new(Path::new(output), frames);
            assert_eq!(images.sidecar(), Path::new(expected), "{output}");
        }
        let images = Images::new(Path::new("a.png"), 2);
        assert_eq!(images.to_string(), "a.0000.png to a.0001.png");
    }

    // Folders as other programs and languages have named them.
    #[cfg(unix)]
    #[test]
    fn paths_that_are_no_text_stay_as_they_are() {
        use std::os::unix::ffi::OsStrExt;

        let path = |bytes: &[u8]| PathBuf::from(std::ffi::OsStr::from_bytes(bytes));
        let output = path(b"ou\xff\xfet/a.png");
        assert_eq!(Images::new(&output, 1).path(0), output);
        assert_eq!(Images::new(&output, 2).path(1), path(b"ou\xff\xfet/a.0001.png"));
        assert_eq!(Images::new(&output, 2).sidecar(), path(b"ou\xff\xfet/a.json"));
        assert_eq!(Images::new(&path(b"\xff"), 2).path(0), path(b"\xff.0000"));
    }
}
