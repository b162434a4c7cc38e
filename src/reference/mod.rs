//! The f64 twin of every kernel: plain loops that share nothing with the device's code.

pub mod intersect;
