//! PLY, the Stanford polygon file format, in text and binary of either byte order: positions and faces. All other
//! elements and properties (normals, colours, texture) are skipped.

use std::path::Path;

use super::words::shown;
use super::{COPY_AGAIN, EXPORT_AGAIN, Faces, Fault, Scalar, Words, index, surface, whole};
use crate::issue::Issue;
use crate::scene::mesh::{MAX_ELEMENTS, Parts, Soup};

/// Most lines of a header.
const MAX_LINES: usize = 10_000;

pub(in crate::scene) fn read(path: &Path, bytes: &[u8]) -> Result<Parts, Vec<Issue>> {
    surface(path, parse(bytes))
}

/// A property of an element: one number, or a list with its length before it.
struct Property {
    name: Vec<u8>,
    /// Type of a list's length.
    length: Option<Scalar>,
    kind: Scalar,
}

/// Some rows of equal properties.
struct Element {
    name: Vec<u8>,
    count: usize,
    properties: Vec<Property>,
}

impl Element {
    /// Bytes of a row in a binary file; none where they differ.
    fn row(&self) -> Option<usize> {
        let fixed = self.properties.iter().all(|p| p.length.is_none());
        fixed.then(|| self.properties.iter().map(|p| p.kind.bytes()).sum())
    }
}

/// The content after the header.
enum Body<'b> {
    Text(Words<'b>),
    Binary { words: Words<'b>, big: bool },
}

impl Body<'_> {
    fn number(&mut self, kind: Scalar, what: &str) -> Result<f64, Fault> {
        match self {
            Self::Text(words) => words.number(what),
            Self::Binary { words, big } => Ok(kind.value(words.bytes(kind.bytes(), what)?, *big)),
        }
    }

    /// Ends a row: a line of its own in text, which may hold more than the header says.
    fn end_row(&mut self) {
        if let Self::Text(words) = self {
            words.line_left();
        }
    }

    /// Reads one property of a row; gives each of its numbers to `take`.
    fn property(
        &mut self,
        property: &Property,
        what: &str,
        mut take: impl FnMut(f64),
    ) -> Result<(), Fault> {
        let Some(length) = property.length else {
            take(self.number(property.kind, what)?);
            return Ok(());
        };
        let stated = self.number(length, what)?;
        let count = whole(stated).filter(|count| *count >= 0);
        let wrong = || Fault::new(format!("a list of {stated} values in {what}"), COPY_AGAIN);
        // More than the file holds ends with the file.
        for _ in 0..count.ok_or_else(wrong)? {
            take(self.number(property.kind, what)?);
        }
        Ok(())
    }
}

fn parse(bytes: &[u8]) -> Result<(Soup, Faces), Fault> {
    let (elements, mut body) = header(bytes)?;
    let (mut soup, mut faces) = (Soup::default(), Faces::default());
    for element in &elements {
        match element.name.as_slice() {
            b"vertex" => vertices(element, &mut body, &mut soup.positions)?,
            b"face" => polygons(element, &mut body, |corners| faces.polygon(&indices(corners)?))?,
            b"tristrips" => polygons(element, &mut body, |corners| strips(corners, &mut faces))?,
            _ => skip(element, &mut body)?,
        }
    }
    Ok((soup, faces))
}

fn indices(corners: &[f64]) -> Result<Vec<u32>, Fault> {
    corners.iter().map(|&corner| index(whole(corner).unwrap_or(-1))).collect()
}

/// Strips one after another, with -1 between them.
fn strips(corners: &[f64], faces: &mut Faces) -> Result<(), Fault> {
    let strips = corners.split(|corner| *corner == -1.0).filter(|strip| !strip.is_empty());
    strips.map(indices).try_for_each(|strip| faces.strip(&strip?))
}

/// The lines of a header; the first one's end tells that of all, so that the first byte of a binary body is none.
struct Lines<'b> {
    bytes: &'b [u8],
    end: &'static [u8],
    number: usize,
}

impl<'b> Lines<'b> {
    fn of(bytes: &'b [u8]) -> Self {
        let first = bytes.iter().position(|&b| b == b'\n' || b == b'\r').unwrap_or(0);
        let end: &[u8] = match bytes.get(first..first + 2) {
            Some(b"\r\n") => b"\r\n",
            Some([b'\r', _]) => b"\r",
            _ => b"\n",
        };
        Self { bytes, end, number: 0 }
    }

    fn next(&mut self) -> Option<&'b [u8]> {
        let len = self.bytes.windows(self.end.len()).position(|w| w == self.end)?;
        let line = &self.bytes[..len];
        self.bytes = &self.bytes[len + self.end.len()..];
        self.number += 1;
        (self.number <= MAX_LINES).then(|| line.trim_ascii())
    }
}

