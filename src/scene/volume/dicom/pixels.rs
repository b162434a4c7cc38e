//! Pixels of frames as voxels.

use std::io::Cursor;
use std::ops::Range;

use image::{ImageDecoder, codecs::jpeg::JpegDecoder};

use super::elements::{FLOAT_PIXELS, PIXELS, Value};
use super::file::Transfer;
use super::image::{Color, Image};
use super::{Dicom, SAVE, bytes_of, source};
use crate::issue::FileError;
use crate::volume::layout::{Axis, Layout};
use crate::volume::{Scalar, Voxels};

/// Most bytes of pixels for a compressed byte, with a margin: a run of 128 is two bytes, a JPEG block of 64
/// values two bits.
const MAX_RATIO: usize = source::MAX_RATIO as usize;

/// The voxels of these frames, one after another.
pub(super) fn decode(dicom: &Dicom, image: &Image, frames: &[usize]) -> Result<Voxels, FileError> {
    let tag = if image.kind == Scalar::F32 { FLOAT_PIXELS } else { PIXELS };
    let big = dicom.syntax == Transfer::Big;
    let mut voxels: Option<Voxels> = None;
    // A frame at a time: what is packed and what is not are never in memory together.
    let mut each = |bytes: &[u8]| {
        let layout = Layout::new([(Axis::Space, bytes.len() / image.kind.bytes())]);
        let (frame, _) = Voxels::decode(bytes, image.kind, big, &layout, 0);
        match &mut voxels {
            Some(voxels) => voxels.append(frame),
            None => voxels = Some(frame),
        }
    };
    match dicom.root.get(&tag) {
        Some(Value::Bytes(range)) => native(dicom, image, range.clone(), frames, &mut each)?,
        Some(Value::Fragments(fragments)) => packed(dicom, image, fragments, frames, &mut each)?,
        _ => return Err(dicom.lacks("PixelData", tag)),
    }
    let voxels = voxels.ok_or_else(|| dicom.lacks("PixelData", tag))?;
    Ok(trim(voxels, image.bits))
}

/// Values of fewer bits than allocated, without the bits above them, which do not belong to them.
fn trim(voxels: Voxels, bits: u32) -> Voxels {
    match voxels {
        Voxels::U8(v) if bits < 8 => {
            Voxels::U8(v.iter().map(|x| x & (0xff >> (8 - bits))).collect())
        }
        Voxels::I8(v) if bits < 8 => {
            Voxels::I8(v.iter().map(|x| x << (8 - bits) >> (8 - bits)).collect())
        }
        Voxels::U16(v) if bits < 16 => {
            Voxels::U16(v.iter().map(|x| x & (0xffff >> (16 - bits))).collect())
        }
        Voxels::I16(v) if bits < 16 => {
            Voxels::I16(v.iter().map(|x| x << (16 - bits) >> (16 - bits)).collect())
        }
        other => other,
    }
}

fn native(
    dicom: &Dicom,
    image: &Image,
    range: Range<usize>,
    frames: &[usize],
    each: &mut impl FnMut(&[u8]),
) -> Result<(), FileError> {
    let samples = if image.color == Color::Ybr422 { 2 } else { image.samples };
    let frame = image.rows * image.columns * samples * image.kind.bytes();
    // 8-bit values in big-endian words would be swapped in pairs; nobody has written them since 2006.
    let held = range.len();
    if frame.checked_mul(image.frames).is_none_or(|total| total > held) {
        let message = format!(
            "is cut off: {} frames of {frame} bytes are declared, {held} bytes are there",
            image.frames
        );
        return Err(FileError::byte(dicom.path, range.start as u64, message, SAVE));
    }
    let mut out = Vec::new();
    for &index in frames {
        let start = range.start + index * frame;
        out.clear();
        grey(image, &dicom.bytes[start..start + frame], &mut out);
        each(&out);
    }
    Ok(())
}

/// Appends the brightness of every pixel; red, green and blue are weighted as in BT.601 (PS3.3,
/// C.7.6.3.1.2).
fn grey(image: &Image, frame: &[u8], out: &mut Vec<u8>) {
    let pixels = image.rows * image.columns;
    let luma = |r: u8, g: u8, b: u8| {
        let y = 0.299 * f64::from(r) + 0.587 * f64::from(g) + 0.114 * f64::from(b);
        y.round() as u8
    };
    match (image.color, image.planar) {
        (Color::Grey, _) => out.extend_from_slice(frame),
        (Color::Ybr, true) => out.extend_from_slice(&frame[..pixels]),
        (Color::Ybr, false) => out.extend(frame.iter().step_by(3)),
        // Two brightnesses, then the two colours of both.
        (Color::Ybr422, _) => out.extend(frame.chunks_exact(4).flat_map(|c| [c[0], c[1]])),
        (Color::Rgb, false) => {
            out.extend(frame.chunks_exact(3).map(|c| luma(c[0], c[1], c[2])));
        }
        (Color::Rgb, true) => {
            let at = |i: usize| luma(frame[i], frame[pixels + i], frame[2 * pixels + i]);
            out.extend((0..pixels).map(at));
        }
    }
}

