//! VTP, polydata of VTK in XML (docs.vtk.org, "VTK XML formats"): points, polygons and strips of all pieces; numbers in
//! text, in base64, or behind the elements, packed by zlib or not.

use std::borrow::Cow;
use std::io::Read as _;
use std::path::Path;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use flate2::read::ZlibDecoder;
use quick_xml::events::{BytesStart, Event};

use super::vtk::{Cells, SURFACE, offset_cells};
use super::words::shown;
use super::xml::{self, attribute, number};
use super::{COPY_AGAIN, EXPORT_AGAIN, Faces, Fault, MAX_VALUES, Scalar, Words};
use crate::issue::Issue;
use crate::scene::mesh::{MAX_ELEMENTS, MAX_FILE, Parts, Soup};

/// Most bytes of a block before it was packed, for each byte of it (as for volumes).
const MAX_RATIO: usize = 1032;

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

/// Binary encoding of numbers in the file.
#[derive(Clone, Copy)]
struct Form {
    big: bool,
    /// Type of the lengths before the data.
    length: Scalar,
    packed: bool,
}

/// Place of an array's numbers.
enum Place<'b> {
    Text(&'b [u8]),
    Base64(&'b [u8]),
    /// At this byte of what follows the elements.
    Appended(usize),
}

struct Array<'b> {
    name: String,
    kind: Scalar,
    place: Place<'b>,
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

/// The data after the elements.
#[derive(Default)]
struct Appended<'b> {
    bytes: &'b [u8],
    base64: bool,
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
    let mut numbers = Numbers { form, appended, budget: 2 * MAX_FILE as usize };
    let mut out = Surface::default();
    if let Some(array) = space {
        let text = numbers.of(&array, None)?;
        out.ras = text.starts_with(&[f64::from(b'R'), f64::from(b'A'), f64::from(b'S')]);
    }
    for piece in pieces {
        numbers.piece(&piece, &mut out)?;
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
        return Err(Fault::new(cause, SURFACE));
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

/// The numbers of arrays.
struct Numbers<'b> {
    form: Form,
    appended: Appended<'b>,
    /// Bytes that may still be unpacked, of all arrays together.
    budget: usize,
}

impl Numbers<'_> {
    /// Adds a piece to the surface.
    fn piece(&mut self, piece: &Piece<'_>, out: &mut Surface) -> Result<(), Fault> {
        let before = out.positions.len();
        if before + piece.points.min(MAX_ELEMENTS + 1) > MAX_ELEMENTS {
            return Err(Fault::too_many(piece.points, "points"));
        }
        if let Some(array) = piece.position.as_ref().filter(|_| piece.points > 0) {
            let values = self.of(array, Some(3 * piece.points))?;
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
            bounds.extend(self.of(offsets, Some(count))?);
            let mut corners = self.of(corners, None)?;
            let here = out.positions.len() - before;
            if let Some(corner) = corners.iter().find(|&&v| !(v >= 0.0 && v < here as f64)) {
                return Err(super::no_vertex(corner, here));
            }
            corners.iter_mut().for_each(|v| *v += before as f64);
            offset_cells(Some(kind), &bounds, &corners, &mut out.faces)?;
        }
        Ok(())
    }

    /// The numbers of an array, as many as `count` where that is known.
    fn of(&mut self, array: &Array<'_>, count: Option<usize>) -> Result<Vec<f64>, Fault> {
        let what = format!("the array `{}`", array.name);
        if count.is_some_and(|count| count > MAX_VALUES) {
            return Err(Fault::too_many(count.unwrap_or_default(), "values"));
        }
        let values = match &array.place {
            Place::Text(text) => {
                let (mut words, mut out) = (Words::new(text, 0), Vec::new());
                while words.peek().is_some() && out.len() <= count.unwrap_or(MAX_VALUES) {
                    out.push(words.number(&what).map_err(|fault| fault.at(0))?);
                }
                out
            }
            Place::Base64(text) => {
                let bytes = self.bytes(&Source::Base64(text), &what)?;
                self.numbers(array.kind, &bytes)
            }
            Place::Appended(offset) => {
                let (all, base64) = (self.appended.bytes, self.appended.base64);
                let rest = all.get(*offset..).ok_or_else(|| Fault::cut(&what))?;
                let source = if base64 { Source::Base64(rest) } else { Source::Raw(rest) };
                let bytes = self.bytes(&source, &what)?;
                self.numbers(array.kind, &bytes)
            }
        };
        match count {
            Some(count) if values.len() != count => {
                let cause = format!("{what} has {} numbers of {count}", values.len());
                Err(Fault::new(cause, COPY_AGAIN))
            }
            _ if values.len() > MAX_VALUES => Err(Fault::too_many(values.len(), "values")),
            _ => Ok(values),
        }
    }

    fn numbers(&self, kind: Scalar, bytes: &[u8]) -> Vec<f64> {
        // One more than is allowed is noticed; no more are kept.
        let numbers = bytes.chunks_exact(kind.bytes()).take(MAX_VALUES + 1);
        numbers.map(|bytes| kind.value(bytes, self.form.big)).collect()
    }

    /// The bytes of an array: behind their number, or packed in blocks behind the blocks' sizes.
    fn bytes(&mut self, source: &Source<'_>, what: &str) -> Result<Vec<u8>, Fault> {
        let width = self.form.length.bytes();
        let word = |bytes: &[u8], at: usize| {
            let bytes = bytes.get(at * width..(at + 1) * width).ok_or_else(|| Fault::cut(what))?;
            Ok::<_, Fault>(self.form.length.value(bytes, self.form.big) as usize)
        };
        let head = source.first(width)?;
        if head.is_empty() {
            return Ok(Vec::new());
        }
        let first = word(&head, 0)?;
        if !self.form.packed {
            let all = source.first(width.saturating_add(first))?;
            let data = all.get(width..width.saturating_add(first));
            let data = data.ok_or_else(|| Fault::cut(what))?;
            self.spend(data.len())?;
            return Ok(data.to_vec());
        }
        let blocks = first;
        let head = source.first(width.saturating_mul(blocks.saturating_add(3)))?;
        let (size, last) = (word(&head, 1)?, word(&head, 2)?);
        let packed = (0..blocks).map(|k| word(&head, 3 + k)).collect::<Result<Vec<_>, _>>()?;
        let mut at = width * (3 + blocks);
        let total = packed.iter().fold(at, |sum, size| sum.saturating_add(*size));
        let all = source.first(total)?;
        self.spend(all.len())?;
        let mut out = Vec::new();
        for (k, length) in packed.into_iter().enumerate() {
            let is_last = k + 1 == blocks;
            let size = if is_last && last > 0 { last } else { size };
            let end = at.saturating_add(length);
            let block = all.get(at..end).ok_or_else(|| Fault::cut(what))?;
            at = end;
            if size > block.len().saturating_mul(MAX_RATIO) {
                let cause = format!("{what}: {length} bytes cannot hold a block of {size}");
                return Err(Fault::new(cause, COPY_AGAIN));
            }
            self.spend(size)?;
            let before = out.len();
            let read = ZlibDecoder::new(block).take(size as u64).read_to_end(&mut out);
            if read.is_err() || out.len() - before != size {
                let cause = format!("{what}: block {k} is not what zlib packs, or is cut off");
                return Err(Fault::new(cause, COPY_AGAIN));
            }
        }
        Ok(out)
    }

    fn spend(&mut self, bytes: usize) -> Result<(), Fault> {
        let left = self.budget.checked_sub(bytes);
        self.budget = left.ok_or_else(|| {
            let most = (2 * MAX_FILE) >> 20;
            Fault::new(format!("unpacks to more than {most} MB"), super::REDUCE)
        })?;
        Ok(())
    }
}

