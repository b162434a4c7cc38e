// Properties of frames whatever computes them: closed forms of acoustics and image formation.
// Each expectation is worked out in its test and takes nothing from the code under test.
// tools/validate.rs includes this file: the report shows what the tests prove.

mod apertures;
mod border;
mod brightness;
mod chain;
pub mod check;
mod cole;
mod contrast;
mod convergence;
mod conversion;
mod detection;
mod determinism;
mod energy;
mod flow;
mod formation;
mod full_wave;
mod fusion;
mod fusion_shadows;
mod grain;
mod hilbert;
mod interfaces;
mod intersections;
mod invariance;
mod levels;
#[path = "../../tools/validate/page.rs"]
pub mod page;
mod paths;
mod penumbra;
mod pictures;
mod profile;
mod refraction;
mod render;
mod resolution;
mod reverberation;
mod roughness;
pub mod rows;
pub mod scenes;
mod selectors;
mod shadow;
pub mod speckle;
mod squeeze;
mod stages;
mod strips;
#[cfg(test)]
mod sweep;
mod thickness;
mod timing;
mod vessel;
