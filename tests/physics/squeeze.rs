//! Transforms that scale along one axis: planes, their normals, and refraction at them.

use glam::{DAffine3, DVec3};
use insonify::scene::Scene;
use insonify_tools::reference::Segment;

use crate::physics::check::{Bench, Check, Outcome, Physics};
use crate::physics::interfaces::fresnel;
use crate::physics::refraction::traced;
use crate::physics::render::angle;
use crate::physics::scenes::{add_box, linear, tissue};

/// Speed mm/us and impedance MRayl before the slab and in it.
const BEFORE: [f64; 2] = [1.44, 1.34];
const SLAB: [f64; 2] = [1.58, 1.65];
/// Depth of its front on the axis, mm.
const FRONT: f64 = 40.0;

/// Check T31.
pub fn a_squeezed_slab_is_met_and_refracts_at_its_squeezed_planes() -> Check {
    Check {
        row: "T31",
        name: "a_squeezed_slab_is_met_and_refracts_at_its_squeezed_planes",
        claim: "A slab tilted by 15 or 40 degrees and then scaled along the depth axis by s, in a transform above \
            its own, is a slab tilted by t with tan t = s tan(tilt): scanline x meets it at 40 - x tan t mm after \
            that over the speed of sound, is refracted by Snell's law at t and keeps what Fresnel's lets through \
            there. s = 0.5, 1.6; within 1e-5 of times, 1e-4 rad, 1e-4 of the weight.",
        planted: "Normals that are scaled as points are, instead of by the inverse: tan t = tan(tilt) / s.",
        run: slab,
    }
}

/// Scanlines that meet the slab tilted by `tilt` rad and then scaled along z about its front's middle.
fn scene(tilt: f64, scale: f64) -> Scene {
    let mut scene = linear(9, 24.0, tissue(BEFORE[0], BEFORE[1], 0.0));
    let at = DAffine3::from_translation(DVec3::new(0.0, 0.0, FRONT))
        * DAffine3::from_scale(DVec3::new(1.0, 1.0, scale))
        * DAffine3::from_rotation_y(tilt)
        * DAffine3::from_translation(DVec3::new(3.1, 5.3, 0.0));
    add_box(&mut scene, [900.0; 3], tissue(SLAB[0], SLAB[1], 0.0), at);
    scene
}

fn slab(bench: &Bench, physics: Physics) -> Outcome {
    let mut out = Outcome::default();
    for tilt in [15.0_f64, 40.0].map(f64::to_radians) {
        for scale in [0.5, 1.6] {
            let scene = scene(tilt, scale);
            // The plane through (0, FRONT), and its normal, which the planted error changes.
            let slope = scale * tilt.tan();
            let normal = match physics {
                Physics::Right => slope.atan(),
                Physics::Planted => (tilt.tan() / scale).atan(),
            };
            for (name, lines) in traced(bench, &scene) {
                let [mut time, mut other, mut turned, mut weight] = [0.0_f64; 4];
                for (l, line) in lines.iter().enumerate() {
                    let into = line.iter().find(|s: &&Segment| s.instance == 0);
                    let into = into.unwrap_or_else(|| panic!("{name}: line {l} meets the slab"));
                    let x = scene.probe.ray(l as u32, 0).0.x;
                    let arrival = (FRONT - x * slope) / BEFORE[0];
                    time = time.max((into.time / arrival - 1.0).abs());
                    let inverse = (FRONT - x * tilt.tan() / scale) / BEFORE[0];
                    other = other.max((into.time / inverse - 1.0).abs());
                    let refracted = (SLAB[0] / BEFORE[0] * normal.sin()).asin();
                    turned = turned.max((angle(into.direction) - (normal - refracted)).abs());
                    let through = fresnel(BEFORE, SLAB, normal);
                    weight = weight.max((into.weight / through - 1.0).abs());
                }
                let what = format!("{name}, {:.0} degrees times {scale}", tilt.to_degrees());
                out.compare(format!("{what}: time, relative"), time, 0.0, 1e-5)
                    .unlike("points that are scaled by the inverse", other);
                out.compare(format!("{what}: direction, rad"), turned, 0.0, 1e-4);
                out.compare(format!("{what}: weight, relative"), weight, 0.0, 1e-4);
            }
        }
    }
    out
}
