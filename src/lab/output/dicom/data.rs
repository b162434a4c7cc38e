//! Data sets in the making, and what all files have.

use std::collections::hash_map::RandomState;
use std::hash::{BuildHasher, Hasher};
use std::path::Path;

use dicom_core::dictionary::{DataDictionary, DataDictionaryEntry};
use dicom_core::value::DataSetSequence;
use dicom_core::{DataElement, PrimitiveValue, Tag, VR};
use dicom_dictionary_std::{StandardDataDictionary, tags, uids};
use dicom_object::{FileMetaTableBuilder, InMemDicomObject};

use super::DicomError;

/// Most bytes of pixels: an element's length has 32 bits, its largest value means something else, and it is even.
pub(super) const MAX_PIXELS: usize = 0xffff_fffe;

/// A data set in the making. Types of elements are those of the standard's dictionary.
pub(super) struct DataSet(InMemDicomObject);

/// Size and colours of the frames of a file.
pub(super) struct Frames {
    pub width: u32,
    pub height: u32,
    /// True where a pixel has three values.
    pub color: bool,
}

impl DataSet {
    /// One without elements.
    pub fn new() -> Self {
        Self(InMemDicomObject::new_empty())
    }

    /// Adds an element.
    ///
    /// # Panics
    /// When the standard has none of this tag.
    pub fn put(&mut self, tag: Tag, value: impl Into<PrimitiveValue>) {
        let entry = StandardDataDictionary.by_tag(tag).expect("an element of the standard");
        self.0.put(DataElement::new(tag, entry.vr().relaxed(), value.into()));
    }

    /// Adds an element of numbers in text.
    pub fn decimals(&mut self, tag: Tag, values: impl IntoIterator<Item = f64>) {
        self.put(tag, PrimitiveValue::Strs(values.into_iter().map(decimal).collect()));
    }

    /// Adds an element of 64-bit numbers.
    pub fn doubles(&mut self, tag: Tag, values: impl IntoIterator<Item = f64>) {
        self.put(tag, PrimitiveValue::F64(values.into_iter().collect()));
    }

    /// Adds an element of several texts.
    pub fn texts(&mut self, tag: Tag, values: &[&str]) {
        self.put(tag, PrimitiveValue::Strs(values.iter().map(|&v| v.to_owned()).collect()));
    }

    /// Adds a sequence of data sets.
    pub fn items(&mut self, tag: Tag, items: impl IntoIterator<Item = Self>) {
        let items: Vec<_> = items.into_iter().map(|item| item.0).collect();
        self.0.put(DataElement::new(tag, VR::SQ, DataSetSequence::from(items)));
    }

    /// Adds a sequence of one data set.
    pub fn item(&mut self, tag: Tag, fill: impl FnOnce(&mut Self)) {
        let mut item = Self::new();
        fill(&mut item);
        self.items(tag, [item]);
    }

    /// Adds a sequence of one code.
    pub fn code(&mut self, tag: Tag, scheme: &str, [value, meaning]: [&str; 2]) {
        self.item(tag, |item| {
            item.put(tags::CODE_VALUE, value);
            item.put(tags::CODING_SCHEME_DESIGNATOR, scheme);
            item.put(tags::CODE_MEANING, meaning);
        });
    }

    /// Adds patient, study, series, equipment and the image's number: nobody was examined. `name` stands for the
    /// patient's.
    pub fn common(&mut self, name: &str) {
        self.put(tags::SPECIFIC_CHARACTER_SET, "ISO_IR 192");
        let name: String = name.chars().filter(|c| !"\\^=".contains(*c)).take(60).collect();
        self.put(tags::PATIENT_NAME, format!("{name}^Simulated"));
        self.put(tags::PATIENT_ID, "SIMULATED");
        for unknown in [
            tags::STUDY_DATE,
            tags::STUDY_TIME,
            tags::STUDY_ID,
            tags::ACCESSION_NUMBER,
            tags::REFERRING_PHYSICIAN_NAME,
            tags::PATIENT_BIRTH_DATE,
            tags::PATIENT_SEX,
            tags::PATIENT_ORIENTATION,
        ] {
            self.put(unknown, "");
        }
        self.put(tags::MODALITY, "US");
        self.put(tags::MANUFACTURER, "insonify");
        self.put(tags::MANUFACTURER_MODEL_NAME, "insonify");
        self.put(tags::SOFTWARE_VERSIONS, env!("CARGO_PKG_VERSION"));
        self.put(tags::STUDY_INSTANCE_UID, uid());
        self.put(tags::SERIES_INSTANCE_UID, uid());
        self.put(tags::SERIES_NUMBER, "1");
        self.put(tags::INSTANCE_NUMBER, "1");
        self.put(tags::LOSSY_IMAGE_COMPRESSION, "00");
    }

    /// Adds the pixels of all frames, 8 bits a value.
    pub fn pixels(&mut self, frames: &Frames, mut pixels: Vec<u8>) {
        let short = |n: u32| u16::try_from(n).expect("a side of an image");
        let (samples, photometric) = if frames.color { (3u16, "RGB") } else { (1, "MONOCHROME2") };
        self.put(tags::SAMPLES_PER_PIXEL, samples);
        self.put(tags::PHOTOMETRIC_INTERPRETATION, photometric);
        if frames.color {
            self.put(tags::PLANAR_CONFIGURATION, 0u16);
        }
        self.put(tags::ROWS, short(frames.height));
        self.put(tags::COLUMNS, short(frames.width));
        self.put(tags::BITS_ALLOCATED, 8u16);
        self.put(tags::BITS_STORED, 8u16);
        self.put(tags::HIGH_BIT, 7u16);
        self.put(tags::PIXEL_REPRESENTATION, 0u16);
        if !pixels.len().is_multiple_of(2) {
            pixels.push(0);
        }
        let pixels = PrimitiveValue::U8(pixels.into());
        self.0.put(DataElement::new(tags::PIXEL_DATA, VR::OB, pixels));
    }

    /// Writes a file of this class.
    ///
    /// # Errors
    /// Errors of the file system.
    pub fn write(mut self, path: &Path, class: &str) -> Result<(), DicomError> {
        let instance = uid();
        self.put(tags::SOP_CLASS_UID, class);
        self.put(tags::SOP_INSTANCE_UID, instance.as_str());
        let meta = FileMetaTableBuilder::new()
            .transfer_syntax(uids::EXPLICIT_VR_LITTLE_ENDIAN)
            .media_storage_sop_class_uid(class)
            .media_storage_sop_instance_uid(instance);
        let file = self.0.with_meta(meta).map_err(|e| DicomError::new(path, e))?;
        let mut bytes = Vec::new();
        file.write_all(&mut bytes).map_err(|e| DicomError::new(path, e))?;
        crate::output::files::replace(path, &bytes).map_err(|e| DicomError::new(path, e))
    }
}

/// A number as text of at most 16 characters, as DICOM has it.
pub(super) fn decimal(value: f64) -> String {
    let digits = (0..=12).rev().map(|digits| format!("{value:.digits$}"));
    digits.into_iter().find(|text| text.len() <= 16).unwrap_or_else(|| format!("{value:.5e}"))
}

/// An identifier of our own: a random UUID under 2.25 (PS3.5, B.2).
pub(super) fn uid() -> String {
    let word = || u128::from(RandomState::new().build_hasher().finish());
    let bits = word() << 64 | word();
    // Version 4, variant 1.
    let bits = bits & !(0xf << 76) | 4 << 76;
    let bits = bits & !(0x3 << 62) | 0x2 << 62;
    format!("2.25.{bits}")
}
