//! The f64 twin of every kernel of the image: plain loops that share nothing with the device's code.
//!
//! One module per kernel, with the kernel's name; what each computes is docs/kernels.md. The inputs
//! are the structures that the kernels bind ([`layout`](insonify::sim::layout)), widened to f64.

pub mod accumulator;
pub mod acoustics;
pub mod angles;
pub mod aperture;
pub mod axial;
pub mod beam;
pub mod blur;
pub mod chart;
pub mod convert;
pub mod darken;
pub mod detect;
pub mod display;
pub mod doppler;
pub mod enhance;
pub mod expect;
pub mod field;
#[cfg(test)]
mod fixture;
mod footprint;
pub mod fuse;
pub mod geometry;
mod interface;
pub mod interpolate;
pub mod intersect;
pub mod label;
pub mod lattice;
pub mod level;
pub mod mask;
pub mod origin;
mod owned;
mod path;
pub mod pyramid;
pub mod random;
pub mod refit;
pub mod scatter;
pub mod segment;
pub mod shadow;
pub mod stack;
pub mod straight;
pub mod texture;
pub mod tiles;
pub mod trace;
mod transmitted;
mod wavefront;
pub mod world;

pub use accumulator::Accumulator;
pub use owned::Owned;
pub use segment::Segment;
pub use world::World;
