//! Bytes of the OpenIGTLink protocol (version 3, header versions 1 and 2): big endian, names of a
//! fixed length, CRC-64 of ECMA-182.

use std::borrow::Cow;
use std::fmt;
use std::time::{SystemTime, UNIX_EPOCH};

use crc::{CRC_64_ECMA_182, Crc, Table};

/// Checksum with sixteen tables: an image of the screen's size takes a millisecond, not five.
static CRC: Crc<u64, Table<16>> = Crc::<u64, Table<16>>::new(&CRC_64_ECMA_182);

/// Checksum of a message's body.
pub fn checksum(body: &[u8]) -> u64 {
    CRC.checksum(body)
}

/// The reason why bytes are no message.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DecodeError {
    /// Not the protocol, or a future version.
    #[error("header version {0} is none of OpenIGTLink's (1, 2, 3)")]
    Version(u16),
    /// The body differs from the one sent.
    #[error("the body's checksum is {computed:016x}, not {stated:016x}")]
    Checksum {
        /// Checksum in the header.
        stated: u64,
        /// Checksum of the body.
        computed: u64,
    },
    /// Bytes are missing, or left over.
    #[error("{what} of {bytes} bytes")]
    Length {
        /// The part with the wrong length.
        what: &'static str,
        /// Number of bytes.
        bytes: usize,
    },
    /// A code that the protocol does not define.
    #[error("{what} {code}, which is not defined")]
    Code {
        /// The field with the code.
        what: &'static str,
        /// The code.
        code: u64,
    },
}

/// Takes values off the front of some bytes.
pub(super) struct Reader<'b> {
    rest: &'b [u8],
    what: &'static str,
}

impl<'b> Reader<'b> {
    /// A reader of `bytes`; errors name `what`.
    pub fn new(bytes: &'b [u8], what: &'static str) -> Self {
        Self { rest: bytes, what }
    }

    /// The next `count` bytes.
    pub fn take(&mut self, count: usize) -> Result<&'b [u8], DecodeError> {
        let (taken, rest) = self
            .rest
            .split_at_checked(count)
            .ok_or(DecodeError::Length { what: self.what, bytes: self.rest.len() })?;
        self.rest = rest;
        Ok(taken)
    }

    /// The next bytes, as many as fit into the array.
    pub fn array<const N: usize>(&mut self) -> Result<[u8; N], DecodeError> {
        let taken = self.take(N)?;
        Ok(taken.try_into().expect("as many as asked for"))
    }

    pub fn u8(&mut self) -> Result<u8, DecodeError> {
        Ok(self.array::<1>()?[0])
    }

    pub fn u16(&mut self) -> Result<u16, DecodeError> {
        Ok(u16::from_be_bytes(self.array()?))
    }

    pub fn u32(&mut self) -> Result<u32, DecodeError> {
        Ok(u32::from_be_bytes(self.array()?))
    }

    pub fn u64(&mut self) -> Result<u64, DecodeError> {
        Ok(u64::from_be_bytes(self.array()?))
    }

    pub fn floats<const N: usize>(&mut self) -> Result<[f32; N], DecodeError> {
        let mut out = [0.0; N];
        for value in &mut out {
            *value = f32::from_be_bytes(self.array()?);
        }
        Ok(out)
    }

    pub fn shorts<const N: usize>(&mut self) -> Result<[u16; N], DecodeError> {
        let mut out = [0; N];
        for value in &mut out {
            *value = self.u16()?;
        }
        Ok(out)
    }

    /// All remaining bytes.
    pub fn rest(self) -> &'b [u8] {
        self.rest
    }

    /// Fails where bytes remain.
    pub fn end(self) -> Result<(), DecodeError> {
        match self.rest.len() {
            0 => Ok(()),
            bytes => Err(DecodeError::Length { what: self.what, bytes }),
        }
    }
}

/// Appends big-endian floats.
pub(super) fn put_floats(out: &mut Vec<u8>, values: &[f32]) {
    out.extend(values.iter().flat_map(|v| v.to_be_bytes()));
}

/// Appends big-endian short integers.
pub(super) fn put_shorts(out: &mut Vec<u8>, values: &[u16]) {
    out.extend(values.iter().flat_map(|v| v.to_be_bytes()));
}

/// A name in a field of N bytes, padded with zeros.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Label<const N: usize>(pub(super) [u8; N]);

impl<const N: usize> Label<N> {
    /// A label with the text, cut to N bytes.
    pub fn new(text: &str) -> Self {
        let mut end = text.len().min(N);
        while !text.is_char_boundary(end) {
            end -= 1;
        }
        let mut bytes = [0; N];
        bytes[..end].copy_from_slice(&text.as_bytes()[..end]);
        Self(bytes)
    }

    /// Most bytes of a text in the field.
    pub fn room(&self) -> usize {
        N
    }

    /// The text before the first zero.
    pub fn text(&self) -> Cow<'_, str> {
        let end = self.0.iter().position(|&b| b == 0).unwrap_or(N);
        String::from_utf8_lossy(&self.0[..end])
    }

    /// Returns whether the field holds this text.
    pub fn is(&self, text: &str) -> bool {
        self.text() == text
    }

    /// Returns whether it begins with a zero.
    pub fn is_empty(&self) -> bool {
        self.0.first().is_none_or(|&b| b == 0)
    }
}

/// In quotes, with escapes for unprintable characters: it may come from anybody.
impl<const N: usize> fmt::Display for Label<N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "`{}`", self.text().escape_debug())
    }
}

impl<const N: usize> fmt::Debug for Label<N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

/// Time since 1970 (UTC) in units of 2^-32 s; 0 is none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Timestamp(pub u64);

impl Timestamp {
    /// The present time.
    pub fn now() -> Self {
        let now = SystemTime::now().duration_since(UNIX_EPOCH);
        // A clock before 1970 gives zero.
        let now = now.unwrap_or_default();
        let fraction = (u64::from(now.subsec_nanos()) << 32) / 1_000_000_000;
        Self((now.as_secs() << 32) | fraction)
    }

    /// Time in seconds.
    pub fn seconds(self) -> f64 {
        self.0 as f64 / 2f64.powi(32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checksum_is_that_of_ecma_182() {
        // The catalogue of parametrised CRC algorithms: the check value of CRC-64/ECMA-182.
        assert_eq!(checksum(b"123456789"), 0x6c40_df5f_0b49_7347);
    }

    #[test]
    fn names_are_cut_between_characters_and_shown_harmlessly() {
        assert!(Label::<4>::new("abc").is("abc"));
        assert!(Label::<4>::new("abcdef").is("abcd"));
        assert!(Label::<4>::new("abc\u{e9}").is("abc"));
        let hostile = Label::<8>(*b"\x1b[2J\xff\0xy");
        let shown = hostile.to_string();
        assert!(!shown.contains('\x1b') && !shown.contains('x'), "{shown}");
        assert!(Label::<4>::new("").is_empty() && !hostile.is_empty());
    }

    #[test]
    fn time_is_a_fixed_point_number() {
        assert_eq!(Timestamp((5 << 32) | (1 << 31)).seconds(), 5.5);
        let (before, stamp) = (SystemTime::now(), Timestamp::now());
        let before = before.duration_since(UNIX_EPOCH).expect("after 1970");
        assert!((0.0..5.0).contains(&(stamp.seconds() - before.as_secs_f64() + 1e-6)));
    }
}
