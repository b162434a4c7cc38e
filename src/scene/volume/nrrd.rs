//! NRRD headers (.nrrd, .nhdr), by the definition of the format
//! (teem.sourceforge.net/nrrd/format.html).

use std::path::Path;

use super::Format;
use super::fields::{Field, Fields};
use super::grid::Frame;
use super::header::{Header, unused};
use super::layout::{Axis, Layout};
use super::scalar::Scalar;
use super::sequence::{frames, nrrd as planes};
use super::source::{Coding, Line, Lines, Payload};
use crate::issue::FileError;

mod space;

/// Most axes of a NRRD file (`NRRD_DIM_MAX`).
const MAX_AXES: usize = 16;

/// Fields that are used, or that have no effect here.
const KNOWN: [&str; 32] = [
    "type",
    "dimension",
    "space",
    "space dimension",
    "sizes",
    "space directions",
    "space origin",
    "spacings",
    "axis mins",
    "axismins",
    "kinds",
    "endian",
    "encoding",
    "data file",
    "datafile",
    "line skip",
    "lineskip",
    "byte skip",
    "byteskip",
    "space units",
    "units",
    "labels",
    "content",
    "min",
    "max",
    "old min",
    "oldmin",
    "old max",
    "oldmax",
    "measurement frame",
    "centers",
    "centerings",
];

pub(super) fn header(path: &Path) -> Result<Header, FileError> {
    let (fields, pairs, data) = fields(path)?;
    let dimension = fields.need("dimension")?;
    let n: usize = fields.number(dimension)?;
    if !(1..=MAX_AXES).contains(&n) {
        return Err(fields.error(dimension, "1 to 16 axes are possible", "correct it"));
    }
    let sizes = fields.sizes(fields.need("sizes")?, n)?;
    let space = space::space(&fields, n)?;
    let axes = space::axes(&fields, n, &space)?;
    let count = axes.iter().filter(|a| **a == Axis::Space).count();
    let time = axes.iter().position(|a| *a == Axis::Time);
    let grid = space::grid(&fields, &axes, &space)?;
    let interval = match time.filter(|&t| count == 3 && sizes[t] > 1) {
        Some(time) => space::interval(&fields, n, time, &space)?,
        None => None,
    };
    let stacked = count == 2 && time.is_some();
    let mut layout = Layout::new(axes.into_iter().zip(sizes));
    if stacked {
        layout.stack();
    }
    let kind = kind(&fields)?;
    let payload = payload(&fields, data)?;
    let big_endian = match fields.find(&["endian"]) {
        Some(field) => match field.value.to_ascii_lowercase().as_str() {
            "little" => false,
            "big" => true,
            _ => return Err(fields.error(field, "no byte order", "write little or big")),
        },
        None if kind.bytes() == 1 || payload.coding == Coding::Text => false,
        None => {
            return Err(FileError::file(
                path,
                "the header lacks `endian`",
                "add `endian: little` or `endian: big`",
            ));
        }
    };
    let mut out = Header {
        format: Format::Nrrd,
        kind,
        big_endian,
        layout,
        interval,
        grid,
        scale: None,
        payload,
        warnings: Vec::new(),
    };
    let strange = fields.list.iter().map(|f| f.key.as_str());
    let strange = strange.filter(|key| !KNOWN.iter().any(|k| k.eq_ignore_ascii_case(key)));
    let tracked = planes::is_tracked(&pairs);
    let of_frames = |key: &str| key.starts_with(frames::PREFIX) || planes::is_known(key);
    let pairs = pairs.iter().map(|f| f.key.as_str());
    let pairs = pairs.filter(|key| !(is_of_segments(key) || tracked && of_frames(key)));
    let ignored: Vec<_> = strange.chain(pairs).collect();
    out.warnings.extend(unused(path, &ignored));
    if tracked {
        let message = "is a tracked sequence: the poses of its frames are ignored";
        let remedy = "`insonify reconstruct` makes a volume from frames and poses";
        out.warn(path, 1, message, remedy);
    } else if stacked {
        let message = "is a sequence of planes: its frames are stacked, 1 mm apart";
        let remedy =
            "save it as .igs.mha (3D Slicer does); `insonify reconstruct` makes a volume of that";
        out.warn(path, 1, message, remedy);
    } else if count == 2 {
        let message = "is a plane: one slice of 1 mm";
        out.warn(path, 1, message, "give a volume of several slices");
    }
    if space.frame == Frame::Unstated {
        let message = "no anatomical frame is stated; LPS is assumed";
        out.warn(path, 1, message, "add `space: left-posterior-superior` or what it is");
    }
    Ok(out)
}

