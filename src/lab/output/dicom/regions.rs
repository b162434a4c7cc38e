//! Regions of ultrasound images: what their pixels are, in cm, or in seconds and cm/s (PS3.3, C.8.5.5).

use dicom_dictionary_std::tags;

use super::About;
use super::data::DataSet;

/// Codes of units (PS3.3, C.8.5.5.1.15).
const CENTIMETRES: u16 = 3;
const SECONDS: u16 = 4;
const CENTIMETRES_PER_SECOND: u16 = 7;
/// Codes of spatial formats (C.8.5.5.1.1).
const PLANE: u16 = 1;
const SPECTRAL: u16 = 3;
/// Codes of data (C.8.5.5.1.2).
const TISSUE: u16 = 1;
const COLOUR_FLOW: u16 = 2;
const PULSED: u16 = 3;
const CONTINUOUS: u16 = 4;
/// Flag of a region over whose pixels others lie (C.8.5.5.1.3, bit 0).
const LOW_PRIORITY: u32 = 1;

/// A box of Doppler colours over an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColourBox {
    /// Its edges, mm from the middle of the transducer's face: left, top, right, bottom. Of a sector those of the rectangle
    /// around it.
    pub edges: [f64; 4],
    /// Pulses per second, Hz.
    pub prf: f64,
}

/// The scales of spectra against time: seconds and velocity of their pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpectralScale {
    /// True for a continuous wave.
    pub continuous: bool,
    /// Pulses per second, Hz.
    pub prf: f64,
    /// Angle by which velocities are corrected, degrees.
    pub angle: f64,
    /// Time of the first column, and from column to column, s.
    pub time: [f64; 2],
    /// Velocity of the uppermost row, and from row to row downwards, mm/s.
    pub velocity: [f64; 2],
}

/// A region of an image whose pixels these are: first and last column and row.
fn region([format, kind]: [u16; 2], flags: u32, [x0, y0, x1, y1]: [u32; 4]) -> DataSet {
    let mut region = DataSet::new();
    region.put(tags::REGION_SPATIAL_FORMAT, format);
    region.put(tags::REGION_DATA_TYPE, kind);
    region.put(tags::REGION_FLAGS, flags);
    region.put(tags::REGION_LOCATION_MIN_X0, x0);
    region.put(tags::REGION_LOCATION_MIN_Y0, y0);
    region.put(tags::REGION_LOCATION_MAX_X1, x1);
    region.put(tags::REGION_LOCATION_MAX_Y1, y1);
    region
}

/// Puts the units of both axes, the reference pixel with its values, and the values from pixel to pixel.
fn scale(
    region: &mut DataSet,
    units: [u16; 2],
    reference: [i32; 2],
    values: [f64; 2],
    steps: [f64; 2],
) {
    let x = [
        tags::REFERENCE_PIXEL_X0,
        tags::PHYSICAL_UNITS_X_DIRECTION,
        tags::REFERENCE_PIXEL_PHYSICAL_VALUE_X,
        tags::PHYSICAL_DELTA_X,
    ];
    let y = [
        tags::REFERENCE_PIXEL_Y0,
        tags::PHYSICAL_UNITS_Y_DIRECTION,
        tags::REFERENCE_PIXEL_PHYSICAL_VALUE_Y,
        tags::PHYSICAL_DELTA_Y,
    ];
    for (axis, [pixel, unit, value, step]) in [x, y].into_iter().enumerate() {
        region.put(pixel, reference[axis]);
        region.put(unit, units[axis]);
        region.put(value, values[axis]);
        region.put(step, steps[axis]);
    }
}

/// The regions of an image: all of it, in cm from the middle of the transducer's face, and the box of colours over it.
pub(super) fn of_image(about: &About, [width, height]: [u32; 2]) -> Vec<DataSet> {
    let About { pitch, corner, .. } = *about;
    // The pixel that the middle of the face lies in; it may be above the image. Regions have their own corner's pixel as 0.
    let middle = corner.map(|corner| (-corner / pitch).floor());
    let place = [0, 1].map(|axis| (corner[axis] + (middle[axis] + 0.5) * pitch) / 10.0);
    let in_cm = |region: &mut DataSet, [x0, y0]: [u32; 2]| {
        let reference = [middle[0] as i32 - x0 as i32, middle[1] as i32 - y0 as i32];
        scale(region, [CENTIMETRES; 2], reference, place, [pitch / 10.0; 2]);
    };
    let flags = if about.colours.is_some() { LOW_PRIORITY } else { 0 };
    let mut whole = region([PLANE, TISSUE], flags, [0, 0, width - 1, height - 1]);
    in_cm(&mut whole, [0, 0]);
    frequency(&mut whole, about);
    let mut out = vec![whole];
    if let Some(ColourBox { edges: [left, top, right, bottom], prf }) = about.colours {
        let pixel = |mm: f64, axis: usize, count: u32| {
            ((mm - corner[axis]) / pitch).floor().clamp(0.0, f64::from(count - 1)) as u32
        };
        let [x0, x1] = [left, right].map(|mm| pixel(mm, 0, width));
        let [y0, y1] = [top, bottom].map(|mm| pixel(mm, 1, height));
        let mut coloured = region([PLANE, COLOUR_FLOW], 0, [x0, y0, x1, y1]);
        in_cm(&mut coloured, [x0, y0]);
        frequency(&mut coloured, about);
        coloured.put(tags::PULSE_REPETITION_FREQUENCY, prf.round() as u32);
        out.push(coloured);
    }
    out
}

/// The region of spectra against time: all of the picture.
pub(super) fn of_spectra(about: &About, of: &SpectralScale, [width, height]: [u32; 2]) -> DataSet {
    let kind = if of.continuous { CONTINUOUS } else { PULSED };
    let mut out = region([SPECTRAL, kind], 0, [0, 0, width - 1, height - 1]);
    let values = [of.time[0], of.velocity[0] / 10.0];
    let steps = [of.time[1], of.velocity[1] / 10.0];
    scale(&mut out, [SECONDS, CENTIMETRES_PER_SECOND], [0, 0], values, steps);
    frequency(&mut out, about);
    out.put(tags::PULSE_REPETITION_FREQUENCY, of.prf.round() as u32);
    out.put(tags::DOPPLER_CORRECTION_ANGLE, of.angle);
    out
}

fn frequency(region: &mut DataSet, about: &About) {
    // kHz.
    region.put(tags::TRANSDUCER_FREQUENCY, (about.frequency * 1e3).round() as u32);
}
