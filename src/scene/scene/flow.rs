//! Blood that flows in a mesh: its velocity from place to place and over time, and how far it has carried what is in it.
//!
//! A flow is a shape, which spreads the speed over the mesh, times a course, which says how the speed changes over time.
//! What scatters in the blood is carried along for a while and then renewed, in two generations of which one is loudest
//! while the other is silent: the squares of their weights add up to 1, so that speckle is as loud at every time. A
//! generation lives as long as the flow shears it by little enough for its scatterers to be found.

pub mod course;
mod line;
mod vessel;

use glam::{DAffine3, DMat3, DVec3};

pub use course::Course;
pub use line::CentreLine;
pub use vessel::{Apart, Tube, Vessel};

/// Largest change of the way per mm across it, at the end of a generation's life: scatterers are found by an affine map
/// with a limit on its stretch (`docs/kernels.md`, scatter), which a shear by this much respects.
pub const MOST_SHEAR: f64 = 1.5;
/// Longest way, mm, that scatterers are carried to either side of where they rest. Several resolution cells: by then what
/// a scanner shows at a place has long been replaced.
pub const MOST_WAY: f64 = 10.0;
/// Longest life of a generation, s, where hardly anything flows.
const LONGEST_LIFE: f64 = 1000.0;

/// Blood that flows in one mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Flow {
    /// Name in messages and for overrides.
    pub name: String,
    /// Index into [`Scene::instances`](super::Scene::instances).
    pub instance: usize,
    /// Shape of the flow: the way its speed is spread over the mesh.
    pub shape: FlowShape,
    /// Speed, mm/s, where shape and course are 1.
    pub speed: f64,
    /// How the speed changes over time.
    pub course: Course,
    /// The present time, s.
    pub(super) seconds: f64,
}

/// Shape of a flow: the way its speed is spread over a mesh, in the mesh's own space.
#[derive(Clone, Debug, PartialEq)]
pub enum FlowShape {
    /// Alike everywhere, in this direction.
    Uniform(
        /// Unit vector.
        DVec3,
    ),
    /// Along a tube and its branches: fastest on their centre lines, at rest on their walls.
    Tube(
        /// The lines.
        Vessel,
    ),
}

/// Scatterers of blood that were set out at the same time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Generation {
    /// Number; no two generations that live at a time have the same.
    pub number: u32,
    /// Factor on amplitudes.
    pub weight: f64,
    /// How far the flow has carried them from where they rest, mm, where its shape is 1; below 0 in the first half of
    /// their life.
    pub way: f64,
}

impl Flow {
    /// A flow at time 0.
    pub fn new(
        name: String,
        instance: usize,
        shape: FlowShape,
        speed: f64,
        course: Course,
    ) -> Self {
        Self { name, instance, shape, speed, course, seconds: 0.0 }
    }

    /// True if the other one is the same flow, at whatever time.
    pub fn is_same(&self, other: &Self) -> bool {
        *self == Self { seconds: self.seconds, ..other.clone() }
    }

    /// Velocity at a place of the mesh at `seconds`, mm/s, in the space to which `placed` brings the mesh.
    pub fn velocity(&self, place: DVec3, placed: &DAffine3, seconds: f64) -> DVec3 {
        let rate = self.speed * self.course.at(seconds);
        rate * self.shape.velocity(place, &placed.matrix3)
    }

    /// How far it carries what flows where its shape is 1 between two times, mm.
    pub fn way(&self, from: f64, to: f64) -> f64 {
        self.speed * (self.course.way(to) - self.course.way(from))
    }

    /// How far it carries that in `interval` seconds from now on, at the present speed, mm.
    pub fn pace(&self, interval: f64) -> f64 {
        self.speed * self.course.at(self.seconds) * interval
    }

    /// Life of a generation in a mesh that `placed` brings into the world, s. `within` holds the places of the mesh, in its
    /// own space: what flows faster elsewhere does not count.
    pub fn lifetime(&self, placed: &DAffine3, within: impl Fn(DVec3) -> bool) -> f64 {
        let (speed, shear) = self.shape.extremes(placed, within);
        let fastest = self.speed.abs() * self.course.largest();
        let sheared = MOST_SHEAR / (fastest * shear);
        let carried = MOST_WAY / (fastest * speed);
        (2.0 * sheared.min(carried)).min(LONGEST_LIFE)
    }

    /// The two generations of `after` seconds from now, of which each lives for `lifetime`.
    pub fn generations(&self, lifetime: f64, after: f64) -> [Generation; 2] {
        let seconds = self.seconds + after;
        [0.0, 0.5].map(|later| {
            let lives = seconds / lifetime + later;
            let age = lives - lives.floor() - 0.5;
            let halves = 2.0 * lives.floor() + 2.0 * later;
            Generation {
                // Numbers begin again after two million, long after the same ones have gone.
                number: halves.rem_euclid(f64::from(1 << 21)) as u32,
                weight: (std::f64::consts::PI * age).cos(),
                way: self.way(seconds - age * lifetime, seconds),
            }
        })
    }
}

impl FlowShape {
    /// Velocity over the speed at a place of the mesh, in the directions of the space to which `placed` brings it.
    pub fn velocity(&self, place: DVec3, placed: &DMat3) -> DVec3 {
        match self {
            Self::Uniform(direction) => (*placed * *direction).normalize_or_zero(),
            Self::Tube(vessel) => vessel.velocity(place, placed),
        }
    }

