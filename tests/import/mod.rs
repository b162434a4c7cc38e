//! `insonify import` as a user runs it, of everything that it takes.

use std::fmt::Write as _;

use glam::DVec3;
use insonify::scene::Mesh;

mod dicom;
mod folders;
mod label_maps;
mod masks;
mod numbers;
mod plus;
mod segments;

/// A mesh as the text of an OBJ file, moved.
fn obj(mesh: &Mesh, shift: DVec3) -> String {
    let mut out = String::new();
    for p in &mesh.positions {
        let p = DVec3::from(p.map(f64::from)) + shift;
        writeln!(out, "v {} {} {}", p.x, p.y, p.z).expect("text");
    }
    for [a, b, c] in &mesh.triangles {
        writeln!(out, "f {} {} {}", a + 1, b + 1, c + 1).expect("text");
    }
    out
}
