//! The motion of the heart: one beat as an analytic, invertible deformation of the shape at end
//! diastole, sampled at eight instants.
//!
//! In the ventricles a point at radius r from the left ventricle's axis and level z goes to
//!   r'^2 = (r^2 - kappa m) / lambda,   z' with dz'/dz = lambda,
//! where m is r^2 inside the cavity and the cavity's a(z)^2 in the wall: the cavity shrinks by the
//! factor 1 - kappa, and the muscle, which keeps its volume, thickens (the incompressible thick-walled
//! cylinder; Arts, Reneman and Veenstra, Ann Biomed Eng 1979). Outside the left ventricle the radius
//! shrinks towards it, so that the right one empties. The base descends to the resting apex, the
//! apex turns against the base, and the atria are drawn out and fill while the ventricles empty.
//!
//! Normal values (Lang et al., J Am Soc Echocardiogr 2015;28:1-39): left ventricle 62-150 ml at end
//! diastole, ejection fraction 52-72 %; descent of the mitral ring 12-15 mm (Hu et al., Eur Heart J
//! Cardiovasc Imaging 2013); twist about 10 degrees (Sengupta et al., JACC Cardiovasc Imaging 2008).

use glam::{DMat3, DVec2, DVec3};

use crate::check::Surface;
use crate::heart::{ATRIA, CAVITY, EQUATOR, MITRAL, WALL};

/// Length of the beat, s: 71 per minute.
pub const PERIOD: f64 = 0.85;

/// Keyframes, evenly spaced over [`PERIOD`]; the first is end diastole.
pub const KEYFRAMES: usize = 8;

/// State of the beat at a keyframe.
#[derive(Clone, Copy, Debug)]
pub struct Phase {
    /// Share of the stroke volume that has left the ventricles.
    pub ejected: f64,
    /// Share of their reservoir volume that has entered the atria.
    pub filled: f64,
    /// Opening of the valves between atria and ventricles: 0 closed, 1 open.
    pub open: f64,
}

/// The beat: ejection until 0.32 s, early filling, rest, and the atria's contraction (the volume
/// curves of the cardiac cycle, Guyton and Hall, Textbook of Medical Physiology: about 70 % of the
/// filling is early, 20-25 % the atria's).
pub fn phases() -> [Phase; KEYFRAMES] {
    [
        (0.0, 0.0, 0.0),
        (0.42, 0.45, 0.0),
        (0.86, 0.85, 0.0),
        (1.0, 1.0, 0.0),
        (0.52, 0.62, 1.0),
        (0.30, 0.45, 0.55),
        (0.25, 0.42, 0.40),
        (0.10, 0.16, 0.75),
    ]
    .map(|(ejected, filled, open)| Phase { ejected, filled, open })
}

/// Share of the cavity's section that goes at full ejection.
const KAPPA: f64 = 0.67;
/// Descent of the base at full ejection, mm.
const DESCENT: f64 = 14.0;
/// Slope by which radii outside the left ventricle shrink at full ejection, and over which length:
/// the right ventricle's cavity, but not its wall beyond.
const SQUEEZE: (f64, f64) = (0.86, 18.5);
/// Turns of the apex and of the base at full ejection, rad.
const TWIST: (f64, f64) = (0.14, -0.06);
/// Widening of the atria at full filling.
const SWELLING: f64 = 0.36;
/// Level of the outer apex, which rests, and of the atria's roof, which does too, mm.
const APEX: f64 = 23.0;
/// See [`APEX`].
const ROOF: f64 = 168.0;

fn smoothstep(from: f64, to: f64, x: f64) -> f64 {
    let u = ((x - from) / (to - from)).clamp(0.0, 1.0);
    u * u * (3.0 - 2.0 * u)
}

/// Squared radius at level `z` of an egg as [`CAVITY`] gives it; softly zero beyond its poles.
fn radius2([r, below, above]: [f64; 3], z: f64) -> f64 {
    let h = z - EQUATOR;
    let u = if h < 0.0 { h / below } else { h / above };
    let square = r * r * (1.0 - u * u);
    0.5 * (square + square.hypot(8.0))
}

/// Position at a phase, mm, of the point that is at `p` at end diastole.
pub fn deform(p: DVec3, phase: Phase) -> DVec3 {
    let p = swell(p, phase.filled);
    let q = contract(p, phase.ejected);
    let z = p.z - descend(p.z, phase.ejected);
    let angle = phase.ejected * twist(p.z);
    DVec2::from_angle(angle).rotate(q).extend(z)
}

