//! Twin of `trace`: Monte-Carlo paths, their surface echoes and their segments.

use glam::{DAffine3, DVec3};

use super::aperture::Passed;
use super::geometry::{face, line_pitch, world_line};
use super::interface::{self, Interface};
use super::path::{Path, Role, reflect, step};
use super::random::{PURPOSE_JITTER, draw, gaussian, unit};
use super::stack::Stack;
use super::straight::{Start, Toggled};
use super::world::{World, affine};
use super::{Accumulator, Segment, acoustics};
use insonify::sim::layout::{
    Counters, FLAG_COHERENT, FLAG_FACE_REFLECTION, FLAG_ROUGH_TRANSMISSION, FLAG_WAVEFRONT, Frame,
    LEAST_MAIN, LEAST_PASSED, LEAST_PITCH, SAMPLING_MAIN_PATH, SAMPLING_SHARED_PRIMARY,
    STRIP_LIMIT,
};

mod branches;
mod passed;

pub use passed::passed;

/// The results of `trace`.
#[derive(Clone, Debug)]
pub struct Traced {
    /// Surface echoes, in units of 1 / surface_scale.
    pub surface: Accumulator,
    /// Segments per line e * scanlines + l, by path; none is dropped for lack of room.
    pub segments: Vec<Vec<Segment>>,
    /// Nodes of the main paths, by layer, node and scanline; empty where losses do not count by the aperture.
    pub passed: Vec<Passed>,
    /// Counters; `segments_dropped` is the number beyond the frame's capacity.
    pub counters: Counters,
}

struct Tracer<'a> {
    world: &'a World<'a>,
    probe_from_world: DAffine3,
    /// True while main paths are followed for what they lose.
    ahead: bool,
    /// The next node that a main path reaches.
    node: u32,
    /// Sine by which rays on it are turned down to the node before.
    noted: f64,
    out: Traced,
}

/// Follows all paths of all lines from their starts.
pub fn trace(world: &World, starts: &[Start]) -> Traced {
    let frame = world.frame;
    let lines = frame.layers * frame.scanlines;
    let mut tracer = Tracer::new(world, passed(world, starts));
    for line in 0..lines {
        for n in 0..frame.paths {
            let path = tracer.start(line, n, &starts[line as usize]);
            tracer.follow(path);
        }
    }
    let mut out = tracer.out;
    let sizes = out.segments.iter().map(|s| s.len() as u32);
    out.counters.segments = sizes.clone().sum();
    out.counters.segments_dropped = sizes.map(|n| n.saturating_sub(frame.segment_capacity)).sum();
    out.counters.saturated = out.surface.saturated;
    out
}

impl<'a> Tracer<'a> {
    fn new(world: &'a World<'a>, passed: Vec<Passed>) -> Self {
        let frame = world.frame;
        Self {
            world,
            probe_from_world: affine(&frame.probe_from_world),
            ahead: false,
            node: 0,
            noted: 0.0,
            out: Traced {
                surface: Accumulator::new(frame),
                segments: vec![Vec::new(); (frame.layers * frame.scanlines) as usize],
                passed,
                counters: Counters::default(),
            },
        }
    }

    fn start(&self, line: u32, n: u32, begin: &Start) -> Path {
        let frame = self.world.frame;
        let start = world_line(frame, line % frame.scanlines, line / frame.scanlines);
        let words = draw(frame, n, 0, PURPOSE_JITTER);
        let (jitter, lobe) = (f64::from(frame.origin_jitter), f64::from(frame.emission_lobe));
        let (mut direction, mut lateral, mut fan) = (start.direction, start.lateral, 0.0);
        if lobe > 0.0 {
            direction = acoustics::power_cosine(direction, lobe, [unit(words[1]), unit(words[2])]);
            lateral = (lateral - lateral.dot(direction) * direction).normalize();
            fan = 1.0 / (lobe + 2.0);
        }
        let mut origin = start.origin + jitter * gaussian(words[0]) * start.lateral;
        let mut t_min = 0.0;
        if begin.travelled > 0.0 {
            origin += begin.travelled * direction;
            t_min = step(origin);
        }
        Path {
            role: if frame.sampling == SAMPLING_MAIN_PATH { Role::Main } else { Role::Single },
            n,
            line,
            weight: begin.weight,
            share: 1.0 / f64::from(frame.paths),
            probability: 1.0,
            time: begin.travelled / f64::from(frame.speed),
            origin,
            direction,
            lateral,
            handedness: 1.0,
            interactions: begin.interactions,
            reflections: 0,
            spread: [jitter * jitter, 0.0, fan],
            lens: [0.0; 3],
            bent: 0.0,
            strip: {
                let [pitch, growth] = line_pitch(frame);
                [pitch + begin.travelled * growth, growth]
            },
            survival: 1.0,
            group: [0, 1],
            stack: begin.media.clone(),
            t_min,
            shadowed: false,
        }
    }

