//! The `motion` of a transform.

use glam::DVec3;

use super::columns;
use super::document::Document;
use super::error::SceneError;
use super::placing::{AXIS, PLACE, TURN};
use super::table::Stated;
use super::trajectory;
use crate::scene::animation::{Clock, Curve, Fetal, Loop, Motion, Trs, Turn};
use crate::settings::units::{DURATION, RATE};
use crate::settings::{Facts, Form, Value, group, words};

/// Shortest and longest period, s: a microsecond, which no frame resolves, to a day.
pub(super) const PERIODS: (f64, f64) = (1e-6, 86_400.0);
/// Factors by which tissue may be squeezed or stretched: half and twice is more than real tissue bears, and the limit
/// to which its scatterers are found (`docs/kernels.md`, Deformed tissue).
pub(super) const SQUEEZE: (f64, f64) = (0.4, 2.5);
/// Updates per second: from one a day to more than any frame rate.
pub(super) const UPDATES: Facts = Facts::quantity(&RATE, 1e-5, 1e6);
/// The time in which all is shown once.
pub(super) const PERIOD: Facts = Facts::quantity(&DURATION, PERIODS.0, PERIODS.1).key("period");
/// Longest mean of a burst of movements or of a pause, s.
const LONGEST: f64 = 3600.0;

words! {
    /// Kind of a motion.
    pub enum MotionKind {
        /// To and fro.
        Sine = "sine",
        /// Round and round.
        Orbit = "orbit",
        /// Bursts of movements at irregular times.
        Fetal = "fetal",
        /// Along a trajectory.
        File = "file",
    }
}

words! {
    /// Interpolation between the rows of a trajectory.
    pub enum Between {
        /// Straight, and rotations along the great circle.
        Linear = "linear",
        /// The values of the row before.
        Step = "step",
    }
}

group! {
    /// Phase of a period, and its end.
    pub struct Cycle in "" {
        /// Place in the period at time 0.
        phase: f64 = 0.0, Facts::number(0.0, 1.0);
        /// After a period: again; stay; or back the same way, and again.
        mode: Loop = Loop::Repeat, Facts::word::<Loop>().key("loop");
    }
}

group! {
    /// Rate of updates.
    pub struct Updates in "" {
        /// Updates per second; nothing changes between them.
        rate: Option<f64> = None, UPDATES.by_default("always");
    }
}

group! {
    /// Motion of a transform.
    pub struct MotionKeys in "transform.motion" {
        /// Kind of the motion.
        kind: MotionKind = MotionKind::Sine, Facts::word::<MotionKind>().required();
        /// Time of one oscillation or turn. Sine and orbit.
        period: Option<f64> = None, PERIOD.by_default("required");
        /// Amplitude of the shift. Sine and fetal, which need this or `rotate` (sine: or `scale`).
        translate: [f64; 3] = [0.0; 3], PLACE;
        /// Axis of rotation. Sine, orbit and fetal.
        axis: [f64; 3] = [0.0, 0.0, 1.0], AXIS;
        /// Amplitude of the rotation; of an orbit the angle of one period.
        angle: f64 = 0.0, TURN;
        /// Factor, or factors along x, y, z, at the sine's height. Applied before `rotate`. Sine only.
        scale: [f64; 3] = [1.0; 3], Facts::factors(SQUEEZE.0, SQUEEZE.1);
        /// A point on the axis of `rotate`, a joint; the point about which `scale` squeezes.
        centre: [f64; 3] = [0.0; 3], PLACE;
        /// Which movements. Fetal only.
        seed: u32 = 1, Facts::whole(0, u32::MAX).limits("32 bits");
        // Lively enough for a short clip. Fetuses of 8 to 19 weeks rest for up to 13 minutes (de Vries, Visser and
        // Prechtl 1985, Early Human Development 12, 99-120).
        /// Mean length of a burst. Fetal only.
        duration: f64 = 4.0, Facts::quantity(&DURATION, 0.1, LONGEST);
        /// Mean length of a pause. Fetal only.
        pause: f64 = 6.0, Facts::quantity(&DURATION, 0.0, LONGEST);
        /// Trajectory, relative to the scene file. File only.
        file: Option<String> = None, Facts::of(Form::Text).by_default("required");
        /// Between rows: straight, and rotations along the great circle; or as in the row before. File only.
        interpolation: Between = Between::Linear, Facts::word::<Between>();
    }
}

/// Keys of some kinds of motion only, with these kinds; `kind` and `rate` belong to all.
const OWN: [(&str, &[MotionKind]); 12] = {
    use MotionKind::{Fetal, File, Orbit, Sine};
    [
        ("period", &[Sine, Orbit]),
        ("phase", &[Sine, Orbit, File]),
        ("loop", &[Sine, Orbit, File]),
        ("translate", &[Sine, Fetal]),
        ("rotate", &[Sine, Orbit, Fetal]),
        ("scale", &[Sine]),
        ("centre", &[Sine, Orbit, Fetal]),
        ("seed", &[Fetal]),
        ("duration", &[Fetal]),
        ("pause", &[Fetal]),
        ("file", &[File]),
        ("interpolation", &[File]),
    ]
};

