//! Checks of every mesh before it is written: closed, manifold, outward, without triangles of zero
//! area.

use std::collections::HashMap;

use glam::{DVec3, Vec3};

/// Vertices, mm, and counter-clockwise triangles.
#[derive(Clone, Debug, Default)]
pub struct Surface {
    /// Positions, mm.
    pub positions: Vec<Vec3>,
    /// Unit outward normals, one per vertex.
    pub normals: Vec<Vec3>,
    /// Vertex indices.
    pub triangles: Vec<[u32; 3]>,
}

/// Reason for which a mesh must not be written.
#[derive(Debug, PartialEq, thiserror::Error)]
pub enum Defect {
    /// No surface at all.
    #[error("no triangles: the field has no zero set within the scene's box")]
    Empty,
    /// An edge with one triangle only.
    #[error("{0} open edges")]
    Open(usize),
    /// An edge with more than two triangles, or with two that run the same way along it.
    #[error("{0} edges that are shared by more than two triangles or wound inconsistently")]
    Edges(usize),
    /// A vertex whose triangles form more than one fan.
    #[error("{0} vertices where the surface touches itself")]
    Pinched(usize),
    /// Signed volume not positive, mm3.
    #[error("signed volume {0:.3} mm3: the triangles face inwards")]
    Inverted(f64),
    /// Triangles of no area, which have no normal.
    #[error("{0} triangles without area")]
    Degenerate(usize),
}

/// Smallest doubled area of a triangle, mm2. Coordinates are written to 1 um, so that a triangle
/// below (1 um)2 may be lost in writing.
const MIN_DOUBLE_AREA: f32 = 1e-6;

/// Signed volume by the divergence theorem, mm3.
pub fn volume(surface: &Surface) -> f64 {
    let p = |i: u32| -> DVec3 { surface.positions[i as usize].as_dvec3() };
    let six: f64 = surface.triangles.iter().map(|&[a, b, c]| p(a).dot(p(b).cross(p(c)))).sum();
    six / 6.0
}

/// Area, mm2.
pub fn area(surface: &Surface) -> f64 {
    let double = |t: &[u32; 3]| f64::from(double_area_vector(surface, t).length());
    surface.triangles.iter().map(double).sum::<f64>() / 2.0
}

/// Twice the area times the unit normal of a triangle.
pub fn double_area_vector(surface: &Surface, t: &[u32; 3]) -> Vec3 {
    let [a, b, c] = t.map(|i| surface.positions[i as usize]);
    (b - a).cross(c - a)
}

/// Runs all checks; returns the first defect found.
pub fn check(surface: &Surface) -> Result<(), Defect> {
    if surface.triangles.is_empty() {
        return Err(Defect::Empty);
    }
    // Directed edges: each must occur once, and its reverse once.
    let mut directed: HashMap<(u32, u32), u32> = HashMap::new();
    for &[a, b, c] in &surface.triangles {
        for edge in [(a, b), (b, c), (c, a)] {
            *directed.entry(edge).or_default() += 1;
        }
    }
    let repeated = directed.values().filter(|&&n| n > 1).count();
    if repeated > 0 {
        return Err(Defect::Edges(repeated));
    }
    let open = directed.keys().filter(|(a, b)| !directed.contains_key(&(*b, *a))).count();
    if open > 0 {
        return Err(Defect::Open(open));
    }
    let pinched = pinched_vertices(surface);
    if pinched > 0 {
        return Err(Defect::Pinched(pinched));
    }
    let thin = |t: &&[u32; 3]| double_area_vector(surface, t).length() < MIN_DOUBLE_AREA;
    let degenerate = surface.triangles.iter().filter(thin).count();
    if degenerate > 0 {
        return Err(Defect::Degenerate(degenerate));
    }
    let volume = volume(surface);
    if volume <= 0.0 {
        return Err(Defect::Inverted(volume));
    }
    Ok(())
}

/// Vertices whose triangles do not form a single closed fan.
fn pinched_vertices(surface: &Surface) -> usize {
    // For vertex v the triangle (v, a, b) leads from a to b; one fan visits all of them.
    let mut fans: Vec<Vec<(u32, u32)>> = vec![Vec::new(); surface.positions.len()];
    for &[a, b, c] in &surface.triangles {
        fans[a as usize].push((b, c));
        fans[b as usize].push((c, a));
        fans[c as usize].push((a, b));
    }
    fans.iter().filter(|fan| !is_single_fan(fan)).count()
}

fn is_single_fan(fan: &[(u32, u32)]) -> bool {
    let Some(&(start, mut at)) = fan.first() else {
        return true;
    };
    let mut steps = 1;
    while at != start && steps <= fan.len() {
        let Some(&(_, next)) = fan.iter().find(|(a, _)| *a == at) else {
            return false;
        };
        at = next;
        steps += 1;
    }
    steps == fan.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tetrahedron() -> Surface {
        Surface {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z],
            normals: vec![Vec3::Z; 4],
            triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
        }
    }

    #[test]
    fn a_tetrahedron_passes() {
        assert_eq!(check(&tetrahedron()), Ok(()));
        // A corner of the unit cube: 1/6; rounding of f32 coordinates is far below 1e-6.
        assert!((volume(&tetrahedron()) - 1.0 / 6.0).abs() < 1e-6);
    }

    #[test]
    fn planted_defects_are_found() {
        let mut open = tetrahedron();
        open.triangles.pop();
        assert_eq!(check(&open), Err(Defect::Open(3)));

        let mut flipped = tetrahedron();
        flipped.triangles[0] = [0, 1, 2];
        assert_eq!(check(&flipped), Err(Defect::Edges(3)));

        let mut inverted = tetrahedron();
        for t in &mut inverted.triangles {
            t.swap(0, 1);
        }
        assert!(matches!(check(&inverted), Err(Defect::Inverted(_))));

        let mut flat = tetrahedron();
        flat.positions[3] = flat.positions[0];
        assert_eq!(check(&flat), Err(Defect::Degenerate(2)));

        // A second tetrahedron, point-mirrored, hangs on vertex 0 of the first.
        let mut pinched = tetrahedron();
        pinched.positions.extend([Vec3::X, Vec3::Y, Vec3::Z].map(|v| -v));
        let mirrored = |i: u32| if i == 0 { 0 } else { i + 3 };
        for t in tetrahedron().triangles {
            let [a, b, c] = t.map(mirrored);
            pinched.triangles.push([a, c, b]);
        }
        assert_eq!(check(&pinched), Err(Defect::Pinched(1)));

        assert_eq!(check(&Surface::default()), Err(Defect::Empty));
    }
}
