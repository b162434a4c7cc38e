//! Entries of single frames in the header of a sequence: `Seq_Frame0007_ProbeToTrackerTransform`.

use std::collections::BTreeMap;

use glam::{DAffine3, DMat3, DVec3};

use crate::issue::FileError;
use crate::volume::fields::{Field, Fields};
use crate::volume::write::number;

/// Beginning of the keys of frames.
pub(in crate::volume) const PREFIX: &str = "Seq_Frame";
const TRANSFORM: &str = "Transform";
const STATUS: &str = "TransformStatus";
const IMAGE_STATUS: &str = "ImageStatus";
/// The same as PLUS names it in NRRD.
const PLUS_STATUS: &str = "Status";
const TIMESTAMP: &str = "Timestamp";
const SPACING: &str = "ElementSpacing";

/// Relative difference of sizes of pixels that are the same.
const SAME_PIXEL: f64 = 1e-6;

/// A measured transform, and whether it is valid.
#[derive(Clone, Debug, PartialEq)]
pub struct Pose {
    /// From the first frame of the name to the second (`ProbeToTracker`), in their units, mm as a
    /// rule.
    pub transform: DAffine3,
    /// `OK`, or the reason why it is not (`INVALID`, `OUT_OF_VIEW`, ...); none where the file does not state
    /// it, which counts as `OK`.
    pub status: Option<String>,
}

impl Pose {
    /// A valid pose.
    pub fn ok(transform: DAffine3) -> Self {
        Self { transform, status: Some("OK".to_owned()) }
    }

    /// Returns whether it is valid.
    pub fn is_ok(&self) -> bool {
        self.status.as_deref().is_none_or(|s| s == "OK")
    }
}

/// Data of one frame beside its pixels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TrackedFrame {
    /// Time since a moment common to the sequence, s.
    pub timestamp: Option<f64>,
    /// `ImageStatus`, whether its pixels are an image, where stated.
    pub image: Option<bool>,
    /// Poses by name without `Transform`, e.g. `ProbeToTracker`.
    pub poses: BTreeMap<String, Pose>,
    /// Other entries, in the order of the file.
    pub fields: Vec<(String, String)>,
}

impl TrackedFrame {
    /// Returns whether its pixels are an image.
    pub fn has_image(&self) -> bool {
        self.image != Some(false)
    }

    /// Size of a pixel, mm, where the frame states its own: PLUS does where the depth may be changed.
    pub fn pixel(&self) -> Option<[f64; 2]> {
        let (_, value) = self.fields.iter().find(|(name, _)| name == SPACING)?;
        let mut numbers = value.split_whitespace().map(|word| word.parse::<f64>().ok());
        Some([numbers.next()??, numbers.next()??])
    }

    /// Keys and values of frame `index` in a header.
    pub(super) fn entries(&self, index: usize) -> Vec<(String, String)> {
        let mut out = Vec::new();
        let mut entry = |name: &str, value: &str| {
            out.push((format!("{PREFIX}{index:04}_{name}"), value.to_owned()));
        };
        for (name, pose) in &self.poses {
            let (m, t) = (pose.transform.matrix3, pose.transform.translation);
            let rows = [0, 1, 2].map(|row| {
                let row = m.row(row).extend(t[row]).to_array();
                row.map(number).join(" ")
            });
            entry(&format!("{name}{TRANSFORM}"), &format!("{} 0 0 0 1", rows.join(" ")));
            if let Some(status) = &pose.status {
                entry(&format!("{name}{STATUS}"), status);
            }
        }
        if let Some(timestamp) = self.timestamp {
            entry(TIMESTAMP, &number(timestamp));
        }
        for (name, value) in &self.fields {
            entry(name, value);
        }
        if let Some(image) = self.image {
            entry(IMAGE_STATUS, if image { "OK" } else { "INVALID" });
        }
        out
    }
}

/// The sizes of pixels that frames state, each with the number of the first frame that has it.
pub(super) fn pixels<'f>(
    frames: impl Iterator<Item = (usize, &'f TrackedFrame)>,
) -> Vec<(usize, [f64; 2])> {
    let mut out: Vec<(usize, [f64; 2])> = Vec::new();
    for (index, size) in frames.filter_map(|(index, frame)| Some((index, frame.pixel()?))) {
        let same = |&(_, last): &(usize, [f64; 2])| {
            last.iter().zip(size).all(|(a, b)| (a - b).abs() <= SAME_PIXEL * b.abs())
        };
        if !out.last().is_some_and(same) {
            out.push((index, size));
        }
    }
    out
}

