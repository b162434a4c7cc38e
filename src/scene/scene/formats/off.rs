//! OFF, the Object File Format of Geomview (geomview.org/docs/html/OFF.html), in text: positions and faces. A vertex
//! and a face have a line each; what follows its position or its corners (normals, colours, texture) is not read.

use std::path::Path;

use super::{EXPORT_AGAIN, Faces, Fault, REDUCE, index, surface, whole};
use crate::issue::Issue;
use crate::scene::mesh::{MAX_ELEMENTS, Parts, Soup};

pub(in crate::scene) fn read(path: &Path, bytes: &[u8]) -> Result<Parts, Vec<Issue>> {
    surface(path, parse(bytes))
}

/// The lines with content, each with its number, without comments.
fn lines(bytes: &[u8]) -> impl Iterator<Item = (usize, &[u8])> {
    let end = if bytes.contains(&b'\n') { b'\n' } else { b'\r' };
    let lines = bytes.split(move |&b| b == end).zip(1..);
    lines.filter_map(|(line, number)| {
        let end = line.iter().position(|&b| b == b'#').unwrap_or(line.len());
        let line = line[..end].trim_ascii();
        (!line.is_empty()).then_some((number, line))
    })
}

fn numbers<T: std::str::FromStr>(line: &[u8]) -> impl Iterator<Item = Result<T, Fault>> {
    let words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
    words.map(|word| {
        let number = str::from_utf8(word).ok().and_then(|text| text.parse().ok());
        number.ok_or_else(|| super::words::no_number(word, "vertices and faces have a line each"))
    })
}

/// The keyword before `OFF`: which values each vertex has. `None` where the line begins otherwise.
fn keyword(line: &[u8]) -> Option<(&[u8], &[u8])> {
    let at = line.windows(3).take(6).position(|w| w == b"OFF")?;
    let (before, after) = (&line[..at], &line[at + 3..]);
    before.iter().all(|b| b"STCN4n".contains(b)).then_some((before, after))
}

