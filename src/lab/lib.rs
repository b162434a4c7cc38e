//! Data sets, sweeps, examinations, studies, teaching, fitting and registration to acquired volumes, segmentations made into
//! scenes, files and links of others: what is done with images and scenes beside looking at them. It knows no window.

#![warn(missing_docs)]

use insonify_base::{issue, random, statistics};
use insonify_gpu as gpu;
use insonify_scene::{probe, scene, settings, volume};
use insonify_sim as sim;

pub mod acquire;
pub mod dataset;
pub mod doppler;
pub mod exam;
pub mod exchange;
pub mod igtl;
pub mod import;
pub mod matching;
pub mod output;
pub mod register;
pub mod strain;
pub mod study;
pub mod teach;

// Tests here skip as those in tests/ do.
#[cfg(test)]
#[path = "../../tests/common/skip.rs"]
mod skip;
