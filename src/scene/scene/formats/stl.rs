//! STL, binary and text, with all solids of a text. Normals are not read: they follow from the order of the corners.
//!
//! Text is read as other programs read it: upper or lower case, any white space, names of any bytes or none, any
//! words for a normal.

use std::collections::HashMap;
use std::path::Path;

use super::{COPY_AGAIN, Faces, Fault, Words};
use crate::issue::Issue;
use crate::scene::mesh::{MAX_ELEMENTS, Parts, Soup};

/// Bytes of a binary file before its triangles, and of each triangle.
const HEADER: usize = 84;
const RECORD: usize = 50;
/// Bytes at the beginning that tell text from binary.
const BEGINNING: usize = 512;

pub(in crate::scene) fn read(path: &Path, bytes: &[u8]) -> Result<Parts, Vec<Issue>> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let read = if is_text(bytes) { text(path, bytes) } else { binary(path, bytes) };
    read.map_err(|fault| fault.issues(path))
}

/// Returns whether it is text: it begins with `solid`, is not as long as a binary file of the declared count would be,
/// and has no zero among its first bytes.
fn is_text(bytes: &[u8]) -> bool {
    let exact = declared(bytes).is_some_and(|n| bytes.len() == HEADER + n * RECORD);
    let solid = bytes.trim_ascii_start().get(..5).is_some_and(|w| w.eq_ignore_ascii_case(b"solid"));
    !exact && solid && !bytes.iter().take(BEGINNING).any(|&b| b == 0)
}

fn declared(bytes: &[u8]) -> Option<usize> {
    let count = bytes.get(80..HEADER)?.try_into().ok()?;
    Some(u32::from_le_bytes(count) as usize)
}

/// A soup being made, whose equal corners are one vertex.
#[derive(Default)]
struct Solid {
    name: String,
    positions: Vec<[f32; 3]>,
    seen: HashMap<[u32; 3], u32>,
    faces: Faces,
    /// Vertices of the solids before it.
    before: usize,
}

impl Solid {
    fn polygon(&mut self, corners: &[[f32; 3]]) -> Result<(), Fault> {
        if self.before + self.positions.len() > MAX_ELEMENTS {
            return Err(Fault::too_many("these", "vertices"));
        }
        let corners = corners.iter().map(|&corner| {
            // Adding zero makes -0 and +0 equal.
            let key = corner.map(|v| (v + 0.0).to_bits());
            *self.seen.entry(key).or_insert_with(|| {
                self.positions.push(corner);
                (self.positions.len() - 1) as u32
            })
        });
        let corners: Vec<_> = corners.collect();
        self.faces.polygon(&corners)
    }

    fn soup(self) -> Soup {
        Soup { name: self.name, positions: self.positions, triangles: self.faces.triangles }
    }
}

fn binary(path: &Path, bytes: &[u8]) -> Result<Parts, Fault> {
    let short = || Fault::new("is too short for an STL file", COPY_AGAIN);
    let declared = declared(bytes).ok_or_else(short)?;
    let (triangles, rest) = bytes[HEADER..].as_chunks::<RECORD>();
    let held = triangles.len();
    if declared > held {
        let binary = bytes.iter().take(BEGINNING).any(|&b| b == 0);
        return Err(match binary {
            true => Fault::new(
                format!("is cut off: its header says {declared} triangles, it holds {held}"),
                COPY_AGAIN,
            ),
            false => Fault::new(
                "is no STL file: it is neither text that begins with `solid` nor binary",
                "export it again as binary STL",
            ),
        });
    }
    if declared > MAX_ELEMENTS {
        return Err(Fault::too_many(declared, "triangles"));
    }
    let mut solid = Solid::default();
    for record in &triangles[..declared] {
        let value = |i: usize| {
            let bytes = record[12 + 4 * i..].first_chunk().expect("twelve numbers and two bytes");
            f32::from_le_bytes(*bytes)
        };
        solid.polygon(&[0, 3, 6].map(|i| [0, 1, 2].map(|axis| value(i + axis))))?;
    }
    let extra = (held - declared) * RECORD + rest.len();
    let message = format!("{extra} bytes after the last triangle are ignored");
    let issues = (extra > 0).then(|| Issue::warning(path, extra, message, ""));
    let issues = issues.into_iter().collect();
    Ok(Parts { parts: vec![solid.soup()], issues, ..Parts::default() })
}

