//! Errors about files, what is written, random numbers by counters, statistics: what every part of insonify stands on. It knows
//! nothing of ultrasound, scenes or devices.

#![warn(missing_docs)]

pub mod issue;
pub mod output;
pub mod random;
pub mod statistics;
