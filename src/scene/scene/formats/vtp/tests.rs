use std::io::Write as _;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::ZlibEncoder;

use super::*;

fn load(bytes: impl AsRef<[u8]>) -> Result<Parts, Vec<Issue>> {
    read(Path::new("x.vtp"), bytes.as_ref())
}

/// Encoding of a test's numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Way {
    Text,
    Inline,
    AppendedBase64,
    AppendedRaw,
}

/// A file being written.
struct Writer {
    way: Way,
    /// True for lengths of 64 bits, big-endian numbers, and blocks of 24 bytes, packed.
    wide: bool,
    packed: bool,
    appended: Vec<u8>,
}

impl Writer {
    fn word(&self, value: usize) -> Vec<u8> {
        match self.wide {
            true => (value as u64).to_be_bytes().to_vec(),
            false => (value as u32).to_le_bytes().to_vec(),
        }
    }

    fn put<T: ToString + Copy>(
        &mut self,
        name: &str,
        kind: &str,
        values: &[T],
        bytes: impl Fn(T, bool) -> Vec<u8>,
    ) -> String {
        let data: Vec<u8> = values.iter().flat_map(|&v| bytes(v, self.wide)).collect();
        // Lengths, and what they are the lengths of: parts of their own in base64 where packed.
        let (mut head, mut body) = (self.word(data.len()), data.clone());
        if self.packed {
            let blocks: Vec<_> = data.chunks(24).collect();
            let pack = |block: &&[u8]| {
                let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
                encoder.write_all(block).expect("memory");
                encoder.finish().expect("memory")
            };
            let packed: Vec<_> = blocks.iter().map(pack).collect();
            let sizes = [blocks.len(), 24, data.len() % 24];
            let sizes = sizes.into_iter().chain(packed.iter().map(Vec::len));
            head = sizes.flat_map(|size| self.word(size)).collect();
            body = packed.concat();
        }
        let base64 = match self.packed {
            true => STANDARD.encode(&head) + &STANDARD.encode(&body),
            false => STANDARD.encode([head.clone(), body.clone()].concat()),
        };
        let text: Vec<_> = values.iter().map(T::to_string).collect();
        let (form, offset) = ("appended", self.appended.len());
        let (format, content) = match self.way {
            Way::Text => ("ascii", text.join("\n  ")),
            Way::Inline => ("binary", format!("\n  {base64}\n")),
            Way::AppendedBase64 => {
                self.appended.extend(base64.bytes());
                (form, String::new())
            }
            Way::AppendedRaw => {
                self.appended.extend(head);
                self.appended.extend(body);
                (form, String::new())
            }
        };
        format!(
            "<DataArray type=\"{kind}\" Name=\"{name}\" format=\"{format}\" offset=\"{offset}\">\
             {content}<InformationKey name=\"a\">7 7</InformationKey></DataArray>"
        )
    }

    fn ints(&mut self, name: &str, values: &[i64]) -> String {
        let bytes = |v: i64, big: bool| match big {
            true => v.to_be_bytes().to_vec(),
            false => v.to_le_bytes().to_vec(),
        };
        self.put(name, "Int64", values, bytes)
    }

    /// Two pieces: a square and a triangle, then a strip.
    fn file(mut self) -> Vec<u8> {
        let floats = |v: f32, big: bool| match big {
            true => v.to_be_bytes().to_vec(),
            false => v.to_le_bytes().to_vec(),
        };
        let square = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, -2.0, 0.0, 1.0, 0.0f32];
        let mut pieces = String::new();
        for (cells, polys, strips) in [("Polys", 2, 0), ("Strips", 0, 1)] {
            let points = self.put("Points", "Float32", &square, floats);
            let (corners, offsets): (&[i64], &[i64]) = match polys {
                0 => (&[0, 1, 2, 3], &[4]),
                _ => (&[0, 1, 2, 3, 0, 2, 1], &[4, 7]),
            };
            let corners = self.ints("connectivity", corners);
            let offsets = self.ints("offsets", offsets);
            pieces += &format!(
                "<Piece NumberOfPoints=\"4\" NumberOfVerts=\"0\" NumberOfLines=\"0\" \
                 NumberOfStrips=\"{strips}\" NumberOfPolys=\"{polys}\"><PointData/>\
                 <Points>{points}</Points><Verts/><{cells}>{corners}{offsets}</{cells}></Piece>"
            );
        }
        let order = if self.wide { "BigEndian" } else { "LittleEndian" };
        let header = if self.wide { "UInt64" } else { "UInt32" };
        let packed = if self.packed { "compressor=\"vtkZLibDataCompressor\"" } else { "" };
        let mut out = format!(
            "<?xml version=\"1.0\"?>\n<!-- by hand -->\n<VTKFile type=\"PolyData\" version=\"1.0\" \
             byte_order=\"{order}\" header_type=\"{header}\" {packed}><PolyData><FieldData>\
             <DataArray type=\"String\" Name=\"SPACE\" format=\"ascii\">82 65 83 0</DataArray>\
             </FieldData>{pieces}</PolyData>"
        )
        .into_bytes();
        if self.way != Way::Text && self.way != Way::Inline {
            let raw = self.way == Way::AppendedRaw;
            let encoding = if raw { "raw" } else { "base64" };
            out.extend(format!("<AppendedData encoding=\"{encoding}\">\n _").bytes());
            out.extend(&self.appended);
            out.extend(b"\n</AppendedData>");
        }
        out.extend(b"</VTKFile>\n");
        out
    }
}

