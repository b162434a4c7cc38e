//! `shadow`: the transmitted level along each line.

use super::inputs::{frame, rows, scanlines};
use super::worlds;
use super::{Case, Check, Input, Job, Size, Subject};
use crate::reference::aperture::{self, loses_by_aperture};
use crate::reference::darken;
use crate::reference::origin;
use crate::reference::shadow::{self, Piece};
use insonify::sim::layout::{
    APERTURE_BANDS, Aperture, FAR_PIECE, FLAG_APERTURE, FLAG_COINCIDENT, FLAG_FOOTPRINT,
    FLAG_MASKED, FLAG_WAVEFRONT, MAX_PIECES, START_WORDS, Surface,
};
use insonify::sim::stages;

/// Largest difference of levels, nepers, in samples where no piece begins.
const LEVEL: f64 = 2e-3;
/// Distance from the beginning of a piece, in samples, within which the level may be that of either side.
const EDGE: f64 = 0.01;

pub const SUBJECT: Subject = Subject {
    tolerance: "levels of all samples within 2e-3 Np (1e-3 mm of absorption of 0.06 Np/mm, a thousandth \
                of a transmittance), either side's within 0.01 samples of a surface; one line in 60 \
                may meet a triangle's edge otherwise",
    job,
    check,
    plant: |job, outputs| {
        // 0.04 dB more is lost at the first surface.
        job.edit(outputs, "pieces", |pieces: &mut [[f32; 4]]| {
            for line in pieces.chunks_mut(MAX_PIECES) {
                for piece in line[1..].iter_mut().filter(|p| p[0] < FAR_PIECE) {
                    piece[1] -= 0.005;
                }
            }
        });
    },
    ..Subject::of(&stages::SHADOW)
};

fn job(case: Case, size: Size) -> Job {
    let mut frame = frame(case, size);
    frame.flags = match case {
        Case::Random => FLAG_MASKED | FLAG_FOOTPRINT | FLAG_WAVEFRONT | FLAG_APERTURE,
        Case::Odd => FLAG_MASKED,
        Case::Modes => FLAG_COINCIDENT,
        _ => 0,
    };
    if case == Case::Odd {
        // All paths of a line begin alike, at the mask.
        (frame.origin_jitter, frame.emission_lobe) = (0.0, 0.0);
    }
    let mut world = worlds::world(case);
    if frame.flags & FLAG_MASKED != 0 {
        // An organ that others overlap, a bone beside it, and a vessel.
        for index in [1, 3, 4] {
            world.mask(index);
        }
    }
    let mut tissues = worlds::tissues();
    if case == Case::NotFinite {
        tissues[2].absorption = f32::INFINITY;
    }
    let mut inputs = vec![Input::words("frame", &[frame]), Input::words("tissues", &tissues)];
    inputs.extend(world.inputs());
    let mut job = Job { inputs, push: Vec::new() };
    let (starts, _) = origin::origin(&worlds::owned(&job).world());
    job.inputs.extend([
        Input::words("stacks", &origin::pack(&starts)),
        Input::floats("rows", bytemuck::cast_slice(&rows(&frame))),
        scanlines(&frame),
    ]);
    Job::of(&stages::SHADOW, job.inputs, Vec::new())
}

/// The pieces of each line from the device's buffer.
pub(super) fn unpack(pieces: &[[f32; 4]]) -> Vec<Vec<Piece>> {
    let (lines, _) = pieces.as_chunks::<MAX_PIECES>();
    let piece = |p: &[f32; 4]| Piece { begin: p[0].into(), level: p[1].into(), slope: p[2].into() };
    let line = |line: &[[f32; 4]; MAX_PIECES]| {
        let held = line.iter().take_while(|p| p[0] < FAR_PIECE);
        held.map(piece).collect()
    };
    lines.iter().map(line).collect()
}

fn check(job: &Job, outputs: &[Vec<u8>]) -> Vec<Check> {
    let mut owned = worlds::owned(job);
    // The echo properties of surfaces do not matter here: in the twin all are mirrors.
    let sides = owned.instances.iter();
    let sides = sides.map(|i| i.surface_outside.max(i.surface_inside) as usize + 1);
    let mirror = Surface { roughness: 1e9, ..Surface::default() };
    owned.surfaces = vec![mirror; sides.max().unwrap_or(0)];
    let (world, frame) = (owned.world(), owned.frame);
    let starts = job.get::<[u32; START_WORDS]>("stacks");
    let starts: Vec<_> = starts.iter().map(origin::unpack).collect();
    let twin = shadow::shadow(&world, &starts);
    let pieces: Vec<[f32; 4]> = job.after(outputs, "pieces");
    let got = unpack(&pieces);
    // Levels below -40 nepers count as equal: hardly any sound gets there.
    let dark = |level: f64| level.max(-40.0);
    let alike = |got: &[Piece], expected: &[Piece]| {
        (0..frame.samples).map(f64::from).all(|k| {
            let beside = expected.iter().any(|p| (p.begin - k).abs() < EDGE);
            let levels = [got, expected].map(|pieces| dark(shadow::level(pieces, k)));
            let [a, b] = levels;
            beside || (a - b).abs() < LEVEL || (a.is_nan() && b.is_nan())
        })
    };
    let wrong = got.iter().zip(&twin).filter(|(got, twin)| !alike(got, twin));
    let wrong = wrong.count();
    // What is lost at the nodes is what the pieces say.
    let shades: Vec<Aperture> = job.after(outputs, "shades");
    let lines = frame.layers * frame.scanlines;
    let nodes = (0..lines).flat_map(|line| (0..=APERTURE_BANDS).map(move |node| [line, node]));
    let otherwise = |&[line, node]: &[u32; 2]| {
        let kappa = f64::from(node) * f64::from(frame.samples) / f64::from(APERTURE_BANDS);
        let expected = darken::lost(shadow::level(&got[line as usize], kappa));
        let lost = f64::from(shades[aperture::place(&frame, line, node)].lost);
        (lost - expected).abs() >= 1e-4 || lost.is_nan() != expected.is_nan()
    };
    let lost = nodes.filter(|at| loses_by_aperture(&frame) && otherwise(at)).count();
    // Otherwise nothing would be compared.
    let flat = twin.iter().filter(|p| p.len() < 3).count();
    vec![
        Check::count("lines", twin.len(), wrong, twin.len() / 60),
        Check::count("losses at nodes", got.len(), lost, got.len() / 60),
        Check::equal("number of lines", &[got.len()], &[twin.len()]),
        Check::count(
            "lines that meet nothing",
            twin.len(),
            flat,
            // A frame's only mask may be narrow: that of the tests is met by 10 of 24 scanlines.
            twin.len() * 3 / 4,
        ),
    ]
}
