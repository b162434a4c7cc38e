//! The arrays that the processor gives to the kernels of a frame.

use super::super::layout::{
    Counters, Frame, Instance, POINT_GROUP, Row, Scanline, Surface, Tissue,
};
use super::super::pass::Array;
use crate::output::npy::Element::{Float, Word};

/// The frame's constants, the scene's tables, the contact of the probe; and the counters, to which every
/// kernel may add.
pub static INPUTS: [Array; 9] = [
    Array::of::<Frame>("frame", Word, |_| 1),
    Array::of::<Scanline>("scanlines", Float, |s| u64::from(s.frame.face_lines()) + 1),
    Array::of::<Row>("rows", Float, |s| s.frame.samples.into()),
    Array::of::<Tissue>("tissues", Word, |s| s.tissues),
    // Two sides of every instance.
    Array::of::<Surface>("surfaces", Float, |s| 2 * u64::from(s.frame.instances)),
    // Points, and the spheres around groups of them.
    Array::new("points", Float, 4, |s| {
        u64::from(s.frame.points) + u64::from(s.frame.points.div_ceil(POINT_GROUP))
    }),
    Array::new("grey", Word, 1, |_| 256),
    Array::new("contact", Float, 1, |s| 2 * u64::from(s.frame.face_lines()) + 1),
    Array::of::<Counters>("counters", Word, |_| 1).zeroed(),
];

/// The anatomy, held by [`super::super::World`].
pub static ANATOMY: [Array; 9] = [
    Array::anatomy("instances", Word, size_of::<Instance>() / 4),
    Array::anatomy("vertices", Float, 3),
    Array::anatomy("normals", Float, 3),
    Array::anatomy("smoothed", Word, 4),
    Array::anatomy("triangles", Word, 3),
    Array::anatomy("nodes", Word, 20),
    Array::anatomy("fields", Float, 4),
    // Those of the last frame.
    Array::anatomy("instances_before", Word, size_of::<Instance>() / 4),
    Array::anatomy("fields_before", Float, 4),
];
