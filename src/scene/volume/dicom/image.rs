//! The pixel format of a DICOM file.

use super::elements::{FLOAT_PIXELS, VALUES, first};
use super::{Dicom, MAX_VOXELS, SAVE, Scalar, bytes_of};
use crate::issue::FileError;

/// Meaning of a pixel's values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Color {
    /// One brightness.
    Grey,
    /// Red, green and blue.
    Rgb,
    /// Brightness and two of colour.
    Ybr,
    /// The same, the colours of two pixels together.
    Ybr422,
}

/// The pixel format.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Image {
    pub rows: usize,
    pub columns: usize,
    pub frames: usize,
    /// Values per pixel.
    pub samples: usize,
    /// True where each value of the pixels has a plane of its own.
    pub planar: bool,
    pub color: Color,
    pub kind: Scalar,
    /// Number of significant bits of a value.
    pub bits: u32,
    /// Slope and intercept, where they have an effect.
    pub scale: Option<(f64, f64)>,
}

impl Image {
    pub fn is_color(&self) -> bool {
        self.color != Color::Grey
    }

    pub fn of(dicom: &Dicom) -> Result<Self, FileError> {
        let elements = dicom.elements();
        let root = &dicom.root;
        let number = |element: u16, name: &str| {
            let tag = (0x0028, element);
            let value = elements.number(root, tag).map(usize::from);
            value.ok_or_else(|| dicom.lacks(name, tag))
        };
        let (rows, columns) = (number(0x0010, "Rows")?, number(0x0011, "Columns")?);
        let frames = match elements.decimals::<1>(root, (0x0028, 0x0008)) {
            Some([frames]) if (1.0..4e9).contains(&frames) => frames as usize,
            None if elements.text(root, (0x0028, 0x0008)).is_none() => 1,
            _ => return Err(dicom.lacks("NumberOfFrames", (0x0028, 0x0008))),
        };
        let samples = number(0x0002, "SamplesPerPixel")?;
        let photometric = elements.text(root, (0x0028, 0x0004)).unwrap_or_default();
        let color = match (photometric.as_ref(), samples) {
            ("MONOCHROME1", 1) => {
                let message = "is MONOCHROME1: its values grow towards black";
                return Err(dicom.error(message, "save it as MONOCHROME2"));
            }
            ("MONOCHROME2", 1) => Color::Grey,
            ("RGB", 3) => Color::Rgb,
            ("YBR_FULL", 3) => Color::Ybr,
            ("YBR_FULL_422", 3) => Color::Ybr422,
            (other, samples) => {
                let message = format!("`{other}` of {samples} values per pixel cannot be read");
                return Err(dicom.error(message, "save it as MONOCHROME2 or RGB"));
            }
        };
        let signed = number(0x0103, "PixelRepresentation").unwrap_or(0) == 1;
        let allocated = number(0x0100, "BitsAllocated")?;
        let float = root.contains_key(&FLOAT_PIXELS);
        let kind = match (allocated, signed, float) {
            (32, _, true) => Scalar::F32,
            (8, false, false) => Scalar::U8,
            (8, true, false) => Scalar::I8,
            (16, false, false) => Scalar::U16,
            (16, true, false) => Scalar::I16,
            _ => {
                let message = format!("values of {allocated} bits cannot be read");
                return Err(dicom.error(message, "save it with 8 or 16 bits"));
            }
        };
        let bits = number(0x0101, "BitsStored").unwrap_or(allocated);
        let high = number(0x0102, "HighBit").unwrap_or(bits.wrapping_sub(1));
        if bits == 0 || bits > allocated || high != bits - 1 {
            let message = format!("{bits} bits up to bit {high} of {allocated} cannot be read");
            return Err(dicom.error(message, SAVE));
        }
        if (color != Color::Grey) && kind != Scalar::U8 {
            return Err(dicom.error("colours of more than 8 bits cannot be read", SAVE));
        }
        let image = Self {
            rows,
            columns,
            frames,
            samples,
            planar: samples > 1 && number(0x0006, "PlanarConfiguration")? == 1,
            color,
            kind,
            bits: bits as u32,
            scale: scale(dicom)?,
        };
        if rows == 0 || columns == 0 {
            return Err(dicom.error(format!("{columns} x {rows} pixels are no image"), SAVE));
        }
        if bytes_of(&image, frames).is_none() {
            let most = MAX_VOXELS >> 30;
            let message =
                format!("{frames} frames of {columns} x {rows} pixels are more than {most} GB");
            return Err(dicom.error(message, "crop it, or save fewer frames"));
        }
        Ok(image)
    }
}

fn scale(dicom: &Dicom) -> Result<Option<(f64, f64)>, FileError> {
    let shared = first(&dicom.root, super::elements::SHARED);
    let item = shared.and_then(|s| first(s, VALUES)).unwrap_or(&dicom.root);
    let elements = dicom.elements();
    let value = |tag| elements.decimals::<1>(item, tag).map(|[v]| v);
    let slope = value((0x0028, 0x1053)).unwrap_or(1.0);
    let intercept = value((0x0028, 0x1052)).unwrap_or(0.0);
    if !(slope.is_finite() && intercept.is_finite()) {
        return Err(dicom.error("RescaleSlope or RescaleIntercept is not a finite number", SAVE));
    }
    Ok(((slope, intercept) != (1.0, 0.0)).then_some((slope, intercept)))
}