#[test]
fn every_encoding_gives_the_same_surface() {
    for way in [Way::Text, Way::Inline, Way::AppendedBase64, Way::AppendedRaw] {
        for (wide, packed) in [(false, false), (false, true), (true, false), (true, true)] {
            let file = Writer { way, wide, packed, appended: Vec::new() }.file();
            let parts = load(&file).unwrap_or_else(|e| panic!("{way:?} {wide} {packed}: {e:?}"));
            let soup = &parts.parts[0];
            assert_eq!(soup.positions[6], [1.0, 1.0, -2.0]);
            let square = [[0, 1, 2], [0, 2, 3], [0, 2, 1]];
            assert_eq!(soup.triangles, [&square[..], &[[4, 5, 6], [6, 5, 7]]].concat());
            assert!(parts.issues.is_empty() && parts.ras, "{:?}", parts.issues);
        }
    }
}

#[test]
fn planted_faults_are_named() {
    let text = Writer { way: Way::Text, wide: false, packed: false, appended: Vec::new() }.file();
    let text = String::from_utf8(text).expect("text");
    for (from, to, cause) in [
        ("PolyData\" version", "ImageData\" version", "holds data of type `ImageData`"),
        ("PolyData\" version", "ImageData\" version", "it is a volume"),
        ("PolyData\" version", "UnstructuredGrid\" version", "Extract Surface"),
        ("header_type", "compressor=\"vtkLZ4DataCompressor\" header_type", "packed by `vtkLZ4"),
        ("NumberOfPoints=\"4\"", "NumberOfPoints=\"5\"", "has 12 numbers of 15"),
        ("NumberOfPoints=\"4\"", "NumberOfPoints=\"4000000000\"", "too many"),
        ("NumberOfPolys=\"2\"", "NumberOfPolys=\"3\"", "has 2 numbers of 3"),
        ("\n  3", "\n  4", "vertex 4, counted from 0, and there are 4"),
        ("\n  3", "\n  -3", "vertex -3"),
        ("\n  3", "\n  x", "`x` is no number"),
        ("\n  7", "\n  70", "offsets 4 and 70 of 7 corners"),
        ("</Points>", "</Point>", "is not valid XML"),
    ] {
        let broken = text.replacen(from, to, 1);
        assert_ne!(broken, text, "{from}");
        let message = load(broken).map_or_else(|e| e[0].to_string(), |_| String::new());
        assert!(message.contains(cause), "{cause}: {message}");
    }
    assert!(load("<a/>").expect_err("none")[0].message.contains("is no VTK file"));
    let packed = Writer { way: Way::AppendedRaw, wide: true, packed: true, appended: Vec::new() };
    let packed = packed.file();
    for cut in [packed.len() - 60, packed.len() - 200] {
        assert!(load(&packed[..cut]).is_err(), "{cut}");
    }
    // A block that states more than it can hold.
    let mut bomb = packed.clone();
    let at = bomb.windows(2).position(|w| w == b" _").expect("appended") + 2 + 8;
    bomb[at..at + 8].copy_from_slice(&(1u64 << 40).to_be_bytes());
    assert!(load(&bomb).expect_err("a bomb")[0].message.contains("cannot hold"));
}
