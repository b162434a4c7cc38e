//! The valves between atria and ventricles: a skirt of two leaflets that hangs from the ring.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

use crate::beat::Phase;
use crate::check::Surface;
use crate::heart::{MITRAL, ORIFICE, TRICUSPID, TRICUSPID_CENTRE};

/// A valve at end diastole, before the beat moves its ring.
#[derive(Clone, Copy)]
pub struct Valve {
    /// Middle of the ring, mm.
    centre: DVec3,
    /// Radius at which the leaflets are rooted: just inside the muscle around the opening, mm.
    radius: f64,
    /// Distance of the middles of the meeting leaflets from the plane between them, open, mm.
    gape: f64,
}

/// The mitral valve.
pub fn mitral() -> Valve {
    Valve { centre: DVec3::new(0.0, 0.0, MITRAL), radius: ORIFICE[0] + 1.0, gape: 10.5 }
}

/// The tricuspid valve, drawn with two leaflets: the view shows no more.
pub fn tricuspid() -> Valve {
    Valve { centre: TRICUSPID_CENTRE.extend(TRICUSPID), radius: ORIFICE[1] + 1.0, gape: 9.5 }
}

/// Thickness of a leaflet, mm (normal: under 4 mm at the tip, 1-2 mm in the body).
const THICKNESS: f64 = 1.5;
/// Half of the gap that is left between closed leaflets, mm: they must not pass through each other.
const GAP: f64 = 1.3;
/// Leaflet length over the distance that it has to bridge: closed leaflets tent into the ventricle.
const SLACK: f64 = 1.12;
/// Half-width of the line of closure along y over the ring's radius.
const CLOSURE: f64 = 0.62;

impl Valve {
    /// Middle surface at angle `a` about the ring and share `s` from the hinge to the free edge.
    fn middle(&self, a: f64, s: f64, open: f64) -> DVec3 {
        let (sin, cos) = a.sin_cos();
        let hinge = DVec2::new(cos, sin) * self.radius;
        let edge = |half: f64| DVec2::new(half * cos, self.radius * CLOSURE * sin);
        let length = SLACK * hinge.distance(edge(GAP));
        let free = edge(GAP + (self.gape - GAP) * open);
        let drop = (length * length - hinge.distance_squared(free)).sqrt();
        // Closed leaflets belly towards the atrium, open ones towards the wall.
        let belly = 4.0 * s * (1.0 - s);
        let at = hinge.lerp(free, s) + hinge * (0.06 * belly * open);
        self.centre + at.extend(-drop * s + 1.1 * belly * (1.0 - open))
    }

    /// The leaflets' closed surface: `around` columns, `along` rows of quadrilaterals on each face.
    pub fn leaflets(&self, phase: Phase, around: usize, along: usize) -> Surface {
        let ring = 2 * (along + 1);
        let mut out = Surface::default();
        for i in 0..around {
            let a = TAU * (i as f64 + 0.5) / around as f64;
            for j in 0..ring {
                // Down the ventricle's face, back up the atrium's.
                let (row, side) = match j <= along {
                    true => (j, -1.0),
                    false => (ring - 1 - j, 1.0),
                };
                let s = row as f64 / along as f64;
                let at = |a: f64, s: f64| self.middle(a, s, phase.open);
                const H: f64 = 1e-4;
                let (da, ds) = (at(a + H, s) - at(a - H, s), at(a, s + H) - at(a, s - H));
                // Upwards on the hanging skirt's inner face: towards the atrium.
                let normal = ds.cross(da).normalize();
                let up = if normal.dot(DVec3::Z + DVec3::new(-a.cos(), -a.sin(), 0.0)) < 0.0 {
                    -normal
                } else {
                    normal
                };
                // Thinner towards the free edge.
                let half = 0.5 * THICKNESS * (1.0 - 0.3 * s);
                out.positions.push((at(a, s) + up * (side * half)).as_vec3());
                out.normals.push((up * side).as_vec3());
            }
        }
        let index = |i: usize, j: usize| ((i % around) * ring + j % ring) as u32;
        for i in 0..around {
            for j in 0..ring {
                let [a, b] = [index(i, j), index(i + 1, j)];
                let [d, c] = [index(i, j + 1), index(i + 1, j + 1)];
                out.triangles.extend([[a, c, b], [a, d, c]]);
            }
        }
        out
    }
}
