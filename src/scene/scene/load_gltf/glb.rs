//! The binary container of glTF 2.0 (chapter 4.4): a header, a JSON chunk, a binary chunk.

use std::path::Path;

use crate::issue::Issue;

const MAGIC: &[u8] = b"glTF";
const JSON: u32 = 0x4E4F_534A;
const BIN: u32 = 0x004E_4942;

/// The two chunks; a text file has no binary one.
pub(super) struct Container<'a> {
    pub json: &'a [u8],
    pub binary: Option<&'a [u8]>,
    pub issues: Vec<Issue>,
}

/// Splits a file into its chunks. Any sign of lost bytes is an error.
pub(super) fn open<'a>(path: &Path, bytes: &'a [u8]) -> Result<Container<'a>, Issue> {
    let is_glb = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("glb"));
    if !bytes.starts_with(MAGIC) {
        if is_glb {
            return Err(fault(path, "is not a GLB file: it does not begin with `glTF`"));
        }
        return Ok(Container { json: bytes, binary: None, issues: Vec::new() });
    }
    let (Some(version), Some(length)) = (word(bytes, 4), word(bytes, 8)) else {
        return Err(fault(path, "is cut off inside its header"));
    };
    if version != 2 {
        return Err(fault(path, format!("is GLB version {version}; version 2 can be read")));
    }
    if length as usize > bytes.len() || length < 12 {
        let held = bytes.len();
        return Err(fault(
            path,
            format!("its header declares {length} bytes, the file holds {held}"),
        ));
    }
    let mut container = Container { json: &[], binary: None, issues: Vec::new() };
    let extra = bytes.len() - length as usize;
    if extra > 0 {
        container.warn(path, format!("{extra} bytes after the declared length are ignored"));
    }
    container.chunks(path, &bytes[..length as usize])?;
    if container.json.is_empty() {
        return Err(fault(path, "has no JSON chunk, or an empty one"));
    }
    Ok(container)
}

impl<'a> Container<'a> {
    fn chunks(&mut self, path: &Path, bytes: &'a [u8]) -> Result<(), Issue> {
        let mut at = 12;
        let mut index = 0;
        let mut seen_json = false;
        while at < bytes.len() {
            let (Some(length), Some(kind)) = (word(bytes, at), word(bytes, at + 4)) else {
                return Err(fault(path, format!("is cut off in the header of chunk {index}")));
            };
            let end = (at + 8).saturating_add(length as usize);
            let Some(data) = bytes.get(at + 8..end) else {
                return Err(fault(path, format!("chunk {index} reaches beyond the file")));
            };
            if length % 4 != 0 {
                self.warn(path, format!("the length of chunk {index} is not a multiple of 4"));
            }
            match (kind, index) {
                (JSON, 0) => {
                    self.json = data;
                    seen_json = true;
                }
                (_, 0) => return Err(fault(path, "its first chunk is not JSON")),
                (JSON, _) if seen_json => {
                    return Err(fault(path, "has more than one JSON chunk"));
                }
                (BIN, _) if self.binary.is_some() => {
                    return Err(fault(path, "has more than one binary chunk"));
                }
                (BIN, n) => {
                    if n > 1 {
                        self.warn(path, format!("the binary chunk is chunk {n}, not chunk 1"));
                    }
                    if data.is_empty() {
                        self.warn(path, "the binary chunk is empty".to_owned());
                    }
                    self.binary = Some(data);
                }
                _ => self.warn(path, format!("chunk {index} is of an unknown kind and ignored")),
            }
            at = end;
            index += 1;
        }
        Ok(())
    }

    fn warn(&mut self, path: &Path, message: String) {
        self.issues.push(Issue::warning(path, 1, message, "export it again"));
    }
}

fn fault(path: &Path, message: impl Into<String>) -> Issue {
    Issue::error(path, 1, message, "export or copy it again")
}

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    let four = bytes.get(at..at + 4)?;
    Some(u32::from_le_bytes(four.try_into().ok()?))
}
