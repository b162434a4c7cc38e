//! The elements of a DICOM file (PS3.5, PS3.10). Other readers allocate the length that an element declares
//! before they check that the file holds it, four gigabytes for twelve bytes; this one keeps places in
//! the file instead of values, and only of elements that a volume needs.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ops::Range;

/// Group and element.
pub(super) type Tag = (u16, u16);

/// Sequences that are read, also where their type is not written.
pub(super) const SHARED: Tag = (0x5200, 0x9229);
pub(super) const PER_FRAME: Tag = (0x5200, 0x9230);
pub(super) const POSITION_VOLUME: Tag = (0x0020, 0x930e);
pub(super) const ORIENTATION_VOLUME: Tag = (0x0020, 0x930f);
pub(super) const POSITION_PATIENT: Tag = (0x0020, 0x9113);
pub(super) const ORIENTATION_PATIENT: Tag = (0x0020, 0x9116);
pub(super) const MEASURES: Tag = (0x0028, 0x9110);
pub(super) const VALUES: Tag = (0x0028, 0x9145);
/// Tags of segmentations.
pub(super) const SEGMENTS: Tag = (0x0062, 0x0002);
pub(super) const CATEGORY: Tag = (0x0062, 0x0003);
pub(super) const IDENTIFICATION: Tag = (0x0062, 0x000a);
pub(super) const TYPE: Tag = (0x0062, 0x000f);
const SEQUENCES: [Tag; 12] = [
    SHARED,
    PER_FRAME,
    POSITION_VOLUME,
    ORIENTATION_VOLUME,
    POSITION_PATIENT,
    ORIENTATION_PATIENT,
    MEASURES,
    VALUES,
    SEGMENTS,
    CATEGORY,
    IDENTIFICATION,
    TYPE,
];
pub(super) const PIXELS: Tag = (0x7fe0, 0x0010);
pub(super) const FLOAT_PIXELS: Tag = (0x7fe0, 0x0008);
/// Groups and elements of values that are kept.
const KEPT: [Tag; 30] = [
    (0x0002, 0x0010),
    (0x0008, 0x0016),
    (0x0008, 0x0060),
    (0x0008, 0x0104),
    (0x0018, 0x0050),
    (0x0018, 0x1063),
    (0x0020, 0x0032),
    (0x0020, 0x0037),
    (0x0020, 0x9301),
    (0x0020, 0x9302),
    (0x0028, 0x0002),
    (0x0028, 0x0004),
    (0x0028, 0x0006),
    (0x0028, 0x0008),
    (0x0028, 0x0010),
    (0x0028, 0x0011),
    (0x0028, 0x0030),
    (0x0028, 0x0100),
    (0x0028, 0x0101),
    (0x0028, 0x0102),
    (0x0028, 0x0103),
    (0x0028, 0x1052),
    (0x0028, 0x1053),
    (0x0062, 0x0001),
    (0x0062, 0x0004),
    (0x0062, 0x0005),
    (0x0062, 0x000b),
    (0x0062, 0x000e),
    PIXELS,
    FLOAT_PIXELS,
];
const ITEM: Tag = (0xfffe, 0xe000);
const ITEM_END: Tag = (0xfffe, 0xe00d);
const SEQUENCE_END: Tag = (0xfffe, 0xe0dd);
const UNDEFINED: u32 = u32::MAX;
/// Deepest nesting of sequences that is read; the standard needs a handful.
const MAX_DEPTH: usize = 32;

/// Encoding of elements.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Syntax {
    /// True where types are written.
    pub explicit: bool,
    /// True where the most significant byte comes first.
    pub big: bool,
}

/// Value of an element: places in the file.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value {
    /// Bytes.
    Bytes(Range<usize>),
    /// Items of a sequence.
    Items(Vec<Item>),
    /// Fragments of compressed pixels, the table of offsets first.
    Fragments(Vec<Range<usize>>),
}

/// Elements by tag.
pub(super) type Item = BTreeMap<Tag, Value>;