fn packed(
    dicom: &Dicom,
    image: &Image,
    fragments: &[Range<usize>],
    frames: &[usize],
    each: &mut impl FnMut(&[u8]),
) -> Result<(), FileError> {
    // The table of offsets comes first. A frame may be cut into several fragments; then the table has
    // their starts, which only files of old video recorders need.
    let data = fragments.get(1..).unwrap_or_default();
    if data.len() != image.frames {
        let message = format!("{} frames lie in {} fragments", image.frames, data.len());
        return Err(dicom.error(message, "save it with one fragment per frame, or uncompressed"));
    }
    let size = bytes_of(image, 1).unwrap_or(u64::MAX) as usize;
    let mut out = Vec::new();
    for &index in frames {
        let range = data[index].clone();
        let at = range.start as u64;
        let bytes = &dicom.bytes[range];
        let wrong = |cause: String| {
            FileError::byte(dicom.path, at, format!("frame {index}: {cause}"), SAVE)
        };
        if bytes.len().saturating_mul(MAX_RATIO) < size {
            let cause = format!("{} bytes cannot hold {size} bytes of pixels", bytes.len());
            return Err(wrong(cause));
        }
        out.clear();
        match dicom.syntax {
            Transfer::Jpeg => jpeg(image, bytes, &mut out).map_err(wrong)?,
            Transfer::Rle => rle(image, bytes, &mut out).map_err(wrong)?,
            _ => return Err(wrong("compressed pixels in a file that is not".to_owned())),
        }
        each(&out);
    }
    Ok(())
}

/// Appends a frame of JPEG. The decoder gives grey or red, green and blue, whatever the file states.
fn jpeg(image: &Image, bytes: &[u8], out: &mut Vec<u8>) -> Result<(), String> {
    let decoder = JpegDecoder::new(Cursor::new(bytes)).map_err(|e| format!("is no JPEG: {e}"))?;
    let (width, height) = decoder.dimensions();
    if (width as usize, height as usize) != (image.columns, image.rows) {
        return Err(format!("the JPEG has {width} x {height} pixels"));
    }
    let color = match decoder.color_type() {
        image::ColorType::L8 => Color::Grey,
        image::ColorType::Rgb8 => Color::Rgb,
        other => return Err(format!("pixels of {other:?} cannot be read")),
    };
    let mut pixels = vec![0; decoder.total_bytes() as usize];
    decoder.read_image(&mut pixels).map_err(|e| format!("the JPEG is broken: {e}"))?;
    let decoded = Image { color, planar: false, ..image.clone() };
    grey(&decoded, &pixels, out);
    Ok(())
}

/// Appends a frame of run lengths (PS3.5, annex G): a segment per byte of each value.
fn rle(image: &Image, bytes: &[u8], out: &mut Vec<u8>) -> Result<(), String> {
    let width = image.kind.bytes();
    let (pixels, planes) = (image.rows * image.columns, image.samples * width);
    let word = |i: usize| {
        let chunk = bytes.get(4 * i..)?.first_chunk::<4>()?;
        Some(u32::from_le_bytes(*chunk) as usize)
    };
    if word(0) != Some(planes) {
        return Err(format!("the header does not name {planes} segments"));
    }
    let mut frame = vec![0; pixels * planes];
    for plane in 0..planes {
        let segment = word(plane + 1).and_then(|start| bytes.get(start..));
        let mut input = segment.ok_or("a segment lies outside the frame")?.iter();
        // The most significant byte of a value comes first; here the least significant does.
        let (sample, byte) = (plane / width, width - 1 - plane % width);
        let mut place = 0;
        let mut put = |value: u8| {
            if place < pixels {
                frame[(sample * pixels + place) * width + byte] = value;
            }
            place += 1;
            place < pixels
        };
        let short = || "a segment is cut off".to_owned();
        'segment: loop {
            let code = *input.next().ok_or_else(short)? as i8;
            match code {
                0.. => {
                    for _ in 0..=code {
                        if !put(*input.next().ok_or_else(short)?) {
                            break 'segment;
                        }
                    }
                }
                -127..=-1 => {
                    let value = *input.next().ok_or_else(short)?;
                    for _ in 0..=-i16::from(code) {
                        if !put(value) {
                            break 'segment;
                        }
                    }
                }
                i8::MIN => {}
            }
        }
    }
    let planar = Image { planar: true, ..image.clone() };
    grey(&planar, &frame, out);
    Ok(())
}
