//! What frames must show whatever computes them: closed forms of acoustics and image formation.
//! Each expectation is worked out in its test and takes nothing from the code under test.

mod check;
mod detection;
mod grain;
mod interfaces;
mod levels;
mod moments;
mod pictures;
mod paths;
mod profile;
mod refraction;
mod render;
mod resolution;
mod reverberation;
mod rows;
mod scenes;
mod speckle;
mod sweep;
mod timing;
