//! Nodes of the main paths: what they pass on their way, and what of the beam is left where its middle is dark.

use insonify::sim::layout::{APERTURE_BANDS, HARDLY_PASSED, OTHER_SPEED};

use super::Tracer;
use crate::reference::aperture::{
    Passed, UNKNOWN, loses_by_aperture, lost_of, nepers, place, time_of,
};
use crate::reference::interface::Interface;
use crate::reference::path::{Path, Role};
use crate::reference::straight::Start;
use crate::reference::world::World;

/// Nodes of the main paths, by layer, node and scanline; nothing where losses do not count by the aperture.
pub fn passed(world: &World, starts: &[Start]) -> Vec<Passed> {
    let frame = world.frame;
    let lines = frame.layers * frame.scanlines;
    if !loses_by_aperture(frame) {
        return Vec::new();
    }
    let mut tracer =
        Tracer::new(world, vec![Passed::default(); (lines * (APERTURE_BANDS + 1)) as usize]);
    tracer.ahead = true;
    for line in 0..lines {
        tracer.node = 0;
        tracer.noted = 0.0;
        let path = tracer.start(line, 0, &starts[line as usize]);
        tracer.follow(path);
    }
    tracer.out.passed
}

impl Tracer<'_> {
    /// True for a main path that goes on where its own beam is dark.
    pub(super) fn is_steady(&self, path: &Path) -> bool {
        path.role == Role::Main && loses_by_aperture(self.world.frame)
    }

    /// True for a main path at a surface that lets hardly anything through.
    pub(super) fn is_hidden(&self, path: &Path, interface: &Interface) -> bool {
        self.is_steady(path) && interface.reflectance > 1.0 - f64::from(HARDLY_PASSED)
    }

    /// True for a shadowed path in a medium of another speed than tissue, past which others reach.
    pub(super) fn is_passed_by(&self, path: &Path, speed: f64) -> bool {
        let assumed = f64::from(self.world.frame.speed);
        path.shadowed && (speed - assumed).abs() > f64::from(OTHER_SPEED) * assumed
    }

    /// A main path with the weight of the whole beam where it is.
    pub(super) fn whole(&self, path: &Path) -> Path {
        let mut whole = path.clone();
        if self.is_steady(path) && !self.ahead {
            let table =
                |at: usize| [self.world.apertures[at].gain.into(), self.out.passed[at].lost];
            let lost = lost_of(path.weight);
            whole.weight *= nepers(self.world.frame, table, path.line, path.time, lost).exp();
        }
        whole
    }

    /// Notes what a main path loses in its medium up to a time at the nodes that it reaches before.
    pub(super) fn lose(&mut self, path: &Path, until: f64) {
        let (tissue, _) = self.world.medium(&path.stack);
        let absorption = f64::from(self.world.tissues[tissue as usize].absorption);
        self.note(path, Some(absorption * self.speed(path)), until);
    }

    /// Notes that a main path has ended; one without a weight was not followed.
    pub(super) fn lose_no_more(&mut self, path: &Path) {
        self.note(path, (path.weight > 0.0).then_some(0.0), f64::INFINITY);
    }

    pub(super) fn note(&mut self, path: &Path, rate: Option<f64>, until: f64) {
        let frame = self.world.frame;
        if !self.ahead {
            return;
        }
        while self.node <= APERTURE_BANDS && time_of(frame, self.node) < until {
            let way = time_of(frame, self.node) - path.time;
            let at = place(frame, path.line, self.node);
            let followed = rate.filter(|_| way >= 0.0);
            let lost = followed
                .map_or(UNKNOWN, |rate| (lost_of(path.weight) + rate * way).min(lost_of(0.0)));
            self.out.passed[at] = Passed { lost, bent: path.bent - self.noted };
            self.noted = path.bent;
            self.node += 1;
        }
    }
}