/// Atria widen about their middles.
fn swell(p: DVec3, filled: f64) -> DVec3 {
    let mut shift = DVec2::ZERO;
    for middle in ATRIA {
        let d = p - middle.as_dvec3();
        // Half-widths over which the widening fades, mm; not beyond the valves.
        let fade = (d.truncate().length_squared() / (20.0f64 * 20.0) + (d.z / 20.0).powi(2)) * 0.5;
        shift += d.truncate() * SWELLING * filled * (-fade).exp();
    }
    p + shift.extend(0.0) * smoothstep(MITRAL - 6.0, MITRAL + 12.0, p.z)
}

/// The ventricles' contraction across the axis.
fn contract(p: DVec3, ejected: f64) -> DVec2 {
    let across = p.truncate();
    let square = across.length_squared();
    if square == 0.0 {
        return across;
    }
    let ventricles = 1.0 - smoothstep(100.0, 126.0, p.z);
    let kappa = KAPPA * ejected * ventricles;
    let lambda = 1.0 - ejected * ventricles * DESCENT / (MITRAL - APEX);
    // The lesser of r^2 and a^2, smooth; the wall loses 3 % of its volume by it, as muscle does
    // whose blood is pressed out.
    let cavity = radius2(CAVITY, p.z);
    let m = square / (1.0 + (square / cavity).powi(16)).powf(1.0 / 16.0);
    let radius = ((square - kappa * m) / lambda).sqrt();
    // Beyond the left ventricle: distance from it, softly zero within.
    let outside = 1.5 * softplus((square.sqrt() - radius2(WALL, p.z).sqrt()) / 1.5);
    let (slope, reach) = SQUEEZE;
    let right = smoothstep(30.0, 62.0, p.z) * ventricles;
    let shorter = slope * ejected * right * reach * (outside / reach).tanh();
    across * ((radius - shorter) / square.sqrt())
}

fn softplus(x: f64) -> f64 {
    if x > 30.0 { x } else { x.exp().ln_1p() }
}

/// Distance that level `z` has moved towards the apex, mm.
fn descend(z: f64, ejected: f64) -> f64 {
    let ventricles = (z - APEX) / (MITRAL - APEX);
    let atria = (ROOF - z) / (ROOF - MITRAL);
    // Rounded over a few mm where the two lines meet, and zero outside.
    let least = |a: f64, b: f64| 0.5 * (a + b - (a - b).hypot(0.12));
    let share = least(ventricles, atria);
    DESCENT * ejected * 0.5 * (share + share.hypot(0.05))
}

/// Angle about the axis at full ejection, rad.
fn twist(z: f64) -> f64 {
    let (apex, base) = TWIST;
    let u = smoothstep(APEX, MITRAL, z);
    (apex + (base - apex) * u) * (1.0 - smoothstep(MITRAL, ROOF, z))
}

/// Derivative of [`deform`] by central differences; the columns are d/dx, d/dy, d/dz.
pub fn gradient(p: DVec3, phase: Phase) -> DMat3 {
    // Positions of 100 mm to 1e-14 and a third derivative of 1e-3 / mm2: error under 1e-8.
    const H: f64 = 1e-3;
    let column = |e: DVec3| (deform(p + e * H, phase) - deform(p - e * H, phase)) / (2.0 * H);
    DMat3::from_cols(column(DVec3::X), column(DVec3::Y), column(DVec3::Z))
}

/// The surface at a phase. Fails where the deformation does not keep handedness.
pub fn at(surface: &Surface, phase: Phase) -> Result<Surface, String> {
    let mut out = surface.clone();
    for (p, n) in out.positions.iter_mut().zip(&mut out.normals) {
        let from = p.as_dvec3();
        let gradient = gradient(from, phase);
        if gradient.determinant() <= 0.05 {
            return Err(format!(
                "the deformation folds at {from}: determinant {:.3} with {phase:?}",
                gradient.determinant()
            ));
        }
        *p = deform(from, phase).as_vec3();
        let normal = gradient.inverse().transpose() * n.as_dvec3();
        *n = normal.normalize().as_vec3();
    }
    Ok(out)
}
