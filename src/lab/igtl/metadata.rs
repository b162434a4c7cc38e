//! The additions of header version 2 to a message: an extended header, and keys with values.

use super::wire::{DecodeError, Reader};

/// Least size of an extended header, bytes.
const EXTENDED_HEADER_BYTES: usize = 12;
/// Bytes of an entry in the index of the metadata.
const INDEX_ENTRY_BYTES: usize = 8;

/// Extended header and metadata.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ExtendedHeader {
    /// The sender's number of the message.
    pub id: u32,
    /// In the sender's order.
    pub metadata: Vec<MetadataEntry>,
}

/// A key and a value of the metadata.
#[derive(Clone, Debug, PartialEq)]
pub struct MetadataEntry {
    /// ASCII.
    pub key: Vec<u8>,
    /// Character set of the value, as IANA numbers them: 3 ASCII, 106 UTF-8.
    pub encoding: u16,
    /// Text in that set.
    pub value: Vec<u8>,
}

impl ExtendedHeader {
    /// Bytes before the content, and bytes after it.
    pub(super) fn encode(&self) -> [Vec<u8>; 2] {
        let short = |n: usize| u16::try_from(n).expect("no longer than the protocol allows");
        let long = |n: usize| u32::try_from(n).expect("no longer than the protocol allows");
        let mut index = short(self.metadata.len()).to_be_bytes().to_vec();
        let mut text = Vec::new();
        for entry in &self.metadata {
            index.extend(short(entry.key.len()).to_be_bytes());
            index.extend(entry.encoding.to_be_bytes());
            index.extend(long(entry.value.len()).to_be_bytes());
            text.extend_from_slice(&entry.key);
            text.extend_from_slice(&entry.value);
        }
        let mut front = Vec::with_capacity(EXTENDED_HEADER_BYTES);
        front.extend((EXTENDED_HEADER_BYTES as u16).to_be_bytes());
        front.extend(short(index.len()).to_be_bytes());
        front.extend(long(text.len()).to_be_bytes());
        front.extend(self.id.to_be_bytes());
        index.extend(text);
        [front, index]
    }

    /// Extended header and metadata of a body, and the content between them.
    pub(super) fn decode(body: &[u8]) -> Result<(Self, &[u8]), DecodeError> {
        let mut from = Reader::new(body, "an extended header");
        let (size, index_size) = (usize::from(from.u16()?), usize::from(from.u16()?));
        let (text_size, id) = (from.u32()? as usize, from.u32()?);
        // Bytes that a later version may add to the extended header.
        from.take(
            size.checked_sub(EXTENDED_HEADER_BYTES)
                .ok_or(DecodeError::Length { what: "an extended header", bytes: size })?,
        )?;
        let rest = from.rest();
        let tail = index_size.saturating_add(text_size);
        let cut = rest
            .len()
            .checked_sub(tail)
            .ok_or(DecodeError::Length { what: "metadata", bytes: tail })?;
        let (content, tail) = rest.split_at(cut);
        let (index, text) = tail.split_at(index_size);
        let metadata = match index_size {
            0 => Vec::new(),
            _ => entries(index, text)?,
        };
        Ok((Self { id, metadata }, content))
    }
}

fn entries(index: &[u8], text: &[u8]) -> Result<Vec<MetadataEntry>, DecodeError> {
    let mut index_from = Reader::new(index, "an index of metadata");
    let count = usize::from(index_from.u16()?);
    let mut rows = Reader::new(index_from.take(count * INDEX_ENTRY_BYTES)?, "an index of metadata");
    index_from.end()?;
    let mut from = Reader::new(text, "metadata");
    let mut out = Vec::with_capacity(count);
    for _ in 0..count {
        let (key, encoding, value) = (rows.u16()?, rows.u16()?, rows.u32()?);
        out.push(MetadataEntry {
            key: from.take(key.into())?.to_vec(),
            encoding,
            value: from.take(value as usize)?.to_vec(),
        });
    }
    from.end()?;
    Ok(out)
}
