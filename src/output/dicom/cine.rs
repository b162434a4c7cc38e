//! Loops as DICOM: Ultrasound Multi-frame Image Storage (PS3.3, A.7), uncompressed, with the size of a pixel in a
//! region.
//!
//! Written with `dicom-object`, which knows types, paddings and lengths. Volumes are read by our own bounded
//! reader, which never allocates what a file only declares.

use std::collections::hash_map::RandomState;
use std::hash::{BuildHasher, Hasher};
use std::path::{Path, PathBuf};

use dicom_core::value::DataSetSequence;
use dicom_core::{DataElement, PrimitiveValue, Tag, VR};
use dicom_object::{FileMetaTableBuilder, InMemDicomObject};

/// Ultrasound Multi-frame Image Storage.
const CLASS: &str = "1.2.840.10008.5.1.4.1.1.3.1";
/// Explicit VR Little Endian.
const SYNTAX: &str = "1.2.840.10008.1.2.1";
/// Most bytes of pixels: an element's length has 32 bits, its largest value means something else, and it is even.
const MAX_PIXELS: usize = 0xffff_fffe;
/// Code of centimetres in a region (PS3.3, C.8.5.5.1.15).
const CENTIMETRES: u16 = 3;

/// Reason for which a loop was not written.
#[derive(Debug, thiserror::Error)]
#[error("writing {}: {cause}", path.display())]
pub struct LoopError {
    /// The file.
    pub path: PathBuf,
    /// Message of the system, or what is wrong with the frames.
    pub cause: String,
}