/// A mistake: byte and cause.
pub(super) type Mistake = (usize, String);

/// Reads elements one after another.
pub(super) struct Parser<'b> {
    pub bytes: &'b [u8],
    pub at: usize,
    pub syntax: Syntax,
}

struct Element {
    tag: Tag,
    sequence: bool,
    /// True for elements without a written type, whatever the rest has.
    implicit: bool,
    length: u32,
    start: usize,
}

impl Parser<'_> {
    fn take<const N: usize>(&mut self) -> Result<[u8; N], Mistake> {
        let found = self.bytes.get(self.at..).and_then(|b| b.first_chunk::<N>());
        let found = found.ok_or_else(|| (self.at, "is cut off within an element".to_owned()))?;
        self.at += N;
        Ok(*found)
    }

    fn u16(&mut self) -> Result<u16, Mistake> {
        let bytes = self.take()?;
        Ok(if self.syntax.big { u16::from_be_bytes(bytes) } else { u16::from_le_bytes(bytes) })
    }

    fn u32(&mut self) -> Result<u32, Mistake> {
        let bytes = self.take()?;
        Ok(if self.syntax.big { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) })
    }

    fn element(&mut self) -> Result<Element, Mistake> {
        let start = self.at;
        let tag = (self.u16()?, self.u16()?);
        let (mut sequence, mut implicit) = (SEQUENCES.contains(&tag), false);
        let length = if tag.0 == ITEM.0 || !self.syntax.explicit {
            self.u32()?
        } else {
            let kind = self.take::<2>()?;
            sequence = &kind == b"SQ";
            match &kind {
                b"OB" | b"OD" | b"OF" | b"OL" | b"OV" | b"OW" | b"SQ" | b"SV" | b"UC" | b"UN"
                | b"UR" | b"UT" | b"UV" => {
                    self.take::<2>()?;
                    let length = self.u32()?;
                    // A sequence of unknown type is written without types.
                    implicit = &kind == b"UN" && length == UNDEFINED;
                    length
                }
                kind if kind.iter().all(u8::is_ascii_uppercase) => u32::from(self.u16()?),
                _ => return Err((start, format!("{tag:04x?} has no type that DICOM knows"))),
            }
        };
        Ok(Element { tag, sequence, implicit, length, start })
    }

    /// The end of a value of this length, which has to lie within `end`.
    fn end(&self, element: &Element, end: usize) -> Result<usize, Mistake> {
        let length = element.length as usize;
        let fits = self.at.checked_add(length).filter(|&e| e <= end);
        fits.ok_or_else(|| {
            let held = end.saturating_sub(self.at);
            let cause = format!("{:04x?} declares {length} bytes, {held} are there", element.tag);
            (element.start, cause)
        })
    }

    /// The byte after the elements of group 2, or the first that cannot be read.
    pub fn end_of_group_2(&self) -> usize {
        let mut ahead = Self { ..*self };
        loop {
            let start = ahead.at;
            let end = ahead
                .element()
                .and_then(|e| ahead.end(&e, self.bytes.len()).map(|end| (e.tag.0, end)));
            match end {
                Ok((2, end)) => ahead.at = end,
                _ => return start,
            }
        }
    }

    /// Elements up to `end`, or to the end of an item.
    pub fn item(&mut self, end: usize, depth: usize) -> Result<Item, Mistake> {
        if depth > MAX_DEPTH {
            return Err((self.at, format!("sequences are nested {MAX_DEPTH} deep")));
        }
        let mut item = Item::new();
        while self.at < end {
            let element = self.element()?;
            if element.tag == ITEM_END {
                break;
            }
            let tag = element.tag;
            let value = if tag == PIXELS && element.length == UNDEFINED {
                Value::Fragments(self.fragments(end)?)
            } else if element.sequence || element.length == UNDEFINED {
                let syntax = self.syntax;
                self.syntax.explicit &= !element.implicit;
                let items = self.items(&element, end, depth)?;
                self.syntax = syntax;
                Value::Items(items)
            } else {
                let value = self.at..self.end(&element, end)?;
                self.at = value.end;
                Value::Bytes(value)
            };
            if KEPT.contains(&tag) || SEQUENCES.contains(&tag) {
                item.insert(tag, value);
            }
        }
        Ok(item)
    }

    fn items(
        &mut self,
        sequence: &Element,
        end: usize,
        depth: usize,
    ) -> Result<Vec<Item>, Mistake> {
        let end = match sequence.length {
            UNDEFINED => end,
            _ => self.end(sequence, end)?,
        };
        let mut items = Vec::new();
        while self.at < end {
            let element = self.element()?;
            match element.tag {
                SEQUENCE_END => break,
                ITEM => {
                    let end = match element.length {
                        UNDEFINED => end,
                        _ => self.end(&element, end)?,
                    };
                    let item = self.item(end, depth + 1)?;
                    if SEQUENCES.contains(&sequence.tag) {
                        items.push(item);
                    }
                }
                tag => {
                    return Err((element.start, format!("{tag:04x?} is no item of a sequence")));
                }
            }
        }
        Ok(items)
    }

    fn fragments(&mut self, end: usize) -> Result<Vec<Range<usize>>, Mistake> {
        let mut out = Vec::new();
        while self.at < end {
            let element = self.element()?;
            match element.tag {
                SEQUENCE_END => return Ok(out),
                ITEM => {
                    let value = self.at..self.end(&element, end)?;
                    self.at = value.end;
                    out.push(value);
                }
                tag => {
                    return Err((element.start, format!("{tag:04x?} is no fragment of pixels")));
                }
            }
        }
        Err((self.at, "is cut off: the compressed pixels do not end".to_owned()))
    }
}

