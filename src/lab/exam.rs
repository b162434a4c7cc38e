//! Examinations: what is measured in each, what follows from it, and the report. Knows no window and no Vulkan.

pub mod ecg;
pub mod obstetric;
mod packages;
mod report;
pub mod ventricle;
mod worksheet;

pub use packages::{CaliperKind, Item, Quantity, annotations, items, names};
pub use report::{Picture, Report};
pub use worksheet::{Derived, Line, Measured, Worksheet};
