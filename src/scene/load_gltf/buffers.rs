//! The bytes behind a glTF file: the binary chunk, files beside it, data URIs.

use std::path::Path;

use gltf::buffer::{Data, Source};

use crate::scene::issue::Issue;
use crate::scene::mesh::MAX_FILE;

/// Loads every buffer. Files are looked for beside `path`, never at absolute addresses.
pub(super) fn load(path: &Path, gltf: &gltf::Gltf) -> Result<Vec<Vec<u8>>, Issue> {
    let mut blob = gltf.blob.clone();
    let mut total = 0;
    let mut all = Vec::new();
    for buffer in gltf.buffers() {
        let name = format!("buffer {}", buffer.index());
        let fail = |message: String, remedy: &str| Issue::error(path, 1, message, remedy).of(&name);
        total += buffer.length() as u64;
        if total > MAX_FILE {
            return Err(fail(
                format!(
                    "declares {} MB, the limit is {} MB",
                    total >> 20,
                    MAX_FILE >> 20
                ),
                "reduce the mesh",
            ));
        }
        let bytes = match buffer.source() {
            Source::Bin => blob.take().ok_or_else(|| {
                fail(
                    "has no uri and there is no binary chunk".to_owned(),
                    "export it again",
                )
            })?,
            Source::Uri(uri) => {
                local(path, uri)
                    .map_err(|message| fail(message, "keep the file beside the .gltf"))?;
                Data::from_source(buffer.source(), path.parent())
                    .map_err(|e| {
                        fail(
                            format!("cannot be read: {e}"),
                            "restore the file that it names",
                        )
                    })?
                    .0
            }
        };
        if bytes.len() < buffer.length() {
            return Err(fail(
                format!(
                    "is cut off: {} bytes declared, {} there",
                    buffer.length(),
                    bytes.len()
                ),
                "export or copy it again",
            ));
        }
        all.push(bytes);
    }
    Ok(all)
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
        // A missing or oddly encoded name is the reader's to report.
        _ => Ok(()),
    }
}
