//! MetaImage headers (.mha, .mhd), as MetaIO and ITK read them: the rows of the direction matrix are the
//! directions of the axes, and the frame is LPS.

use std::path::Path;

use glam::DVec3;

use super::fields::{Field, Fields};
use super::grid::{self, Frame, Grid, UNEQUAL};
use super::header::{Header, unused};
use super::layout::{Axis, Layout};
use super::scalar::Scalar;
use super::sequence::{self, frames};
use super::source::{Coding, Line, Lines, Payload, Skip};
use super::{Format, Warning};
use crate::issue::FileError;

/// Most axes that are read. MetaIO takes ten.
const MAX_AXES: usize = 10;

const ORIGIN: [&str; 3] = ["Offset", "Position", "Origin"];
const DIRECTION: [&str; 3] = ["TransformMatrix", "Rotation", "Orientation"];
const BIG_ENDIAN: [&str; 2] = ["BinaryDataByteOrderMSB", "ElementByteOrderMSB"];
/// Keys that are used, or that have no effect here. `AnatomicalOrientation` names the axes, which the
/// direction gives exactly.
const KNOWN: [&str; 29] = [
    "ObjectType",
    "ObjectSubType",
    "NDims",
    "Name",
    "ID",
    "ParentID",
    "Color",
    "Comment",
    "CompressedData",
    "CompressedDataSize",
    "BinaryData",
    "CenterOfRotation",
    "AnatomicalOrientation",
    "ElementSpacing",
    "ElementSize",
    "DimSize",
    "HeaderSize",
    "Modality",
    "ElementMin",
    "ElementMax",
    "ElementNumberOfChannels",
    "ElementType",
    "ElementDataFile",
    "DistanceUnits",
    "Kinds",
    "AcquisitionDate",
    "CreationDate",
    "SequenceID",
    "TransformType",
];

pub(super) fn header(path: &Path) -> Result<Header, FileError> {
    let (fields, data) = fields(path)?;
    let mut out = of_fields(&fields, data)?;
    let keys = unused_keys(&fields);
    let of_frames = |f: &&&Field| sequence::KEYS.contains(&f.key.as_str());
    let stacked_frames = frames::in_header(&fields);
    let keys = keys.iter().filter(|f| !(stacked_frames && of_frames(f)));
    let keys: Vec<_> = keys.map(|f| f.key.as_str()).collect();
    out.warnings.extend(unused(path, &keys));
    out.warnings.extend(stacked(&fields));
    Ok(out)
}

/// The header made of these fields; the voxels follow byte `data` if they are in the same file.
pub(super) fn of_fields(fields: &Fields, data: u64) -> Result<Header, FileError> {
    if let Some(object) = fields.find(&["ObjectType"])
        && !object.value.eq_ignore_ascii_case("Image")
    {
        return Err(fields.error(object, "is no image", "give a MetaImage of ObjectType Image"));
    }
    let axes = fields.need("NDims")?;
    let n: usize = fields.number(axes)?;
    if !(2..=MAX_AXES).contains(&n) {
        return Err(fields.error(axes, "2 to 10 axes can be read", "give a volume"));
    }
    let dims = fields.sizes(fields.need("DimSize")?, n)?;
    let stated = fields.find(&["ElementSpacing", "ElementSize"]);
    let stated = stated.map(|f| fields.spacings(f, n)).transpose()?;
    // ITK and programs based on it write seconds.
    let interval = stated.as_ref().and_then(|s| s.get(3)).copied();
    let spacings = stated.unwrap_or_else(|| vec![1.0; n]);
    let identity = || (0..n * n).map(|i| f64::from(u8::from(i % (n + 1) == 0))).collect();
    let rows = fields.find(&DIRECTION).map(|f| fields.numbers(f, n * n));
    let rows: Vec<f64> = rows.transpose()?.unwrap_or_else(identity);
    let origin = fields.find(&ORIGIN).map(|f| fields.numbers(f, n));
    let origin: Vec<f64> = origin.transpose()?.unwrap_or_default();
    let steps = grid::steps(n, &rows, &spacings);
    let warnings = stretched(fields.path, &steps, &spacings).into_iter().collect();
    let channels = match fields.find(&["ElementNumberOfChannels"]) {
        Some(field) => fields.sizes(field, 1)?[0],
        None => 1,
    };
    let kinds = [Axis::Space, Axis::Space, Axis::Space, Axis::Time];
    let kinds = kinds.into_iter().chain(std::iter::repeat(Axis::Values));
    let axes = kinds.zip(dims);
    let big_endian = switch(fields, &BIG_ENDIAN)?.unwrap_or(false);
    Ok(Header {
        format: Format::MetaImage,
        kind: kind(fields)?,
        big_endian,
        layout: Layout::new([(Axis::Values, channels)].into_iter().chain(axes)),
        interval,
        grid: Grid { steps, origin: grid::point(&origin), frame: Frame::Lps, unit: unit(fields)? },
        scale: None,
        payload: payload(fields, data)?,
        warnings,
    })
}

/// The warning of a direction whose axes are not of length 1, so that voxels are of another size than the spacing says.
fn stretched(path: &Path, steps: &[DVec3; 3], spacings: &[f64]) -> Option<Warning> {
    let sizes = steps.iter().zip(spacings).map(|(step, spacing)| (step.length(), *spacing));
    let (size, spacing) = sizes
        .into_iter()
        .find(|(size, spacing)| (size - spacing).abs() > UNEQUAL * spacing.abs())?;
    let message = format!(
        "an axis of TransformMatrix is not of length 1: voxels are {size:.3} apart along it, and ElementSpacing says {spacing:.3}"
    );
    Some(Warning::warning(path, 1, message, "export it with axes of length 1"))
}