/// Sizes of pixels in words: "pixels of 0.1 x 0.1 mm, from frame 3 on of 0.2 x 0.2 mm".
pub(super) fn pixel_sizes(sizes: &[(usize, [f64; 2])]) -> Option<String> {
    let [(_, first), later @ ..] = sizes else { return None };
    let written = |[x, y]: [f64; 2]| format!("{x} x {y} mm");
    let later =
        later.iter().map(|(at, size)| format!(", from frame {at} on of {}", written(*size)));
    Some(format!("pixels of {}{}", written(*first), later.collect::<String>()))
}

/// Returns whether the third axis is declared to be of space.
pub(in crate::volume) fn third_axis_is_space(fields: &Fields) -> bool {
    let kinds = fields.find(&["Kinds"]);
    kinds.is_some_and(|f| f.value.split_whitespace().nth(2) == Some("domain"))
}

/// Returns whether a header describes frames.
pub(in crate::volume) fn in_header(fields: &Fields) -> bool {
    fields.list.iter().any(|f| f.key.starts_with(PREFIX)) && !third_axis_is_space(fields)
}

/// Frames that have entries, by number, each below `count`. They are no more than the text lines of the
/// header, whatever the file claims to hold.
pub(super) fn parse(
    fields: &Fields,
    count: usize,
) -> Result<BTreeMap<usize, TrackedFrame>, FileError> {
    let mut out: BTreeMap<usize, (TrackedFrame, BTreeMap<String, String>)> = BTreeMap::new();
    for field in &fields.list {
        let Some(rest) = field.key.strip_prefix(PREFIX) else {
            continue;
        };
        let parts =
            rest.split_once('_').and_then(|(i, name)| Some((i.parse::<usize>().ok()?, name)));
        let Some((index, name)) = parts else {
            return Err(fields.error(
                field,
                "names no frame",
                "write it like Seq_Frame0000_Timestamp",
            ));
        };
        if index >= count {
            let cause = format!("there are {count} frames, counted from 0");
            return Err(fields.error(field, &cause, "correct DimSize or the number of the frame"));
        }
        let (frame, statuses) = out.entry(index).or_default();
        if let Some(of) = name.strip_suffix(STATUS) {
            statuses.insert(of.to_owned(), field.value.clone());
        } else if let Some(of) = name.strip_suffix(TRANSFORM) {
            let pose = Pose { transform: transform(fields, field)?, status: None };
            frame.poses.insert(of.to_owned(), pose);
        } else if name == TIMESTAMP {
            let time: f64 = fields.number(field)?;
            if !time.is_finite() {
                return Err(fields.error(field, "is no time", "write seconds"));
            }
            frame.timestamp = Some(time);
        } else if [IMAGE_STATUS, PLUS_STATUS].contains(&name) {
            frame.image = Some(field.value == "OK");
        } else {
            frame.fields.push((name.to_owned(), field.value.clone()));
        }
    }
    let attach = |(mut frame, statuses): (TrackedFrame, BTreeMap<String, String>)| {
        for (name, status) in statuses {
            match frame.poses.get_mut(&name) {
                Some(pose) => pose.status = Some(status),
                None => frame.fields.push((format!("{name}{STATUS}"), status)),
            }
        }
        frame
    };
    Ok(out.into_iter().map(|(i, found)| (i, attach(found))).collect())
}

/// Sixteen numbers, row by row, the last row (0, 0, 0, 1).
fn transform(fields: &Fields, field: &Field) -> Result<DAffine3, FileError> {
    matrix(&field.value).map_err(|cause| {
        fields.error(field, cause, "write the sixteen numbers of a 4 x 4 matrix, row by row")
    })
}

/// A 4 x 4 matrix in text, row by row, as an affine transform.
///
/// # Errors
/// The fault of the text, to follow its name.
pub fn matrix(text: &str) -> Result<DAffine3, &'static str> {
    let numbers: Result<Vec<f64>, _> = text.split_whitespace().map(str::parse).collect();
    let numbers = numbers.map_err(|_| "is no list of numbers")?;
    let Ok(m) = <[f64; 16]>::try_from(numbers) else {
        return Err("does not have 16 numbers");
    };
    if m.iter().any(|v| !v.is_finite()) {
        return Err("is not finite");
    }
    if m[12..] != [0.0, 0.0, 0.0, 1.0] {
        return Err("is no affine transform: its last row is not 0 0 0 1");
    }
    let column = |c: usize| DVec3::new(m[c], m[4 + c], m[8 + c]);
    let linear = DMat3::from_cols(column(0), column(1), column(2));
    Ok(DAffine3::from_mat3_translation(linear, column(3)))
}
