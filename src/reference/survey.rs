//! Twin of `survey`: the anatomy as an eye sees it, with the probe and the B-mode image in it.

use glam::{DVec2, DVec3, Vec4};

use super::world::{World, affine};
use crate::sim::layout::{KIND_CONVEX, SURVEY_CUT, SURVEY_IMAGE, Survey};

/// Surfaces that a ray goes through at most.
const LAYERS: usize = 24;
/// What shows less than this is not looked for.
const LEAST: f64 = 0.01;
/// Surfaces closer together than this, mm, are one.
const SAME: f64 = 1e-3;

/// What the kernel reads.
pub struct View<'a> {
    /// Anatomy and probe.
    pub world: World<'a>,
    /// From where it is seen.
    pub survey: &'a Survey,
    /// Colour and opacity of each instance.
    pub looks: &'a [[f32; 4]],
    /// The B-mode image, as `display` leaves it.
    pub pixels: &'a [u32],
}

/// The part of a ray that is not hidden yet.
struct Seen {
    colour: DVec3,
    clear: f64,
}

impl Seen {
    fn lay(&mut self, colour: DVec3, opacity: f64) {
        self.colour += self.clear * opacity * colour;
        self.clear *= 1.0 - opacity;
    }
}

fn xyz(v: [f32; 4]) -> DVec3 {
    Vec4::from(v).truncate().as_dvec3()
}

