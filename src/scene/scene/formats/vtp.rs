//! VTP, polydata of VTK in XML (docs.vtk.org, "VTK XML formats"): points, polygons and strips of all pieces; numbers in
//! text, in base64, or behind the elements, packed by zlib or not.

use std::borrow::Cow;
use std::path::Path;

use quick_xml::events::{BytesStart, Event};

use arrays::{Appended, Array, Form, Numbers, Place};

use super::vtk::{Cells, not_polydata, offset_cells};
use super::words::shown;
use super::xml::{self, attribute, number};
use super::{EXPORT_AGAIN, Faces, Fault, Scalar};
use crate::issue::Issue;
use crate::scene::mesh::{MAX_ELEMENTS, Parts, Soup};

mod arrays;

pub(in crate::scene) fn read(path: &Path, bytes: &[u8]) -> Result<Parts, Vec<Issue>> {
    let Surface { positions, faces, ras } = parse(bytes).map_err(|fault| fault.issues(path))?;
    let issues = faces.warning(path).into_iter().collect();
    let triangles = faces.over(positions.len()).map_err(|fault| fault.issues(path))?;
    let soup = Soup { positions, triangles, ..Soup::default() };
    Ok(Parts { parts: vec![soup], issues, ras, ..Parts::default() })
}

#[derive(Default)]
struct Surface {
    positions: Vec<[f32; 3]>,
    faces: Faces,
    /// True where the file states that its frame is RAS.
    ras: bool,
}

/// The arrays of a piece that make its surface.
#[derive(Default)]
struct Piece<'b> {
    points: usize,
    strips: usize,
    polygons: usize,
    position: Option<Array<'b>>,
    /// Offsets and connectivity, of strips and of polygons.
    cells: [[Option<Array<'b>>; 2]; 2],
}

fn parse(bytes: &[u8]) -> Result<Surface, Fault> {
    let mut reader = xml::reader(bytes);
    let mut form = None;
    let mut pieces: Vec<Piece<'_>> = Vec::new();
    let mut appended = Appended::default();
    let mut space = None;
    // The list that is read: points, strips, polygons or data of the whole file.
    let mut section = Vec::new();
    loop {
        let (element, empty) = match reader.read_event().map_err(xml::malformed)? {
            Event::Eof => break,
            Event::Start(element) => (element, false),
            Event::Empty(element) => (element, true),
            _ => continue,
        };
        match element.local_name().as_ref() {
            b"VTKFile" => form = Some(file(&element)?),
            b"Piece" => {
                let count = |name: &str| match attribute(&element, name)? {
                    None => Ok(0),
                    Some(_) => number::<usize>(&element, name),
                };
                pieces.push(Piece {
                    points: count("NumberOfPoints")?,
                    strips: count("NumberOfStrips")?,
                    polygons: count("NumberOfPolys")?,
                    ..Piece::default()
                });
            }
            b"DataArray" | b"Array" => {
                let array = array(&element, &mut reader, empty)?;
                match (section.as_slice(), pieces.last_mut(), array) {
                    (b"FieldData", _, Some(array)) if array.name == "SPACE" => space = Some(array),
                    (b"Points", Some(piece), array) => piece.position = array,
                    (b"Strips", Some(piece), Some(array)) => put(&mut piece.cells[0], array),
                    (b"Polys", Some(piece), Some(array)) => put(&mut piece.cells[1], array),
                    _ => {}
                }
            }
            b"AppendedData" => {
                let encoding = attribute(&element, "encoding")?.unwrap_or_default();
                // No XML from here on; the data begin after an underscore.
                let rest: &[u8] = reader.get_ref();
                let mark = rest.iter().position(|&b| b == b'_').map_or(rest.len(), |at| at + 1);
                appended = Appended { bytes: &rest[mark..], base64: encoding == "base64" };
                break;
            }
            name @ (b"Points" | b"Strips" | b"Polys" | b"Verts" | b"Lines" | b"PointData"
            | b"CellData" | b"FieldData") => section = name.to_vec(),
            _ => {}
        }
    }
    let form = form.ok_or_else(|| Fault::new("is no VTK file in XML", EXPORT_AGAIN))?;
    let mut numbers = Numbers::new(form, appended);
    let mut out = Surface::default();
    if let Some(array) = space {
        let text = numbers.of(&array, None)?;
        out.ras = text.starts_with(&[f64::from(b'R'), f64::from(b'A'), f64::from(b'S')]);
    }
    for piece in pieces {
        add(&piece, &mut numbers, &mut out)?;
    }
    Ok(out)
}

fn put<'b>(cells: &mut [Option<Array<'b>>; 2], array: Array<'b>) {
    match array.name.as_str() {
        "offsets" => cells[0] = Some(array),
        "connectivity" => cells[1] = Some(array),
        _ => {}
    }
}

