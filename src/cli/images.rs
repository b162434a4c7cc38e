//! Names of the images of several frames.

use std::fmt;
use std::path::{MAIN_SEPARATOR, Path, PathBuf};

/// File names of a number of frames.
#[derive(Debug)]
pub struct Images {
    /// The part before the number, or the whole name where there is none.
    before: String,
    /// Least digits of the number, and the part after it.
    numbered: Option<(usize, String)>,
    frames: u32,
}

impl Images {
    /// The number takes the place of the first `{}` or `%04d` in the file name of `output`; several frames
    /// without either are numbered before the extension.
    pub fn new(output: &Path, frames: u32) -> Self {
        let text = output.to_string_lossy();
        // All numbers are as long as the last, so that names sort.
        let digits = frames.saturating_sub(1).to_string().len().max(4);
        let parts = braces(&text, digits)
            .or_else(|| percent(&text))
            .or_else(|| (frames > 1).then(|| before_extension(output, digits)));
        match parts {
            Some((before, digits, after)) => {
                Self { before, numbered: Some((digits, after)), frames }
            }
            None => Self { before: text.into_owned(), numbered: None, frames },
        }
    }

    /// File of frame `index`.
    pub fn path(&self, index: u32) -> PathBuf {
        let before = &self.before;
        PathBuf::from(match &self.numbered {
            Some((digits, after)) => format!("{before}{index:0digits$}{after}"),
            None => before.clone(),
        })
    }
}

impl Images {
    /// The file with what is said of all of them: their name without its number, as JSON.
    pub fn sidecar(&self) -> PathBuf {
        let Some((_, after)) = &self.numbered else {
            return Path::new(&self.before).with_extension("json");
        };
        let before = self.before.trim_end_matches(['.', '-', '_']);
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

fn before_extension(output: &Path, digits: usize) -> Parts {
    let extension =
        output.extension().map_or_else(String::new, |e| format!(".{}", e.to_string_lossy()));
    let stem = output.with_extension("");
    (format!("{}.", stem.to_string_lossy()), digits, extension)
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
}
