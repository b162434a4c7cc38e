//! What frames must show whatever computes them: closed forms of acoustics and image formation.
//! Each expectation is worked out in its test and takes nothing from the code under test.

mod brightness;
mod check;
mod contrast;
mod convergence;
mod conversion;
mod detection;
mod determinism;
mod energy;
mod formation;
mod grain;
mod hilbert;
mod interfaces;
mod intersections;
mod invariance;
mod levels;
mod moments;
mod paths;
mod pictures;
mod profile;
mod refraction;
mod render;
mod resolution;
mod reverberation;
mod roughness;
mod rows;
mod scenes;
mod shadow;
#[path = "../common/signal.rs"]
mod signal;
mod speckle;
mod stages;
mod sweep;
mod thickness;
mod timing;
