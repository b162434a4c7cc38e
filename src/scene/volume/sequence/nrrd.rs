//! Sequences in NRRD: a list of planes, as 3D Slicer's volume sequences are (its developer guide, "Sequences"), with
//! the entries of frames as PLUS and SlicerIGSIO write and read them, as key/value pairs.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

use flate2::Compression;
use flate2::write::GzEncoder;
use glam::{DAffine3, DVec3};

use super::frames::PREFIX;
use super::{KEYS, ORIENTATION, Sequence};
use crate::issue::FileError;
use crate::volume::fields::{Field, Fields};
use crate::volume::header::Header;
use crate::volume::write::{create, number};
use crate::volume::{Voxels, nrrd};

/// Extensions of these files.
const EXTENSIONS: [&str; 2] = ["nrrd", "nhdr"];
/// Orientation by the name that PLUS gives it in this format.
const PLUS_ORIENTATION: &str = "ultrasound image orientation";
/// Pose of pixels, whose columns are then the directions of the axes.
const CALIBRATION: &str = "ImageToProbe";
/// Keys that say to 3D Slicer what the frames are.
const CLASS: &str = "DataNodeClassName";
const INDEX_TYPE: &str = "axis 3 index type";
const INDEX_VALUES: &str = "axis 3 index values";

/// Returns whether a file is of this format by its extension.
pub(super) fn is_meant(path: &Path) -> bool {
    let extension = path.extension().unwrap_or_default();
    EXTENSIONS.iter().any(|e| extension.eq_ignore_ascii_case(e))
}

/// Keys of a header that are used where its planes are frames.
pub(in crate::volume) fn is_known(key: &str) -> bool {
    KEYS.contains(&key) || is_form(key)
}

/// Those of them that say what form the file has, and nothing of its content.
pub(super) fn is_form(key: &str) -> bool {
    [ORIENTATION, PLUS_ORIENTATION, CLASS].contains(&key)
        || (key.starts_with("axis ") && key.contains(" index "))
}

/// Returns whether pairs of a header describe frames.
pub(in crate::volume) fn is_tracked(pairs: &[Field]) -> bool {
    pairs.iter().any(|f| f.key.starts_with(PREFIX))
}

fn words(field: &Field) -> impl Iterator<Item = &str> {
    field.value.split_whitespace()
}

/// Pairs of a header as fields, and what it says of the pixels, its frames as slices.
pub(super) fn header(path: &Path) -> Result<(Fields<'_>, Header), FileError> {
    let (fields, pairs, _) = nrrd::fields(path)?;
    let mut header = nrrd::header(path)?;
    let layout = &mut header.layout;
    let remedy = "give a sequence of planes";
    let kinds = fields.find(&["kinds"]);
    if let Some(kinds) = kinds.filter(|f| words(f).any(|k| k == "list" || k == "time")) {
        // Planes of two axes are slices already.
        let solid = words(kinds).filter(|k| ["domain", "space"].contains(k)).count();
        match (layout.volumes > 1 || solid > 2, layout.size[2]) {
            (true, 1) => layout.stack(),
            (true, _) => return Err(fields.error(kinds, "each frame is a volume", remedy)),
            (false, _) => {}
        }
    } else if layout.size[2] > 1 || !is_tracked(&pairs) {
        // PLUS writes a frame alone without a list.
        let message = "is a volume, not a sequence: none of its axes is of kind `list`";
        return Err(FileError::file(path, message, remedy));
    }
    // They are about volumes.
    header.warnings.clear();
    Ok((Fields { path, list: pairs }, header))
}

/// The orientation of pixels that a header states.
pub(super) fn orientation<'f>(pairs: &'f Fields) -> Option<&'f Field> {
    pairs.find(&[ORIENTATION, PLUS_ORIENTATION])
}

/// Writes a sequence (.nrrd).
pub(super) fn write(sequence: &Sequence, path: &Path) -> Result<(), FileError> {
    let [width, height] = sequence.size;
    let count = sequence.frames.len();
    let kind = match sequence.pixels {
        Voxels::U8(_) => "uchar",
        Voxels::I8(_) => "signed char",
        Voxels::U16(_) => "ushort",
        Voxels::I16(_) => "short",
        Voxels::F32(_) => "float",
    };
    let placed = placed(sequence);
    let vector = |v: DVec3| format!("({})", v.to_array().map(number).join(","));
    let axes = placed.matrix3;
    let directions = [axes.x_axis, axes.y_axis, axes.z_axis].map(vector).join(" ");
    let mut text = format!(
        "NRRD0004\ntype: {kind}\ndimension: 4\nspace: right-anterior-superior\n\
         sizes: {width} {height} 1 {count}\nspace directions: {directions} none\n\
         kinds: domain domain domain list\nlabels: \"\" \"\" \"\" \"time\"\n\
         units: \"\" \"\" \"\" \"s\"\nendian: little\nencoding: gzip\nspace origin: {}\n",
        vector(placed.translation)
    );
    let mut pair = |key: &str, value: &str| {
        let sound = !key.contains([':', '\n']) && !value.contains('\n');
        assert!(sound, "pair `{key}` = `{value}`");
        writeln!(text, "{key}:={value}").expect("memory");
    };
    pair(CLASS, "vtkMRMLScalarVolumeNode");
    pair(INDEX_TYPE, "numeric");
    if let Some(orientation) = &sequence.orientation {
        pair(ORIENTATION, orientation);
        pair(PLUS_ORIENTATION, orientation);
    }
    for (key, value) in &sequence.fields {
        pair(key, value);
    }
    for (index, frame) in sequence.frames.iter().enumerate() {
        for (key, value) in frame.entries(index) {
            pair(&key, &value);
        }
    }
    // The last one: 3D Slicer stops looking for poses at a line longer than 1000 characters.
    if let Some(times) = times(sequence) {
        pair(INDEX_VALUES, &times.join(" "));
    }
    text.push('\n');
    let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(&sequence.pixels.to_le_bytes()).expect("memory");
    create(path, &text, &encoder.finish().expect("memory"))
}

/// The place of the planes of all frames, as far as it is one: in the probe's frame by their calibration, else in
/// their own, by the size of a pixel.
fn placed(sequence: &Sequence) -> DAffine3 {
    let mut frames = sequence.frames.iter().map(|f| f.poses.get(CALIBRATION));
    let first = frames.next().flatten();
    match first.filter(|_| frames.all(|other| other == first)) {
        Some(pose) if pose.is_ok() => pose.transform,
        _ => {
            let [x, y] = sequence.spacing;
            DAffine3::from_scale(DVec3::new(x, y, 1.0))
        }
    }
}

/// Times of the frames as 3D Slicer writes those of poses, in ms: so it shows both together. With more digits where
/// frames would share one; none where a frame has no time.
fn times(sequence: &Sequence) -> Option<Vec<String>> {
    let times: Option<Vec<f64>> = sequence.frames.iter().map(|f| f.timestamp).collect();
    let times = times?;
    let short: Vec<_> = times.iter().map(|t| format!("{t:.3}")).collect();
    let apart = short.windows(2).all(|pair| pair[0] != pair[1]);
    Some(if apart { short } else { times.into_iter().map(number).collect() })
}
