//! The middle of a beam through the anatomy: what `trace` follows before anything random, transmitted at every surface,
//! as a chain of straight ways, each in one medium.

use super::aperture::loses_by_aperture;
use super::geometry::Line;
use super::interface;
use super::path::{Path, Role, step};
use super::straight::{Start, Toggled};
use super::world::World;
use insonify::sim::layout::{Frame, LEAST_MAIN, LEAST_PASSED};

/// A straight way in one medium.
#[derive(Clone, Debug)]
pub(super) struct Way {
    /// The path at its beginning.
    pub(super) path: Path,
    /// mm/us; around masks that of the recording.
    pub(super) speed: f64,
    /// Np/mm.
    pub(super) absorption: f64,
    /// True if echoes are wanted from it.
    pub(super) heard: bool,
    /// True if nothing goes along it: the path has ended here.
    pub(super) ends: bool,
    /// Its length up to the next one, mm; of the last one 0.
    pub(super) length: f64,
    /// The surface at which it begins; none at the start and at the border of a mask.
    pub(super) surface: Option<Passed>,
}

/// A surface that the path has passed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Passed {
    /// Angle between path and normal, rad.
    pub(super) incidence: f64,
    /// The part of the intensity that gets through; 0 where nothing does.
    pub(super) transmitted: f64,
}

/// Sample at which a path is.
pub(super) fn sample(frame: &Frame, path: &Path) -> f64 {
    f64::from(frame.speed) / f64::from(frame.sample_pitch) * path.time
}

/// The path of the beam's middle along a line, from the place where its paths begin.
pub(super) fn middle(frame: &Frame, line: u32, along: Line, begin: &Start) -> Path {
    let origin = along.origin + begin.travelled * along.direction;
    Path {
        role: Role::Main,
        n: 0,
        line,
        weight: begin.weight,
        share: 1.0,
        probability: 1.0,
        time: begin.travelled / f64::from(frame.speed),
        origin,
        direction: along.direction,
        lateral: along.lateral,
        handedness: 1.0,
        interactions: begin.interactions,
        reflections: 0,
        spread: [0.0; 3],
        lens: [0.0; 3],
        bent: 0.0,
        strip: [0.0; 2], // not asked for
        survival: 1.0,
        group: [0, 1],
        stack: begin.media.clone(),
        t_min: if begin.travelled > 0.0 { step(origin) } else { 0.0 },
        shadowed: false,
    }
}

/// The ways of a path. It ends where `is_over`, of the path and the number of its ways so far.
pub(super) fn ways(
    world: &World,
    mut path: Path,
    is_over: impl Fn(&Path, usize) -> bool,
) -> Vec<Way> {
    let frame = world.frame;
    let end = f64::from(frame.depth) / f64::from(frame.speed);
    let mut ways: Vec<Way> = Vec::new();
    let (mut fresh, mut lost, mut surface) = (true, path.weight <= 0.0, None);
    for crossing in 0.. {
        let tissue = &world.tissues[world.medium(&path.stack).0 as usize];
        let heard = world.is_heard(&path.stack);
        // Around the mask sound travels at the speed assumed by the recording.
        let speed = f64::from(if heard { tissue.speed } else { frame.speed });
        let ends = lost || crossing >= 64 + frame.max_interactions || is_over(&path, ways.len());
        if fresh || ends {
            let absorption = tissue.absorption.into();
            let path = path.clone();
            ways.push(Way { path, speed, absorption, heard, ends, length: 0.0, surface });
            surface = None;
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
        fresh = !same || heard != hears;
        if !fresh {
            path.t_min = last + step(path.origin + last * path.direction);
            path.stack = after;
            continue;
        }
        ways.last_mut().expect("the first begins at once").length = hit.t;
        path.weight *= world.unabsorbed(&path.stack, hit.t);
        path.origin += hit.t * path.direction;
        path.time += hit.t / speed;
        let [a, b, c] = path.spread;
        path.spread = [a + 2.0 * b * hit.t + c * hit.t * hit.t, b + c * hit.t, c];
        path.t_min = step(path.origin);
        path.interactions += u32::from(!same);
        if same || (!heard && !hears) {
            path.t_min += last - hit.t;
            if !same {
                path.weight *= world.passed(&path.stack, &after);
            }
        } else {
            let row = sample(frame, &path).floor() as i64;
            let row = &world.rows[row.clamp(0, i64::from(frame.samples) - 1) as usize];
            let interface = interface::meet(world, row, &path, &hit, &after);
            let normal = world.slope(row, &path, &hit).shading;
            let incidence =
                path.direction.cross(normal).length().atan2(-path.direction.dot(normal));
            let turned = interface.turned(world, &path, interface.refracting);
            let mut transmitted = turned.map_or(0.0, |_| (1.0 - interface.reflectance).max(0.0));
            if loses_by_aperture(frame) {
                transmitted = transmitted.max(LEAST_PASSED.into());
            }
            if let Some(direction) = turned {
                path.direction = direction;
                let across = path.lateral - path.lateral.dot(direction) * direction;
                path.lateral = across.normalize();
            }
            path.weight *= transmitted;
            if loses_by_aperture(frame) {
                path.weight = path.weight.max(LEAST_MAIN.into());
            }
            surface = Some(Passed { incidence, transmitted });
            lost = transmitted <= 0.0;
        }
        path.stack = after;
    }
    ways
}
