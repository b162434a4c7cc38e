//! Twin of `shadow`: the loss of sound in the anatomy inside the mask, beyond the loss that the
//! tissue around the mask would cause.

use super::geometry::world_line;
use super::interface::{self, Interface};
use super::path::{Path, Role, step};
use super::straight::{Start, Toggled};
use super::world::World;
use insonify::sim::layout::MAX_PIECES;

/// Level that stands for no sound at all, nepers.
const DARK: f64 = -200.0;

/// A piece of a line in which the transmitted level changes linearly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Piece {
    /// Axial sample at which it begins.
    pub begin: f64,
    /// Level there, nepers of the two-way amplitude.
    pub level: f64,
    /// Loss per sample, nepers.
    pub slope: f64,
}

/// Level at sample `k` from the pieces of one line, which begin at sample 0; nepers.
pub fn level(pieces: &[Piece], k: f64) -> f64 {
    let piece = pieces.iter().rfind(|p| p.begin <= k);
    let piece = piece.expect("the first begins at the face");
    piece.level - piece.slope * (k - piece.begin)
}

/// Pieces of each line e * scanlines + l, from the place where its paths begin.
pub fn shadow(world: &World, starts: &[Start]) -> Vec<Vec<Piece>> {
    let lines = 0..world.frame.layers * world.frame.scanlines;
    lines
        .zip(starts)
        .map(|(line, start)| match start.weight > 0.0 {
            true => follow(world, middle(world, line, start)),
            false => vec![Piece { begin: 0.0, level: 0.0, slope: 0.0 }],
        })
        .collect()
}

/// The path of the beam's middle.
fn middle(world: &World, line: u32, begin: &Start) -> Path {
    let frame = world.frame;
    let start = world_line(frame, line % frame.scanlines, line / frame.scanlines);
    let origin = start.origin + begin.travelled * start.direction;
    Path {
        role: Role::Main,
        n: 0,
        line,
        weight: 1.0,
        share: 1.0,
        probability: 1.0,
        time: begin.travelled / f64::from(frame.speed),
        origin,
        direction: start.direction,
        lateral: start.lateral,
        handedness: 1.0,
        interactions: 0,
        reflections: 0,
        spread: [0.0; 3],
        lens: [0.0; 3],
        survival: 1.0,
        stack: begin.media.clone(),
        t_min: if begin.travelled > 0.0 { step(origin) } else { 0.0 },
    }
}

/// Refracts the path; false at total reflection of the whole beam.
fn refract(world: &World, path: &mut Path, interface: &Interface) -> bool {
    let Some(direction) = interface.turned(world, path, interface.refracting) else {
        return false;
    };
    path.direction = direction;
    path.lateral = (path.lateral - path.lateral.dot(direction) * direction).normalize();
    true
}

fn follow(world: &World, mut path: Path) -> Vec<Piece> {
    let frame = world.frame;
    let end = f64::from(frame.depth) / f64::from(frame.speed);
    let samples = f64::from(frame.speed) / f64::from(frame.sample_pitch);
    let mut pieces: Vec<Piece> = Vec::new();
    let mut surrounding = f64::from(world.tissues[frame.background as usize].absorption);
    let (mut level, mut fresh, mut lost) = (0.0, true, false);
    for crossing in 0.. {
        let tissue = &world.tissues[world.medium(&path.stack).0 as usize];
        let (mut speed, absorption) = (f64::from(tissue.speed), f64::from(tissue.absorption));
        let heard = world.is_heard(&path.stack);
        if !heard {
            // Around the mask sound travels at the speed assumed by the recording.
            speed = frame.speed.into();
            surrounding = absorption;
        }
        let excess = if heard { absorption - surrounding } else { 0.0 };
        // The device's list keeps its last place for the piece that marks the end.
        let full = pieces.len() + 2 == MAX_PIECES;
        let ends = lost || full || crossing == 64 + frame.max_interactions;
        if fresh || ends {
            pieces.push(Piece {
                begin: if crossing == 0 { 0.0 } else { samples * path.time },
                level,
                slope: if ends { 0.0 } else { excess * speed / samples },
            });
        }
        let range = [path.t_min, (end - path.time) * speed];
        let crossings = world.crossings(path.origin, path.direction, range);
        if ends || crossings.is_empty() {
            break;
        }
        let toggled = world.toggled(&path.stack, &crossings);
        let Toggled { hit, after, last, .. } = toggled;
        let hears = world.is_heard(&after);
        let same = world.medium(&path.stack) == world.medium(&after);
        if same && heard == hears {
            path.t_min = last + step(path.origin + last * path.direction);
            path.stack = after;
            fresh = false;
            continue;
        }
        path.origin += hit.t * path.direction;
        path.time += hit.t / speed;
        path.t_min = step(path.origin);
        level -= excess * hit.t;
        fresh = heard || hears;
        if same || !fresh {
            path.t_min += last - hit.t;
        } else {
            let row = (samples * path.time).floor() as i64;
            let row = &world.rows[row.clamp(0, i64::from(frame.samples) - 1) as usize];
            let interface = interface::meet(world, row, &path, &hit, &after);
            let passes = 1.0 - interface.reflectance;
            lost = !refract(world, &mut path, &interface) || passes <= 0.0;
            level = if lost { DARK } else { level + passes.ln() };
        }
        path.stack = after;
    }
    pieces
}
