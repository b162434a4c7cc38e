//! A path between two interactions, and its reflection by a mirror.

use glam::DVec3;

use super::acoustics::mirror;
use super::geometry::{beam_weight, world_line};
use super::interface::MIRROR;
use super::random::pcg4d;
use super::stack::Stack;
use insonify::sim::layout::{Frame, LEAST_FACING};

/// Purpose of the random numbers that are added to an echo before it is rounded down.
const PURPOSE_DITHER: u32 = 0x51ed_270b;
/// Purpose of the random number that decides whether a faint branch is followed.
pub(super) const PURPOSE_SURVIVAL: u32 = 0x2545_f491;

/// Purpose of the random number that decides how many paths of a group are reflected.
pub(super) const PURPOSE_PARTS: u32 = 0x85eb_ca6b;

/// The origin of a path, and its continuation at interactions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    /// Transmitted path of main-path sampling; branches split off from it.
    Main,
    /// Reflected part of a main path.
    Branch,
    /// One stochastic choice at every interaction.
    Single,
}

/// A path between two interactions.
#[derive(Clone, Debug)]
pub(super) struct Path {
    pub(super) role: Role,
    /// Index n of the path sample.
    pub(super) n: u32,
    pub(super) line: u32,
    /// One-way intensity weight W.
    pub(super) weight: f64,
    /// Share p of an echo.
    pub(super) share: f64,
    /// Probability Q of the branches taken.
    pub(super) probability: f64,
    /// One-way time T, us.
    pub(super) time: f64,
    pub(super) origin: DVec3,
    pub(super) direction: DVec3,
    pub(super) lateral: DVec3,
    pub(super) handedness: f64,
    pub(super) interactions: u32,
    pub(super) reflections: u32,
    pub(super) spread: [f64; 3],
    /// See [`super::Segment::lens`].
    pub(super) lens: [f64; 3],
    /// Sine by which surfaces have turned a ray on a main path, towards its lateral axis.
    pub(super) bent: f64,
    /// Distance of the neighbouring scanline's path across, mm, and its growth per mm.
    pub(super) strip: [f64; 2],
    /// Probability with which it was followed; its weight is divided by it.
    pub(super) survival: f64,
    /// First and number of the paths that have come the same way.
    pub(super) group: [u32; 2],
    pub(super) stack: Stack,
    pub(super) t_min: f64,
    /// True for a main path behind a surface that lets hardly anything through.
    pub(super) shadowed: bool,
}

impl Path {
    /// Key of the random numbers at the interaction just reached.
    pub(super) fn key(&self) -> u32 {
        self.interactions + 32 * self.reflections
    }

    /// Amplitude factor of echoes, from the path's distance to the geometric scanline.
    pub(super) fn beam_weight(&self, frame: &Frame) -> f64 {
        let (l, layer) = self.scanline(frame.scanlines);
        let line = world_line(frame, l, layer);
        beam_weight(frame, (self.origin - line.origin).dot(line.lateral))
    }

    /// The numbers added before rounding down of draw `n`: for each sample of a deposit, real and imaginary part.
    pub(super) fn dither(&self, frame: &Frame, n: u32) -> [f64; 8] {
        let words = self.line_random(frame, n, PURPOSE_DITHER);
        std::array::from_fn(|i| {
            let word = words[i / 2];
            let half = if i % 2 == 0 { word >> 16 } else { word & 0xffff };
            f64::from(half) / 65_536.0
        })
    }

    /// Random numbers of path `n` at the line's interaction just reached, for decisions that neighbouring lines must not
    /// share.
    pub(super) fn line_random(&self, frame: &Frame, n: u32, purpose: u32) -> [u32; 4] {
        let (l, layer) = self.scanline(frame.scanlines);
        let on_face = layer * frame.face_lines() + frame.first_line + l;
        pcg4d([on_face, n, self.key(), frame.seed ^ purpose])
    }

    /// The way along a surface of normal `n` from where the path meets it to where a parallel one does, 1 mm beside it.
    pub(super) fn across_surface(&self, n: DVec3) -> DVec3 {
        let facing = (-self.direction.dot(n)).max(LEAST_FACING.into());
        self.lateral + self.lateral.dot(n) / facing * self.direction
    }

    /// Scanline and layer.
    pub(super) fn scanline(&self, scanlines: u32) -> (u32, u32) {
        (self.line % scanlines, self.line / scanlines)
    }
}

/// Distance from `p` within which a surface is the one just left.
pub(super) fn step(p: DVec3) -> f64 {
    4e-6 * p.abs().max_element().max(1.0)
}

/// Reflects the path into `direction`, mirrored by the plane of normal `m`.
pub(super) fn reflect(path: &mut Path, direction: DVec3, m: DVec3) {
    path.direction = direction;
    path.lateral = mirror(path.lateral, m);
    path.handedness = -path.handedness;
    path.reflections += 1;
}

/// Adds the lobe of a rough reflection, and the `turn` of a curved one, rad, to the spread: their variance per axis
/// grows with the distance.
pub(super) fn widen(path: &mut Path, roughness: f64, turn: f64) {
    if roughness < MIRROR {
        path.spread[2] += 4.0 / (roughness + 2.0);
    }
    path.spread[2] += (turn * turn).min(1.0);
}