    /// Largest velocity over the speed, and its largest change per mm, in a mesh that `placed` brings into the world, where
    /// `within` holds the places of the mesh's own space.
    fn extremes(&self, placed: &DAffine3, within: impl Fn(DVec3) -> bool) -> (f64, f64) {
        match self {
            Self::Uniform(_) => (1.0, 0.0),
            Self::Tube(vessel) => {
                let (speed, shear) = vessel.extremes(within);
                (speed, shear / thinnest(placed))
            }
        }
    }

    /// The narrowest radius, mm, in the space to which `placed` brings the mesh, where `within` holds the places of the mesh's
    /// own space; none of a shape that is alike everywhere.
    pub fn narrowest(&self, placed: &DAffine3, within: impl Fn(DVec3) -> bool) -> Option<f64> {
        match self {
            Self::Uniform(_) => None,
            Self::Tube(vessel) => Some(thinnest(placed) * vessel.narrowest(within)),
        }
    }
}

/// The smallest factor by which a placement stretches the axes of a mesh.
fn thinnest(placed: &DAffine3) -> f64 {
    let m = &placed.matrix3;
    [m.x_axis, m.y_axis, m.z_axis].map(DVec3::length).into_iter().fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::animation::Clock;

    fn tube(exponent: f64, speed: f64, course: Course) -> Flow {
        let line = CentreLine::new(vec![DVec3::ZERO, DVec3::Z * 40.0], vec![3.0; 2]);
        let shape = FlowShape::Tube(Vessel::tube(line.expect("two points"), exponent));
        Flow::new("vessel".into(), 0, shape, speed, course)
    }

    /// A course that goes to and fro, of 0.8 s.
    fn pulse() -> Course {
        let knots = vec![[0.0, 0.2], [0.1, 1.0], [0.4, -0.3], [1.0, 0.2]];
        Course::pulsatile(Clock { period: 0.8, phase: 0.3, ..Clock::default() }, knots)
    }

    #[test]
    fn a_parabola_carries_half_of_what_its_middle_would() {
        let flow = tube(2.0, 500.0, Course::Steady);
        // Q = pi R^2 v / 2, by rings.
        let rings = 3000;
        let rate: f64 = (0..rings)
            .map(|i| {
                let [low, high] = [i, i + 1].map(|i| 3.0 * f64::from(i) / f64::from(rings));
                let place = DVec3::new(low.midpoint(high), 0.0, 20.0);
                let area = std::f64::consts::PI * (high * high - low * low);
                area * flow.velocity(place, &DAffine3::IDENTITY, 0.0).z
            })
            .sum();
        let expected = std::f64::consts::PI * 9.0 * 500.0 / 2.0;
        assert!((rate / expected - 1.0).abs() < 1e-6, "{rate} {expected}");
    }

    #[test]
    fn a_placement_turns_a_flow_and_keeps_its_speed() {
        let flow = tube(4.0, 300.0, Course::Steady);
        let scale = DVec3::new(2.0, 0.5, 3.0);
        let turn = glam::DQuat::from_rotation_x(0.5);
        let placed = DAffine3::from_scale_rotation_translation(scale, turn, DVec3::ONE);
        let velocity = flow.velocity(DVec3::Z, &placed, 0.0);
        assert!(velocity.abs_diff_eq(turn * DVec3::Z * 300.0, 1e-9), "{velocity}");
    }

    /// The way is the integral of the speed.
    #[test]
    fn the_way_is_what_the_speed_adds_up_to() {
        let flow = tube(2.0, 800.0, pulse());
        let steps = 200_000;
        for (from, to) in [(0.0, 0.1), (-0.7, 2.9), (5.3, 5.1)] {
            let step = (to - from) / f64::from(steps);
            let at = |i: i32| from + step * (f64::from(i) + 0.5);
            let sum: f64 = (0..steps).map(|i| step * 800.0 * flow.course.at(at(i))).sum();
            assert!((flow.way(from, to) - sum).abs() < 1e-4, "{} {sum}", flow.way(from, to));
        }
    }

    #[test]
    fn generations_are_as_loud_together_at_every_time_and_are_renewed_in_silence() {
        let mut flow = tube(2.0, 800.0, pulse());
        let lifetime = flow.lifetime(&DAffine3::IDENTITY, |_| true);
        // The wall's shear is 2 * 800 / 3 a second.
        assert!((lifetime - 2.0 * MOST_SHEAR * 3.0 / 1600.0).abs() < 1e-12, "{lifetime}");
        let mut before = flow.generations(lifetime, 0.0);
        for i in 1..4000 {
            flow.seconds = f64::from(i) * lifetime / 200.0;
            let now = flow.generations(lifetime, 0.0);
            let power: f64 = now.iter().map(|g| g.weight * g.weight).sum();
            assert!((power - 1.0).abs() < 1e-12);
            assert_ne!(now[0].number, now[1].number);
            for (now, before) in now.iter().zip(&before) {
                if now.number == before.number {
                    let moved = flow.way(flow.seconds - lifetime / 200.0, flow.seconds);
                    assert!((now.way - before.way - moved).abs() < 1e-9);
                } else {
                    assert!(now.weight < 0.02 && before.weight < 0.02, "{now:?} {before:?}");
                }
                assert!(now.way.abs() <= MOST_SHEAR * 3.0 / 2.0 + 1e-9);
            }
            before = now;
        }
    }
}
