//! Messages: 58 bytes of header, then (header version 2) an extended header, the content, metadata.

use super::image::Image;
pub use super::metadata::{ExtendedHeader, MetadataEntry};
pub use super::tools::{PlacedTool, TrackedTool, matrix};
use super::wire::{DecodeError, Label, Reader, Timestamp, checksum, put_floats};

/// Bytes of a header.
pub const HEADER: usize = 58;

/// The header of every message.
#[derive(Clone, Debug, PartialEq)]
pub struct Header {
    /// 1, or 2 with an extended header (3 is taken for 2: some senders write the protocol's version).
    pub version: u16,
    /// Type of the message.
    pub kind: Label<12>,
    /// Device name.
    pub device: Label<20>,
    /// Time of its making.
    pub time: Timestamp,
    /// Number of bytes that follow.
    pub body_size: u64,
    /// Checksum of those bytes.
    pub checksum: u64,
}

impl Header {
    /// Reads a header.
    ///
    /// # Errors
    /// An unknown version: the rest cannot be read then.
    pub fn decode(bytes: &[u8; HEADER]) -> Result<Self, DecodeError> {
        let mut from = Reader::new(bytes, "a header");
        let version = from.u16()?;
        if !(1..=3).contains(&version) {
            return Err(DecodeError::Version(version));
        }
        Ok(Self {
            version,
            kind: Label(from.array()?),
            device: Label(from.array()?),
            time: Timestamp(from.u64()?),
            body_size: from.u64()?,
            checksum: from.u64()?,
        })
    }

    /// Returns whether it states no checksum: 0, which one in 2^64 bodies has.
    pub fn is_unchecked(&self) -> bool {
        self.checksum == 0
    }

    fn encode(&self, out: &mut Vec<u8>) {
        out.extend(self.version.to_be_bytes());
        out.extend(self.kind.0);
        out.extend(self.device.0);
        out.extend(self.time.0.to_be_bytes());
        out.extend(self.body_size.to_be_bytes());
        out.extend(self.checksum.to_be_bytes());
    }
}

/// A message and its content.
#[derive(Clone, Debug, PartialEq)]
pub struct Message {
    /// Device name.
    pub device: Label<20>,
    /// Time of its making.
    pub time: Timestamp,
    /// Extended header and metadata of header version 2; none: version 1.
    pub extension: Option<ExtendedHeader>,
    /// Content of the message.
    pub content: Content,
}

/// Content of a message.
#[derive(Clone, Debug, PartialEq)]
pub enum Content {
    /// TRANSFORM: the first three rows of a matrix, column after column; the last is the shift, mm.
    Transform([f32; 12]),
    /// TDATA: places of tools.
    Tracking(Vec<TrackedTool>),
    /// POSITION: a place, mm, and a turn, a unit quaternion x, y, z, w. Shorter messages leave out w, which is then not
    /// negative, or the turn, which is then none.
    Position {
        /// The place.
        place: [f32; 3],
        /// As much of the turn as there is: 0, 3 or 4 numbers.
        turn: Vec<f32>,
    },
    /// QTDATA: places of tools.
    Placed(Vec<PlacedTool>),
    /// IMAGE.
    Image(Box<Image>),
    /// STATUS.
    Status {
        /// 1 is OK; the others are in the protocol.
        code: u16,
        /// The sender's own subcode.
        subcode: i64,
        /// Name of the error.
        name: Label<20>,
        /// Text, ended by a zero.
        message: Vec<u8>,
    },
    /// CAPABILITY: types that the sender takes.
    Capability(Vec<Label<12>>),
    /// STT_TDATA: asks the receiver to send TDATA.
    StartTracking {
        /// Least time between two messages, ms.
        resolution: u32,
        /// Frame of the wanted poses; empty: the usual one.
        coordinates: Label<32>,
    },
    /// STRING: a text.
    String {
        /// Encoding by its number in the MIB of IANA: 3 is US-ASCII, 106 UTF-8.
        encoding: u16,
        /// The text.
        text: Vec<u8>,
    },
    /// COMMAND, or RTS_COMMAND: the reply to one.
    Command {
        /// True for RTS_COMMAND.
        reply: bool,
        /// The sender's number of it.
        id: u32,
        /// Name of the command.
        name: Label<128>,
        /// Encoding, as of a STRING.
        encoding: u16,
        /// The command, or the reply.
        text: Vec<u8>,
    },
    /// Any other type, and queries without content.
    Other {
        /// Its type.
        kind: Label<12>,
        /// Its content.
        bytes: Vec<u8>,
    },
}

