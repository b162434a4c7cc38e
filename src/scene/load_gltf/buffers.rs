//! The bytes behind a glTF file: the binary chunk, files beside it, data URIs.

use std::path::Path;

use gltf::buffer::{Data, Source};

use crate::issue::Issue;
use crate::scene::mesh::MAX_FILE;

/// Buffers by index, absent where they cannot be loaded, and why not.
pub(super) struct Buffers {
    pub bytes: Vec<Option<Vec<u8>>>,
    pub issues: Vec<Issue>,
}

/// Loads all buffers; only failing to load a `needed` one is an error. Files are looked for
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
        Source::Uri(uri) => {
            local(path, uri).map_err(|message| (message, "keep the file beside the .gltf"))?;
            let data = Data::from_source(buffer.source(), path.parent());
            data.map_err(|e| {
                let message = format!("cannot be read: {e}");
                (message, "restore the file that it names")
            })?
            .0
        }
    };
    if bytes.len() < buffer.length() {
        return Err((
            format!("is cut off: {} bytes declared, {} there", buffer.length(), bytes.len()),
            "export or copy it again",
        ));
    }
    Ok(bytes)
}

/// Refuses addresses that leave this machine or name something huge.
fn local(path: &Path, uri: &str) -> Result<(), String> {
    if uri.starts_with("data:") {
        return Ok(());
    }
    if uri.contains("://") || uri.starts_with('/') {
        return Err(format!("is at `{uri}`, which is not beside the file"));
    }
    let beside = path.parent().unwrap_or(Path::new("")).join(uri);
    match std::fs::metadata(beside) {
        Ok(info) if info.len() > MAX_FILE => Err(format!("`{uri}` is too large")),
        Ok(info) if !info.is_file() => Err(format!("`{uri}` is not a file")),
        // A missing or oddly encoded name is the reader's to report.
        _ => Ok(()),
    }
}
