//! Arrival of a path at a surface: normals, reflectance and echo.

use std::ops::Range;

use glam::DVec3;

use super::Accumulator;
use super::acoustics::{Fluid, mirror, power_cosine, reflection, refract};
use super::footprint;
use super::path::Path;
use super::random::{PURPOSE_NORMAL, PURPOSE_THICKNESS, draw, gaussian, pcg4d, unit};
use super::stack::Stack;
use super::wavefront::{Slope, turned};
use super::world::{Crossing, World};
use insonify::sim::layout::{
    BENDING_ANGLE, BENDING_STEP, FLAG_COHERENT, LEAST_PITCH, LOBE_ANGLES, LOBE_DRAWS, LOBE_REACH,
    Row, Surface, Tissue,
};
pub(super) use insonify::sim::lobe::MIRROR;

/// Edge of the cells that share the random phase of a thick surface's echo, mm.
const PHASE_CELL: f64 = 0.5;
/// Shift of these cells, in their edge, away from the round numbers at which faces are modelled.
const PHASE_SHIFT: f64 = 0.381_966;
/// Micro-normals tried before giving up.
const ATTEMPTS: u32 = 8;

/// A sampled micro-normal, and the direction into which it mirrors the path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Micro {
    pub(super) normal: DVec3,
    pub(super) reflected: DVec3,
}

/// The interface at which a path arrives. Normals are unit vectors turned against the path.
#[derive(Clone, Copy, Debug)]
pub(super) struct Interface {
    /// Normal of the triangle.
    pub(super) geometric: DVec3,
    /// Normal interpolated from the vertices.
    pub(super) shading: DVec3,
    /// Normal averaged over the wavefront, by which the path refracts.
    pub(super) refracting: DVec3,
    /// Change of `refracting` per mm across the path, in the image plane; 0 in geometric acoustics.
    turning: DVec3,
    ray: DVec3,
    /// The micro-normal; none if no attempt was acceptable: then there is no echo and no reflected path.
    pub(super) micro: Option<Micro>,
    /// Fluids before and behind.
    pub(super) fluids: [Fluid; 2],
    /// Intensity reflectance R at the refracting normal; where the surface is curved or rough, its mean
    /// over the beam. 1 at total reflection.
    pub(super) reflectance: f64,
    /// True if a part of the beam is transmitted though its middle is totally reflected.
    pub(super) curved: bool,
    /// Standard deviation of the reflected direction over the beam, rad.
    pub(super) turn: f64,
    pub(super) roughness: f64,
    surface: Surface,
    absorption: f64,
    instance: u32,
    /// Tissue behind it.
    behind: u32,
}

fn fluid(tissue: &Tissue) -> Fluid {
    Fluid { speed: tissue.speed.into(), impedance: tissue.impedance.into() }
}

/// The interface at `hit`, where `path` has arrived, with `after` the media behind it; `row` is that
/// of the path's time.
pub(super) fn meet(
    world: &World,
    row: &Row,
    path: &Path,
    hit: &Crossing,
    after: &Stack,
) -> Interface {
    let d = path.direction;
    let Slope { geometric, shading, refracting, turning, ray, width } = world.slope(row, path, hit);
    let behind = world.medium(after).0;
    let before = &world.tissues[world.medium(&path.stack).0 as usize];
    let fluids = [fluid(before), fluid(&world.tissues[behind as usize])];
    let instance = &world.instances[hit.instance as usize];
    let surface = world.surfaces
        [if hit.entry { instance.surface_outside } else { instance.surface_inside } as usize];
    let roughness = f64::from(surface.roughness);
    let cos_i = -d.dot(refracting);
    Interface {
        geometric,
        shading,
        refracting,
        turning,
        ray,
        micro: micro_normal(world, path, geometric, shading, roughness),
        fluids,
        reflectance: footprint::reflectance(fluids[0], fluids[1], cos_i.max(0.0), width),
        curved: width > 0.0,
        turn: 2.0 * width / cos_i.max(1e-3),
        roughness,
        surface,
        absorption: before.absorption.into(),
        instance: hit.instance,
        behind,
    }
}

fn micro_normal(
    world: &World,
    path: &Path,
    geometric: DVec3,
    shading: DVec3,
    roughness: f64,
) -> Option<Micro> {
    let d = path.direction;
    let accept = |normal: DVec3| {
        let reflected = mirror(d, normal);
        (d.dot(normal) < 0.0 && reflected.dot(geometric) > 0.0)
            .then_some(Micro { normal, reflected })
    };
    if roughness >= MIRROR {
        return accept(shading);
    }
    (0..ATTEMPTS).find_map(|j| {
        let words = draw(world.frame, path.n, path.key(), PURPOSE_NORMAL + j);
        let u = [unit(words[0]), unit(words[1])];
        accept(power_cosine(shading, roughness, u))
    })
}

