//! Volumes: Enhanced US Volume Storage (PS3.3, A.59 and C.8.24), its planes placed in the patient.
//!
//! The volume's frame of reference is the transducer's at the middle of the sweep (C.8.24.2.1.2): x across the face, y
//! in depth, z so that the three are right-handed, from the middle of the face on.

use std::path::Path;

use dicom_core::chrono::{DateTime, Utc};
use dicom_dictionary_std::{tags, uids};
use glam::{DAffine3, DVec3};

use super::data::{DataSet, Frames, MAX_PIXELS, uid};
use super::{DicomError, Transducer};

/// Type of the image and of each of its planes (C.8.24.3.2).
const TYPE: [&str; 4] = ["ORIGINAL", "PRIMARY", "VOLUME", "NONE"];
/// Form of a moment, in Greenwich (PS3.5, 6.2).
const MOMENT: &str = "%Y%m%d%H%M%S%.6f+0000";
/// Cosine to an axis of the patient from which on a plane counts as lying across it: ten degrees.
const ALONG: f64 = 0.985;

/// Movement of the transducer against the volume while it is acquired.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    /// Nothing.
    None,
    /// The transducer is shifted.
    Shifted,
    /// It is turned about the middle of its face.
    Turned,
    /// Both.
    Both,
}

impl Motion {
    /// Term of `VolumeToTransducerRelationship` (C.8.24.2).
    fn term(self) -> &'static str {
        match self {
            Self::None => "FIXED",
            Self::Shifted => "POSITION_VAR",
            Self::Turned => "ORIENTATION_VAR",
            Self::Both => "VARIABLE",
        }
    }
}

/// A volume of parallel planes, and how it was acquired.
#[derive(Clone, Debug, PartialEq)]
pub struct Volume {
    /// Name of what is imaged; it stands for the patient's.
    pub name: String,
    /// Voxels along x, y and z of the transducer.
    pub size: [usize; 3],
    /// Grey levels, x fastest.
    pub voxels: Vec<u8>,
    /// Distance of voxels along the same, mm.
    pub spacing: DVec3,
    /// Centre of the first voxel in the transducer's frame, mm.
    pub first: DVec3,
    /// The patient's LPS from the transducer's frame, rigid, mm.
    pub patient_from_transducer: DAffine3,
    /// Movement of the transducer meanwhile.
    pub motion: Motion,
    /// Time from the first frame to the last, s.
    pub duration: f64,
    /// Shape of the transducer.
    pub transducer: Transducer,
    /// Depth of its focus, mm.
    pub focus: f64,
    /// Depth of its image, mm.
    pub depth: f64,
}

impl Volume {
    /// Writes a file (.dcm).
    ///
    /// # Errors
    /// More voxels than a file can hold; errors of the file system.
    ///
    /// # Panics
    /// When the voxels are not those of the size.
    pub fn write(self, path: &Path) -> Result<(), DicomError> {
        let [x, y, z] = self.size;
        assert_eq!(self.voxels.len(), x * y * z, "voxels");
        if x.max(y) > usize::from(u16::MAX) || self.voxels.len() > MAX_PIXELS {
            let cause = format!(
                "{z} planes of {x} x {y} voxels do not fit: 65535 a side and 4 GB do; take a larger spacing"
            );
            return Err(DicomError::new(path, cause));
        }
        let [width, height, count] = self.size.map(|n| n as u32);
        let mut data = DataSet::new();
        data.common(&self.name);
        self.equipment(&mut data);
        self.reference(&mut data);
        let now = Utc::now();
        self.image(&mut data, now);
        self.groups(&mut data, now);
        data.put(tags::NUMBER_OF_FRAMES, count.to_string());
        data.pixels(&Frames { width, height, color: false }, self.voxels);
        data.write(path, uids::ENHANCED_US_VOLUME_STORAGE)
    }

