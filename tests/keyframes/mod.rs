//! Shapes over time: files that are keyframes, and the animations of glTF files, against an evaluation
//! of their own in double precision.

mod compare;
mod document;
mod gltf;
mod heart;
mod made;
mod mistakes;
mod pose;
mod scene;