/// The clock of a motion, a selector or an animation, as the table `below` states it.
pub(super) fn clock(stated: &Stated, below: &str, period: f64) -> Clock {
    let Cycle { phase, mode } = stated.get(below);
    let Updates { rate } = stated.get(below);
    Clock { period, phase, mode, rate }
}

/// The duration of a file, s, as a period; of a single, constant state any will do. Fails at `path` if it is no period.
pub(super) fn lasting(
    document: &Document<'_>,
    path: &str,
    (start, end): (f64, f64),
) -> Result<f64, SceneError> {
    let period = if end > start { end - start } else { 1.0 };
    document.within(&format!("{path}.period"), &PERIOD, &Value::Number(period))?;
    Ok(period)
}

/// The motion that the table `motion` of the transform at `path` describes.
pub(super) fn motion(
    document: &Document<'_>,
    stated: &Stated,
    path: &str,
) -> Result<Motion, SceneError> {
    if !stated.has("motion") {
        return Ok(Motion::Still);
    }
    let path = &format!("{path}.motion");
    let keys: MotionKeys = stated.get("motion.");
    let parts = Parts { document, stated, keys: &keys, path };
    parts.fit()?;
    let translation = DVec3::from(keys.translate);
    Ok(match keys.kind {
        MotionKind::Sine => {
            parts.moves()?;
            Motion::Sine {
                clock: clock(stated, "motion.", parts.need("period", keys.period)?),
                translation,
                turn: parts.turn()?,
                scale: keys.scale.into(),
            }
        }
        MotionKind::Orbit => {
            parts.need("rotate", parts.has("rotate").then_some(()))?;
            Motion::Orbit {
                clock: clock(stated, "motion.", parts.need("period", keys.period)?),
                turn: parts.turn()?,
            }
        }
        MotionKind::Fetal => {
            parts.moves()?;
            Motion::Fetal(Fetal {
                seed: keys.seed,
                translation,
                turn: parts.turn()?,
                duration: keys.duration,
                pause: keys.pause,
                rate: stated.get::<Updates>("motion.").rate,
            })
        }
        MotionKind::File => {
            let file = parts.need("file", keys.file.as_ref())?;
            let folder = document.source.path.parent();
            let full = folder.map_or_else(|| file.into(), |p| p.join(file));
            let curve = match keys.interpolation {
                Between::Linear => Curve::Linear,
                Between::Step => Curve::Step,
            };
            let at = format!("{path}.file");
            let text = columns::text(&full).map_err(|e| {
                document.fail(&at, e.to_string(), "check the path of the trajectory")
            })?;
            let track = trajectory::parse(&full, &text, curve)?;
            let (start, end) = track.span().expect("a trajectory has rows");
            Motion::Track {
                clock: clock(stated, "motion.", lasting(document, path, (start, end))?),
                start,
                rest: Trs::default(),
                track: Box::new(track),
            }
        }
    })
}

/// A motion table with its place.
struct Parts<'a> {
    document: &'a Document<'a>,
    stated: &'a Stated,
    keys: &'a MotionKeys,
    path: &'a str,
}

impl Parts<'_> {
    fn has(&self, key: &str) -> bool {
        self.stated.has(&format!("motion.{key}"))
    }

    /// Refuses keys of another kind of motion.
    fn fit(&self) -> Result<(), SceneError> {
        let fits = |kinds: &[MotionKind]| kinds.contains(&self.keys.kind);
        let Some((key, _)) = OWN.iter().find(|(key, kinds)| self.has(key) && !fits(kinds)) else {
            return Ok(());
        };
        let own = OWN.iter().filter(|(_, kinds)| fits(kinds));
        let own: Vec<_> = own.map(|(key, _)| format!("`{key}`")).collect();
        Err(self.document.fail(
            &format!("{}.{key}", self.path),
            format!("`{key}` does not belong to this kind of motion"),
            format!("it takes `kind`, `rate`, {}", own.join(", ")),
        ))
    }

    fn need<T>(&self, key: &str, given: Option<T>) -> Result<T, SceneError> {
        given.ok_or_else(|| {
            self.document.fail(
                &format!("{}.kind", self.path),
                format!("this kind of motion needs `{key}`"),
                format!("add `{key}`"),
            )
        })
    }

    /// Fails if a table states nothing that moves the node.
    fn moves(&self) -> Result<(), SceneError> {
        let moves = ["translate", "rotate", "scale"].iter().any(|key| self.has(key));
        let needed = match self.keys.kind {
            MotionKind::Sine => "translate`, `rotate` or `scale",
            _ => "translate` or `rotate",
        };
        self.need(needed, moves.then_some(()))
    }

    fn turn(&self) -> Result<Turn, SceneError> {
        if self.has("centre") && !self.has("rotate") && !self.has("scale") {
            return Err(self.document.fail(
                &format!("{}.centre", self.path),
                "`centre` is that of `rotate` or `scale`, and neither is given",
                "add one of them or remove `centre`",
            ));
        }
        let MotionKeys { axis, angle, centre, .. } = self.keys;
        let axis = DVec3::from(*axis).normalize();
        Ok(Turn { axis, angle: *angle, centre: DVec3::from(*centre) })
    }
}