impl View<'_> {
    /// Red, green and blue, 0..1, at a place of the picture: pixels from its upper left corner.
    pub fn colour(&self, place: DVec2) -> DVec3 {
        let s = self.survey;
        let (width, height) = (f64::from(s.width), f64::from(s.height));
        let share = place.y / height;
        let (top, bottom) = (DVec3::new(0.075, 0.085, 0.1), DVec3::new(0.02, 0.022, 0.027));
        let background = top + share * (bottom - top);
        let eye = xyz(s.eye);
        let along = xyz(s.forward)
            + (place.x - width / 2.0) * xyz(s.right)
            + (place.y - height / 2.0) * xyz(s.down);
        if !eye.is_finite() || !along.is_finite() {
            return background;
        }
        let wide = xyz(s.right).length() / along.length();
        let seen = self.look(eye, along.normalize(), wide, background);
        seen.clamp(DVec3::ZERO, DVec3::ONE)
    }

    fn look(&self, o: DVec3, d: DVec3, wide: f64, background: DVec3) -> DVec3 {
        let probe_from_world = affine(&self.world.frame.probe_from_world);
        let from = probe_from_world.transform_point3(o);
        let to = probe_from_world.transform_vector3(d);
        let plane = if from.y * to.y < 0.0 { -from.y / to.y } else { f64::INFINITY };
        let cut = self.survey.flags & SURVEY_CUT != 0;
        let begin = if cut { plane } else { 0.0 };
        let (mut end, mut last) = (f64::INFINITY, background);
        if self.survey.flags & SURVEY_IMAGE != 0
            && plane.is_finite()
            && let Some(level) = self.image(from + plane * to, plane * wide)
        {
            (end, last) = (plane, DVec3::splat(level));
        }
        if let Some((t, normal, colour)) = self.probe(from, to)
            && t < end
        {
            let turn = affine(&self.world.frame.world_from_probe);
            (end, last) = (t, self.lit(colour, turn.transform_vector3(normal), d));
        }
        let mut seen = Seen { colour: DVec3::ZERO, clear: 1.0 };
        if begin < end {
            self.anatomy(o, d, [begin, end], cut, &mut seen);
        }
        seen.lay(last, 1.0);
        seen.colour
    }

    fn anatomy(&self, o: DVec3, d: DVec3, [begin, end]: [f64; 2], cut: bool, seen: &mut Seen) {
        let mut crossings = self.world.crossings(o, d, [begin, f64::INFINITY]);
        crossings.retain(|c| self.looks[c.instance as usize][3] > 0.0);
        if cut && let Some(filled) = self.filling(&crossings) {
            let look = self.looks[filled as usize];
            let opacity = match f64::from(look[3]) {
                full if full >= 1.0 => 1.0,
                opacity => 0.7 * opacity,
            };
            seen.lay(0.85 * xyz(look), opacity);
        }
        let (mut last, mut layers) = (f64::NEG_INFINITY, 0);
        for c in crossings.iter().filter(|c| c.t < end) {
            if layers == LAYERS || seen.clear <= LEAST {
                return;
            }
            if c.t - last < SAME {
                continue;
            }
            (last, layers) = (c.t, layers + 1);
            let (geometric, shading) = self.world.normals(c);
            let n = if shading.is_finite() { shading } else { geometric };
            let look = self.looks[c.instance as usize];
            let own = f64::from(look[3]);
            let rim = 0.75 * (1.0 - n.dot(d).abs()).powi(3);
            let opacity = if own >= 1.0 { 1.0 } else { own + (1.0 - own) * rim };
            seen.lay(self.lit(xyz(look), n, d), opacity);
        }
    }

    /// The instance that fills the point before `crossings`, those of a ray from there: of those that
    /// it leaves before it enters them, the highest in priority, and of equals the one left first.
    fn filling(&self, crossings: &[super::world::Crossing]) -> Option<u32> {
        let mut met = std::collections::BTreeSet::new();
        let mut found: Option<u32> = None;
        let priority = |i: u32| self.world.instances[i as usize].priority;
        for c in crossings {
            if met.insert(c.instance) && !c.entry {
                let higher = found.is_none_or(|f| priority(c.instance) > priority(f));
                found = if higher { Some(c.instance) } else { found };
            }
        }
        found
    }

    /// A light at the eye, one from above its left, and its gloss; both sides of a surface alike.
    fn lit(&self, base: DVec3, n: DVec3, d: DVec3) -> DVec3 {
        let n = -n * n.dot(d).signum();
        let s = self.survey;
        let (right, down) = (xyz(s.right).normalize(), xyz(s.down).normalize());
        let key = (-xyz(s.forward) - 0.45 * right - 0.7 * down).normalize();
        let half = (key - d).normalize();
        let level = 0.16 - 0.5 * n.dot(d) + 0.42 * n.dot(key).max(0.0);
        base * level + DVec3::splat(0.14 * n.dot(half).max(0.0).powi(16))
    }

    /// Grey level (0..1) of pixel (i, j); none outside the sector.
    fn grey(&self, i: f64, j: f64) -> Option<f64> {
        let [width, height] = [self.world.frame.image_width, self.world.frame.image_height];
        let inside = (0.0..f64::from(width)).contains(&i) && (0.0..f64::from(height)).contains(&j);
        let pixel = inside.then(|| self.pixels[j as usize * width as usize + i as usize])?;
        (pixel >> 24 != 0).then(|| f64::from(pixel & 0xff) / 255.0)
    }

    /// The B-mode image at a point of its plane, averaged over a square of `wide` mm: bilinear at
    /// one to four places across it.
    fn image(&self, point: DVec3, wide: f64) -> Option<f64> {
        let frame = self.world.frame;
        let pitch = f64::from(frame.pixel_pitch);
        let x = (point.x - f64::from(frame.image_left)) / pitch;
        let z = (point.z - f64::from(frame.image_top)) / pitch;
        self.grey(x.floor(), z.floor())?;
        let wide = wide / pitch;
        let taps = wide.ceil().clamp(1.0, 4.0);
        let (mut sum, mut weight) = (0.0, 0.0);
        for tap in 0..(taps * taps) as u32 {
            let tap = f64::from(tap);
            let off = |k: f64| ((k + 0.5) / taps - 0.5) * wide - 0.5;
            let (u, v) = (x + off(tap % taps), z + off((tap / taps).floor()));
            for corner in [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]] {
                let share = |at: f64, far: f64| {
                    let part = at - at.floor();
                    if far == 1.0 { part } else { 1.0 - part }
                };
                let share = share(u, corner[0]) * share(v, corner[1]);
                if let Some(level) = self.grey(u.floor() + corner[0], v.floor() + corner[1]) {
                    sum += share * level;
                    weight += share;
                }
            }
        }
        Some(sum / weight.max(1e-6))
    }

    /// Where a ray of the probe's space enters its housing: distance, normal, colour.
    fn probe(&self, from: DVec3, to: DVec3) -> Option<(f64, DVec3, DVec3)> {
        let [half_width, half_thickness, head, whole] = self.survey.housing.map(f64::from);
        let slab =
            |axis: DVec3, low: f64, high: f64| [Side::Plane(axis, high), Side::Plane(-axis, -low)];
        let mut sides = Vec::new();
        sides.extend(slab(DVec3::X, -half_width, half_width));
        sides.extend(slab(DVec3::Y, -half_thickness, half_thickness));
        sides.extend(slab(DVec3::Z, -head, 0.0));
        let frame = self.world.frame;
        if frame.kind == KIND_CONVEX && f64::from(frame.radius) > head {
            let r = f64::from(frame.radius);
            let scale = DVec3::new(1.0 / r, 0.0, 1.0 / r);
            sides.push(Side::Cylinder(scale, DVec3::new(0.0, 0.0, -r)));
        }
        let grip = DVec3::new((0.7 * half_width).min(15.0), half_thickness, 0.0);
        let mut handle = Vec::from(slab(DVec3::Z, -whole, -head));
        let scale = DVec3::new(1.0 / grip.x, 1.0 / grip.y, 0.0);
        handle.push(Side::Cylinder(scale, DVec3::ZERO));
        let head_hit = entry(&sides, from, to).map(|(t, n)| {
            let p = from + t * to;
            let rib = n.x < -0.9
                && p.y.abs() < 0.4 * half_thickness
                && (p.z + 0.6 * head).abs() < 0.25 * head;
            let mark = DVec2::new(p.x + 0.78 * half_width, p.z + 0.65 * head).length() < 2.5;
            let colour = match () {
                () if rib || (mark && n.y.abs() > 0.9) => [0.36, 0.69, 0.77],
                () if n.z > 0.5 => [0.22, 0.23, 0.26],
                () => [0.8, 0.82, 0.85],
            };
            (t, n, DVec3::from(colour))
        });
        let grip_hit = entry(&handle, from, to).map(|(t, n)| (t, n, DVec3::new(0.42, 0.44, 0.48)));
        let hits = head_hit.into_iter().chain(grip_hit);
        hits.min_by(|a, b| a.0.total_cmp(&b.0))
    }
}