/// The elements of a file and its bytes.
pub(super) struct Elements<'b> {
    pub bytes: &'b [u8],
    pub big: bool,
}

impl Elements<'_> {
    fn bytes(&self, item: &Item, tag: Tag) -> Option<&[u8]> {
        match item.get(&tag)? {
            Value::Bytes(range) => Some(&self.bytes[range.clone()]),
            _ => None,
        }
    }

    /// Text without padding.
    pub fn text(&self, item: &Item, tag: Tag) -> Option<Cow<'_, str>> {
        let bytes = self.bytes(item, tag)?;
        let bytes = bytes.trim_ascii_end();
        let end = bytes.iter().rposition(|&b| b != 0).map_or(0, |i| i + 1);
        Some(String::from_utf8_lossy(bytes[..end].trim_ascii()))
    }

    /// An unsigned 16-bit integer.
    pub fn number(&self, item: &Item, tag: Tag) -> Option<u16> {
        let bytes = *self.bytes(item, tag)?.first_chunk::<2>()?;
        Some(if self.big { u16::from_be_bytes(bytes) } else { u16::from_le_bytes(bytes) })
    }

    /// Decimal numbers in text.
    pub fn decimals<const N: usize>(&self, item: &Item, tag: Tag) -> Option<[f64; N]> {
        let text = self.text(item, tag)?;
        let numbers: Option<Vec<f64>> = text.split('\\').map(|w| w.trim().parse().ok()).collect();
        numbers?.try_into().ok()
    }

    /// 64-bit floats.
    pub fn doubles<const N: usize>(&self, item: &Item, tag: Tag) -> Option<[f64; N]> {
        let bytes = self.bytes(item, tag)?;
        let words = bytes.as_chunks::<8>().0.iter();
        let read = |b: &[u8; 8]| {
            if self.big { f64::from_be_bytes(*b) } else { f64::from_le_bytes(*b) }
        };
        let numbers: Vec<f64> = words.map(read).collect();
        numbers.try_into().ok()
    }
}

/// The first item of a sequence.
pub(super) fn first(item: &Item, tag: Tag) -> Option<&Item> {
    match item.get(&tag)? {
        Value::Items(items) => items.first(),
        _ => None,
    }
}
