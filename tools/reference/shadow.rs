//! Twin of `shadow`: the loss of sound in the anatomy inside the mask, beyond the loss that the
//! tissue around the mask would cause.

use super::geometry::world_line;
use super::path::Path;
use super::straight::Start;
use super::transmitted::{middle, sample, ways};
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
            true => follow(world, path(world, line, start)),
            false => vec![Piece { begin: 0.0, level: 0.0, slope: 0.0 }],
        })
        .collect()
}

fn path(world: &World, line: u32, start: &Start) -> Path {
    let frame = world.frame;
    let along = world_line(frame, line % frame.scanlines, line / frame.scanlines);
    Path { weight: 1.0, interactions: 0, ..middle(frame, line, along, start) }
}

fn follow(world: &World, path: Path) -> Vec<Piece> {
    let frame = world.frame;
    let samples = f64::from(frame.speed) / f64::from(frame.sample_pitch);
    let mut pieces: Vec<Piece> = Vec::new();
    let mut surrounding = f64::from(world.tissues[frame.background as usize].absorption);
    let (mut level, mut heard_before) = (0.0, true);
    for way in ways(world, path, |_, _| false) {
        if let Some(surface) = way.surface {
            level = if surface.transmitted > 0.0 { level + surface.transmitted.ln() } else { DARK };
        }
        if !way.heard {
            surrounding = way.absorption;
        }
        let excess = if way.heard { way.absorption - surrounding } else { 0.0 };
        // The device's list keeps its last place for the piece that marks the end.
        let ends = way.ends || pieces.len() + 2 == MAX_PIECES;
        if way.heard || heard_before || ends {
            pieces.push(Piece {
                begin: if pieces.is_empty() { 0.0 } else { sample(frame, &way.path) },
                level,
                slope: if ends { 0.0 } else { excess * way.speed / samples },
            });
        }
        if ends {
            break;
        }
        heard_before = way.heard;
        level -= excess * way.length;
    }
    pieces
}
