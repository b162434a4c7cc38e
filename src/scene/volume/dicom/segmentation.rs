//! DICOM segmentations: frames of one segment each, of one bit a pixel or of shares (PS3.3, A.51), and label maps,
//! whose pixels are the numbers of segments (PS3.3, A.90).

use std::path::Path;

use glam::{DAffine3, DVec3};

use super::elements::{self, Item, PIXELS, Value, first};
use super::source::MAX_BYTES;
use super::{Dicom, SAVE, file, geometry};
use crate::issue::FileError;
use crate::volume::grid::{Frame, Grid};

/// Segmentation Storage.
const SEGMENTS: &str = "1.2.840.10008.5.1.4.1.1.66.4";
/// Label Map Segmentation Storage.
const LABEL_MAP: &str = "1.2.840.10008.5.1.4.1.1.66.7";
/// Pixels of 255 are whole ones where a file of shares does not say what is.
const WHOLE: u16 = 255;
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

/// Segments as voxels. Segments that overlap lie in different layers.
#[derive(Clone, Debug, PartialEq)]
pub struct Segmentation {
    /// Voxels along each axis.
    pub size: [usize; 3],
    /// Voxel indices (integers at centres) to LPS, mm.
    pub world_from_voxel: DAffine3,
    /// Layers of voxels: 0, or 1 and the place of the segment in `segments`; first axis fastest.
    pub layers: Vec<Vec<u8>>,
    /// The segments.
    pub segments: Vec<DicomSegment>,
}

impl Segmentation {
    /// Reads a segmentation; none where the file is of another kind.
    ///
    /// # Errors
    /// A file that is no DICOM; frames that do not fit their segments, places or pixels; segments without a pixel.
    pub fn load(path: &Path) -> Result<Option<Self>, FileError> {
        let dicom = file::read(path)?;
        let elements = dicom.elements();
        let class = elements.text(&dicom.root, (0x0008, 0x0016));
        let kind = match class.as_deref() {
            Some(SEGMENTS) => SegmentationType::of(&dicom)?,
            Some(LABEL_MAP) => SegmentationType::LabelMap,
            _ => return Ok(None),
        };
        let segments = segments(&dicom)?;
        let number = |element: u16, name: &str| {
            let tag = (0x0028, element);
            let value = dicom.elements().number(&dicom.root, tag).filter(|n| *n > 0);
            value.map(usize::from).ok_or_else(|| dicom.lacks(name, tag))
        };
        let (rows, columns) = (number(0x0010, "Rows")?, number(0x0011, "Columns")?);
        let bits = number(0x0100, "BitsAllocated")?;
        if !kind.has_bits(bits) {
            let message = format!("pixels of {bits} bits are none of a segmentation of this kind");
            return Err(dicom.error(message, SAVE));
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
        let at = Frames {
            pixels,
            area: rows * columns,
            slices: heights.iter().map(|h| ((h - first_height) / step).round() as usize).collect(),
            bits,
            big: dicom.elements().big,
        };
        let voxels = size.iter().product();
        let layers = match kind {
            SegmentationType::LabelMap => vec![at.labels(&dicom, voxels, &segments)?],
            SegmentationType::Binary | SegmentationType::Shares { .. } => {
                let mut order = Vec::new();
                for (n, frame) in frames.iter().enumerate() {
                    order.push((segment_of(&dicom, frame, &segments)?, n));
                }
                order.sort_unstable();
                at.layers(&dicom, voxels, &order, kind.threshold(pixels, bits))?
            }
        };
        if layers.iter().flatten().all(|label| *label == 0) {
            return Err(kind.nothing(&dicom, pixels, bits));
        }
        Ok(Some(Self { size, world_from_voxel, layers, segments }))
    }
}

/// The kind of a segmentation.
#[derive(Clone, Copy)]
enum SegmentationType {
    /// A bit for each pixel; some writers take a byte.
    Binary,
    /// Shares of what `most` says is a whole pixel, where the file says it.
    Shares { most: Option<u16> },
    /// The numbers of segments.
    LabelMap,
}

impl SegmentationType {
    fn of(dicom: &Dicom) -> Result<Self, FileError> {
        let elements = dicom.elements();
        let stated = elements.text(&dicom.root, (0x0062, 0x0001));
        match stated.as_deref().unwrap_or("BINARY") {
            "BINARY" => Ok(Self::Binary),
            "FRACTIONAL" => {
                let most = elements.number(&dicom.root, (0x0062, 0x000e)).filter(|most| *most > 0);
                Ok(Self::Shares { most })
            }
            "LABELMAP" => Ok(Self::LabelMap),
            other => {
                let message = format!("is a segmentation of kind {other}, which cannot be read");
                Err(dicom.error(message, "save it as BINARY, FRACTIONAL or LABELMAP"))
            }
        }
    }

    fn has_bits(self, bits: usize) -> bool {
        match self {
            Self::Binary => bits == 1 || bits == 8,
            Self::Shares { .. } => bits == 8,
            Self::LabelMap => bits == 8 || bits == 16,
        }
    }

