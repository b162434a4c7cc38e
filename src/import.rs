//! Segmentations and meshes of others made into scenes.
//!
//! Label maps become one closed surface per label, with the same faces on both sides of a border (`grid`,
//! `composed`, `nets`, `relax`, `surface`).

pub mod composed;
pub mod grid;
pub mod nets;
pub mod raster;
pub mod relax;
pub mod surface;
#[cfg(test)]
mod tests;