fn text(path: &Path, bytes: &[u8]) -> Result<Parts, Fault> {
    let mut words = Words::new(bytes, 1);
    let mut done: Vec<Solid> = Vec::new();
    let mut solid = Solid::default();
    let mut corners: Vec<[f32; 3]> = Vec::new();
    let (mut total, mut short, mut strange) = (0, 0, Vec::new());
    let mut open = false;
    let mut normal = false;
    while let Some(word) = words.next() {
        let lower = word.to_ascii_lowercase();
        match lower.as_slice() {
            b"solid" => {
                let name = String::from_utf8_lossy(words.line_left()).into_owned();
                let before = solid.before + solid.positions.len();
                let next = Solid { name, before, ..Solid::default() };
                done.push(std::mem::replace(&mut solid, next));
            }
            b"endsolid" => {
                words.line_left();
            }
            // Whatever stands for a normal is skipped up to the loop.
            b"facet" => (open, normal) = (true, true),
            b"outer" | b"loop" => normal = false,
            b"vertex" => {
                normal = false;
                let mut coordinate = || words.number("a vertex has three coordinates");
                corners.push([coordinate()?, coordinate()?, coordinate()?]);
            }
            b"endloop" | b"endfacet" => {
                (open, normal) = (lower == b"endloop" && open, false);
                if !corners.is_empty() {
                    solid.polygon(&corners)?;
                    total += corners.len().saturating_sub(2);
                    short += usize::from(corners.len() < 3);
                    corners.clear();
                }
                if total > MAX_ELEMENTS {
                    return Err(Fault::too_many("these", "triangles"));
                }
            }
            _ if normal => {}
            _ => strange.push(words.line()),
        }
        strange.truncate(2);
    }
    if open || !corners.is_empty() {
        return Err(Fault::cut("a facet"));
    }
    done.push(solid);
    let mut issues = Vec::new();
    if let Some(line) = strange.first() {
        let message = "words that are not understood are ignored";
        issues.push(Issue::warning(path, 1, message, "").of(&format!("line {line}")));
    }
    let faces = Faces { short, ..Faces::default() };
    issues.extend(faces.warning(path));
    let parts = done.into_iter().map(Solid::soup).filter(|soup| !soup.triangles.is_empty());
    Ok(Parts { parts: parts.collect(), issues, ..Parts::default() })
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

    fn load(bytes: &[u8]) -> Result<Parts, Vec<Issue>> {
        read(Path::new("x.stl"), bytes)
    }

    #[test]
    fn a_binary_file_may_begin_with_solid() {
        for bytes in [binary(b"solid thing", 2, 2), [&binary(b"solid", 2, 2)[..], b"more"].concat()]
        {
            let parts = load(&bytes).expect("readable");
            assert_eq!(parts.parts[0].triangles.len(), 2);
            // The two triangles share two corners exactly.
            assert_eq!(parts.parts[0].positions.len(), 4);
            assert_eq!(parts.issues.len(), usize::from(bytes.len() > 184));
        }
    }

    #[test]
    fn a_cut_file_says_how_much_is_missing() {
        let issues = load(&binary(b"", 9, 2)).expect_err("cut off");
        assert!(issues[0].message.contains("9 triangles, it holds 2"), "{issues:?}");
        assert!(load(&binary(b"", u32::MAX, 0)).is_err());
        assert!(load(b"").is_err());
        let issues = load(&b"no such file\n".repeat(20)).expect_err("a letter");
        assert!(issues[0].message.contains("is no STL file"), "{issues:?}");
    }

    const TEXT: &str = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n\
        vertex 0 1 0\nendloop\nendfacet\nendsolid a\n";

    #[test]
    fn text_is_read_as_others_read_it() {
        let crooked = TEXT.replace("normal 0 0 1", "normal nan -nan(ind) 1.#QNAN");
        let spaced = TEXT.replace("facet normal", "  facet normal").replace("vertex", "\tvertex");
        for text in [
            TEXT.to_owned(),
            TEXT.to_uppercase(),
            TEXT.replace("solid a", "solid"),
            TEXT.replace("solid a", "solid\ta"),
            TEXT.replace("endsolid a\n", ""),
            TEXT.replace('\n', "\r\n"),
            TEXT.replace('\n', "\r"),
            TEXT.replace("facet normal 0 0 1\n", "facet\n"),
            TEXT.replace('\n', " ").replacen("a ", "a\n", 1),
            format!("\n \n{TEXT}"),
            format!("\u{feff}{TEXT}"),
            format!("  {spaced}"),
            crooked,
        ] {
            let parts = load(text.as_bytes()).unwrap_or_else(|e| panic!("{text}: {e:?}"));
            assert_eq!(parts.parts[0].triangles, [[0, 1, 2]], "{text}");
            assert!(parts.issues.is_empty(), "{text}: {:?}", parts.issues);
        }
        let latin = [b"solid M\xe4tr\xfcschka\n", &TEXT.as_bytes()[8..]].concat();
        assert_eq!(load(&latin).expect("readable").parts.len(), 1);
    }

    #[test]
    fn all_solids_are_read_and_keep_their_names() {
        let two = TEXT.to_owned() + &TEXT.replace("d a", "d the other");
        let parts = load(two.as_bytes()).expect("readable");
        let names: Vec<_> = parts.parts.iter().map(|p| p.name.as_str()).collect();
        assert_eq!(names, ["a", "the other"]);
        assert!(parts.issues.is_empty(), "{:?}", parts.issues);
        // An empty solid is no part.
        let parts = load(format!("solid none\nendsolid\n{TEXT}").as_bytes()).expect("readable");
        assert_eq!(parts.parts.len(), 1);
    }

    #[test]
    fn planted_faults_of_text_are_told() {
        let loop_of_two = TEXT.replace("vertex 0 1 0\n", "");
        assert_eq!(load(loop_of_two.as_bytes()).expect("readable").issues.len(), 1);
        let strange = TEXT.replace("endfacet", "endfacet\ncolour red");
        let found = load(strange.as_bytes()).expect("readable").issues;
        assert!(found[0].to_string().contains("line 9: words"), "{found:?}");
        for (text, cause) in [
            (&TEXT[..60], "ends within"),
            (&TEXT.replace("1 0 0", "1 0 x"), "line 5: `x` is no number"),
        ] {
            let issues = load(text.as_bytes()).expect_err(cause);
            assert!(issues[0].to_string().contains(cause), "{issues:?}");
        }
    }
}
