//! Loops: Ultrasound Multi-frame Image Storage (PS3.3, A.7), with the size of a pixel in a region.

use std::path::{Path, PathBuf};

use dicom_dictionary_std::{tags, uids};

use super::data::{DataSet, Frames, MAX_PIXELS};
use super::{DicomError, Transducer};

/// Code of centimetres in a region (PS3.3, C.8.5.5.1.15).
const CENTIMETRES: u16 = 3;

/// Scene, scale and pace of a loop.
#[derive(Clone, Debug, PartialEq)]
pub struct About {
    /// Name of what is imaged; it stands for the patient's.
    pub name: String,
    /// Edge of a pixel, mm.
    pub pitch: f64,
    /// Left edge and top of the image, mm from the middle of the transducer's face, across and in depth.
    pub corner: [f64; 2],
    /// Frequency of the transducer, MHz.
    pub frequency: f64,
    /// Its shape.
    pub transducer: Transducer,
}

/// A loop that is being made.
pub struct Loop {
    path: PathBuf,
    about: About,
    /// Width and height of the frames.
    size: Option<[u32; 2]>,
    frames: u32,
    /// One value a pixel, three from the first colour on.
    pixels: Vec<u8>,
    color: bool,
}

impl Loop {
    /// Begins a loop; nothing is written before its end.
    pub fn new(path: &Path, about: About) -> Self {
        let path = path.to_owned();
        Self { path, about, size: None, frames: 0, pixels: Vec::new(), color: false }
    }

    /// Adds a frame: RGBA bytes, row by row, of the size of the first. Transparent pixels, outside the sector, are black;
    /// grey ones stay one byte each while no frame has colours.
    ///
    /// # Errors
    /// More pixels than a file can hold.
    ///
    /// # Panics
    /// When the pixels are not those of the size, or frames differ in size.
    pub fn add(&mut self, width: u32, height: u32, rgba: &[u8]) -> Result<(), DicomError> {
        assert_eq!(*self.size.get_or_insert([width, height]), [width, height], "frames of a loop");
        let (pixels, rest) = rgba.as_chunks::<4>();
        assert!(rest.is_empty() && pixels.len() as u64 == u64::from(width) * u64::from(height));
        let shown = pixels.iter().map(|p| if p[3] == 0 { [0; 4] } else { *p });
        let colored = pixels.iter().any(|p| p[3] != 0 && (p[0] != p[1] || p[1] != p[2]));
        if colored && !self.color {
            self.color = true;
            self.pixels = self.pixels.iter().flat_map(|&grey| [grey; 3]).collect();
        }
        match self.color {
            true => self.pixels.extend(shown.flat_map(|p| [p[0], p[1], p[2]])),
            false => self.pixels.extend(shown.map(|p| p[0])),
        }
        self.frames += 1;
        if self.pixels.len() > MAX_PIXELS {
            let cause = "its frames are more than 4 GB: render fewer, or smaller ones";
            return Err(DicomError::new(&self.path, cause));
        }
        Ok(())
    }

    /// Writes the file, with the frames `frame_time` ms apart.
    ///
    /// # Errors
    /// Errors of the file system.
    ///
    /// # Panics
    /// Without a frame.
    pub fn finish(self, frame_time: f64) -> Result<(), DicomError> {
        let [width, height] = self.size.expect("a frame");
        let mut data = DataSet::new();
        data.common(&self.about.name);
        // The fourth value: 2D imaging.
        data.texts(tags::IMAGE_TYPE, &["ORIGINAL", "PRIMARY", "", "0001"]);
        data.put(tags::LATERALITY, "");
        data.put(tags::TRANSDUCER_TYPE, self.about.transducer.term());
        data.decimals(tags::FRAME_TIME, [frame_time]);
        data.put(tags::FRAME_INCREMENT_POINTER, tags::FRAME_TIME);
        data.items(tags::SEQUENCE_OF_ULTRASOUND_REGIONS, [region(&self.about, [width, height])]);
        let frames = Frames { width, height, count: self.frames, color: self.color };
        data.pixels(&frames, self.pixels);
        data.write(&self.path, uids::ULTRASOUND_MULTI_FRAME_IMAGE_STORAGE)
    }
}

/// The one region: the whole image, in cm from the middle of the transducer's face (PS3.3, C.8.5.5).
fn region(about: &About, [width, height]: [u32; 2]) -> DataSet {
    let About { pitch, corner, frequency, .. } = *about;
    let mut region = DataSet::new();
    // 2D, tissue, no flags.
    region.put(tags::REGION_SPATIAL_FORMAT, 1u16);
    region.put(tags::REGION_DATA_TYPE, 1u16);
    region.put(tags::REGION_FLAGS, 0u32);
    region.put(tags::REGION_LOCATION_MIN_X0, 0u32);
    region.put(tags::REGION_LOCATION_MIN_Y0, 0u32);
    region.put(tags::REGION_LOCATION_MAX_X1, width - 1);
    region.put(tags::REGION_LOCATION_MAX_Y1, height - 1);
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
    for ([reference, units, value, delta], corner) in [x, y].into_iter().zip(corner) {
        // The pixel that the middle of the face lies in; it may be above the image.
        let pixel = (-corner / pitch).floor();
        let place = corner + (pixel + 0.5) * pitch;
        region.put(reference, pixel as i32);
        region.put(units, CENTIMETRES);
        region.put(value, place / 10.0);
        region.put(delta, pitch / 10.0);
    }
    // kHz.
    region.put(tags::TRANSDUCER_FREQUENCY, (frequency * 1e3).round() as u32);
    region
}
