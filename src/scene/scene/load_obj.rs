//! Wavefront OBJ: positions and faces. Materials, normals and texture coordinates are not read.

use std::borrow::Cow;
use std::path::Path;

use super::mesh::{MAX_ELEMENTS, Parts, Soup};
use crate::issue::Issue;

pub(super) fn read(path: &Path, bytes: &[u8]) -> Result<Parts, Vec<Issue>> {
    // Lines may end as on old Macintoshes.
    let lines: Cow<'_, [u8]> = match bytes.contains(&b'\n') {
        true => bytes.into(),
        false => bytes.iter().map(|&b| if b == b'\r' { b'\n' } else { b }).collect(),
    };
    let bytes = &*lines;
    let issues = scan(path, bytes);
    if issues.iter().any(Issue::is_error) {
        return Err(issues);
    }
    let options = tobj::LoadOptions {
        triangulate: true,
        ignore_points: true,
        ignore_lines: true,
        ..tobj::LoadOptions::default()
    };
    let no_materials = |_: &Path| Ok((Vec::new(), Default::default()));
    let text = geometry_only(bytes);
    let (models, _) =
        tobj::load_obj_buf(&mut text.as_slice(), &options, no_materials).map_err(|e| {
            vec![Issue::error(
                path,
                1,
                format!("is not a readable OBJ file: {e}"),
                "export it again",
            )]
        })?;
    let parts = models.into_iter().map(|model| Soup {
        name: model.name,
        positions: model.mesh.positions.as_chunks().0.to_vec(),
        triangles: model.mesh.indices.as_chunks().0.to_vec(),
    });
    Ok(Parts { parts: parts.collect(), issues, ..Parts::default() })
}

/// The lines of text that carry geometry or names, each face reduced to its position indices: the rest cannot
/// change the mesh, and a fault in it should not stop the loading.
fn geometry_only(bytes: &[u8]) -> Vec<u8> {
    let mut out = Vec::with_capacity(bytes.len());
    let mut pending: Vec<u8> = Vec::new();
    for line in bytes.split(|&b| b == b'\n') {
        pending.extend_from_slice(line);
        if continues(&mut pending) {
            continue;
        }
        let line = String::from_utf8_lossy(&pending);
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                out.extend(b"v");
                for word in words.take(3) {
                    out.push(b' ');
                    out.extend(word.as_bytes());
                }
                out.push(b'\n');
            }
            Some("f") => {
                out.extend(b"f");
                for word in words.take_while(|w| !w.starts_with('#')) {
                    out.push(b' ');
                    out.extend(word.split('/').next().unwrap_or(word).as_bytes());
                }
                out.push(b'\n');
            }
            Some("o" | "g") => {
                out.extend(line.trim().as_bytes());
                out.push(b'\n');
            }
            _ => {}
        }
        pending.clear();
    }
    out
}

/// Returns whether a text line ends in a backslash, and removes it: the next line belongs to it.
fn continues(line: &mut Vec<u8>) -> bool {
    while line.last() == Some(&b'\r') {
        line.pop();
    }
    let continued = line.last() == Some(&b'\\');
    if continued {
        line.pop();
        line.push(b' ');
    }
    continued
}

