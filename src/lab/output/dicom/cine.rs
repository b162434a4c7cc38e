//! Images and loops: Ultrasound Image Storage and Ultrasound Multi-frame Image Storage (PS3.3, A.6 and A.7), with the
//! size of a pixel in a region.

use std::path::{Path, PathBuf};

use dicom_core::Tag;
use dicom_dictionary_std::{tags, uids};

use super::data::{DataSet, Frames, MAX_PIXELS};
use super::regions::{self, ColourBox, SpectralScale};
use super::{DicomError, Study, Transducer};

/// Most frames with a time each: numbers in text of 17 bytes, in an element of 16-bit length.
const MOST_TIMED: usize = 0xfffe / 17;
/// Comment in each file, whatever is typed.
const COMMENT: &str = "Simulated: not of a patient, not for diagnosis";

/// Scene, scale and study of an image or a loop.
#[derive(Clone, Debug, PartialEq)]
pub struct About {
    /// Name of what is imaged; without a study it stands for the patient's.
    pub name: String,
    /// Edge of a pixel, mm.
    pub pitch: f64,
    /// Left edge and top of the image, mm from the middle of the transducer's face, across and in depth.
    pub corner: [f64; 2],
    /// Frequency of the transducer, MHz.
    pub frequency: f64,
    /// Its shape.
    pub transducer: Transducer,
    /// The box of Doppler colours over it; none of grey images.
    pub colours: Option<ColourBox>,
    /// Whose image it is; none where nobody says.
    pub study: Option<Study>,
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
        self.write_frames(tags::FRAME_TIME, [frame_time])
    }

    /// Writes the file; each frame is shown until its own time, ms from the beginning.
    ///
    /// # Errors
    /// More frames than a file can time one by one; errors of the file system.
    ///
    /// # Panics
    /// Without a frame, or with another number of times.
    pub fn finish_at(self, ends: &[f64]) -> Result<(), DicomError> {
        assert_eq!(ends.len(), self.frames as usize, "a time for each frame");
        if ends.len() > MOST_TIMED {
            let cause = format!("each of its frames has its own time: take at most {MOST_TIMED}");
            return Err(DicomError::new(&self.path, cause));
        }
        let starts = std::iter::once(0.0).chain(ends.iter().copied()).take(ends.len());
        // Each from the one before, the first from itself.
        let before = std::iter::once(0.0).chain(starts.clone());
        let steps = starts.zip(before).map(|(start, before)| start - before);
        self.write_frames(tags::FRAME_TIME_VECTOR, steps)
    }

    fn write_frames(
        self,
        tag: Tag,
        times: impl IntoIterator<Item = f64>,
    ) -> Result<(), DicomError> {
        let count = self.frames.to_string();
        let regions = self.regions();
        self.write(uids::ULTRASOUND_MULTI_FRAME_IMAGE_STORAGE, regions, |data| {
            data.decimals(tag, times);
            data.put(tags::FRAME_INCREMENT_POINTER, tag);
            data.put(tags::NUMBER_OF_FRAMES, count);
        })
    }

    /// The regions of images.
    fn regions(&self) -> Vec<DataSet> {
        regions::of_image(&self.about, self.size.expect("a frame"))
    }

    /// Writes a file of this class, with its regions and what else it has.
    fn write(
        self,
        class: &str,
        regions: Vec<DataSet>,
        add: impl FnOnce(&mut DataSet),
    ) -> Result<(), DicomError> {
        let [width, height] = self.size.expect("a frame");
        let mut data = DataSet::new();
        data.common(&self.about.name);
        if let Some(study) = &self.about.study {
            study.put(&mut data, &self.about.name);
        }
        data.put(tags::IMAGE_COMMENTS, COMMENT);
        // The fourth value: 2D imaging.
        data.texts(tags::IMAGE_TYPE, &["ORIGINAL", "PRIMARY", "", "0001"]);
        data.put(tags::LATERALITY, "");
        data.put(tags::TRANSDUCER_TYPE, self.about.transducer.term());
        add(&mut data);
        data.items(tags::SEQUENCE_OF_ULTRASOUND_REGIONS, regions);
        data.pixels(&Frames { width, height, color: self.color }, self.pixels);
        data.write(&self.path, class)
    }
}

/// Writes a file of one image: RGBA bytes, row by row, taken as [`Loop::add`] takes a frame.
///
/// # Errors
/// More pixels than a file can hold; errors of the file system.
///
/// # Panics
/// When the pixels are not those of the size.
pub fn still(
    path: &Path,
    about: About,
    [width, height]: [u32; 2],
    rgba: &[u8],
) -> Result<(), DicomError> {
    let mut image = Loop::new(path, about);
    image.add(width, height, rgba)?;
    let regions = image.regions();
    image.write(uids::ULTRASOUND_IMAGE_STORAGE, regions, |_| {})
}

/// Writes a file of spectra against time: grey levels, row by row, and what a pixel is in seconds and cm/s. Pitch and corner of
/// `about` mean nothing.
///
/// # Errors
/// Errors of the file system.
///
/// # Panics
/// When the pixels are not those of the size.
pub fn spectra(
    path: &Path,
    about: About,
    scale: &SpectralScale,
    [width, height]: [u32; 2],
    greys: &[u8],
) -> Result<(), DicomError> {
    let region = regions::of_spectra(&about, scale, [width, height]);
    let mut image = Loop::new(path, about);
    let rgba: Vec<u8> = greys.iter().flat_map(|&grey| [grey, grey, grey, 255]).collect();
    image.add(width, height, &rgba)?;
    image.write(uids::ULTRASOUND_IMAGE_STORAGE, vec![region], |data| {
        // No 2D imaging.
        data.texts(tags::IMAGE_TYPE, &["ORIGINAL", "PRIMARY"]);
    })
}