fn parse(bytes: &[u8]) -> Result<(Soup, Faces), Fault> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let mut lines = lines(bytes).peekable();
    let none = || Fault::new("is no OFF file: it does not begin with OFF and counts", EXPORT_AGAIN);
    // The keyword may be missing, and the counts may follow in its line, in the worst case without a blank.
    let (mut four, mut counts) = (false, None);
    let &(number, first) = lines.peek().ok_or_else(none)?;
    if let Some((before, after)) = keyword(first) {
        lines.next();
        let after = after.trim_ascii();
        if before.contains(&b'n') {
            let cause = "has vertices of a number of dimensions of its own (nOFF)";
            return Err(Fault::new(cause, "save it as OFF with three coordinates"));
        }
        if after.eq_ignore_ascii_case(b"BINARY") {
            return Err(Fault::new("is a binary OFF file", "save it as text, or as .ply"));
        }
        four = before.contains(&b'4');
        counts = (!after.is_empty()).then_some((number, after));
    }
    let (number, line) = counts.or_else(|| lines.next()).ok_or_else(none)?;
    // The number of edges, which the third would be, is not needed.
    let counts: Result<Vec<usize>, _> = numbers(line).take(2).collect();
    let &[vertices, count] = counts.map_err(|_| none().at(number))?.as_slice() else {
        return Err(none().at(number));
    };
    if vertices > MAX_ELEMENTS || count > MAX_ELEMENTS {
        return Err(Fault::too_many(vertices.max(count), "vertices or faces"));
    }
    let mut soup = Soup::default();
    for k in 0..vertices {
        let what = || Fault::cut(format!("vertex {k} of {vertices}"));
        let (number, line) = lines.next().ok_or_else(what)?;
        let values = numbers(line).take(if four { 4 } else { 3 });
        let values = values.collect::<Result<Vec<f32>, _>>().map_err(|fault| fault.at(number))?;
        soup.positions.push(match values[..] {
            [x, y, z] => [x, y, z],
            [x, y, z, w] => [x, y, z].map(|v| v / w),
            _ => {
                let cause = format!("vertex {k} has too few coordinates");
                return Err(Fault::new(cause, EXPORT_AGAIN).at(number));
            }
        });
    }
    let mut faces = Faces::default();
    let mut corners = Vec::new();
    for k in 0..count {
        let what = || Fault::cut(format!("face {k} of {count}"));
        let (number, line) = lines.next().ok_or_else(what)?;
        let mut values = numbers::<f64>(line);
        let size = values.next().ok_or_else(what)?.map_err(|fault| fault.at(number))?;
        if size > line.len() as f64 {
            let cause = format!("face {k} states {size} corners, which its line does not hold");
            return Err(Fault::new(cause, EXPORT_AGAIN).at(number));
        }
        corners.clear();
        for value in values.take(size as usize) {
            let value = value.map_err(|fault| fault.at(number))?;
            corners.push(index(whole(value).unwrap_or(-1)).map_err(|fault| fault.at(number))?);
        }
        if corners.len() != size as usize {
            let cause = format!("face {k} has {} corners of {size}", corners.len());
            return Err(Fault::new(cause, EXPORT_AGAIN).at(number));
        }
        faces.polygon(&corners).map_err(|fault| Fault { remedy: REDUCE, ..fault })?;
    }
    Ok((soup, faces))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn load(text: &str) -> Result<Parts, Vec<Issue>> {
        read(Path::new("x.off"), text.as_bytes())
    }

    const SQUARE: &str = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n";

    #[test]
    fn every_header_gives_the_same_square() {
        let plain = format!("4 1 4\n{SQUARE}4 0 1 2 3\n");
        let colours = plain.replace(" 0\n", " 0 255 0 0 1\n");
        for text in [
            format!("OFF\n{plain}"),
            format!("OFF {plain}"),
            format!("OFF{plain}"),
            plain.clone(),
            format!("# by hand\nOFF # a square\n\n{plain}"),
            format!("COFF\n{colours}"),
            format!("NOFF\n{}", plain.replace(" 0\n", " 0 0 0 1\n")),
            format!("STCNOFF\n{}", plain.replace(" 0\n", " 0 0 0 1 .5 .5 .5 1 0 1\n")),
            format!("4OFF\n{}", plain.replace(" 0\n", " 0 1\n")),
            format!("OFF\r\n{}", plain.replace('\n', "\r\n")),
            format!("OFF\r{}", plain.replace('\n', "\r")),
            plain.replace("4 1 4", "4 1").replace("3\n", "3 0.5 0.5 0.5\n"),
        ] {
            let parts = load(&text).unwrap_or_else(|issues| panic!("{text}: {issues:?}"));
            let soup = &parts.parts[0];
            assert_eq!(soup.triangles, [[0, 1, 2], [0, 2, 3]], "{text}");
            assert_eq!(soup.positions[2], [1.0, 1.0, 0.0], "{text}");
        }
        let halved = load("4OFF\n3 1 0\n0 0 0 1\n2 0 0 2\n0 2 0 2\n3 0 1 2\n").expect("readable");
        assert_eq!(halved.parts[0].positions[1], [1.0, 0.0, 0.0]);
    }

    #[test]
    fn planted_faults_are_named_with_their_line() {
        for (text, line, cause) in [
            (
                format!("OFF\n4 1 0\n{SQUARE}3 0 1 4\n"),
                0,
                "vertex 4, counted from 0, and there are 4",
            ),
            (format!("OFF\n4 1 0\n{SQUARE}3 0 1 -1\n"), 7, "vertex -1"),
            (format!("OFF\n4 1 0\n{SQUARE}3 0 1\n"), 7, "2 corners of 3"),
            (format!("OFF\n4 1 0\n{SQUARE}3000000 0 1\n"), 7, "does not hold"),
            (format!("OFF\n4 2 0\n{SQUARE}3 0 1 2\n"), 0, "ends within face 1 of 2"),
            ("OFF\n4 1 0\n0 0\n".to_owned(), 3, "too few coordinates"),
            ("OFF\n4 1 0\n0 0 x\n".to_owned(), 3, "`x` is no number"),
            ("OFF\n400000000 1 0\n".to_owned(), 0, "too many"),
            ("nOFF 4\n4 1 0\n".to_owned(), 0, "nOFF"),
            ("OFF BINARY\n".to_owned(), 0, "binary"),
            ("hello\n".to_owned(), 1, "is no OFF file"),
            (String::new(), 0, "is no OFF file"),
        ] {
            let issues = load(&text).expect_err(&text);
            assert!(issues[0].message.contains(cause), "{text}: {issues:?}");
            let place = if line == 0 { String::new() } else { format!("line {line}") };
            assert_eq!(issues[0].mesh, place, "{text}: {issues:?}");
        }
    }
}
