//! Plane waves at a fluid-fluid interface.

use glam::DVec3;

/// Speed and impedance of a fluid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fluid {
    /// Speed of sound, mm/us.
    pub speed: f64,
    /// Characteristic impedance, MRayl.
    pub impedance: f64,
}

/// Cosine of the transmitted angle for the incident one's; none at total reflection.
/// Snell: sin t / c2 = sin i / c1.
pub fn transmitted_cosine(before: Fluid, after: Fluid, cos_i: f64) -> Option<f64> {
    let ratio = after.speed / before.speed;
    let squared = 1.0 - ratio * ratio * (1.0 - cos_i * cos_i);
    (squared > 0.0).then(|| squared.sqrt())
}

/// Signed pressure reflection coefficient (Z2 cos i - Z1 cos t) / (Z2 cos i + Z1 cos t); +1 at
/// total reflection, whose phase is not modelled.
pub fn reflection(before: Fluid, after: Fluid, cos_i: f64) -> f64 {
    match transmitted_cosine(before, after, cos_i) {
        None => 1.0,
        Some(cos_t) => {
            let (a, b) = (after.impedance * cos_i, before.impedance * cos_t);
            (a - b) / (a + b)
        }
    }
}

/// Direction `d` mirrored by the plane with unit normal `m`.
pub fn mirror(d: DVec3, m: DVec3) -> DVec3 {
    d - 2.0 * d.dot(m) * m
}

/// Unit direction behind the interface of unit normal `m` turned against `d`; none at total
/// reflection.
pub fn refract(before: Fluid, after: Fluid, d: DVec3, m: DVec3) -> Option<DVec3> {
    let cos_i = -d.dot(m);
    let cos_t = transmitted_cosine(before, after, cos_i)?;
    let ratio = after.speed / before.speed;
    Some((ratio * d + (ratio * cos_i - cos_t) * m).normalize())
}

/// Unit tangent and bitangent of `n` (Duff et al., JCGT 6(1), 2017).
fn basis(n: DVec3) -> (DVec3, DVec3) {
    let sign = 1f64.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    (
        DVec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x),
        DVec3::new(b, sign + n.y * n.y * a, -n.y),
    )
}

/// Micro-normal about `n` with density (s + 1) / (2 pi) cos^s, from two uniforms.
pub fn power_cosine(n: DVec3, roughness: f64, [u, v]: [f64; 2]) -> DVec3 {
    let cos = u.max(1.0 / 16_777_216.0).powf(1.0 / (roughness + 1.0));
    let sin = (1.0 - cos * cos).max(0.0).sqrt();
    let (tangent, bitangent) = basis(n);
    let (sin_azimuth, cos_azimuth) = (std::f64::consts::TAU * v).sin_cos();
    sin * (cos_azimuth * tangent + sin_azimuth * bitangent) + cos * n
}

#[cfg(test)]
mod tests;