    /// Transducer, and what is said of an output of sound that there is not.
    fn equipment(&self, data: &mut DataSet) {
        data.put(tags::DEVICE_SERIAL_NUMBER, "SIMULATED");
        let [geometry, steering] = self.transducer.codes();
        for (tag, code) in [
            (tags::TRANSDUCER_SCAN_PATTERN_CODE_SEQUENCE, ["125241", "Plane scan pattern"]),
            (tags::TRANSDUCER_GEOMETRY_CODE_SEQUENCE, geometry),
            (tags::TRANSDUCER_BEAM_STEERING_CODE_SEQUENCE, steering),
            (tags::TRANSDUCER_APPLICATION_CODE_SEQUENCE, ["125261", "External Transducer"]),
        ] {
            data.code(tag, "DCM", code);
        }
        for index in [
            tags::MECHANICAL_INDEX,
            tags::BONE_THERMAL_INDEX,
            tags::CRANIAL_THERMAL_INDEX,
            tags::SOFT_TISSUE_THERMAL_INDEX,
        ] {
            data.decimals(index, [0.0]);
        }
        data.doubles(tags::DEPTHS_OF_FOCUS, [self.focus]);
        data.put(tags::DEPTH_OF_SCAN_FIELD, format!("{:.0}", self.depth));
    }

    /// Frames of reference: patient, volume, time.
    fn reference(&self, data: &mut DataSet) {
        data.put(tags::FRAME_OF_REFERENCE_UID, uid());
        data.put(tags::POSITION_REFERENCE_INDICATOR, "");
        data.put(tags::VOLUME_FRAME_OF_REFERENCE_UID, uid());
        data.put(tags::ULTRASOUND_ACQUISITION_GEOMETRY, "PATIENT");
        data.put(tags::VOLUME_TO_TRANSDUCER_RELATIONSHIP, self.motion.term());
        let identity = (0..16).map(|i| if i % 5 == 0 { 1.0 } else { 0.0 });
        data.doubles(tags::VOLUME_TO_TRANSDUCER_MAPPING_MATRIX, identity);
        data.put(tags::PATIENT_FRAME_OF_REFERENCE_SOURCE, "REGISTRATION");
        data.put(tags::POSITION_MEASURING_DEVICE_USED, "RIGID");
        data.put(tags::SYNCHRONIZATION_FRAME_OF_REFERENCE_UID, uid());
        data.put(tags::SYNCHRONIZATION_TRIGGER, "NO TRIGGER");
        data.put(tags::ACQUISITION_TIME_SYNCHRONIZED, "N");
    }

    /// The image as a whole.
    fn image(&self, data: &mut DataSet, now: DateTime<Utc>) {
        data.texts(tags::IMAGE_TYPE, &TYPE);
        data.put(tags::CONTENT_DATE, now.format("%Y%m%d").to_string());
        data.put(tags::CONTENT_TIME, now.format("%H%M%S").to_string());
        data.put(tags::ACQUISITION_DATE_TIME, now.format(MOMENT).to_string());
        data.doubles(tags::ACQUISITION_DURATION, [self.duration]);
        data.items(tags::ACQUISITION_CONTEXT_SEQUENCE, []);
        data.code(tags::ANATOMIC_REGION_SEQUENCE, "SCT", ["38266002", "Entire body"]);
        data.code(tags::VIEW_CODE_SEQUENCE, "SCT", self.view());
        data.put(tags::PRESENTATION_LUT_SHAPE, "IDENTITY");
        data.decimals(tags::RESCALE_INTERCEPT, [0.0]);
        data.decimals(tags::RESCALE_SLOPE, [1.0]);
        data.put(tags::BURNED_IN_ANNOTATION, "NO");
        // One dimension: the place of a plane.
        let organization = uid();
        data.put(tags::DIMENSION_ORGANIZATION_TYPE, "3D");
        data.item(tags::DIMENSION_ORGANIZATION_SEQUENCE, |item| {
            item.put(tags::DIMENSION_ORGANIZATION_UID, organization.as_str());
        });
        data.item(tags::DIMENSION_INDEX_SEQUENCE, |item| {
            item.put(tags::DIMENSION_ORGANIZATION_UID, organization.as_str());
            item.put(tags::DIMENSION_INDEX_POINTER, tags::IMAGE_POSITION_VOLUME);
            item.put(tags::FUNCTIONAL_GROUP_POINTER, tags::PLANE_POSITION_VOLUME_SEQUENCE);
            item.put(tags::DIMENSION_DESCRIPTION_LABEL, "Plane");
        });
        // GDCM, and with it ITK and 3D Slicer, looks for the place of this class here and not in the groups.
        self.measures(data);
        data.decimals(tags::IMAGE_ORIENTATION_PATIENT, self.orientation());
        data.decimals(tags::IMAGE_POSITION_PATIENT, self.place(0).to_array());
    }