/// Fields, key/value pairs, and the byte after the empty line that ends the header.
pub(super) fn fields(path: &Path) -> Result<(Fields<'_>, Vec<Field>, u64), FileError> {
    let mut lines = Lines::of(path)?;
    let (mut list, mut pairs, mut at) = (Vec::new(), Vec::new(), 0);
    while let Some(Line { number, text, end }) = lines.next()? {
        at = end;
        let text = text.trim_end();
        if number == 1 {
            let version = text.strip_prefix("NRRD").filter(|v| v.len() == 4);
            if version.and_then(|v| v.parse::<u32>().ok()).is_none_or(|v| v > 5) {
                return Err(FileError::line(
                    path,
                    1,
                    "does not begin with NRRD and a version up to 0005",
                    "give a NRRD file",
                ));
            }
        } else if text.is_empty() {
            break;
        } else if text.starts_with('#') {
            // A comment.
        } else if let Some((key, value)) = text.split_once(':') {
            let (into, value) = match value.strip_prefix('=') {
                Some(value) => (&mut pairs, value),
                None => (&mut list, value),
            };
            let (key, value) = (key.trim().to_owned(), value.trim().to_owned());
            into.push(Field { line: number, key, value });
        } else {
            return Err(FileError::line(
                path,
                number,
                "is neither `field: value` nor `key:=value`, and no empty line ended the header",
                "export or copy the file again",
            ));
        }
    }
    Ok((Fields { path, list }, pairs, at))
}

/// True for a key of 3D Slicer about its segments, which `import` reads: `Segment0_Name`, `Segmentation_...`.
fn is_of_segments(key: &str) -> bool {
    let Some((of, _)) = key.split_once('_') else { return false };
    of.strip_prefix("Segment").is_some_and(|rest| {
        rest == "ation" || !rest.is_empty() && rest.bytes().all(|b| b.is_ascii_digit())
    })
}

fn kind(fields: &Fields) -> Result<Scalar, FileError> {
    let field = fields.need("type")?;
    Ok(match field.value.to_ascii_lowercase().as_str() {
        "signed char" | "int8" | "int8_t" => Scalar::I8,
        "uchar" | "unsigned char" | "uint8" | "uint8_t" => Scalar::U8,
        "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => {
            Scalar::I16
        }
        "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => Scalar::U16,
        "int" | "signed int" | "int32" | "int32_t" => Scalar::I32,
        "uint" | "unsigned int" | "uint32" | "uint32_t" => Scalar::U32,
        "longlong"
        | "long long"
        | "long long int"
        | "signed long long"
        | "signed long long int"
        | "int64"
        | "int64_t" => Scalar::I64,
        "ulonglong" | "unsigned long long" | "unsigned long long int" | "uint64" | "uint64_t" => {
            Scalar::U64
        }
        "float" => Scalar::F32,
        "double" => Scalar::F64,
        _ => {
            return Err(fields.error(
                field,
                "this type cannot be read",
                "save it as uchar, short or float",
            ));
        }
    })
}

fn payload(fields: &Fields, after_header: u64) -> Result<Payload, FileError> {
    let encoding = fields.need("encoding")?;
    let coding = match encoding.value.to_ascii_lowercase().as_str() {
        "raw" => Coding::Raw,
        "gzip" | "gz" => Coding::Gzip,
        "bzip2" | "bz2" => Coding::Bzip2,
        "hex" => Coding::Hex,
        "ascii" | "text" | "txt" => Coding::Text,
        _ => {
            return Err(fields.error(
                encoding,
                "this encoding cannot be read",
                "save it with raw, gzip, bzip2, hex or ascii",
            ));
        }
    };
    let lines = match fields.find(&["line skip", "lineskip"]) {
        Some(field) => fields.number(field)?,
        None => 0,
    };
    let skip = fields.skip(&["byte skip", "byteskip"], coding != Coding::Text)?;
    let (file, offset) = match fields.find(&["data file", "datafile"]) {
        None => (fields.path.to_owned(), after_header),
        Some(field) => (fields.detached(field)?, 0),
    };
    Ok(Payload { file, offset, lines, skip, coding })
}