    /// The error of a file none of whose pixels belongs to a segment.
    fn nothing(self, dicom: &Dicom, pixels: &[u8], bits: usize) -> FileError {
        let (message, largest) = ("none of its segments has a pixel", pixels.iter().max().copied());
        let (Self::Shares { most }, Some(largest @ 1..)) = (self, largest) else {
            let message = format!("{message}: all are 0");
            return dicom.error(message, "give the segmentation with what was drawn in it");
        };
        let whole = match most {
            Some(most) => format!("{most}, its MaximumFractionalValue"),
            None => format!("{WHOLE}, as it has no MaximumFractionalValue"),
        };
        dicom.error(
            format!(
                "{message}: its shares are {largest} at most, and count from {} on, half of {whole}",
                self.threshold(pixels, bits)
            ),
            &format!(
                "if {largest} means that a pixel lies inside, set MaximumFractionalValue (0062,000E) to {largest}, or save the \
                 file as BINARY with 0 and 1"
            ),
        )
    }

    /// The least value of a pixel that belongs to its segment: half of a whole one.
    fn threshold(self, pixels: &[u8], bits: usize) -> u16 {
        let small = || bits == 1 || pixels.iter().all(|pixel| *pixel <= 1);
        let whole = match self {
            Self::Binary | Self::LabelMap => 1,
            Self::Shares { most: Some(most) } => most,
            Self::Shares { most: None } if small() => 1,
            Self::Shares { most: None } => WHOLE,
        };
        whole.div_ceil(2)
    }
}

/// The frames of a file.
struct Frames<'p> {
    pixels: &'p [u8],
    /// Pixels of a frame.
    area: usize,
    /// The plane of voxels of each frame.
    slices: Vec<usize>,
    bits: usize,
    /// True where bytes of larger numbers come first.
    big: bool,
}

impl Frames<'_> {
    fn pixel(&self, at: usize) -> u16 {
        match self.bits {
            1 => u16::from(self.pixels[at / 8] >> (at % 8) & 1),
            8 => u16::from(self.pixels[at]),
            _ => {
                let pair = [self.pixels[2 * at], self.pixels[2 * at + 1]];
                if self.big { u16::from_be_bytes(pair) } else { u16::from_le_bytes(pair) }
            }
        }
    }

    /// Voxels of frames whose pixels are numbers of segments.
    fn labels(
        &self,
        dicom: &Dicom,
        voxels: usize,
        segments: &[DicomSegment],
    ) -> Result<Vec<u8>, FileError> {
        let mut known = vec![None; usize::from(u16::MAX) + 1];
        for (segment, of) in segments.iter().enumerate().rev() {
            known[usize::from(of.number)] = Some(segment as u8 + 1);
        }
        // The background may be described or not.
        known[0] = Some(0);
        let mut out = vec![0u8; voxels];
        for (n, slice) in self.slices.iter().enumerate() {
            for at in 0..self.area {
                let number = self.pixel(n * self.area + at);
                let label = known[usize::from(number)].ok_or_else(|| {
                    let message = format!("has pixels of segment {number}, which is not described");
                    dicom.error(message, SAVE)
                })?;
                out[slice * self.area + at] = label;
            }
        }
        Ok(out)
    }

    /// Layers of voxels of frames of one segment each: each segment in the first layer in which it meets no other.
    /// `order` has the segments in order, with their frames.
    fn layers(
        &self,
        dicom: &Dicom,
        voxels: usize,
        order: &[(usize, usize)],
        threshold: u16,
    ) -> Result<Vec<Vec<u8>>, FileError> {
        let mut layers: Vec<Vec<u8>> = vec![vec![0; voxels]];
        for own in order.chunk_by(|a, b| a.0 == b.0) {
            let places = || {
                own.iter().flat_map(|&(_, frame)| {
                    let (from, to) = (frame * self.area, self.slices[frame] * self.area);
                    let on = (0..self.area).filter(move |at| self.pixel(from + at) >= threshold);
                    on.map(move |at| to + at)
                })
            };
            let free = |layer: &Vec<u8>| places().all(|at| layer[at] == 0);
            let layer = match layers.iter().position(free) {
                Some(layer) => layer,
                None => {
                    let bytes = (layers.len() as u64 + 1) * voxels as u64;
                    if bytes > MAX_BYTES {
                        let message = "its segments overlap so often that they need more than 4 GB";
                        return Err(
                            dicom.error(message, "crop it, or save fewer segments to one file")
                        );
                    }
                    layers.push(vec![0; voxels]);
                    layers.len() - 1
                }
            };
            for at in places() {
                layers[layer][at] = own[0].0 as u8 + 1;
            }
        }
        Ok(layers)
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
        let words = [
            elements.text(item, (0x0062, 0x0005)),
            meaning(elements::TYPE),
            meaning(elements::CATEGORY),
        ];
        let words = words.into_iter().flatten().filter(|t| !t.is_empty());
        out.push(DicomSegment { number, names: words.map(std::borrow::Cow::into_owned).collect() });
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
