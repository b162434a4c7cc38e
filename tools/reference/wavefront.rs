//! Refraction of a beam's wavefront at a surface: by the mean slope over the wavefront's width.

use glam::DVec3;

use super::acoustics::{Fluid, refract};
use super::path::Path;
use super::world::{Crossing, World};
use insonify::sim::layout::{
    FLAG_FOOTPRINT, FLAG_WAVEFRONT, Frame, LEAST_DESCENT, LEAST_FACING, RAY_WIDTH, Row,
};

/// A surface where a path meets it. Normals are unit and turned against the path, that of the wavefront as far as
/// the triangle's is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slope {
    /// Normal of the triangle.
    pub(super) geometric: DVec3,
    /// Normal interpolated from the vertices.
    pub(super) shading: DVec3,
    /// Normal of the mean slope over the wavefront; in geometric acoustics equal to `shading`.
    pub(super) refracting: DVec3,
    /// Change of `refracting` per mm across the path, in the image plane.
    pub(super) turning: DVec3,
    /// Normal of the mean slope over what one of the aperture's rays stands for, by which it turns.
    pub(super) ray: DVec3,
    /// Deviation of sin i over the beam; 0 on flat surfaces and in geometric acoustics.
    pub(super) width: f64,
}

/// A unit vector from its projection onto an octahedron, and its coherence.
pub(super) fn unpacked(word: u32) -> (DVec3, f64) {
    let part = |from: u32| (f64::from((word << (19 - from)) as i32 >> 19) / 4095.0).max(-1.0);
    let (x, y) = (part(0), part(13));
    let z = 1.0 - x.abs() - y.abs();
    let fold = |a: f64| if a >= 0.0 { z.min(0.0) } else { -z.min(0.0) };
    (DVec3::new(x + fold(x), y + fold(y), z).normalize(), f64::from(word >> 26) / 63.0)
}

/// Mean slope, as a normal, of what a wavefront along `d` meets where the surface's normals average to `n` with a
/// `coherence` below 1: the area reaches around a rim. What faces `d` less what is turned away is the mean's part
/// along `d`. As much of the wavefront as is turned away passes the body by, and keeps its direction.
fn partly_turned(n: DVec3, coherence: f64, d: DVec3) -> DVec3 {
    let facing = -n.dot(d);
    let across = coherence * (n + facing * d);
    let whole = (1.0 - across.length_squared()).max(1e-6).sqrt();
    let met = (whole + coherence * facing).max(0.0) / 2.0;
    (met * across - whole * whole * d).normalize()
}