/// Fields up to the one with the place of the voxels, and the byte after it.
pub(super) fn fields(path: &Path) -> Result<(Fields<'_>, u64), FileError> {
    let mut lines = Lines::of(path)?;
    let mut list = Vec::new();
    while let Some(Line { number, text, end }) = lines.next()? {
        if text.trim().is_empty() {
            continue;
        }
        let Some((key, value)) = text.split_once('=') else {
            return Err(FileError::line(
                path,
                number,
                "is not of the form `Key = value`",
                "give a MetaImage; its header ends with ElementDataFile",
            ));
        };
        let (key, value) = (key.trim().to_owned(), value.trim().to_owned());
        let last = key == "ElementDataFile";
        list.push(Field { line: number, key, value });
        if last {
            return Ok((Fields { path, list }, end));
        }
    }
    Err(FileError::file(
        path,
        "the header does not end: ElementDataFile is missing",
        "export or copy it again",
    ))
}

/// Whether the first of these keys that is there says yes; none where there is none of them. A word that is
/// neither is refused: `Talse` is yes to programs that look at its first letter and no to others.
fn switch(fields: &Fields, keys: &[&str]) -> Result<Option<bool>, FileError> {
    let Some(field) = fields.find(keys) else {
        return Ok(None);
    };
    match field.value.to_ascii_lowercase().as_str() {
        "true" | "t" | "yes" | "y" | "1" => Ok(Some(true)),
        "false" | "f" | "no" | "n" | "0" => Ok(Some(false)),
        _ => Err(fields.error(field, "is neither True nor False", "write True or False")),
    }
}

/// Types that are read, by their names; those that are written come first.
pub(super) const TYPES: [(&str, Scalar); 12] = [
    ("MET_UCHAR", Scalar::U8),
    ("MET_CHAR", Scalar::I8),
    ("MET_USHORT", Scalar::U16),
    ("MET_SHORT", Scalar::I16),
    ("MET_UINT", Scalar::U32),
    ("MET_INT", Scalar::I32),
    ("MET_FLOAT", Scalar::F32),
    ("MET_DOUBLE", Scalar::F64),
    // In MetaIO a LONG has 32 bits in files.
    ("MET_ULONG", Scalar::U32),
    ("MET_LONG", Scalar::I32),
    ("MET_LONG_LONG", Scalar::I64),
    ("MET_ULONG_LONG", Scalar::U64),
];

fn kind(fields: &Fields) -> Result<Scalar, FileError> {
    let field = fields.need("ElementType")?;
    let name = field.value.trim_end_matches("_ARRAY");
    let found = TYPES.iter().find(|(known, _)| *known == name).map(|(_, kind)| *kind);
    let remedy = "save it as MET_UCHAR, MET_SHORT or MET_FLOAT";
    found.ok_or_else(|| fields.error(field, "this type cannot be read", remedy))
}

fn unit(fields: &Fields) -> Result<f64, FileError> {
    let Some(field) = fields.find(&["DistanceUnits"]) else {
        return Ok(1.0);
    };
    match field.value.as_str() {
        "mm" | "?" => Ok(1.0),
        "um" => Ok(1e-3),
        "cm" => Ok(10.0),
        _ => Err(fields.error(field, "no unit that MetaImage knows", "write mm, um or cm")),
    }
}

fn payload(fields: &Fields, after_header: u64) -> Result<Payload, FileError> {
    let place = fields.need("ElementDataFile")?;
    let local = place.value.eq_ignore_ascii_case("LOCAL");
    let (file, offset) = match local {
        true => (fields.path.to_owned(), after_header),
        false => (fields.detached(place)?, 0),
    };
    let skip = fields.skip(&["HeaderSize"], true)?;
    let compressed = switch(fields, &["CompressedData"])?.unwrap_or(false);
    let text = !switch(fields, &["BinaryData"])?.unwrap_or(true);
    Ok(Payload {
        file,
        offset,
        lines: 0,
        skip: if local || compressed { Skip::Bytes(0) } else { skip },
        coding: match (compressed, text) {
            (true, _) => Coding::Zlib,
            (false, true) => Coding::Text,
            (false, false) => Coding::Raw,
        },
    })
}

/// A warning where the third axis is not one of space: a plane, or frames of a sequence. Plus also calls
/// the third axis of reconstructed volumes a list; only sequences have fields per frame.
fn stacked(fields: &Fields) -> Option<Warning> {
    let axes = fields.find(&["NDims"]).map(|f| f.value.as_str());
    let message = match (axes, frames::in_header(fields)) {
        (Some("2"), _) => "is a plane: one slice of 1 mm",
        (Some("3"), true) => "is a tracked sequence: its frames are stacked, their poses ignored",
        (_, true) => "is a tracked sequence: the poses of its frames are ignored",
        _ => return None,
    };
    Some(Warning::warning(
        fields.path,
        1,
        message,
        "`insonify reconstruct` makes a volume from frames and poses",
    ))
}

/// Fields whose keys are not used for a volume, except those of frames.
pub(super) fn unused_keys<'f>(fields: &'f Fields) -> Vec<&'f Field> {
    let known = KNOWN.iter().chain(&ORIGIN).chain(&DIRECTION).chain(&BIG_ENDIAN);
    let known: Vec<_> = known.collect();
    let fields = fields.list.iter();
    fields
        .filter(|f| !f.key.starts_with(frames::PREFIX))
        .filter(|f| !known.iter().any(|k| k.eq_ignore_ascii_case(&f.key)))
        .collect()
}