impl Content {
    /// Type in the header.
    pub fn kind(&self) -> Label<12> {
        Label::new(match self {
            Self::Transform(_) => "TRANSFORM",
            Self::Tracking(_) => "TDATA",
            Self::Position { .. } => "POSITION",
            Self::Placed(_) => "QTDATA",
            Self::Image(_) => "IMAGE",
            Self::Status { .. } => "STATUS",
            Self::Capability(_) => "CAPABILITY",
            Self::StartTracking { .. } => "STT_TDATA",
            Self::String { .. } => "STRING",
            Self::Command { reply: false, .. } => "COMMAND",
            Self::Command { reply: true, .. } => "RTS_COMMAND",
            Self::Other { kind, .. } => return *kind,
        })
    }

    fn encode(&self, out: &mut Vec<u8>) {
        match self {
            Self::Transform(matrix) => put_floats(out, matrix),
            Self::Tracking(tools) => tools.iter().for_each(|tool| tool.encode(out)),
            Self::Position { place, turn } => {
                put_floats(out, place);
                put_floats(out, turn);
            }
            Self::Placed(tools) => tools.iter().for_each(|tool| tool.encode(out)),
            Self::Image(image) => image.encode(out),
            Self::Status { code, subcode, name, message } => {
                out.extend(code.to_be_bytes());
                out.extend(subcode.to_be_bytes());
                out.extend(name.0);
                out.extend_from_slice(message);
            }
            Self::Capability(kinds) => out.extend(kinds.iter().flat_map(|k| k.0)),
            Self::StartTracking { resolution, coordinates } => {
                out.extend(resolution.to_be_bytes());
                out.extend(coordinates.0);
            }
            Self::String { encoding, text } => {
                let text = &text[..text.len().min(u16::MAX.into())];
                out.extend(encoding.to_be_bytes());
                out.extend((text.len() as u16).to_be_bytes());
                out.extend_from_slice(text);
            }
            Self::Command { id, name, encoding, text, .. } => {
                out.extend(id.to_be_bytes());
                out.extend(name.0);
                out.extend(encoding.to_be_bytes());
                out.extend((text.len() as u32).to_be_bytes());
                out.extend_from_slice(text);
            }
            Self::Other { bytes, .. } => out.extend_from_slice(bytes),
        }
    }

    fn decode(kind: Label<12>, content: &[u8]) -> Result<Self, DecodeError> {
        let odd = |what| DecodeError::Length { what, bytes: content.len() };
        Ok(match &*kind.text() {
            "TRANSFORM" => {
                let mut from = Reader::new(content, "a TRANSFORM");
                let matrix = from.floats()?;
                from.end()?;
                Self::Transform(matrix)
            }
            "TDATA" => {
                if !content.len().is_multiple_of(TrackedTool::BYTES) {
                    return Err(odd("a TDATA"));
                }
                let tools = content.chunks_exact(TrackedTool::BYTES).map(TrackedTool::decode);
                Self::Tracking(tools.collect::<Result<_, _>>()?)
            }
            "POSITION" => {
                let mut from = Reader::new(content, "a POSITION");
                let place = from.floats()?;
                let turn = match content.len() {
                    12 => Vec::new(),
                    24 => from.floats::<3>()?.to_vec(),
                    _ => from.floats::<4>()?.to_vec(),
                };
                from.end()?;
                Self::Position { place, turn }
            }
            "QTDATA" => {
                if !content.len().is_multiple_of(PlacedTool::BYTES) {
                    return Err(odd("a QTDATA"));
                }
                let tools = content.chunks_exact(PlacedTool::BYTES).map(PlacedTool::decode);
                Self::Placed(tools.collect::<Result<_, _>>()?)
            }
            "IMAGE" => Self::Image(Box::new(Image::decode(content)?)),
            "STATUS" => {
                let mut from = Reader::new(content, "a STATUS");
                Self::Status {
                    code: from.u16()?,
                    subcode: i64::from_be_bytes(from.array()?),
                    name: Label(from.array()?),
                    message: from.rest().to_vec(),
                }
            }
            "CAPABILITY" => {
                let (kinds, rest) = content.as_chunks::<12>();
                if !rest.is_empty() {
                    return Err(odd("a CAPABILITY"));
                }
                Self::Capability(kinds.iter().map(|k| Label(*k)).collect())
            }
            "STT_TDATA" => {
                let mut from = Reader::new(content, "an STT_TDATA");
                let (resolution, coordinates) = (from.u32()?, Label(from.array()?));
                from.end()?;
                Self::StartTracking { resolution, coordinates }
            }
            "STRING" => {
                let mut from = Reader::new(content, "a STRING");
                let (encoding, length) = (from.u16()?, from.u16()?);
                let text = from.rest().to_vec();
                match text.len() == usize::from(length) {
                    true => Self::String { encoding, text },
                    false => return Err(odd("a STRING")),
                }
            }
            reply @ ("COMMAND" | "RTS_COMMAND") => {
                let mut from = Reader::new(content, "a COMMAND");
                let (id, name) = (from.u32()?, Label(from.array()?));
                let (encoding, length) = (from.u16()?, from.u32()?);
                let text = from.rest().to_vec();
                match text.len() as u64 == u64::from(length) {
                    true => Self::Command { reply: reply != "COMMAND", id, name, encoding, text },
                    false => return Err(odd("a COMMAND")),
                }
            }
            _ => Self::Other { kind, bytes: content.to_vec() },
        })
    }
}

