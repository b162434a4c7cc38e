//! Settings of reflection at interfaces.

use super::group;
use super::units::{LENGTH, LEVEL};

const INF: f64 = f64::INFINITY;
const OFF: f64 = f64::NEG_INFINITY;

group! {
    /// Reflection at an interface, seen from one side.
    #[derive(Copy)]
    pub struct Surface in "mesh", from files {
        /// Exponent of the micro-normals' power-cosine lobe: 0 is diffuse, `inf` a mirror.
        roughness: f64,
            Facts::number(0.0, INF).by_default("tissue")
                .label("Roughness").usual(0.0, 2000.0).off(INF, "mirror");
        /// Scale of the half-normal depth over which the interface is spread.
        thickness: f64,
            Facts::quantity(&LENGTH, 0.0, 10.0).by_default("tissue").label("Thickness").usual(0.0, 1.0);
        /// Exponent of the echo's lobe: the larger, the less returns from oblique surfaces.
        specularity: f64,
            Facts::number(0.0, 1e6).by_default("tissue").label("Specularity").usual(0.0, 50.0);
        /// Gain of this surface's echoes.
        gain: f64,
            Facts::quantity(&LEVEL, OFF, 200.0).key("surface_gain").by_default("`0 dB`")
                .label("Gain").usual(-30.0, 30.0).off(OFF, "none");
    }
}
