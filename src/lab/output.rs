//! Output of the program: lines to standard output and standard error and the formats of arrays and pictures
//! (`insonify-base`), and formats of the field.

pub use insonify_base::output::*;

pub mod dicom;
pub mod film;
pub mod movie;
pub mod mp4;
pub mod naming;
pub mod obj;
pub mod plot;
pub mod uff;
pub mod zea;