/// What a loop shows.
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
    /// `CURVED LINEAR`, `LINEAR` or `SECTOR_PHASED` (PS3.3, C.8.5.6.1.13).
    pub transducer: &'static str,
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
    /// Returns whether `path` names one, by its extension.
    pub fn is_meant(path: &Path) -> bool {
        path.extension().is_some_and(|e| e.eq_ignore_ascii_case("dcm"))
    }

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
    pub fn add(&mut self, width: u32, height: u32, rgba: &[u8]) -> Result<(), LoopError> {
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
            return Err(self.failed(cause));
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
    pub fn finish(mut self, frame_time: f64) -> Result<(), LoopError> {
        let instance = uid();
        let object = self.object(&instance, frame_time);
        let meta = FileMetaTableBuilder::new()
            .transfer_syntax(SYNTAX)
            .media_storage_sop_class_uid(CLASS)
            .media_storage_sop_instance_uid(&instance);
        let file = object.with_meta(meta).map_err(|e| self.failed(e))?;
        let mut bytes = Vec::new();
        file.write_all(&mut bytes).map_err(|e| self.failed(e))?;
        super::files::replace(&self.path, &bytes).map_err(|e| self.failed(e))
    }

    fn failed(&self, cause: impl ToString) -> LoopError {
        LoopError { path: self.path.clone(), cause: cause.to_string() }
    }

    /// All elements of the information object, by its modules.
    fn object(&mut self, instance: &str, frame_time: f64) -> InMemDicomObject {
        let [width, height] = self.size.expect("a frame");
        let short = |n: u32| u16::try_from(n).expect("a side of a B-mode image");
        let mut object = InMemDicomObject::new_empty();
        let mut put = |group: u16, element: u16, vr: VR, value: PrimitiveValue| {
            object.put(DataElement::new(Tag(group, element), vr, value));
        };
        let text = |text: &str| PrimitiveValue::from(text);
        // Patient, study, series, equipment: nobody was examined.
        put(0x0008, 0x0005, VR::CS, text("ISO_IR 192"));
        put(0x0008, 0x0020, VR::DA, text(""));
        put(0x0008, 0x0030, VR::TM, text(""));
        put(0x0008, 0x0050, VR::SH, text(""));
        put(0x0008, 0x0060, VR::CS, text("US"));
        put(0x0008, 0x0070, VR::LO, text("insonify"));
        put(0x0008, 0x0090, VR::PN, text(""));
        put(0x0008, 0x1090, VR::LO, text("insonify"));
        put(0x0018, 0x1020, VR::LO, text(env!("CARGO_PKG_VERSION")));
        let name: String =
            self.about.name.chars().filter(|c| !"\\^=".contains(*c)).take(60).collect();
        put(0x0010, 0x0010, VR::PN, text(&format!("{name}^Simulated")));
        put(0x0010, 0x0020, VR::LO, text("SIMULATED"));
        put(0x0010, 0x0030, VR::DA, text(""));
        put(0x0010, 0x0040, VR::CS, text(""));
        put(0x0020, 0x000d, VR::UI, text(&uid()));
        put(0x0020, 0x000e, VR::UI, text(&uid()));
        put(0x0020, 0x0010, VR::SH, text(""));
        put(0x0020, 0x0011, VR::IS, text("1"));
        // General image, ultrasound image. The fourth value of the type: 2D imaging.
        put(
            0x0008,
            0x0008,
            VR::CS,
            PrimitiveValue::Strs(
                ["ORIGINAL", "PRIMARY", "", "0001"].map(str::to_owned).into_iter().collect(),
            ),
        );
        put(0x0008, 0x0016, VR::UI, text(CLASS));
        put(0x0008, 0x0018, VR::UI, text(instance));
        put(0x0020, 0x0013, VR::IS, text("1"));
        put(0x0020, 0x0020, VR::CS, text(""));
        put(0x0020, 0x0060, VR::CS, text(""));
        put(0x0018, 0x6031, VR::CS, text(self.about.transducer));
        put(0x0028, 0x2110, VR::CS, text("00"));
        // Cine, multi-frame: the pointer names FrameTime.
        put(0x0018, 0x1063, VR::DS, text(&decimal(frame_time)));
        put(0x0028, 0x0008, VR::IS, text(&self.frames.to_string()));
        put(
            0x0028,
            0x0009,
            VR::AT,
            PrimitiveValue::Tags([Tag(0x0018, 0x1063)].into_iter().collect()),
        );
        // Image pixel.
        let (samples, photometric) = if self.color { (3, "RGB") } else { (1, "MONOCHROME2") };
        put(0x0028, 0x0002, VR::US, PrimitiveValue::from(samples as u16));
        put(0x0028, 0x0004, VR::CS, text(photometric));
        if self.color {
            put(0x0028, 0x0006, VR::US, PrimitiveValue::from(0u16));
        }
        put(0x0028, 0x0010, VR::US, PrimitiveValue::from(short(height)));
        put(0x0028, 0x0011, VR::US, PrimitiveValue::from(short(width)));
        put(0x0028, 0x0014, VR::US, PrimitiveValue::from(u16::from(self.color)));
        for (element, bits) in [(0x0100, 8u16), (0x0101, 8), (0x0102, 7), (0x0103, 0)] {
            put(0x0028, element, VR::US, PrimitiveValue::from(bits));
        }
        let mut pixels = std::mem::take(&mut self.pixels);
        if !pixels.len().is_multiple_of(2) {
            pixels.push(0);
        }
        put(0x7fe0, 0x0010, VR::OB, PrimitiveValue::U8(pixels.into()));
        let region = DataSetSequence::from(vec![self.region([width, height])]);
        object.put(DataElement::new(Tag(0x0018, 0x6011), VR::SQ, region));
        object
    }

    /// The one region: the whole image, in cm from the middle of the transducer's face (PS3.3, C.8.5.5).
    fn region(&self, [width, height]: [u32; 2]) -> InMemDicomObject {
        let About { pitch, corner, frequency, .. } = self.about;
        let mut region = InMemDicomObject::new_empty();
        let mut put = |element: u16, vr: VR, value: PrimitiveValue| {
            region.put(DataElement::new(Tag(0x0018, element), vr, value));
        };
        // 2D, tissue, no flags.
        put(0x6012, VR::US, PrimitiveValue::from(1u16));
        put(0x6014, VR::US, PrimitiveValue::from(1u16));
        put(0x6016, VR::UL, PrimitiveValue::from(0u32));
        for (element, edge) in [(0x6018, 0), (0x601a, 0), (0x601c, width - 1), (0x601e, height - 1)]
        {
            put(element, VR::UL, PrimitiveValue::from(edge));
        }
        for (n, corner) in (0u16..).zip(corner) {
            // The pixel that the middle of the face lies in; it may be above the image.
            let pixel = (-corner / pitch).floor();
            let place = corner + (pixel + 0.5) * pitch;
            put(0x6020 + 2 * n, VR::SL, PrimitiveValue::from(pixel as i32));
            put(0x6024 + 2 * n, VR::US, PrimitiveValue::from(CENTIMETRES));
            put(0x6028 + 2 * n, VR::FD, PrimitiveValue::from(place / 10.0));
            put(0x602c + 2 * n, VR::FD, PrimitiveValue::from(pitch / 10.0));
        }
        // kHz.
        put(0x6030, VR::UL, PrimitiveValue::from((frequency * 1e3).round() as u32));
        region
    }
}

/// A number as text of at most 16 characters, as DICOM has it.
fn decimal(value: f64) -> String {
    let digits = (0..=12).rev().map(|digits| format!("{value:.digits$}"));
    digits.into_iter().find(|text| text.len() <= 16).unwrap_or_else(|| format!("{value:.5e}"))
}

/// An identifier of our own: a random UUID under 2.25 (PS3.5, B.2).
fn uid() -> String {
    let word = || u128::from(RandomState::new().build_hasher().finish());
    let bits = word() << 64 | word();
    // Version 4, variant 1.
    let bits = bits & !(0xf << 76) | 4 << 76;
    let bits = bits & !(0x3 << 62) | 0x2 << 62;
    format!("2.25.{bits}")
}