/// Counts of a scan, each with the first line of its kind.
#[derive(Default)]
struct Tally(Vec<(&'static str, bool, usize, usize)>);

impl Tally {
    fn note(&mut self, what: &'static str, stops: bool, line: usize) {
        match self.0.iter_mut().find(|entry| entry.0 == what) {
            Some(entry) => entry.3 += 1,
            None => self.0.push((what, stops, line, 1)),
        }
    }
}

/// Checks each text line, because the reader's own errors name no line.
fn scan(path: &Path, bytes: &[u8]) -> Vec<Issue> {
    let mut tally = Tally::default();
    let (mut vertices, mut faces) = (0usize, 0usize);
    let mut pending: Vec<u8> = Vec::new();
    for (number, line) in bytes.split(|&b| b == b'\n').enumerate() {
        pending.extend_from_slice(line);
        if continues(&mut pending) {
            continue;
        }
        let text = String::from_utf8_lossy(&pending);
        let mut words = text.split_whitespace().take_while(|w| !w.starts_with('#'));
        let at = number + 1;
        match words.next() {
            Some("v") => {
                vertices += 1;
                vertex(words, at, &mut tally);
            }
            Some("f") => {
                faces += face(words, vertices, at, &mut tally);
            }
            Some("p" | "l") => tally.note("points or lines are ignored", false, at),
            Some("curv" | "curv2" | "surf" | "parm" | "cstype" | "bzp" | "bsp") => {
                tally.note("free-form curves and surfaces are ignored", false, at);
            }
            Some(
                "vn" | "vt" | "vp" | "o" | "g" | "s" | "mtllib" | "usemtl" | "usemap" | "mg"
                | "end",
            )
            | None => {}
            Some(_) => tally.note("statements that are not understood are ignored", false, at),
        }
        pending.clear();
    }
    if vertices > MAX_ELEMENTS || faces > MAX_ELEMENTS {
        let message = format!(
            "{} vertices or triangles are too many: the limit is {MAX_ELEMENTS}",
            vertices.max(faces)
        );
        return vec![Issue::error(path, 1, message, "reduce the mesh")];
    }
    let issues = tally.0.into_iter().map(|(what, stops, line, count)| {
        let message = format!("{what} ({count} times, first in line {line})");
        if stops {
            Issue::error(path, count, message, "correct the line or export the file again")
        } else {
            Issue::warning(path, count, message, "")
        }
    });
    issues.collect()
}

fn vertex<'a>(words: impl Iterator<Item = &'a str>, line: usize, tally: &mut Tally) {
    let mut numbers = 0;
    for (i, word) in words.enumerate() {
        match word.parse::<f32>() {
            Ok(v) if i < 3 && !v.is_finite() => {
                tally.note("vertex coordinates are not finite", true, line);
            }
            Ok(w) if i == 3 && numbers == 3 && w != 1.0 => {
                tally.note(
                    "a fourth coordinate (weight or colour) of vertices is ignored",
                    false,
                    line,
                );
            }
            Ok(_) => {}
            Err(_) if i < 3 => tally.note("vertex coordinates are not numbers", true, line),
            Err(_) => {}
        }
        numbers += 1;
    }
    if numbers < 3 {
        tally.note("vertices have fewer than three coordinates", true, line);
    }
}

/// Checks a face; returns the number of its triangles.
fn face<'a>(
    words: impl Iterator<Item = &'a str>,
    vertices: usize,
    line: usize,
    tally: &mut Tally,
) -> usize {
    let mut corners = 0usize;
    for word in words {
        corners += 1;
        match word.split('/').next().unwrap_or(word).parse::<i64>() {
            Err(_) => tally.note("face indices are not integers", true, line),
            Ok(0) => tally.note("face indices are zero (they count from 1)", true, line),
            Ok(i) if i.unsigned_abs() as usize > vertices => {
                tally.note("face indices name vertices that do not exist yet", true, line);
            }
            Ok(_) => {}
        }
    }
    if corners < 3 {
        tally.note("faces with fewer than three corners are ignored", false, line);
    }
    corners.saturating_sub(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn load(text: &str) -> Result<Parts, Vec<Issue>> {
        read(Path::new("x.obj"), text.as_bytes())
    }

    const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

    #[test]
    fn quads_become_two_triangles_of_the_same_winding() {
        let parts = load(&format!("{SQUARE}f 1/9/9 2//7 3 4\n")).expect("readable");
        let soup = &parts.parts[0];
        let corners: Vec<_> =
            soup.triangles.iter().map(|t| t.map(|i| soup.positions[i as usize])).collect();
        assert_eq!(corners.len(), 2);
        assert_eq!(corners[0], [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]]);
    }

    #[test]
    fn names_separate_parts_and_lines_may_be_continued() {
        let text = format!("{SQUARE}o one\nf 1 2 \\\n 3\no two\nf -4 -2 -1\n");
        let parts = load(&text).expect("readable");
        let names: Vec<_> = parts.parts.iter().map(|p| p.name.as_str()).collect();
        assert_eq!(names, ["one", "two"]);
    }

    #[test]
    fn planted_faults_are_named_with_their_line() {
        for (text, cause) in [
            ("f 1 2 5\n", "do not exist yet (1 times, first in line 5"),
            ("f 1 2 0\n", "zero"),
            ("f 1 2 x\n", "not integers"),
            ("v 1 nan 2\n", "not finite"),
            ("v 1 2\n", "fewer than three coordinates"),
            ("v 1 2 a\n", "not numbers"),
        ] {
            let issues = load(&format!("{SQUARE}{text}")).expect_err(text);
            assert!(issues[0].message.contains(cause), "{text}: {issues:?}");
        }
        let parts = load(&format!("{SQUARE}f 1 2 3\nl 1 2\nf 1 2\n")).expect("readable");
        assert_eq!(parts.issues.len(), 2);
    }
}