    /// One-way time of the image's bottom.
    fn end(&self) -> f64 {
        f64::from(self.world.frame.depth) / f64::from(self.world.frame.speed)
    }

    fn follow(&mut self, mut path: Path) {
        let frame = self.world.frame;
        for _ in 0..64 + frame.max_interactions {
            if self.ended(&path) {
                break;
            }
            let t_end = (self.end() - path.time) * self.speed(&path);
            let range = [path.t_min, t_end];
            let crossings = self.world.crossings(path.origin, path.direction, range);
            self.out.counters.rays += 1;
            let nearest = crossings.first().map_or(t_end, |c| c.t);
            if self.flies_past(&path, t_end, self.world.meets_mask(&crossings)) {
                self.note(&path, None, f64::INFINITY);
                return;
            }
            if let Some((t, normal)) = self.face(&path, nearest) {
                self.emit(&path, t);
                let ends = frame.flags & FLAG_FACE_REFLECTION == 0
                    || path.reflections >= frame.max_reflections;
                if ends {
                    return;
                }
                self.interact(&mut path, t);
                self.face_echo(&path, normal);
                let back = acoustics::mirror(path.direction, normal);
                reflect(&mut path, back, normal);
            } else {
                if crossings.is_empty() {
                    self.emit(&path, t_end);
                    self.lose(&path, f64::INFINITY);
                    return;
                }
                let toggled = self.world.toggled(&path.stack, &crossings);
                self.out.counters.stack_overflow += toggled.overflow;
                let Toggled { hit, after, last, .. } = toggled;
                let heard = [&path.stack, &after].map(|s| self.world.is_heard(s));
                let same = self.world.medium(&path.stack) == self.world.medium(&after);
                if same || heard == [false; 2] {
                    if same && heard[0] == heard[1] {
                        path.t_min = last + step(path.origin + last * path.direction);
                    } else {
                        // The mask begins or ends within a medium: the segment is cut there. Outside the mask
                        // another medium begins, and sound goes straight on.
                        self.emit(&path, hit.t);
                        self.advance(&mut path, hit.t);
                        path.t_min += last - hit.t;
                        if !same {
                            path.weight *= self.world.passed(&path.stack, &after);
                            path.interactions += 1;
                        }
                    }
                    path.stack = after;
                    continue;
                }
                self.emit(&path, hit.t);
                self.interact(&mut path, hit.t);
                let row = &self.world.rows[self.out.surface.sample(path.time)];
                let interface = interface::meet(self.world, row, &path, &hit, &after);
                let whole = self.whole(&path);
                let faint = self.is_steady(&path)
                    && (whole.weight < f64::from(frame.min_weight)
                        || path.shadowed && self.is_hidden(&path, &interface));
                if !self.ahead && !faint {
                    self.echo(&whole, &interface);
                }
                let goes_on = match path.role {
                    Role::Main if self.is_steady(&path) => {
                        if !faint {
                            self.branch(&whole, &interface);
                        }
                        if self.is_hidden(&path, &interface) || path.shadowed {
                            path.shadowed = true;
                            let passed = 1.0 - interface.reflectance;
                            path.weight *= passed.max(LEAST_PASSED.into());
                            path.stack = after;
                            continue;
                        }
                        let turned = interface.turned(self.world, &path, interface.refracting);
                        let passed = turned.map_or(0.0, |_| 1.0 - interface.reflectance);
                        path.weight *= passed.max(LEAST_PASSED.into());
                        self.pass(&mut path, &interface, interface.refracting, after);
                        true
                    }
                    Role::Main => {
                        self.branch(&path, &interface);
                        path.weight *= 1.0 - interface.reflectance;
                        interface.reflectance < 1.0 && self.transmit(&mut path, &interface, after)
                    }
                    Role::Branch => self.part(&mut path, &interface, after),
                    Role::Single => self.choose(&mut path, &interface, after),
                };
                if !goes_on {
                    return;
                }
            }
        }
        self.lose_no_more(&path);
    }

    /// Deposits what `interface` sends straight back of `path`; the first path of a line speaks for all where they are alike.
    fn echo(&mut self, path: &Path, interface: &Interface) {
        let frame = self.world.frame;
        let mean = path.role == Role::Main && are_alike(frame) && frame.flags & FLAG_COHERENT == 0;
        let out = &mut self.out.surface;
        match mean {
            true if path.n == 0 => interface.mean_echo(self.world, path, out),
            true => (),
            false => interface.echo(self.world, path, out),
        }
    }