/// Bytes as the file writes them, from where an array begins.
enum Source<'b> {
    Raw(&'b [u8]),
    Base64(&'b [u8]),
}

impl Source<'_> {
    /// The first `count` bytes, or all that there are.
    fn first(&self, count: usize) -> Result<Vec<u8>, Fault> {
        match self {
            Self::Raw(bytes) => Ok(bytes[..count.min(bytes.len())].to_vec()),
            Self::Base64(text) => base64(text, count),
        }
    }
}

/// Decodes base64 until there are `count` bytes. Parts of their own, which may end in `=`, follow each other: lengths
/// and data are such parts.
fn base64(text: &[u8], count: usize) -> Result<Vec<u8>, Fault> {
    // Quads of characters that give as many bytes, were there no `=`; each `=` asks for another one at the end.
    let digits = text.iter().copied().filter(|b| !b.is_ascii_whitespace());
    let digits: Vec<u8> = digits
        .take_while(|b| *b != b'<')
        .take(count.div_ceil(3).saturating_add(2).saturating_mul(4))
        .collect();
    let mut out = Vec::new();
    let mut rest = digits.as_slice();
    while !rest.is_empty() && out.len() < count {
        let end = rest.iter().position(|&b| b == b'=').map_or(rest.len(), |at| at / 4 * 4 + 4);
        let (part, after) = rest.split_at(end.min(rest.len()));
        let part = &part[..part.len() / 4 * 4];
        let decoded = STANDARD
            .decode(part)
            .map_err(|e| Fault::new(format!("numbers are not in base64: {e}"), COPY_AGAIN))?;
        out.extend(decoded);
        rest = after;
    }
    out.truncate(count);
    Ok(out)
}

#[cfg(test)]
mod tests;
