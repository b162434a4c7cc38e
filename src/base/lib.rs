//! What every part of insonify stands on, and what knows nothing of ultrasound, scenes or devices: errors about files, what is
//! written, random numbers by counters, statistics.

#![warn(missing_docs)]

pub mod issue;
pub mod output;
pub mod random;
pub mod statistics;