fn header(bytes: &[u8]) -> Result<(Vec<Element>, Body<'_>), Fault> {
    let mut lines = Lines::of(bytes);
    if lines.next() != Some(b"ply") {
        return Err(Fault::new("is no PLY file: its first line is not `ply`", EXPORT_AGAIN));
    }
    let mut elements: Vec<Element> = Vec::new();
    let mut format = None;
    loop {
        let line = lines.next().ok_or_else(|| Fault::cut("the header"))?;
        let words: Vec<_> = line.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty()).collect();
        let wrong = |cause: &str| {
            Err(Fault::new(format!("`{}`: {cause}", shown(line)), EXPORT_AGAIN).at(lines.number))
        };
        match words[..] {
            [] | [b"comment" | b"obj_info", ..] => {}
            [b"format", name, _] => format = Some(name),
            [b"element", name, count] => {
                let count = str::from_utf8(count).ok().and_then(|c| c.parse().ok());
                let Some(count) = count else { return wrong("is no number of elements") };
                elements.push(Element { name: name.to_owned(), count, properties: Vec::new() });
            }
            [b"property", b"list", length, kind, name] => {
                let (length, kind) = (scalar(length), scalar(kind));
                let (Some(length), Some(kind), Some(element)) = (length, kind, elements.last_mut())
                else {
                    return wrong("is of no type of PLY, or before all elements");
                };
                let property = Property { name: name.to_owned(), length: Some(length), kind };
                element.properties.push(property);
            }
            [b"property", kind, name] => {
                let (Some(kind), Some(element)) = (scalar(kind), elements.last_mut()) else {
                    return wrong("is of no type of PLY, or before all elements");
                };
                element.properties.push(Property { name: name.to_owned(), length: None, kind });
            }
            [b"end_header"] => break,
            _ => return wrong("is not understood"),
        }
    }
    let words = Words::new(lines.bytes, lines.number + 1);
    let body = match format {
        Some(b"ascii") => Body::Text(words),
        Some(b"binary_little_endian") => Body::Binary { words, big: false },
        Some(b"binary_big_endian") => Body::Binary { words, big: true },
        _ => return Err(Fault::new("states no format that PLY has", EXPORT_AGAIN)),
    };
    for element in &elements {
        let read = [&b"vertex"[..], b"face", b"tristrips"].contains(&element.name.as_slice());
        if read && element.count > MAX_ELEMENTS {
            let name = String::from_utf8_lossy(&element.name);
            return Err(Fault::too_many(element.count, &format!("elements `{name}`")));
        }
    }
    Ok((elements, body))
}

fn scalar(name: &[u8]) -> Option<Scalar> {
    Some(match name {
        b"char" | b"int8" => Scalar::I8,
        b"uchar" | b"uint8" => Scalar::U8,
        b"short" | b"int16" => Scalar::I16,
        b"ushort" | b"uint16" => Scalar::U16,
        b"int" | b"int32" => Scalar::I32,
        b"uint" | b"uint32" => Scalar::U32,
        b"float" | b"float32" => Scalar::F32,
        b"double" | b"float64" => Scalar::F64,
        _ => return None,
    })
}

fn vertices(
    element: &Element,
    body: &mut Body<'_>,
    positions: &mut Vec<[f32; 3]>,
) -> Result<(), Fault> {
    let place = |name: &[u8]| element.properties.iter().position(|p| p.name == name);
    let (Some(x), Some(y), Some(z)) = (place(b"x"), place(b"y"), place(b"z")) else {
        return Err(Fault::new("has vertices without x, y and z", EXPORT_AGAIN));
    };
    for n in 0..element.count {
        let mut position = [0.0; 3];
        for (p, property) in element.properties.iter().enumerate() {
            let axis = [x, y, z].iter().position(|&axis| axis == p);
            let read = body.property(property, "the vertices", |value| {
                if let Some(axis) = axis {
                    position[axis] = value as f32;
                }
            });
            read.map_err(|fault| fault.counted(n, element.count))?;
        }
        body.end_row();
        positions.push(position);
    }
    Ok(())
}

/// Reads elements with a list of corners; gives each list to `take`.
fn polygons(
    element: &Element,
    body: &mut Body<'_>,
    mut take: impl FnMut(&[f64]) -> Result<(), Fault>,
) -> Result<(), Fault> {
    let names = [&b"vertex_indices"[..], b"vertex_index"];
    let is_list = |p: &Property| names.contains(&p.name.as_slice()) && p.length.is_some();
    let Some(list) = element.properties.iter().position(is_list) else {
        return skip(element, body);
    };
    let mut corners = Vec::new();
    for n in 0..element.count {
        corners.clear();
        for (p, property) in element.properties.iter().enumerate() {
            let read = body.property(property, "the faces", |value| {
                if p == list {
                    corners.push(value);
                }
            });
            read.map_err(|fault| fault.counted(n, element.count))?;
        }
        body.end_row();
        take(&corners)?;
    }
    Ok(())
}

fn skip(element: &Element, body: &mut Body<'_>) -> Result<(), Fault> {
    let what = format!("the elements `{}`", String::from_utf8_lossy(&element.name));
    if let (Body::Binary { words, .. }, Some(row)) = (&mut *body, element.row()) {
        let size = row.checked_mul(element.count).ok_or_else(|| Fault::cut(&what))?;
        words.bytes(size, &what)?;
        return Ok(());
    }
    if element.properties.is_empty() {
        return Ok(());
    }
    for _ in 0..element.count {
        for property in &element.properties {
            body.property(property, &what, |_| {})?;
        }
        body.end_row();
    }
    Ok(())
}

#[cfg(test)]
mod tests;