/// Gain per sample of surface echoes in the layer of `path`, with the fixed-point scale.
pub(super) fn gain<'a>(world: &'a World, path: &Path) -> impl Fn(usize) -> f64 + 'a {
    let frame = world.frame;
    let (_, layer) = path.scanline(frame.scanlines);
    let y = super::geometry::probe(frame).elevation(layer);
    move |k| {
        let row = &world.rows[k];
        let sigma = f64::from(row.sigma_elevation);
        f64::from(row.surface_gain)
            * (-y * y / (2.0 * sigma * sigma)).exp()
            * f64::from(frame.surface_scale)
    }
}

impl Interface {
    /// The direction behind the interface of `path`, refracted at normal `n`; none where all is reflected. The middle
    /// of a beam may be totally reflected where the rest is not: it goes straight on.
    pub(super) fn turned(&self, world: &World, path: &Path, n: DVec3) -> Option<DVec3> {
        let direction = turned(world.frame, self.fluids, path.direction, n, self.geometric);
        direction.or(self.curved.then_some(path.direction))
    }

    /// Change of the direction in which `path` is refracted at normal `n`, per mm across, rad.
    pub(super) fn bending(&self, path: &Path, n: DVec3) -> f64 {
        if self.turning == DVec3::ZERO {
            return 0.0;
        }
        let [before, behind] = self.fluids;
        let through = |n: DVec3| refract(before, behind, path.direction, n);
        let step = f64::from(BENDING_STEP);
        let beside = through((n + step * self.turning).normalize());
        let bent = beside.zip(through(n)).map(|(beside, middle)| (beside - middle) / step);
        bent.map_or(0.0, |bent| bent.dot(path.lateral))
    }

    /// Sine by which a ray on `path` is turned towards its lateral axis; 0 at total reflection.
    pub(super) fn ray_bending(&self, path: &Path) -> f64 {
        let [before, behind] = self.fluids;
        let through = refract(before, behind, path.direction, self.ray);
        let through = through.filter(|_| path.direction.dot(self.ray) < 0.0);
        through.map_or(0.0, |direction| direction.dot(path.lateral))
    }

    /// The neighbouring scanline's path behind the surface, refracted at normal `n`, where the path's lateral axis is
    /// `beside`: it meets the surface's plane beside this path. At total reflection both go on as they came.
    pub(super) fn strip_behind(&self, path: &Path, n: DVec3, beside: DVec3) -> [f64; 2] {
        let [distance, growth] = path.strip;
        let [before, behind] = self.fluids;
        let shift = path.across_surface(n);
        let least = f64::from(LEAST_PITCH);
        let part = (f64::from(BENDING_STEP) / distance.abs().max(least))
            .min(f64::from(BENDING_ANGLE) / growth.abs().max(least));
        let aside = (path.direction + part * growth * path.lateral).normalize();
        let turned = (n + part * distance * self.turning).normalize();
        let both = (path.direction.dot(n) < 0.0)
            .then(|| {
                refract(before, behind, path.direction, n)
                    .zip(refract(before, behind, aside, turned))
            })
            .flatten();
        let behind = both.map_or(growth, |(middle, aside)| (aside - middle).dot(beside) / part);
        [distance * shift.dot(beside), behind]
    }

    /// Share of the echo of direction `d` that the aperture receives: mirrors spread about the normal, 1 where it
    /// faces the path.
    fn received(&self, d: DVec3, lobe: f64) -> f64 {
        let facing = (2.0 * d.dot(self.shading).powi(2) - 1.0).max(0.0);
        let diffuse = 2.0 / (self.roughness + 2.0);
        let energy = (-2.0 * lobe * (1.0 - facing * facing) / (1.0 + 8.0 * lobe * diffuse)).exp();
        (energy + diffuse * (1.0 - energy)).sqrt()
    }

    /// Share of the pressure that the path's small mirror sends straight back.
    fn sent_back(&self, d: DVec3) -> Option<f64> {
        let Micro { normal, reflected } = self.micro?;
        let facing = (-d.dot(reflected)).max(0.0);
        let r = reflection(self.fluids[0], self.fluids[1], -d.dot(normal));
        (facing > 0.0).then(|| r * facing.powf(self.surface.specularity.into()))
    }

