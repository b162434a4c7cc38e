//! The parting of paths at a surface: what is reflected off a main path, and what a path does there by chance.

use insonify::sim::layout::{LEAST_SURVIVAL, TRAIN_FACING, TRAIN_FLOOR, TRAIN_PATHS};

use super::{Tracer, are_alike};
use crate::reference::interface::Interface;
use crate::reference::path::{PURPOSE_PARTS, PURPOSE_SURVIVAL, Path, Role, reflect, widen};
use crate::reference::random::{PURPOSE_CHOICE, draw, unit};
use crate::reference::stack::Stack;

impl Tracer<'_> {
    /// Amplitude of what `interface` sends back of `path`, attenuation made up for.
    fn level(&self, path: &Path, interface: &Interface) -> f64 {
        let row = &self.world.rows[self.out.surface.sample(path.time)];
        path.weight * path.survival * interface.reflectance * f64::from(row.compensation)
    }

    /// Follows the reflected part that main-path sampling splits off, to its end.
    pub(super) fn branch(&mut self, main: &Path, interface: &Interface) {
        let frame = self.world.frame;
        let reflects = !self.ahead && main.reflections < frame.max_reflections;
        let Some(echo) = interface.micro.filter(|_| reflects) else {
            return;
        };
        let (n, big_r) = (f64::from(frame.paths), interface.reflectance);
        let mut path = Path { role: Role::Branch, shadowed: false, ..main.clone() };
        // Russian roulette: the fainter a branch, the more rarely it is followed, with as much more weight.
        let level = self.level(&path, interface);
        let floor = f64::from(frame.branch_floor);
        if level < floor {
            path.survival = (level / floor).max(f64::from(LEAST_SURVIVAL));
        }
        let train = path.survival == 1.0 && interface.makes_train(&path, level);
        let least = if train { f64::from(TRAIN_PATHS) } else { 1.0 };
        let branches = (n * big_r).ceil().max(least).min(n);
        if f64::from(main.n) >= branches
            || unit(path.line_random(frame, main.n, PURPOSE_SURVIVAL)[0]) >= path.survival
        {
            return;
        }
        path.weight *= big_r / path.survival;
        path.probability = path.survival;
        path.share = 1.0 / branches;
        path.group = if are_alike(frame) { [0, branches as u32] } else { [main.n, 1] };
        reflect(&mut path, echo.reflected, echo.normal);
        widen(&mut path, interface.roughness, interface.turn);
        if !self.ended(&path) {
            self.follow(path);
        }
    }

    /// Divides the group of a branch's path at a surface; true if the path continues.
    pub(super) fn part(&mut self, path: &mut Path, interface: &Interface, after: Stack) -> bool {
        let frame = self.world.frame;
        let big_r = interface.reflectance;
        let [first, count] = path.group;
        let paths = f64::from(count);
        let train = interface.makes_train(path, self.level(path, interface));
        let portion = if train { big_r.max(0.5) } else { big_r };
        let u = unit(path.line_random(frame, first, PURPOSE_PARTS)[0]);
        let both = count > 1 && paths * portion >= 1.0 && paths * (1.0 - portion) >= 1.0;
        let last = path.reflections >= frame.max_reflections;
        let back = match (last, both) {
            (true, _) if big_r < 1.0 => 0,
            (true, _) => count,
            (false, true) => (paths * portion + 0.5) as u32,
            (false, false) => ((paths * big_r + u) as u32).min(count),
        };
        let reflects = path.n - first >= count - back;
        let (group, part) = match reflects {
            true => ([first + count - back, back], big_r),
            false => ([first, count - back], 1.0 - big_r),
        };
        path.group = group;
        if both || last {
            path.weight *= part;
            path.share *= paths / f64::from(group[1]);
        } else {
            path.probability *= part;
        }
        self.turn(path, interface, after, reflects)
    }

    /// Chooses reflection or transmission at random; true if the path continues.
    pub(super) fn choose(&mut self, path: &mut Path, interface: &Interface, after: Stack) -> bool {
        let frame = self.world.frame;
        let mut u = unit(draw(frame, path.n, path.key(), PURPOSE_CHOICE)[0]);
        if path.interactions == 1 {
            u = (f64::from(path.n) + u) / f64::from(frame.paths);
        }
        let reflects = u < interface.reflectance;
        let part = if reflects { interface.reflectance } else { 1.0 - interface.reflectance };
        path.probability *= part;
        self.turn(path, interface, after, reflects)
    }

    /// Reflects or transmits a path; true if it continues.
    fn turn(&mut self, path: &mut Path, interface: &Interface, after: Stack, back: bool) -> bool {
        if !back {
            return self.transmit(path, interface, after);
        }
        let most = self.world.frame.max_reflections;
        let Some(micro) = interface.micro.filter(|_| path.reflections < most) else {
            return false;
        };
        reflect(path, micro.reflected, micro.normal);
        widen(path, interface.roughness, interface.turn);
        true
    }
}

impl Interface {
    /// True if what the surface sends back meets it, or one beside it, again.
    fn makes_train(&self, path: &Path, level: f64) -> bool {
        -path.direction.dot(self.shading) > f64::from(TRAIN_FACING)
            && level >= f64::from(TRAIN_FLOOR)
    }
}