fn file(element: &BytesStart<'_>) -> Result<Form, Fault> {
    let value = |name: &str| Ok::<_, Fault>(attribute(element, name)?.unwrap_or_default());
    let kind = value("type")?;
    if kind != "PolyData" {
        let cause = format!("holds data of type `{}`, and only PolyData is read", shown(&*kind));
        return Err(Fault::new(cause, not_polydata(kind.as_bytes())));
    }
    let packed = match &*value("compressor")? {
        "" => false,
        "vtkZLibDataCompressor" => true,
        other => {
            let cause =
                format!("is packed by `{}`, and only vtkZLibDataCompressor is read", shown(other));
            return Err(Fault::new(cause, "save it with zlib, or uncompressed"));
        }
    };
    let length = match &*value("header_type")? {
        "UInt64" => Scalar::U64,
        _ => Scalar::U32,
    };
    Ok(Form { big: value("byte_order")? == "BigEndian", length, packed })
}

/// The array of an element; none where its type holds no numbers that are needed.
fn array<'b>(
    element: &BytesStart<'_>,
    reader: &mut quick_xml::Reader<&'b [u8]>,
    empty: bool,
) -> Result<Option<Array<'b>>, Fault> {
    let value = |name: &str| Ok::<_, Fault>(attribute(element, name)?.unwrap_or_default());
    let content = if empty { &b""[..] } else { content(reader)? };
    let place = match &*value("format")? {
        "appended" => Place::Appended(number(element, "offset")?),
        "binary" => Place::Base64(content),
        _ => Place::Text(content),
    };
    let name = value("Name")?.into_owned();
    let kind = match &*value("type")? {
        "Int8" => Scalar::I8,
        // Texts are lists of their characters.
        "UInt8" | "String" => Scalar::U8,
        "Int16" => Scalar::I16,
        "UInt16" => Scalar::U16,
        "Int32" => Scalar::I32,
        "UInt32" => Scalar::U32,
        "Int64" => Scalar::I64,
        "UInt64" => Scalar::U64,
        "Float32" => Scalar::F32,
        "Float64" => Scalar::F64,
        _ => return Ok(None),
    };
    Ok(Some(Array { name, kind, place }))
}

/// The text of an element up to its end, without that of the elements in it.
fn content<'b>(reader: &mut quick_xml::Reader<&'b [u8]>) -> Result<&'b [u8], Fault> {
    let (mut out, mut depth) = (&b""[..], 0);
    loop {
        match reader.read_event().map_err(xml::malformed)? {
            Event::Start(_) => depth += 1,
            Event::End(_) if depth == 0 => return Ok(out),
            Event::End(_) => depth -= 1,
            Event::Text(text) if depth == 0 => {
                if let Cow::Borrowed(text) = text.into_inner()
                    && !text.trim_ascii().is_empty()
                {
                    out = text;
                }
            }
            Event::Eof => return Err(Fault::cut("an array")),
            _ => {}
        }
    }
}

/// Adds a piece to the surface.
fn add(piece: &Piece<'_>, numbers: &mut Numbers<'_>, out: &mut Surface) -> Result<(), Fault> {
    let before = out.positions.len();
    if before + piece.points.min(MAX_ELEMENTS + 1) > MAX_ELEMENTS {
        return Err(Fault::too_many(piece.points, "points"));
    }
    if let Some(array) = piece.position.as_ref().filter(|_| piece.points > 0) {
        let values = numbers.of(array, Some(3 * piece.points))?;
        let points = values.as_chunks().0.iter();
        out.positions.extend(points.map(|p: &[f64; 3]| p.map(|v| v as f32)));
    }
    let lists = [(Cells::Strips, piece.strips), (Cells::Polygons, piece.polygons)];
    for ((kind, count), cells) in lists.into_iter().zip(&piece.cells) {
        let [Some(offsets), Some(corners)] = cells else { continue };
        if count == 0 {
            continue;
        }
        if count > MAX_ELEMENTS {
            return Err(Fault::too_many(count, "polygons or strips"));
        }
        // Each offset is where a cell ends.
        let mut bounds = vec![0.0];
        bounds.extend(numbers.of(offsets, Some(count))?);
        let mut corners = numbers.of(corners, None)?;
        let here = out.positions.len() - before;
        if let Some(corner) = corners.iter().find(|&&v| !(v >= 0.0 && v < here as f64)) {
            return Err(super::no_vertex(corner, here));
        }
        corners.iter_mut().for_each(|v| *v += before as f64);
        offset_cells(Some(kind), &bounds, &corners, &mut out.faces)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests;
