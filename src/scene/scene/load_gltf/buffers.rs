//! The bytes behind a glTF file: the binary chunk, files beside it, data URIs.

use std::io::Read as _;
use std::path::{Component, Path};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use gltf::buffer::Source;
use percent_encoding::percent_decode_str;

use crate::issue::Issue;
use crate::scene::mesh::MAX_FILE;

/// Buffers by index; for those that cannot be loaded, the reason.
pub(super) struct Buffers {
    pub bytes: Vec<Option<Vec<u8>>>,
    pub issues: Vec<Issue>,
}

/// Loads all buffers; only failing to load a `needed` one is an error. Files are searched
/// beside `path`, never at absolute addresses.
pub(super) fn load(
    path: &Path,
    gltf: &gltf::Document,
    binary: Option<&[u8]>,
    needed: &[usize],
) -> Buffers {
    let mut out = Buffers { bytes: Vec::new(), issues: Vec::new() };
    let mut total = 0u64;
    for buffer in gltf.buffers() {
        total = total.saturating_add(buffer.length() as u64);
        let loaded = match total > MAX_FILE {
            true => Err((
                format!("declares more than the limit of {} MB", MAX_FILE >> 20),
                "reduce the mesh",
            )),
            false => one(path, &buffer, binary),
        };
        let bytes = loaded.map_err(|(message, remedy)| {
            let make = match needed.contains(&buffer.index()) {
                true => Issue::error,
                false => Issue::warning,
            };
            let name = format!("buffer {}", buffer.index());
            out.issues.push(make(path, 1, message, remedy.to_owned()).of(&name));
        });
        out.bytes.push(bytes.ok());
    }
    out
}

fn one(
    path: &Path,
    buffer: &gltf::Buffer<'_>,
    binary: Option<&[u8]>,
) -> Result<Vec<u8>, (String, &'static str)> {
    let bytes = match buffer.source() {
        Source::Bin => binary
            .filter(|_| buffer.index() == 0)
            .ok_or_else(|| {
                let message = "has no uri and there is no binary chunk";
                (message.to_owned(), "export it again")
            })?
            .to_vec(),
        Source::Uri(uri) => match uri.strip_prefix("data:") {
            Some(data) => embedded(data)?,
            None => beside(path, uri, buffer.length())?,
        },
    };
    if bytes.len() < buffer.length() {
        return Err((
            format!("is cut off: {} bytes declared, {} there", buffer.length(), bytes.len()),
            "export or copy it again",
        ));
    }
    Ok(bytes)
}

/// Bytes of a data URI, from behind its scheme (RFC 2397).
fn embedded(data: &str) -> Result<Vec<u8>, (String, &'static str)> {
    let unread = |cause: String| (format!("cannot be read: {cause}"), "export it again");
    let text = data.split_once(";base64,").map(|(_, text)| text);
    let text = text.ok_or_else(|| unread("its data URI is not in base64".to_owned()))?;
    STANDARD.decode(text).map_err(|e| unread(format!("its data URI is not in base64: {e}")))
}

/// Bytes of a file in the folder of the glTF file or below it. The address is decoded before it is looked at; one
/// that leaves the folder, or names anything but a file, is refused. At most the declared `length` is read.
fn beside(path: &Path, uri: &str, length: usize) -> Result<Vec<u8>, (String, &'static str)> {
    let elsewhere = "keep the file beside the .gltf";
    let unread = |cause: String| {
        (format!("`{uri}` cannot be read: {cause}"), "restore the file that it names")
    };
    let name = percent_decode_str(uri).decode_utf8().map_err(|e| unread(e.to_string()))?;
    let inside = |c: Component| matches!(c, Component::Normal(_) | Component::CurDir);
    if name.is_empty() || name.contains(':') || !Path::new(&*name).components().all(inside) {
        return Err((format!("is at `{uri}`, which is not beside the file"), elsewhere));
    }
    let file = path.parent().unwrap_or(Path::new("")).join(&*name);
    let info = std::fs::metadata(&file).map_err(|e| unread(e.to_string()))?;
    if !info.is_file() {
        return Err((format!("`{uri}` is not a file"), elsewhere));
    }
    let mut bytes = Vec::new();
    let opened = std::fs::File::open(&file).map_err(|e| unread(e.to_string()))?;
    opened.take(length as u64).read_to_end(&mut bytes).map_err(|e| unread(e.to_string()))?;
    Ok(bytes)
}