impl Message {
    /// A message with the present time, in header version 1, which everybody reads.
    pub fn new(device: &str, content: Content) -> Self {
        Self { device: Label::new(device), time: Timestamp::now(), extension: None, content }
    }

    /// Text of a metadata value.
    pub fn metadata(&self, key: &str) -> Option<String> {
        let entries = &self.extension.as_ref()?.metadata;
        let entry = entries.iter().find(|e| e.key == key.as_bytes())?;
        Some(String::from_utf8_lossy(&entry.value).into_owned())
    }

    /// The bytes to send.
    ///
    /// # Panics
    /// Metadata beyond the limits of the protocol: 65,535 entries or bytes of a key, 4 GB.
    pub fn encode(&self) -> Vec<u8> {
        let mut out = vec![0; HEADER];
        let [front, back] = match &self.extension {
            Some(extension) => extension.encode(),
            None => Default::default(),
        };
        out.extend(front);
        self.content.encode(&mut out);
        out.extend(back);
        let header = Header {
            version: if self.extension.is_some() { 2 } else { 1 },
            kind: self.content.kind(),
            device: self.device,
            time: self.time,
            body_size: (out.len() - HEADER) as u64,
            checksum: checksum(&out[HEADER..]),
        };
        let mut front = Vec::with_capacity(HEADER);
        header.encode(&mut front);
        out[..HEADER].copy_from_slice(&front);
        out
    }

    /// Reads a message.
    ///
    /// # Errors
    /// A body that does not belong to the header, or not to its type.
    pub fn decode(header: &Header, body: &[u8]) -> Result<Self, DecodeError> {
        if body.len() as u64 != header.body_size {
            return Err(DecodeError::Length { what: "a body", bytes: body.len() });
        }
        let computed = checksum(body);
        // Some senders leave it out, and write 0.
        if computed != header.checksum && !header.is_unchecked() {
            return Err(DecodeError::Checksum { stated: header.checksum, computed });
        }
        let (extension, content) = match header.version {
            1 => (None, body),
            _ => {
                let (extension, content) = ExtendedHeader::decode(body)?;
                (Some(extension), content)
            }
        };
        Ok(Self {
            device: header.device,
            time: header.time,
            extension,
            content: Content::decode(header.kind, content)?,
        })
    }

    /// Reads a message and nothing behind it.
    ///
    /// # Errors
    /// Those of [`Self::decode`], and bytes that are missing or left over.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, DecodeError> {
        let (header, body) = bytes
            .split_first_chunk()
            .ok_or(DecodeError::Length { what: "a header", bytes: bytes.len() })?;
        Self::decode(&Header::decode(header)?, body)
    }
}