impl World<'_> {
    /// Normals at the corners of the triangle, averaged over a deviation of `width` mm; object space, any length; and
    /// their coherences. Between two scales they are mixed, below the finest with the vertices' own.
    fn averaged(&self, crossing: &Crossing, width: f64) -> ([DVec3; 3], [f64; 3]) {
        let own = self.corner_normals(crossing);
        let finest = f64::from(self.instances[crossing.instance as usize].finest);
        let corners = self.geometry.triangles[crossing.triangle];
        let at = |i: usize| {
            let averages = self.geometry.smoothed[corners[i] as usize].map(unpacked);
            let scales = [0.0, finest, 2.0 * finest, 4.0 * finest, 8.0 * finest];
            let means = [(own[i], 1.0), averages[0], averages[1], averages[2], averages[3]];
            let above = scales[1..4].iter().take_while(|&&s| width >= s).count();
            let share = ((width - scales[above]) / (scales[above + 1] - scales[above])).min(1.0);
            let [(fine, a), (coarse, b)] = [means[above], means[above + 1]];
            (fine.lerp(coarse, share), a + share * (b - a))
        };
        let corners = [at(0), at(1), at(2)];
        (corners.map(|(n, _)| n), corners.map(|(_, coherence)| coherence))
    }

    /// The slope at `hit`, where `path` has arrived; `row` is that of its time.
    pub(super) fn slope(&self, row: &Row, path: &Path, hit: &Crossing) -> Slope {
        let d = path.direction;
        let (outward, shading) = self.normals(hit);
        let side = if d.dot(outward) < 0.0 { 1.0 } else { -1.0 };
        let geometric = side * outward;
        let shading = if side * shading.dot(d) < 0.0 { side * shading } else { geometric };
        let spread = path.spread[0];
        let wide = self.frame.flags & FLAG_WAVEFRONT != 0;
        let (mut corners, mut refracting) = (self.corner_normals(hit), shading);
        let (mut ray, mut coherence) = (shading, 1.0);
        if wide {
            let width = f64::from(row.sigma_wavefront).hypot(spread.sqrt());
            let facing = |n: DVec3| (-d.dot(n)).max(f64::from(LEAST_FACING));
            let [u, v] = hit.uv;
            let mean = |width: f64| {
                let (corners, [a, b, c]) = self.averaged(hit, width);
                let coherence = (1.0 - u - v) * a + u * b + v * c;
                (corners, side * self.between(hit, corners), coherence)
            };
            // What a beam covers of the surface is longer the more it is inclined.
            let narrow = f64::from(row.sigma_lateral)
                .max(f64::from(RAY_WIDTH) * f64::from(row.sigma_wavefront));
            let (_, narrow, whole) = mean(narrow / facing(shading));
            ray = partly_turned(narrow, whole, d);
            let (_, upright, _) = mean(width);
            (corners, refracting, coherence) = mean(width / facing(upright));
            if coherence <= 0.99999 {
                refracting = partly_turned(refracting, coherence, d);
            }
        }
        let over = path.across_surface(refracting);
        let turning = side * coherence * self.turning(hit, corners, over);
        let mut width = 0.0;
        if self.frame.flags & FLAG_FOOTPRINT != 0 {
            // In the plane of incidence; along the image where there is none.
            let along = d - d.dot(refracting) * refracting + 0.01 * path.lateral;
            let sigma = f64::from(row.sigma_lateral).hypot(spread.sqrt());
            let curved = self.curvature(hit, corners, along) * sigma;
            let averaged_away = along.normalize().dot(shading - refracting);
            width = curved.hypot(averaged_away);
        }
        Slope { geometric, shading, refracting, turning, ray, width }
    }
}

