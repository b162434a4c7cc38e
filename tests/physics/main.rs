//! What frames must show whatever computes them: closed forms of acoustics and image formation.
//! Each expectation is worked out in its test and takes nothing from the code under test.

mod check;
mod detection;
mod energy;
mod grain;
mod interfaces;
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
mod speckle;
mod sweep;
mod thickness;
mod timing;
