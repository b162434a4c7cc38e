//! STL, binary and text.

use std::io::Cursor;
use std::path::Path;

use super::mesh::{MAX_ELEMENTS, Parts, Soup};
use crate::issue::Issue;

/// Bytes of a binary file before its triangles, and of each triangle.
const HEADER: usize = 84;
const RECORD: usize = 50;

pub(super) fn read(path: &Path, bytes: &[u8]) -> Result<Parts, Vec<Issue>> {
    let fail = |message: String, remedy: &str| vec![Issue::error(path, 1, message, remedy)];
    let mut issues = Vec::new();
    let text = bytes.starts_with(b"solid") && !is_binary(bytes);
    if !text {
        let declared = declared(bytes)
            .ok_or_else(|| fail("is too short for an STL file".to_owned(), "export it again"))?;
        let held = (bytes.len() - HEADER) / RECORD;
        if declared > held {
            return Err(fail(
                format!("is cut off: its header says {declared} triangles, it holds {held}"),
                "export or copy it again",
            ));
        }
        let extra = bytes.len() - HEADER - declared * RECORD;
        if extra > 0 {
            issues.push(Issue::warning(
                path,
                extra,
                format!("{extra} bytes after the last triangle are ignored"),
                "",
            ));
        }
        if declared > MAX_ELEMENTS {
            return Err(fail(format!("{declared} triangles are too many"), "reduce the mesh"));
        }
    }
    // The reader takes a file that begins with "solid" for text; a binary one may do so too.
    let mut owned;
    let mut input = Cursor::new(if text || !bytes.starts_with(b"solid") {
        bytes
    } else {
        owned = bytes.to_vec();
        owned[..5].fill(b' ');
        owned.as_slice()
    });
    let mesh = stl_io::read_stl(&mut input).map_err(|e| {
        fail(format!("is not a readable STL file: {e}"), "export it again as binary STL")
    })?;
    let solids = if text { count(bytes, b"endsolid") } else { 1 };
    if solids > 1 {
        issues.push(Issue::warning(
            path,
            solids,
            format!("holds {solids} solids; only the first is read"),
            "save each solid to a file of its own",
        ));
    }
    let soup = Soup {
        name: String::new(),
        positions: mesh.vertices.iter().map(|v| v.0).collect(),
        triangles: mesh.faces.iter().map(|f| f.vertices.map(|i| i as u32)).collect(),
    };
    Ok(Parts { parts: vec![soup], issues })
}

fn declared(bytes: &[u8]) -> Option<usize> {
    let count = bytes.get(80..HEADER)?.try_into().ok()?;
    Some(u32::from_le_bytes(count) as usize)
}

/// Returns whether the length is exactly that of a binary file with the declared count.
fn is_binary(bytes: &[u8]) -> bool {
    declared(bytes).is_some_and(|n| bytes.len() == HEADER + n * RECORD)
}

fn count(bytes: &[u8], word: &[u8]) -> usize {
    bytes.windows(word.len()).filter(|w| *w == word).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn binary(header: &[u8], declared: u32, held: u32) -> Vec<u8> {
        let mut bytes = header.to_vec();
        bytes.resize(80, 0);
        bytes.extend(declared.to_le_bytes());
        for t in 0..held {
            let corners = [0.0, 0.0, 1.0, 0.0, 0.0, t as f32, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0f32];
            bytes.extend(corners.iter().flat_map(|v| v.to_le_bytes()));
            bytes.extend([0, 0]);
        }
        bytes
    }

    #[test]
    fn a_binary_file_may_begin_with_solid() {
        let parts = read(Path::new("x.stl"), &binary(b"solid thing", 2, 2)).expect("readable");
        assert_eq!(parts.parts[0].triangles.len(), 2);
        // The two triangles share two corners exactly.
        assert_eq!(parts.parts[0].positions.len(), 4);
    }

    #[test]
    fn a_cut_file_says_how_much_is_missing() {
        let issues = read(Path::new("x.stl"), &binary(b"", 9, 2)).expect_err("cut off");
        assert!(issues[0].message.contains("9 triangles, it holds 2"), "{issues:?}");
        assert!(read(Path::new("x.stl"), &binary(b"", u32::MAX, 0)).is_err());
        assert!(read(Path::new("x.stl"), b"").is_err());
    }

    #[test]
    fn text_is_read() {
        let text = b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n\
            vertex 0 1 0\nendloop\nendfacet\nendsolid a\n";
        let parts = read(Path::new("x.stl"), text).expect("readable");
        assert_eq!(parts.parts[0].triangles, [[0, 1, 2]]);
    }
}
