//! The arrays that the processor gives to the kernels of a frame.

use super::super::layout::{
    Counters, Frame, Instance, POINT_GROUP, Row, Scanline, Surface, Tissue,
};
use super::super::pass::Array;
use crate::output::npy::Element::{Float, Word};

/// The frame's constants.
pub const FRAME: Array = Array::of::<Frame>("frame", Word, |_| 1);
/// Origin and direction of each scanline of the face.
pub const SCANLINES: Array =
    Array::of::<Scanline>("scanlines", Float, |s| u64::from(s.frame.face_lines()) + 1);
/// Widths, gains, and scales of the fixed-point sums at each depth.
pub const ROWS: Array = Array::of::<Row>("rows", Float, |s| s.frame.samples.into());
/// The scene's tissues.
pub const TISSUES: Array = Array::of::<Tissue>("tissues", Word, |s| s.tissues);
/// Two sides of every instance.
pub const SURFACES: Array =
    Array::of::<Surface>("surfaces", Float, |s| 2 * u64::from(s.frame.instances));
/// Points, and the spheres around groups of them.
pub const POINTS: Array = Array::new("points", Float, 4, |s| {
    u64::from(s.frame.points) + u64::from(s.frame.points.div_ceil(POINT_GROUP))
});
/// Grey of each displayed level.
pub const GREY: Array = Array::new("grey", Word, 1, |_| 256);
/// Contact of the face with the skin, at each scanline and summed.
pub const CONTACT: Array =
    Array::new("contact", Float, 1, |s| 2 * u64::from(s.frame.face_lines()) + 1);
/// Counters, to which every kernel may add.
pub const COUNTERS: Array = Array::of::<Counters>("counters", Word, |_| 1).zeroed();
/// Placements of the meshes.
pub const INSTANCES: Array = Array::given("instances", Word, size_of::<Instance>() / 4);
/// Vertices of all meshes, mm.
pub const VERTICES: Array = Array::given("vertices", Float, 3);
/// Normals of all vertices.
pub const NORMALS: Array = Array::given("normals", Float, 3);
/// Averages of the normals around each vertex, with their coherence.
pub const SMOOTHED: Array = Array::given("smoothed", Word, 4);
/// Three indices into the vertices per triangle.
pub const TRIANGLES: Array = Array::given("triangles", Word, 3);
/// Nodes of the structure that the tracer walks.
pub const NODES: Array = Array::given("nodes", Word, 20);
/// Displacement fields of deforming tissue.
pub const FIELDS: Array = Array::given("fields", Float, 4);
/// Placements of the last frame.
pub const INSTANCES_BEFORE: Array =
    Array::given("instances_before", Word, size_of::<Instance>() / 4);
/// Displacement fields of the last frame.
pub const FIELDS_BEFORE: Array = Array::given("fields_before", Float, 4);

/// The frame's constants, the scene's tables, the contact of the probe; and the counters, to which every
/// kernel may add.
pub static INPUTS: [&Array; 9] =
    [&FRAME, &SCANLINES, &ROWS, &TISSUES, &SURFACES, &POINTS, &GREY, &CONTACT, &COUNTERS];

/// The anatomy, held by [`super::super::World`].
pub static ANATOMY: [&Array; 9] = [
    &INSTANCES,
    &VERTICES,
    &NORMALS,
    &SMOOTHED,
    &TRIANGLES,
    &NODES,
    &FIELDS,
    &INSTANCES_BEFORE,
    &FIELDS_BEFORE,
];
