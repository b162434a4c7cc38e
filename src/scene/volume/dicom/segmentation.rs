//! DICOM segmentations (PS3.3, A.51): frames of one segment each, of one bit a pixel or of shares.

use std::path::Path;

use glam::{DAffine3, DVec3};

use super::elements::{self, Item, PIXELS, Value, first};
use super::source::MAX_BYTES;
use super::{Dicom, SAVE, file, geometry};
use crate::issue::FileError;
use crate::volume::grid::{Frame, Grid};

/// Segmentation Storage.
const CLASS: &str = "1.2.840.10008.5.1.4.1.1.66.4";
/// Largest deviation of a plane from its place, as a part of the distance between planes.
const UNEVEN: f64 = 0.01;
/// Most segments: each has a value of eight bits.
const MOST: usize = 254;

/// A segment of a file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DicomSegment {
    /// Its number, from 1.
    pub number: u16,
    /// `SegmentLabel`, then the meanings of its type and category.
    pub names: Vec<String>,
}

/// Segments as voxels; where two overlap the later one.
#[derive(Clone, Debug, PartialEq)]
pub struct Segmentation {
    /// Voxels along each axis.
    pub size: [usize; 3],
    /// Voxel indices (integers at centres) to LPS, mm.
    pub world_from_voxel: DAffine3,
    /// 0, or 1 and the place of the segment in `segments`; first axis fastest.
    pub voxels: Vec<u8>,
    /// The segments.
    pub segments: Vec<DicomSegment>,
}

impl Segmentation {
    /// Reads a segmentation; none where the file is of another kind.
    ///
    /// # Errors
    /// A file that is no DICOM; frames that do not fit their segments, places or pixels.
    pub fn load(path: &Path) -> Result<Option<Self>, FileError> {
        let dicom = file::read(path)?;
        let elements = dicom.elements();
        let class = elements.text(&dicom.root, (0x0008, 0x0016));
        if class.as_deref() != Some(CLASS) {
            return Ok(None);
        }
        let segments = segments(&dicom)?;
        let number = |element: u16, name: &str| {
            let tag = (0x0028, element);
            let value = dicom.elements().number(&dicom.root, tag).filter(|n| *n > 0);
            value.map(usize::from).ok_or_else(|| dicom.lacks(name, tag))
        };
        let (rows, columns) = (number(0x0010, "Rows")?, number(0x0011, "Columns")?);
        let bits = number(0x0100, "BitsAllocated")?;
        if bits != 1 && bits != 8 {
            return Err(dicom.error(format!("pixels of {bits} bits are no segmentation"), SAVE));
        }
        let Some(Value::Items(frames)) = dicom.root.get(&elements::PER_FRAME) else {
            let tag = elements::PER_FRAME;
            return Err(dicom.lacks("PerFrameFunctionalGroupsSequence", tag));
        };
        let Some(Value::Bytes(range)) = dicom.root.get(&PIXELS) else {
            let message = "its pixels are missing or compressed";
            return Err(dicom.error(message, "decompress it (e.g. gdcmconv --raw)"));
        };
        let pixels = &dicom.bytes[range.clone()];
        let needed = (frames.len() * rows * columns * bits).div_ceil(8);
        if pixels.len() < needed {
            let message = format!(
                "is cut off: {} frames need {needed} bytes, {} are there",
                frames.len(),
                pixels.len()
            );
            return Err(FileError::byte(path, range.start as u64, message, SAVE));
        }
        let places = geometry::places(&dicom, frames)?;
        let heights: Vec<f64> = places.origins.iter().map(|o| o.dot(places.normal)).collect();
        let (first_height, step, count) = spaced(&dicom, &heights, places.thickness)?;
        let size = [columns, rows, count];
        if size.iter().try_fold(1u64, |p, &n| p.checked_mul(n as u64)).is_none_or(|n| n > MAX_BYTES)
        {
            let message = format!("{columns} x {rows} x {count} voxels are more than 4 GB");
            return Err(dicom.error(message, "crop or resample it"));
        }
        let lowest = heights.iter().position(|h| *h == first_height).expect("one of them");
        let grid = Grid {
            steps: [places.x, places.y, places.normal * step],
            origin: places.origins[lowest],
            frame: Frame::Lps,
            unit: 1.0,
        };
        let world_from_voxel = grid.world_from_voxel().map_err(|cause| {
            dicom.error(cause, "correct the orientation or the positions of the planes")
        })?;
        let mut voxels = vec![0u8; size.iter().product()];
        // In the order of segments, so that the later covers the earlier.
        let mut order = Vec::new();
        for (n, frame) in frames.iter().enumerate() {
            order.push((segment_of(&dicom, frame, &segments)?, n));
        }
        order.sort_unstable();
        for (segment, n) in order {
            let slice = ((heights[n] - first_height) / step).round() as usize;
            let plane = &mut voxels[slice * rows * columns..][..rows * columns];
            let start = n * rows * columns;
            for (at, voxel) in plane.iter_mut().enumerate() {
                let on = match bits {
                    1 => pixels[(start + at) / 8] >> ((start + at) % 8) & 1 == 1,
                    _ => pixels[start + at] >= 128,
                };
                if on {
                    *voxel = segment as u8 + 1;
                }
            }
        }
        Ok(Some(Self { size, world_from_voxel, voxels, segments }))
    }
}

