//! Wavefront's meshes as text.

use std::fmt::Write as _;

/// The text of a mesh below the comment `head`: every coordinate is read back to the last bit, so that what two surfaces share
/// stays the same.
pub fn text(head: &str, positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> String {
    let mut out = format!("# {head}\n");
    for [x, y, z] in positions {
        // Writing to a string cannot fail.
        let _ = writeln!(out, "v {x} {y} {z}");
    }
    for triangle in triangles {
        let [a, b, c] = triangle.map(|i| i + 1);
        let _ = writeln!(out, "f {a} {b} {c}");
    }
    out
}