    /// True if the path gives no more echoes: it is outside of all masks, and neither a mask nor
    /// a face that would reflect it is ahead.
    fn flies_past(&self, path: &Path, t_end: f64, mask_ahead: bool) -> bool {
        let frame = self.world.frame;
        let bounces = frame.flags & FLAG_FACE_REFLECTION != 0
            && path.reflections < frame.max_reflections
            && self.face(path, t_end).is_some();
        !self.world.is_heard(&path.stack) && !mask_ahead && !bounces
    }

    /// Speed of a path: that of its medium, or around the masks, and past what throws a shadow, that of the acquired
    /// image.
    fn speed(&self, path: &Path) -> f64 {
        let (tissue, _) = self.world.medium(&path.stack);
        let heard = self.world.is_heard(&path.stack);
        let speed = f64::from(self.world.tissues[tissue as usize].speed);
        let assumed = !heard || self.is_passed_by(path, speed);
        if assumed { f64::from(self.world.frame.speed) } else { speed }
    }

    fn ended(&self, path: &Path) -> bool {
        path.interactions >= self.world.frame.max_interactions
            || path.time >= self.end()
            || match self.is_steady(path) {
                true => path.weight <= 0.0,
                false => path.weight * path.survival < f64::from(self.world.frame.min_weight),
            }
    }

    /// The transducer's face, for reflected paths, if it is nearer than `limit`.
    fn face(&self, path: &Path, limit: f64) -> Option<(f64, DVec3)> {
        if path.reflections == 0 {
            return None;
        }
        let to_probe = &self.probe_from_world;
        let (o, d) =
            (to_probe.transform_point3(path.origin), to_probe.transform_vector3(path.direction));
        let (t, normal) = face(self.world.frame, o, d, path.t_min)?;
        let world = affine(&self.world.frame.world_from_probe);
        (t < limit).then(|| (t, world.transform_vector3(normal).normalize()))
    }

    /// Deposits the part that the transducer's face, a perfect mirror, sends back along the path.
    fn face_echo(&mut self, path: &Path, normal: DVec3) {
        let cos = -path.direction.dot(normal);
        let lobe = (2.0 * cos * cos - 1.0).max(0.0);
        if cos > 0.0 && self.world.is_heard(&path.stack) {
            let amplitude = path.share * path.weight * lobe * path.beam_weight(self.world.frame);
            let gain = interface::gain(self.world, path);
            let (l, _) = path.scanline(self.world.frame.scanlines);
            let dither = path.dither(self.world.frame, path.n);
            let surface = &mut self.out.surface;
            surface.deposit(l, path.time, amplitude, 0.0, gain, dither);
        }
    }

    /// Moves the path by `t` to its next interaction.
    fn interact(&mut self, path: &mut Path, t: f64) {
        self.advance(path, t);
        path.interactions += 1;
        self.out.counters.interactions += 1;
    }

    /// Moves the path by `t`.
    fn advance(&mut self, path: &mut Path, t: f64) {
        self.lose(path, path.time + t / self.speed(path));
        path.origin += t * path.direction;
        path.weight *= self.world.unabsorbed(&path.stack, t);
        if self.is_steady(path) {
            path.weight = path.weight.max(LEAST_MAIN.into());
        }
        path.time += t / self.speed(path);
        let [a, b, c] = path.spread;
        path.spread = [a + 2.0 * b * t + c * t * t, b + c * t, c];
        let [a, b, c] = path.lens;
        path.lens = [a + b * t + c * t * t, b + 2.0 * c * t, c];
        path.strip[0] += t * path.strip[1];
        path.t_min = step(path.origin);
    }

    /// Refracts into the next medium; false when the path is lost to total reflection.
    fn transmit(&mut self, path: &mut Path, interface: &Interface, after: Stack) -> bool {
        let rough = self.world.frame.flags & FLAG_ROUGH_TRANSMISSION != 0;
        let normal = match interface.micro {
            Some(micro) if rough => micro.normal,
            _ => interface.refracting,
        };
        if interface.turned(self.world, path, normal).is_none() {
            self.out.counters.paths_lost += 1;
            return false;
        }
        self.pass(path, interface, normal, after);
        true
    }

    /// Goes through a surface of this normal, straight on where all is reflected.
    fn pass(&self, path: &mut Path, interface: &Interface, normal: DVec3, after: Stack) {
        let direction = interface.turned(self.world, path, normal).unwrap_or(path.direction);
        let row = &self.world.rows[self.out.surface.sample(path.time)];
        if self.is_steady(path) {
            path.bent += interface.ray_bending(path);
        }
        if self.world.frame.flags & FLAG_WAVEFRONT != 0 {
            path.lens[2] += f64::from(row.aperture) * interface.bending(path, normal);
        }
        let lateral = (path.lateral - path.lateral.dot(direction) * direction).normalize();
        path.strip = interface.strip_behind(path, normal, lateral);
        path.direction = direction;
        path.lateral = lateral;
        path.stack = after;
    }

