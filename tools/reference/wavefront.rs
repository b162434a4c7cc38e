//! Refraction of a beam's wavefront at a surface: by the mean slope over the wavefront's width.

use glam::DVec3;

use super::acoustics::{Fluid, refract};
use super::path::Path;
use super::world::{Crossing, World};
use insonify::sim::layout::{
    FLAG_FOOTPRINT, FLAG_WAVEFRONT, Frame, LEAST_DESCENT, LEAST_FACING, Row,
};

/// A surface where a path meets it. Normals are unit and turned against the path, that of the wavefront as far as
/// the triangle's is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slope {
    /// Normal of the triangle.
    pub(super) geometric: DVec3,
    /// Normal interpolated from the vertices.
    pub(super) shading: DVec3,
    /// Normal averaged over the wavefront; in geometric acoustics equal to `shading`.
    pub(super) refracting: DVec3,
    /// Deviation of sin i over the beam; 0 on flat surfaces and in geometric acoustics.
    pub(super) width: f64,
}

/// A unit vector from its projection onto an octahedron.
pub(super) fn unpacked(word: u32) -> DVec3 {
    let part = |half: u32| (f64::from(half as u16 as i16) / 32_767.0).max(-1.0);
    let (x, y) = (part(word & 0xffff), part(word >> 16));
    let z = 1.0 - x.abs() - y.abs();
    let fold = |a: f64| if a >= 0.0 { z.min(0.0) } else { -z.min(0.0) };
    DVec3::new(x + fold(x), y + fold(y), z).normalize()
}

impl World<'_> {
    /// Normals at the corners of the triangle, averaged over a deviation of `width` mm; object space, any length.
    /// Between two scales they are mixed, below the finest with the vertices' own.
    fn averaged(&self, crossing: &Crossing, width: f64) -> [DVec3; 3] {
        let own = self.corner_normals(crossing);
        let finest = f64::from(self.instances[crossing.instance as usize].finest);
        let corners = self.geometry.triangles[crossing.triangle];
        std::array::from_fn(|i| {
            let averages = self.geometry.smoothed[corners[i] as usize].map(unpacked);
            let scales = [0.0, finest, 2.0 * finest, 4.0 * finest, 8.0 * finest];
            let normals = [own[i], averages[0], averages[1], averages[2], averages[3]];
            let above = scales[1..4].iter().take_while(|&&s| width >= s).count();
            let share = (width - scales[above]) / (scales[above + 1] - scales[above]);
            normals[above].lerp(normals[above + 1], share.min(1.0))
        })
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
        if wide {
            let width = f64::from(row.sigma_wavefront).hypot(spread.sqrt());
            let upright = side * self.between(hit, self.averaged(hit, width));
            // What the wavefront covers of the surface is longer the more it is inclined.
            let facing = (-d.dot(upright)).max(f64::from(LEAST_FACING));
            corners = self.averaged(hit, width / facing);
            refracting = side * self.between(hit, corners);
        }
        let mut width = 0.0;
        if self.frame.flags & FLAG_FOOTPRINT != 0 {
            // In the plane of incidence; along the image where there is none.
            let along = d - d.dot(refracting) * refracting + 0.01 * path.lateral;
            let sigma = f64::from(row.sigma_lateral).hypot(spread.sqrt());
            let curved = self.curvature(hit, corners, along) * sigma;
            let averaged_away = along.normalize().dot(shading - refracting);
            width = curved.hypot(averaged_away);
        }
        Slope { geometric, shading, refracting, width }
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
    // Where the mean surface is edge on or seen from behind, as at the side of a bump, nothing is refracted.
    let beyond = if d.dot(n) < 0.0 { through(n)? } else { d };
    // A path that would leave through the triangle again runs along it.
    let rise = (beyond.dot(geometric) + f64::from(LEAST_DESCENT)).max(0.0);
    Some((beyond - rise * geometric).normalize())
}
