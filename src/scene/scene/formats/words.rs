//! Words of a text between white space.

use std::str::FromStr;

use super::{EXPORT_AGAIN, Fault};

/// The words of a text, and the lines in which they stand. Bytes of other content may lie between them.
#[derive(Clone)]
pub(super) struct Words<'b> {
    bytes: &'b [u8],
    at: usize,
    line: usize,
}

impl<'b> Words<'b> {
    /// The words of `bytes`, which begin in this line of the file, counted from 1.
    pub fn new(bytes: &'b [u8], line: usize) -> Self {
        Self { bytes, at: 0, line }
    }

    /// Line of the last word.
    pub fn line(&self) -> usize {
        self.line
    }

    /// The bytes not yet read.
    pub fn rest(&self) -> &'b [u8] {
        &self.bytes[self.at..]
    }

    fn skip_space(&mut self) {
        while let Some(byte) = self.bytes.get(self.at).filter(|b| b.is_ascii_whitespace()) {
            let ends =
                *byte == b'\n' || *byte == b'\r' && self.bytes.get(self.at + 1) != Some(&b'\n');
            self.line += usize::from(ends);
            self.at += 1;
        }
    }

    /// The next word; none at the end.
    pub fn next(&mut self) -> Option<&'b [u8]> {
        self.skip_space();
        let rest = self.rest();
        let len = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        self.at += len;
        (len > 0).then(|| &rest[..len])
    }

    /// The next word, left where it is.
    pub fn peek(&mut self) -> Option<&'b [u8]> {
        self.clone().next()
    }

    /// The rest of the line, without space around it; its end (line feed, carriage return or both) is skipped.
    pub fn line_left(&mut self) -> &'b [u8] {
        let rest = self.rest();
        let len = rest.iter().position(|b| b"\r\n".contains(b)).unwrap_or(rest.len());
        let end = match rest[len..] {
            [] => 0,
            [b'\r', b'\n', ..] => 2,
            _ => 1,
        };
        self.at += len + end;
        self.line += usize::from(end > 0);
        rest[..len].trim_ascii()
    }

    /// The next `count` bytes, whatever they are.
    pub fn bytes(&mut self, count: usize, what: &str) -> Result<&'b [u8], Fault> {
        let found = self.rest().get(..count).ok_or_else(|| Fault::cut(what))?;
        self.at += count;
        Ok(found)
    }

    /// The next word as a number.
    pub fn number<T: FromStr>(&mut self, what: &str) -> Result<T, Fault> {
        let word = self.next().ok_or_else(|| Fault::cut(what))?;
        let number = str::from_utf8(word).ok().and_then(|text| text.parse().ok());
        number.ok_or_else(|| no_number(word, what).at(self.line))
    }
}

/// The fault of a word that is no number.
pub(super) fn no_number(word: &[u8], what: &str) -> Fault {
    Fault::new(format!("`{}` is no number that fits: {what}", shown(word)), EXPORT_AGAIN)
}

/// The beginning of a text, for a message.
pub(super) fn shown(text: impl AsRef<[u8]>) -> String {
    String::from_utf8_lossy(text.as_ref()).chars().take(60).collect()
}
