//! Poses of the probe: around the scene's own, along a trajectory, or on the skin.

use glam::{DAffine3, DVec3};
use toml::{Table, Value as Toml};

use super::distribution::Distribution;
use super::draws::{Count, Draw, DrawKind, Drawn, draw};
use super::reading::{Read, Target};
use crate::scene::animation::{Track, Trs};
use crate::scene::file::Document;
use crate::scene::{Scene, SceneError};
use crate::settings::units::{ANGLE, DURATION, LENGTH};
use crate::settings::{Facts, plain, suggest};
use crate::sim::contact::{Coupling, Hand, PRESS, Skins};

/// Farthest that a pose is drawn from the one around which it is drawn, mm.
const FAR: f64 = 1000.0;
/// Largest turn, rad: a full one.
const ROUND: f64 = std::f64::consts::TAU;
/// Attempts to find a place on the skin.
const ATTEMPTS: u32 = 64;
/// Share of the face that touches the skin at least, unless the plan says it.
const CONTACT: f64 = 0.7;

const SHIFT: Facts = Facts::quantity(&LENGTH, -FAR, FAR);
const TURN: Facts = Facts::quantity(&ANGLE, -ROUND, ROUND);
/// Parts of a pose, in the order in which they are applied: shifts along the probe's axes, then turns about the middle
/// of its face.
const PARTS: [Facts; 6] = [
    SHIFT.key("lateral"),
    SHIFT.key("elevation"),
    SHIFT.key("depth"),
    TURN.key("rotate"),
    TURN.key("tilt"),
    TURN.key("rock"),
];
const LATERAL: usize = 0;
const ELEVATION: usize = 1;
const DEPTH: usize = 2;
/// Time on a trajectory.
const MOMENT: Facts =
    Facts::quantity(&DURATION, f64::NEG_INFINITY, f64::INFINITY).key("trajectory");

/// Poses of the probe in the samples of a scene.
#[derive(Clone, Debug)]
pub(super) struct Poses {
    /// Least share of the face that touches the skin, where the probe is put on it.
    skin: Option<f64>,
    trajectory: Option<Track>,
    /// Draws of the parts, in the order of [`PARTS`].
    parts: [Option<usize>; 6],
    /// Draw of the time on the trajectory.
    moment: Option<usize>,
}

fn name(facts: &Facts) -> String {
    format!("pose.{}", facts.key)
}

impl Poses {
    /// Reads the table at `at` but for the draws, which are not known yet.
    pub fn new(
        document: &Document<'_>,
        at: &str,
        table: &Table,
        trajectory: Option<Track>,
        scene: &Scene,
    ) -> Result<Self, SceneError> {
        let fail = |key: &str, message: String, remedy: &str| {
            Err(document.fail(&format!("{at}.{key}"), message, remedy))
        };
        let known = || PARTS.iter().map(|facts| facts.key).chain(["skin", "contact", "trajectory"]);
        if let Some(wrong) = table.keys().find(|key| !known().any(|k| k == key.as_str())) {
            let message = format!("unknown part of a pose: `{wrong}`");
            return fail(
                wrong,
                message,
                &suggest::among(wrong, known().collect::<Vec<_>>().into_iter()),
            );
        }
        let on_skin = match table.get("skin") {
            None => false,
            Some(Toml::Boolean(on)) => *on,
            Some(other) => {
                return fail(
                    "skin",
                    format!("{other} is neither true nor false"),
                    "write skin = true",
                );
            }
        };
        if on_skin && scene.contact.is_none() {
            let message = "the scene names no skin".to_owned();
            return fail(
                "skin",
                message,
                "add [contact] with the meshes of the skin to the scene file",
            );
        }
        let share = match table.get("contact") {
            None => CONTACT,
            Some(_) if !on_skin => {
                let message = "nothing is held to the skin".to_owned();
                return fail("contact", message, "add skin = true, or leave `contact` out");
            }
            Some(given) => match given.as_float().or(given.as_integer().map(|i| i as f64)) {
                Some(share) if (0.0..=1.0).contains(&share) => share,
                _ => {
                    return fail(
                        "contact",
                        format!("{given} is no share of the face"),
                        "give 0 to 1",
                    );
                }
            },
        };
        let skin = on_skin.then_some(share);
        Ok(Self { skin, trajectory, parts: [None; 6], moment: None })
    }