    /// The same of all mirrors about the normal: the mean, and the root of the mean square.
    fn sent_back_in_the_mean(&self, d: DVec3) -> Option<[f64; 2]> {
        if self.roughness >= MIRROR {
            return self.sent_back(d).map(|sent| [sent; 2]);
        }
        let cosine = -d.dot(self.shading);
        let [before, behind] = self.fluids;
        let along = (1.0 - cosine) * (LOBE_ANGLES - 1) as f64 / f64::from(LOBE_REACH);
        // Beyond the last angle as between the last two.
        let j = (along.max(0.0) as usize).min(LOBE_ANGLES - 2);
        let [above, below] = [j, j + 1].map(|j| self.surface.lobe[j].map(f64::from));
        let at = |i: usize| above[i] + (along - j as f64) * (below[i] - above[i]);
        let pressures = [-1.0, 0.0, 1.0].map(|i| reflection(before, behind, at(2) + i * at(3)));
        // The Gauss-Hermite rule of three points.
        let mean = |[a, b, c]: [f64; 3]| (a + 4.0 * b + c) / 6.0;
        let square = mean(pressures.map(|r| r * r));
        (cosine > 0.0).then(|| [at(0).exp() * mean(pressures), at(1).exp() * square.sqrt()])
    }

    /// Deposits the echo of one path that returns along it.
    pub(super) fn echo(&self, world: &World, path: &Path, out: &mut Accumulator) {
        if let Some(sent) = self.sent_back(path.direction) {
            let shares = [path.share, path.share * path.probability];
            self.deposit(world, path, [sent; 2], shares, path.n..path.n + 1, out);
        }
    }

    /// Deposits the echo of all paths of a line, of which `path` is one.
    pub(super) fn mean_echo(&self, world: &World, path: &Path, out: &mut Accumulator) {
        if let Some(sent) = self.sent_back_in_the_mean(path.direction) {
            let shares = [1.0, 1.0 / f64::from(LOBE_DRAWS)];
            self.deposit(world, path, sent, shares, 0..LOBE_DRAWS, out);
        }
    }

    /// Deposits the part in phase at the surface, by its share of the amplitude, and the rest, in draws by their share of the
    /// power each, displaced by the thickness and with phases that belong to the surface.
    fn deposit(
        &self,
        world: &World,
        path: &Path,
        [in_phase, from_behind]: [f64; 2],
        [share, power]: [f64; 2],
        draws: Range<u32>,
        out: &mut Accumulator,
    ) {
        let (frame, surface) = (world.frame, &self.surface);
        let amplitude = path.weight * f64::from(surface.gain) * path.beam_weight(frame);
        let (l, _) = path.scanline(frame.scanlines);
        let gain = gain(world, path);
        let split = frame.flags & FLAG_COHERENT == 0;
        let coherence = if surface.thickness == 0.0 { 1.0 } else { f64::from(surface.coherence) };
        let rest = (1.0 - coherence * coherence).max(0.0).sqrt();
        if split {
            let in_phase = coherence * share * in_phase * amplitude;
            let dither = path.dither(frame, draws.start);
            out.deposit(l, path.time, in_phase, 0.0, &gain, dither);
            if rest == 0.0 {
                return;
            }
        }
        let p = world.tissue_point(self.instance, path.origin);
        let cell = (p / PHASE_CELL + PHASE_SHIFT).floor().as_i64vec3();
        let lobe = f64::from(world.rows[out.sample(path.time)].lobe);
        let scale = rest * power.sqrt() * self.received(path.direction, lobe);
        let mean = draws.len() > 1;
        for n in draws {
            // The two faces of a thin sheet are cells of their own.
            let face = self.behind.wrapping_mul(0x85eb_ca6b);
            let key = n.wrapping_mul(0x9e37_79b9).wrapping_add(face).wrapping_add(frame.seed);
            let own = pcg4d([cell.x as u32, cell.y as u32, cell.z as u32, key]);
            let words = draw(frame, n, path.key(), PURPOSE_THICKNESS);
            let bits = if mean { own[0] } else { words[0] & 0xffff_0000 | words[1] >> 16 };
            let q = f64::from(surface.thickness) * gaussian(bits).abs();
            let behind = from_behind * amplitude * (-self.absorption * q).exp();
            let (time, dither) = (path.time + q / self.fluids[0].speed, path.dither(frame, n));
            if split {
                let incoherent = |k: usize| gain(k) * f64::from(world.rows[k].incoherent_gain);
                let phase = std::f64::consts::TAU * unit(own[3]);
                out.deposit(l, time, scale * behind, phase, incoherent, dither);
            } else {
                out.deposit(l, time, share * behind, 0.0, &gain, dither);
            }
        }
    }
}

#[cfg(test)]
mod tests;
