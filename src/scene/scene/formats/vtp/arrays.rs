//! Numbers of the arrays of a VTP file: in text, in base64, or behind the elements; packed by zlib or not.

use std::io::Read as _;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use flate2::read::ZlibDecoder;

use crate::scene::formats::{COPY_AGAIN, Fault, MAX_VALUES, REDUCE, Scalar, Words};
use crate::scene::mesh::MAX_FILE;

/// Most bytes of a block before it was packed, for each byte of it (as for volumes).
const MAX_RATIO: usize = 1032;

/// Binary encoding of numbers in the file.
#[derive(Clone, Copy)]
pub(super) struct Form {
    pub big: bool,
    /// Type of the lengths before the data.
    pub length: Scalar,
    pub packed: bool,
}

/// Place of an array's numbers.
pub(super) enum Place<'b> {
    Text(&'b [u8]),
    Base64(&'b [u8]),
    /// At this byte of what follows the elements.
    Appended(usize),
}

pub(super) struct Array<'b> {
    pub name: String,
    pub kind: Scalar,
    pub place: Place<'b>,
}

/// The data after the elements.
#[derive(Default)]
pub(super) struct Appended<'b> {
    pub bytes: &'b [u8],
    pub base64: bool,
}

/// The numbers of arrays.
pub(super) struct Numbers<'b> {
    form: Form,
    appended: Appended<'b>,
    /// Bytes that may still be unpacked, of all arrays together.
    budget: usize,
}

impl<'b> Numbers<'b> {
    pub fn new(form: Form, appended: Appended<'b>) -> Self {
        Self { form, appended, budget: 2 * MAX_FILE as usize }
    }

    /// The numbers of an array, as many as `count` where that is known.
    pub fn of(&mut self, array: &Array<'_>, count: Option<usize>) -> Result<Vec<f64>, Fault> {
        let what = format!("the array `{}`", array.name);
        if count.is_some_and(|count| count > MAX_VALUES) {
            return Err(Fault::too_many(count.unwrap_or_default(), "values"));
        }
        let values = match &array.place {
            Place::Text(text) => {
                let (mut words, mut out) = (Words::new(text, 0), Vec::new());
                while words.peek().is_some() && out.len() <= count.unwrap_or(MAX_VALUES) {
                    out.push(words.number(&what).map_err(|fault| fault.at(0))?);
                }
                out
            }
            Place::Base64(text) => {
                let bytes = self.bytes(&Source::Base64(text), &what)?;
                self.numbers(array.kind, &bytes)
            }
            Place::Appended(offset) => {
                let (all, base64) = (self.appended.bytes, self.appended.base64);
                let rest = all.get(*offset..).ok_or_else(|| Fault::cut(&what))?;
                let source = if base64 { Source::Base64(rest) } else { Source::Raw(rest) };
                let bytes = self.bytes(&source, &what)?;
                self.numbers(array.kind, &bytes)
            }
        };
        match count {
            Some(count) if values.len() != count => {
                let cause = format!("{what} has {} numbers of {count}", values.len());
                Err(Fault::new(cause, COPY_AGAIN))
            }
            _ if values.len() > MAX_VALUES => Err(Fault::too_many(values.len(), "values")),
            _ => Ok(values),
        }
    }

    fn numbers(&self, kind: Scalar, bytes: &[u8]) -> Vec<f64> {
        // One more than is allowed is noticed; no more are kept.
        let numbers = bytes.chunks_exact(kind.bytes()).take(MAX_VALUES + 1);
        numbers.map(|bytes| kind.value(bytes, self.form.big)).collect()
    }