    /// True if the volume echoes of a branch are below the volume floor.
    fn is_faint(&self, path: &Path) -> bool {
        let row = &self.world.rows[self.out.surface.sample(path.time)];
        path.weight * path.survival * f64::from(row.compensation)
            < f64::from(self.world.frame.volume_floor)
    }

    /// Distance between scanlines where the path is, mm, and its growth per mm in `tissue`.
    fn nominal(&self, path: &Path, tissue: u32) -> [f64; 2] {
        let [pitch, growth] = line_pitch(self.world.frame);
        let speed = f64::from(self.world.frame.speed);
        let of_tissue = f64::from(self.world.tissues[tissue as usize].speed);
        [pitch + growth * speed * path.time, growth * speed / of_tissue]
    }

    /// Distance of the neighbouring scanline's path: that of a main path, of reflected ones the scanline's.
    fn strip(&self, path: &Path, tissue: u32) -> [f64; 2] {
        if path.reflections > 0 {
            return self.nominal(path, tissue);
        }
        let side = if path.strip[0] < 0.0 { -1.0 } else { 1.0 };
        path.strip.map(|part| side * part)
    }

    /// True if a strip that neighbouring paths leave is wider or narrower than it may be, at one of its ends.
    fn is_limited(&self, path: &Path, strip: [f64; 2], length: f64, tissue: u32) -> bool {
        let nominal = self.nominal(path, tissue);
        let (least, limit) = (f64::from(LEAST_PITCH), f64::from(STRIP_LIMIT));
        let beyond = |x: f64| {
            let ratio = (strip[0] + x * strip[1]).abs() / (nominal[0] + x * nominal[1]).max(least);
            !(1.0 / limit..=limit).contains(&ratio)
        };
        nominal[0] > least && (beyond(0.0) || beyond(length))
    }

    /// Stores the segment of `length` ahead of the path, if scatterers or points can lie there.
    fn emit(&mut self, path: &Path, length: f64) {
        let (tissue, instance) = self.world.medium(&path.stack);
        let scatters = self.world.tissues[tissue as usize].presence > 0.0;
        let holds_echoes = scatters || !self.world.points.is_empty();
        // A NaN length is no stretch either.
        let speed = self.world.tissues[tissue as usize].speed.into();
        if self.ahead
            || self.is_passed_by(path, speed)
            || !holds_echoes
            || length.partial_cmp(&0.0) != Some(std::cmp::Ordering::Greater)
        {
            return;
        }
        let frame = self.world.frame;
        let unsplit = frame.sampling == SAMPLING_SHARED_PRIMARY && path.interactions == 0;
        if !self.world.is_heard(&path.stack) || path.role == Role::Branch && self.is_faint(path) {
            return;
        }
        let (weight, share) = match path.role {
            _ if !are_alike(frame) => own_share(path),
            Role::Single if !unsplit => own_share(path),
            _ if path.n != path.group[0] => return,
            // Speckle adds in power; the first of a group stands for all of it.
            Role::Branch => {
                let power = path.probability * path.share * f64::from(path.group[1]);
                (path.weight * power.sqrt(), 1.0)
            }
            _ => (path.weight, 1.0),
        };
        let strip = self.strip(path, tissue);
        self.out.counters.strips_limited += u32::from(self.is_limited(path, strip, length, tissue));
        self.out.segments[path.line as usize].push(Segment {
            origin: path.origin,
            length,
            direction: path.direction,
            time: path.time,
            lateral: path.lateral,
            weight,
            spread: path.spread,
            lens: path.lens,
            strip: [strip[0].max(LEAST_PITCH.into()), strip[1]],
            reflected: path.reflections > 0,
            share,
            tissue,
            instance,
            line: path.line,
            handedness: path.handedness,
        });
    }
}

/// True if all paths of a line are equal up to their first reflection.
fn are_alike(frame: &Frame) -> bool {
    frame.origin_jitter <= 0.0
        && frame.emission_lobe <= 0.0
        && frame.flags & FLAG_ROUGH_TRANSMISSION == 0
}

/// Weight and share of a path that stands for itself only.
fn own_share(path: &Path) -> (f64, f64) {
    (
        path.weight * path.survival.sqrt() * path.share,
        (path.probability / (path.survival * path.share)).max(1.0),
    )
}

#[cfg(test)]
mod tests;