    /// The draws of the table at `at`.
    pub fn read(
        &self,
        document: &Document<'_>,
        at: &str,
        table: &Table,
    ) -> Result<Vec<Read>, SceneError> {
        let mut out = Vec::new();
        for facts in &PARTS {
            if let Some(value) = table.get(facts.key) {
                let at = format!("{at}.{}", facts.key);
                let target = Target { name: name(facts), at, facts: Some(facts), document };
                out.push(target.read(value, facts.form)?);
            }
        }
        if let Some((first, last)) = self.trajectory.as_ref().and_then(Track::span) {
            let kind = match first < last {
                true => DrawKind::Number(Distribution::Uniform([first, last])),
                false => DrawKind::Constant(Drawn { number: Some(first), text: plain(first) }),
            };
            let at = format!("{at}.trajectory");
            let facts = Some(&MOMENT);
            let moment = Draw { name: name(&MOMENT), at, facts, kind, with: None, again: false };
            out.push(Read { draw: moment, other: None });
        }
        out.iter_mut().for_each(|read| read.draw.again = true);
        Ok(out)
    }

    /// Notes where its draws are among all.
    pub fn find(&mut self, draws: &[Draw]) {
        let place = |facts: &Facts| draws.iter().position(|d| d.name == name(facts));
        self.parts = std::array::from_fn(|i| place(&PARTS[i]));
        self.moment = place(&MOMENT);
    }

    /// True if draw `index` is a part of the pose.
    pub fn holds(&self, index: usize) -> bool {
        self.parts.contains(&Some(index)) || self.moment == Some(index)
    }

    /// World from probe of a sample, mm, on the scene as it is at the sample's time; none where no place on the skin was
    /// found. The scene's own pose is changed.
    pub fn pose(
        &self,
        draws: &[Draw],
        count: Count,
        scene: &mut Scene,
        skins: &mut Skins,
    ) -> Option<DAffine3> {
        let own = scene.world_from_probe;
        let Some(least) = self.skin else {
            let base = self.base(draws, count, own);
            return Some(base * self.shift(draws, count) * self.turn(draws, count));
        };
        let skin = skins.of(scene);
        let probe = scene.probe.clone();
        let hand = Hand::new(&skin, &probe);
        (0..ATTEMPTS).find_map(|attempt| {
            let count = Count { attempt, ..count };
            let base = self.base(draws, count, own);
            let [lateral, elevation] =
                [LATERAL, ELEVATION].map(|part| self.part(draws, count, part));
            let along = base.transform_vector3(DVec3::new(
                lateral.unwrap_or(0.0),
                elevation.unwrap_or(0.0),
                0.0,
            ));
            let press = self.part(draws, count, DEPTH).unwrap_or(PRESS);
            let (slid, to) = hand.slid_by(&base, along, press)?;
            let slid = slid * self.turn(draws, count);
            scene.world_from_probe = hand.slid(&slid, &to, &to, press);
            let coupling = Coupling::of(scene, skins)?;
            (coupling.touch.share >= least).then_some(scene.world_from_probe)
        })
    }

    /// The pose around which others are drawn.
    fn base(&self, draws: &[Draw], count: Count, own: DAffine3) -> DAffine3 {
        let (Some(track), Some(moment)) = (&self.trajectory, self.moment) else { return own };
        let (_, rotation, translation) = own.to_scale_rotation_translation();
        let rest = Trs { translation, rotation, ..Trs::default() };
        let time = draw(draws, moment, count).number.expect("a time");
        track.at(rest, time).matrix()
    }

    fn part(&self, draws: &[Draw], count: Count, part: usize) -> Option<f64> {
        self.parts[part].and_then(|index| draw(draws, index, count).number)
    }

    fn shift(&self, draws: &[Draw], count: Count) -> DAffine3 {
        let along =
            [LATERAL, ELEVATION, DEPTH].map(|part| self.part(draws, count, part).unwrap_or(0.0));
        DAffine3::from_translation(along.into())
    }

    fn turn(&self, draws: &[Draw], count: Count) -> DAffine3 {
        let angle = |part: usize| self.part(draws, count, part).unwrap_or(0.0);
        DAffine3::from_rotation_z(angle(3))
            * DAffine3::from_rotation_x(angle(4))
            * DAffine3::from_rotation_y(angle(5))
    }
}