/// A bound of a convex body.
enum Side {
    /// normal . p <= height
    Plane(DVec3, f64),
    /// |scale (p - centre)| <= 1
    Cylinder(DVec3, DVec3),
}

impl Side {
    /// Negative inside.
    fn height(&self, p: DVec3) -> f64 {
        match self {
            Self::Plane(normal, height) => normal.dot(p) - height,
            Self::Cylinder(scale, centre) => (*scale * (p - *centre)).length() - 1.0,
        }
    }

    fn normal(&self, p: DVec3) -> DVec3 {
        match self {
            Self::Plane(normal, _) => *normal,
            Self::Cylinder(scale, centre) => (*scale * *scale * (p - *centre)).normalize(),
        }
    }

    /// Where a line crosses it.
    fn roots(&self, from: DVec3, to: DVec3) -> Vec<f64> {
        match self {
            Self::Plane(normal, height) => vec![(height - normal.dot(from)) / normal.dot(to)],
            Self::Cylinder(scale, centre) => {
                let (o, d) = (*scale * (from - *centre), *scale * to);
                let (a, b, c) = (d.dot(d), o.dot(d), o.dot(o) - 1.0);
                let root = (b * b - a * c).sqrt();
                vec![(-b - root) / a, (-b + root) / a]
            }
        }
    }
}

/// Where a ray enters the body within all `sides`, and the outward normal there.
fn entry(sides: &[Side], from: DVec3, to: DVec3) -> Option<(f64, DVec3)> {
    let crossings = sides.iter().enumerate().flat_map(|(i, side)| {
        let roots = side.roots(from, to).into_iter();
        roots.map(move |t| (i, t, side.normal(from + t * to)))
    });
    let enters = |&(i, t, normal): &(usize, f64, DVec3)| {
        let p = from + t * to;
        let others = sides.iter().enumerate().filter(|(j, _)| *j != i);
        t > 0.0
            && t.is_finite()
            && normal.dot(to) < 0.0
            && others.fold(true, |within, (_, side)| within && side.height(p) <= 0.0)
    };
    let found = crossings.filter(enters).map(|(_, t, normal)| (t, normal));
    found.min_by(|a, b| a.0.total_cmp(&b.0))
}