fn segments(dicom: &Dicom) -> Result<Vec<DicomSegment>, FileError> {
    let elements = dicom.elements();
    let tag = elements::SEGMENTS;
    let Some(Value::Items(items)) = dicom.root.get(&tag) else {
        return Err(dicom.lacks("SegmentSequence", tag));
    };
    if items.is_empty() || items.len() > MOST {
        let message = format!("has {} segments; 1 to {MOST} can be read", items.len());
        return Err(dicom.error(message, "save fewer to one file"));
    }
    let mut out = Vec::new();
    for item in items {
        let number = elements.number(item, (0x0062, 0x0004));
        let number = number.ok_or_else(|| dicom.lacks("SegmentNumber", (0x0062, 0x0004)))?;
        let meaning = |tag| {
            let code = first(item, tag)?;
            elements.text(code, (0x0008, 0x0104))
        };
        let said = [
            elements.text(item, (0x0062, 0x0005)),
            meaning(elements::TYPE),
            meaning(elements::CATEGORY),
        ];
        let said = said.into_iter().flatten().filter(|t| !t.is_empty());
        out.push(DicomSegment { number, names: said.map(std::borrow::Cow::into_owned).collect() });
    }
    Ok(out)
}

/// Place in the list of the segment that a frame shows.
fn segment_of(dicom: &Dicom, frame: &Item, segments: &[DicomSegment]) -> Result<usize, FileError> {
    let tag = elements::IDENTIFICATION;
    let shared = first(&dicom.root, elements::SHARED);
    let item = first(frame, tag).or(shared.and_then(|s| first(s, tag)));
    let number = item.and_then(|i| dicom.elements().number(i, (0x0062, 0x000b)));
    let number = number.ok_or_else(|| dicom.lacks("ReferencedSegmentNumber", (0x0062, 0x000b)))?;
    segments.iter().position(|s| s.number == number).ok_or_else(|| {
        let message = format!("a frame shows segment {number}, which is not described");
        dicom.error(message, SAVE)
    })
}

/// The lowest height, the distance of planes and their number. Frames without pixels of their segment are left out of
/// files, so that planes may be missing.
fn spaced(dicom: &Dicom, heights: &[f64], thickness: f64) -> Result<(f64, f64, usize), FileError> {
    let mut sorted = heights.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.dedup_by(|b, a| *b - *a < geometry::SAME);
    let (low, high) = (sorted[0], sorted[sorted.len() - 1]);
    let gaps = sorted.windows(2).map(|w| w[1] - w[0]);
    let step = gaps.fold(f64::INFINITY, f64::min);
    let step = if step.is_finite() { step } else { thickness };
    let count = ((high - low) / step).round();
    // The mean over the whole length is truer than one gap, which is rounded.
    let step = if count > 0.0 { (high - low) / count } else { step };
    for height in &sorted {
        let place = (height - low) / step;
        if (place - place.round()).abs() > UNEVEN * (1.0 + place / 100.0) {
            let message = format!(
                "the planes are not evenly spaced: one is {:.3} mm off",
                (place - place.round()).abs() * step
            );
            return Err(dicom.error(message, "resample it"));
        }
    }
    Ok((low, step, count as usize + 1))
}

/// Positions of the frames.
pub(super) struct Places {
    /// First pixels.
    pub origins: Vec<DVec3>,
    /// From one pixel to the next along rows and columns.
    pub x: DVec3,
    pub y: DVec3,
    /// Unit normal.
    pub normal: DVec3,
    /// Thickness of a plane, mm.
    pub thickness: f64,
}
