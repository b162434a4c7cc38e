//! Tests of what needs no device: readers, tables, closed forms, the sources and documents themselves.

mod common {
    pub mod limited;
    pub mod shared_data;
    pub mod signal;
    pub mod skip;
}

mod animated;
mod calibration;
mod carotid;
mod dicom;
mod docs;
mod keyframes;
mod layout;
mod plus;
mod sources;
mod spirv;
mod volumes;