    /// Functional groups, shared and of each plane.
    fn groups(&self, data: &mut DataSet, now: DateTime<Utc>) {
        data.item(tags::SHARED_FUNCTIONAL_GROUPS_SEQUENCE, |shared| {
            shared.item(tags::PIXEL_MEASURES_SEQUENCE, |item| {
                self.measures(item);
                item.decimals(tags::SLICE_THICKNESS, [self.spacing.z]);
            });
            shared.item(tags::PLANE_ORIENTATION_VOLUME_SEQUENCE, |item| {
                item.doubles(tags::IMAGE_ORIENTATION_VOLUME, [1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
            });
            shared.item(tags::PLANE_ORIENTATION_SEQUENCE, |item| {
                item.decimals(tags::IMAGE_ORIENTATION_PATIENT, self.orientation());
            });
            shared.item(tags::US_IMAGE_DESCRIPTION_SEQUENCE, |item| {
                item.texts(tags::FRAME_TYPE, &TYPE);
                item.put(tags::VOLUMETRIC_PROPERTIES, "VOLUME");
                item.put(tags::VOLUME_BASED_CALCULATION_TECHNIQUE, "NONE");
            });
            shared.item(tags::IMAGE_DATA_TYPE_SEQUENCE, |item| {
                item.put(tags::DATA_TYPE, "TISSUE_INTENSITY");
                item.put(tags::ALIASED_DATA_TYPE, "NO");
            });
            shared.item(tags::FRAME_VOILUT_SEQUENCE, |item| {
                item.decimals(tags::WINDOW_CENTER, [128.0]);
                item.decimals(tags::WINDOW_WIDTH, [256.0]);
            });
        });
        let now = now.format(MOMENT).to_string();
        let planes = (0..self.size[2]).map(|number| {
            let mut plane = DataSet::new();
            let counted = number as u32 + 1;
            plane.item(tags::FRAME_CONTENT_SEQUENCE, |item| {
                item.put(tags::FRAME_REFERENCE_DATE_TIME, now.as_str());
                item.put(tags::FRAME_ACQUISITION_DATE_TIME, now.as_str());
                item.doubles(tags::FRAME_ACQUISITION_DURATION, [1e3 * self.duration]);
                item.put(tags::DIMENSION_INDEX_VALUES, counted);
                item.put(tags::STACK_ID, "1");
                item.put(tags::IN_STACK_POSITION_NUMBER, counted);
            });
            plane.item(tags::PLANE_POSITION_VOLUME_SEQUENCE, |item| {
                item.doubles(tags::IMAGE_POSITION_VOLUME, self.corner(number).to_array());
            });
            plane.item(tags::PLANE_POSITION_SEQUENCE, |item| {
                item.decimals(tags::IMAGE_POSITION_PATIENT, self.place(number).to_array());
            });
            plane
        });
        data.items(tags::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE, planes);
    }

    /// Distances of voxels; the first number is along a column.
    fn measures(&self, data: &mut DataSet) {
        data.decimals(tags::PIXEL_SPACING, [self.spacing.y, self.spacing.x]);
        data.decimals(tags::SPACING_BETWEEN_SLICES, [self.spacing.z]);
    }

    /// Directions of rows and columns in the patient.
    fn orientation(&self) -> [f64; 6] {
        let [x, y] = [DVec3::X, DVec3::Y]
            .map(|axis| self.patient_from_transducer.transform_vector3(axis).to_array());
        [x[0], x[1], x[2], y[0], y[1], y[2]]
    }

    /// Centre of the first voxel of a plane, in the transducer's frame.
    fn corner(&self, plane: usize) -> DVec3 {
        self.first + DVec3::Z * (plane as f64 * self.spacing.z)
    }

    /// The same in the patient.
    fn place(&self, plane: usize) -> DVec3 {
        self.patient_from_transducer.transform_point3(self.corner(plane))
    }

    /// Code and meaning of how the planes lie in the patient (PS3.16, CID 6).
    fn view(&self) -> [&'static str; 2] {
        let normal = self.patient_from_transducer.transform_vector3(DVec3::Z).abs();
        match normal.to_array().map(|cosine| cosine > ALONG) {
            [true, ..] => ["30730003", "Sagittal"],
            [_, true, _] => ["81654009", "Coronal"],
            [.., true] => ["62824007", "Transverse"],
            _ => ["21114003", "Oblique"],
        }
    }
}