    /// The bytes of an array: behind their number, or packed in blocks behind the blocks' sizes.
    fn bytes(&mut self, source: &Source<'_>, what: &str) -> Result<Vec<u8>, Fault> {
        let width = self.form.length.bytes();
        let word = |bytes: &[u8], at: usize| {
            let bytes = bytes.get(at * width..(at + 1) * width).ok_or_else(|| Fault::cut(what))?;
            Ok::<_, Fault>(self.form.length.value(bytes, self.form.big) as usize)
        };
        let head = source.first(width)?;
        if head.is_empty() {
            return Ok(Vec::new());
        }
        let first = word(&head, 0)?;
        if !self.form.packed {
            let all = source.first(width.saturating_add(first))?;
            let data = all.get(width..width.saturating_add(first));
            let data = data.ok_or_else(|| Fault::cut(what))?;
            self.spend(data.len())?;
            return Ok(data.to_vec());
        }
        let blocks = first;
        let head = source.first(width.saturating_mul(blocks.saturating_add(3)))?;
        let (size, last) = (word(&head, 1)?, word(&head, 2)?);
        let packed = (0..blocks).map(|k| word(&head, 3 + k)).collect::<Result<Vec<_>, _>>()?;
        let mut at = width * (3 + blocks);
        let total = packed.iter().fold(at, |sum, size| sum.saturating_add(*size));
        let all = source.first(total)?;
        self.spend(all.len())?;
        let mut out = Vec::new();
        for (k, length) in packed.into_iter().enumerate() {
            let is_last = k + 1 == blocks;
            let size = if is_last && last > 0 { last } else { size };
            let end = at.saturating_add(length);
            let block = all.get(at..end).ok_or_else(|| Fault::cut(what))?;
            at = end;
            if size > block.len().saturating_mul(MAX_RATIO) {
                let cause = format!("{what}: {length} bytes cannot hold a block of {size}");
                return Err(Fault::new(cause, COPY_AGAIN));
            }
            self.spend(size)?;
            let before = out.len();
            let read = ZlibDecoder::new(block).take(size as u64).read_to_end(&mut out);
            if read.is_err() || out.len() - before != size {
                let cause = format!("{what}: block {k} is not what zlib packs, or is cut off");
                return Err(Fault::new(cause, COPY_AGAIN));
            }
        }
        Ok(out)
    }

    fn spend(&mut self, bytes: usize) -> Result<(), Fault> {
        let left = self.budget.checked_sub(bytes);
        self.budget = left.ok_or_else(|| {
            let most = (2 * MAX_FILE) >> 20;
            Fault::new(format!("unpacks to more than {most} MB"), REDUCE)
        })?;
        Ok(())
    }
}

/// Bytes as the file writes them, from where an array begins.
enum Source<'b> {
    Raw(&'b [u8]),
    Base64(&'b [u8]),
}

impl Source<'_> {
    /// The first `count` bytes, or all that there are.
    fn first(&self, count: usize) -> Result<Vec<u8>, Fault> {
        match self {
            Self::Raw(bytes) => Ok(bytes[..count.min(bytes.len())].to_vec()),
            Self::Base64(text) => base64(text, count),
        }
    }
}

/// Decodes base64 until there are `count` bytes. Parts of their own, which may end in `=`, follow each other: lengths
/// and data are such parts.
fn base64(text: &[u8], count: usize) -> Result<Vec<u8>, Fault> {
    // Quads of characters that give as many bytes, were there no `=`; each `=` asks for another one at the end.
    let digits = text.iter().copied().filter(|b| !b.is_ascii_whitespace());
    let digits: Vec<u8> = digits
        .take_while(|b| *b != b'<')
        .take(count.div_ceil(3).saturating_add(2).saturating_mul(4))
        .collect();
    let mut out = Vec::new();
    let mut rest = digits.as_slice();
    while !rest.is_empty() && out.len() < count {
        let end = rest.iter().position(|&b| b == b'=').map_or(rest.len(), |at| at / 4 * 4 + 4);
        let (part, after) = rest.split_at(end.min(rest.len()));
        let part = &part[..part.len() / 4 * 4];
        let decoded = STANDARD
            .decode(part)
            .map_err(|e| Fault::new(format!("numbers are not in base64: {e}"), COPY_AGAIN))?;
        out.extend(decoded);
        rest = after;
    }
    out.truncate(count);
    Ok(out)
}