/// The direction behind an interface of normals `n` and, of the triangle, `geometric`; none at total reflection.
pub(super) fn turned(
    frame: &Frame,
    [before, behind]: [Fluid; 2],
    d: DVec3,
    n: DVec3,
    geometric: DVec3,
) -> Option<DVec3> {
    let through = |n| refract(before, behind, d, n);
    if frame.flags & FLAG_WAVEFRONT == 0 {
        let beyond = through(n).filter(|d| d.dot(geometric) < 0.0);
        return beyond.or_else(|| through(geometric));
    }
    // Seen from behind, as a facet at the side of a bump may be, nothing is refracted.
    let beyond = if d.dot(n) < 0.0 { through(n)? } else { d };
    // A path that would leave through the triangle again runs along it.
    let rise = (beyond.dot(geometric) + f64::from(LEAST_DESCENT)).max(0.0);
    Some((beyond - rise * geometric).normalize())
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use insonify::scene::Mesh;
    use insonify::scene::smoothed::smoothed;

    /// Width of the edge's strip and reach of the plate behind it, mm.
    const REACH: f64 = 30.0;

    /// The edge of a plate 2 `radius` thick, rounded, along y at x = 0; and the columns' places along its profile,
    /// from the middle of the rim, on the upper side negative.
    fn plate(radius: f64) -> (Mesh, Vec<f64>) {
        let step = 0.5;
        let (end, rows) = (REACH + PI / 2.0 * radius, (2.0 * REACH / step) as u32);
        let columns = (2.0 * end / step) as u32;
        let arcs: Vec<f64> = (0..=columns).map(|i| f64::from(i) * step - end).collect();
        let mut mesh = Mesh::default();
        for (i, &arc) in arcs.iter().enumerate() {
            let angle = (arc / radius).clamp(-PI / 2.0, PI / 2.0);
            let flat = arc.abs() - PI / 2.0 * radius;
            let normal = DVec3::new(angle.cos(), 0.0, angle.sin());
            for j in 0..=rows {
                let y = f64::from(j) * step - REACH;
                let p = radius * (normal - DVec3::X) - flat.max(0.0) * DVec3::X + y * DVec3::Y;
                mesh.positions.push(p.as_vec3().to_array());
                mesh.normals.push(normal.as_vec3().to_array());
                let (a, b) = (i as u32 * (rows + 1) + j, (i as u32 + 1) * (rows + 1) + j);
                if i as u32 != columns && j != rows {
                    mesh.triangles.extend([[a, b, b + 1], [a, b + 1, a + 1]]);
                }
            }
        }
        (mesh, arcs)
    }

    /// Mean slope of the plate's upper side over a Gaussian window about x, of which a part lies beyond the rim.
    fn slope_of_plate(radius: f64, deviation: f64, x: f64) -> f64 {
        let height = |x: f64| {
            let over = (x + radius).clamp(0.0, radius);
            (radius * radius - over * over).sqrt()
        };
        let window = |k: i32| {
            let u = f64::from(k) * deviation / 200.0;
            ((-u * u / (2.0 * deviation * deviation)).exp(), x + u, deviation / 200.0)
        };
        let all: Vec<(f64, f64, f64)> = (-1000..1000).map(window).collect();
        let total: f64 = all.iter().map(|(w, _, _)| w).sum();
        let falls = |&(w, at, step): &(f64, f64, f64)| {
            w * (height(at - step / 2.0) - height(at + step / 2.0)) / step
        };
        all.iter().map(falls).sum::<f64>() / total
    }

    /// A beam wider than the edge of an organ is thick turns by what it meets of it, right up to the rim, where
    /// the mean of the normals alone stands across the beam.
    #[test]
    fn a_beam_over_a_rim_turns_by_what_it_meets() {
        let deviation = 4.0;
        for radius in [1.0, 2.0, 3.0] {
            let (mesh, arcs) = plate(radius);
            let words = smoothed(&mesh, deviation / 4.0);
            let mut worst = [0f64; 2];
            let rows = mesh.positions.len() / arcs.len();
            for (column, arc) in arcs.iter().enumerate().filter(|(_, arc)| **arc < 0.0) {
                let middle = column * rows + rows / 2;
                let (n, coherence) = unpacked(words[middle][2]);
                if *arc < -REACH / 1.5 {
                    continue;
                }
                let x = f64::from(mesh.positions[middle][0]);
                let expected = slope_of_plate(radius, deviation, x);
                for (worst, coherence) in worst.iter_mut().zip([coherence, 1.0]) {
                    let turned = partly_turned(n, coherence, DVec3::Z);
                    let slope = -turned.x / turned.z;
                    *worst = worst.max((slope - expected).abs());
                }
            }
            println!("radius {radius}: off by {worst:.3?}");
            assert!(worst[0] < 0.25, "{radius}: {}", worst[0]);
            assert!(worst[1] > 1.0, "{radius}: the mean normal alone does as well");
        }
    }

    #[test]
    fn surfaces_that_cover_the_beam_turn_it_whole() {
        for i in 1..90 {
            let angle = f64::from(i).to_radians();
            let n = DVec3::new(angle.sin(), 0.0, angle.cos());
            assert!(partly_turned(n, 1.0, -DVec3::Z).angle_between(n) < 1e-7, "{i}");
            let behind = partly_turned(-n, 1.0, -DVec3::Z);
            assert!(behind.angle_between(DVec3::Z) < 1e-7, "seen from behind");
        }
        assert_eq!(partly_turned(DVec3::X, 0.0, -DVec3::Z), DVec3::Z, "none of the beam");
    }
}
